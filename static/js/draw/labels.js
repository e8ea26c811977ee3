// Labels: what they say, where they go, and drawing them with their leader lines.

import { classOf, isAirborne, isCoasting, isStanding, labelText } from '../model/label_text.js';
import { isNumber } from '../model/format.js';
import { isNearHold } from '../model/holds.js';
import { coastedS } from '../model/motion.js';
import { clampInto, placeLabels } from '../model/placement.js';
import { onScreen, radiusOf } from './targets.js';

/** @typedef {import('../types.js').Target} Target */
/** @typedef {import('./targets.js').Scene} Scene */

const FIRST = '600 12px system-ui, "DejaVu Sans", sans-serif';
const SECOND = '11px system-ui, "DejaVu Sans", sans-serif';
const MARK = '600 8px system-ui, "DejaVu Sans", sans-serif';
const LINE = 14;
const PAD = 3;
/** From this priority on a label is shown at every scale, and where it overlaps: on a runway, at a holding position, in an alert. */
const MUST = 60;
/** Below this scale other standing targets keep their names to themselves, px/m. */
const STANDING_FROM = 0.3;
/** From this many targets on the screen labels are shortened. */
const CROWD = 90;

/** Keeps the measured widths of texts. */
class Widths {
  constructor() {
    /** @type {Map<string, number>} */
    this.known = new Map();
  }

  /** @param {CanvasRenderingContext2D} context @param {string} font @param {string} text @returns {number} */
  of(context, font, text) {
    const key = font + text;
    let width = this.known.get(key);
    if (width === undefined) {
      if (this.known.size > 5000) this.known.clear();
      context.font = font;
      width = context.measureText(text).width;
      this.known.set(key, width);
    }
    return width;
  }
}

/** The label layer; `place` once for each update, `draw` in every frame. */
export class LabelLayer {
  constructor() {
    this.widths = new Widths();
    this.placedVersion = '';
    this.shown = 0;
    this.hidden = 0;
  }

  /** @param {Scene} scene @param {Target} target @returns {number} the higher, the earlier it is placed */
  priority(scene, target) {
    const { track } = target;
    const stage = scene.alerted.get(track.id);
    if (stage === 'alarm') return 100;
    if (stage) return 90;
    if (track.id === scene.selected || track.id === scene.hovered) return 80;
    if (track.runway || isAirborne(track) || scene.occupants.has(track.id) || isNearHold(scene.holds, track)) return MUST;
    const moving = isStanding(track) ? 0 : 20;
    return moving + (classOf(track) === 'aircraft' ? 20 : classOf(track) === 'vehicle' ? 10 : 0);
  }

  /**
   * @param {CanvasRenderingContext2D} context @param {Scene} scene
   * @param {{x: number, y: number}[]} [keepClear] what else must stay readable
   */
  place(context, scene, keepClear = []) {
    const { picture, view, choices } = scene;
    const here = [...picture.targets.values()].filter((one) => onScreen(one, view, 0));
    const crowded = here.length > CROWD && view.scale < 0.6;
    const candidates = here.map((target) => ({ target, priority: this.priority(scene, target) }))
      .sort((a, b) => b.priority - a.priority || a.target.track.id - b.target.track.id);
    const requests = [];
    this.hidden = 0;
    for (const { target, priority } of candidates) {
      const level = this.level(choices.labels, target, priority, view.scale, crowded);
      const label = target.label;
      label.visible = false;
      if (level === 'off') continue;
      label.text = labelText(target.track, level, coastedS(target, picture.time));
      [label.w, label.h] = this.size(context, label.text);
      requests.push({
        id: target.track.id, x: target.x, y: target.y, radius: radiusOf(target, view.scale),
        w: label.w, h: label.h, slot: label.slot, must: priority >= MUST, pinned: label.pinned,
      });
    }
    const symbols = here.map((one) => ({ id: one.track.id, x: one.x, y: one.y, radius: Math.min(16, radiusOf(one, view.scale)) }));
    keepClear.forEach(({ x, y }, i) => symbols.push({ id: -1e6 - i, x, y, radius: 10 }));
    for (const placed of placeLabels(requests, symbols, view)) {
      const label = picture.targets.get(placed.id)?.label;
      if (!label) continue;
      label.visible = placed.visible;
      label.slot = placed.slot;
      if (!placed.visible) {
        this.hidden += 1;
        label.sx = NaN;
        continue;
      }
      [label.dx, label.dy] = [placed.dx, placed.dy];
      if (!isNumber(label.sx)) [label.sx, label.sy] = [label.dx, label.dy];
    }
    this.shown = requests.length - this.hidden;
  }

  /**
   * @param {import('../types.js').LabelLevel} wanted @param {Target} target @param {number} priority
   * @param {number} scale @param {boolean} crowded
   * @returns {import('../types.js').LabelLevel}
   */
  level(wanted, target, priority, scale, crowded) {
    if (priority >= 80) return 'full';
    if (wanted === 'off') return 'off';
    if (target.label.pinned) return wanted;
    if (priority < MUST && isStanding(target.track)) {
      if (scale < STANDING_FROM) return 'off';
      return scale < 0.8 ? 'short' : wanted;
    }
    return crowded && priority < MUST ? 'short' : wanted;
  }

  /** @param {CanvasRenderingContext2D} context @param {import('../types.js').LabelText} text @returns {[number, number]} */
  size(context, text) {
    const mark = text.mark ? this.widths.of(context, MARK, text.mark) + 4 : 0;
    const first = this.widths.of(context, FIRST, text.first) + mark;
    const second = text.second ? this.widths.of(context, SECOND, text.second) : 0;
    return [Math.ceil(Math.max(first, second)) + 2 * PAD, (text.second ? 2 : 1) * LINE + PAD];
  }

  /** @param {Target} target @param {import('../geo/viewport.js').Viewport} view @returns {boolean} its label is on the screen */
  isDrawn(target, view) {
    return target.label.visible && onScreen(target, view, 0);
  }

  /** @param {CanvasRenderingContext2D} context @param {Scene} scene @param {number} ease 0..1 of the way to a new place */
  draw(context, scene, ease) {
    const targets = [...scene.picture.targets.values()].filter((one) => this.isDrawn(one, scene.view));
    for (const { label, x, y } of targets) {
      // between two placements the target moves, and a pinned label goes where it was put: neither may cut the text
      label.sx = clampInto(x + label.sx + (label.dx - label.sx) * ease, label.w, scene.view.width) - x;
      label.sy = clampInto(y + label.sy + (label.dy - label.sy) * ease, label.h, scene.view.height) - y;
    }
    this.leaders(context, scene, targets);
    context.textAlign = 'left';
    context.textBaseline = 'alphabetic';
    targets.reverse();
    for (const target of targets) this.box(context, scene, target);
    const strong = targets.filter((one) => scene.alerted.has(one.track.id));
    for (const target of strong) this.box(context, scene, target);
  }

  /** @param {CanvasRenderingContext2D} context @param {Scene} scene @param {Target[]} targets */
  leaders(context, scene, targets) {
    context.strokeStyle = scene.theme.ink.leader;
    context.lineWidth = 1;
    for (const dashed of [false, true]) {
      context.setLineDash(dashed ? [3, 3] : []);
      context.beginPath();
      for (const target of targets) {
        if (isCoasting(target.track, coastedS(target, scene.picture.time)) !== dashed) continue;
        const { sx, sy, w, h } = target.label;
        const px = Math.min(Math.max(0, sx), sx + w);
        const py = Math.min(Math.max(0, sy), sy + h);
        const far = Math.hypot(px, py);
        const radius = Math.min(radiusOf(target, scene.view.scale) * 0.7, 18) + 2;
        if (far <= radius + 2) continue;
        context.moveTo(target.x + (px / far) * radius, target.y + (py / far) * radius);
        context.lineTo(target.x + px, target.y + py);
      }
      context.stroke();
    }
    context.setLineDash([]);
  }

  /** @param {CanvasRenderingContext2D} context @param {Scene} scene @param {Target} target */
  box(context, scene, target) {
    const { label, track } = target;
    const { text } = label;
    if (!text) return;
    const { ink } = scene.theme;
    const stage = scene.alerted.get(track.id);
    const x = Math.round(target.x + label.sx);
    const y = Math.round(target.y + label.sy);
    const selected = track.id === scene.selected;
    context.fillStyle = stage === 'alarm' ? ink.alarm : stage ? ink.info : ink.labelBack;
    if (stage === 'alarm' && scene.unacknowledged.has(track.id) && !scene.flashOn) context.globalAlpha = 0.7;
    context.fillRect(x, y, label.w, label.h);
    context.globalAlpha = 1;
    if (selected || label.pinned) {
      context.strokeStyle = selected ? ink.select : ink.leader;
      context.lineWidth = 1;
      context.strokeRect(x - 0.5, y - 0.5, label.w + 1, label.h + 1);
    }
    const strong = stage === 'alarm' ? ink.alarmInk : stage ? ink.infoInk : null;
    const kind = classOf(track);
    context.font = FIRST;
    context.fillStyle = strong ?? (isStanding(track) && !selected ? ink.textDim : kind === 'aircraft' ? ink.text : ink[kind]);
    context.fillText(text.first, x + PAD, y + LINE - 2);
    if (text.mark) {
      context.fillStyle = strong ?? ink.sim;
      const at = this.widths.of(context, FIRST, text.first);
      context.font = MARK;
      context.fillText(text.mark, x + PAD + at + 4, y + LINE - 2);
    }
    if (text.second) {
      context.font = SECOND;
      context.fillStyle = strong ?? ink.textDim;
      context.fillText(text.second, x + PAD, y + 2 * LINE - 3);
    }
  }

  /** @param {Scene} scene @param {number} x @param {number} y @returns {Target|null} whose label is there */
  at(scene, x, y) {
    for (const target of scene.picture.targets.values()) {
      const { label } = target;
      if (!this.isDrawn(target, scene.view)) continue;
      const dx = x - target.x - label.sx;
      const dy = y - target.y - label.sy;
      if (dx >= 0 && dy >= 0 && dx <= label.w && dy <= label.h) return target;
    }
    return null;
  }
}
