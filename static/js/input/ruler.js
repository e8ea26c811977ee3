// Range and bearing lines between places or targets.

import { bearing, countdown, distance } from '../model/format.js';

/** @typedef {{id: number|null, e: number, n: number}} Anchor */

/** @param {Anchor} a @param {Anchor} b @returns {{metres: number, degrees: number}} from a to b */
export function rangeBearing(a, b) {
  const degrees = (Math.atan2(b.e - a.e, b.n - a.n) * 180) / Math.PI;
  return { metres: Math.hypot(b.e - a.e, b.n - a.n), degrees: (degrees + 360) % 360 };
}

/** All lines, and the one being drawn. */
export class Ruler {
  constructor() {
    this.active = false;
    /** @type {{a: Anchor, b: Anchor}[]} */
    this.lines = [];
    /** @type {Anchor|null} */
    this.from = null;
    /** @type {Anchor|null} */
    this.to = null;
  }

  /** @param {Anchor} anchor */
  click(anchor) {
    if (!this.from) {
      this.from = anchor;
      this.to = anchor;
      return;
    }
    this.lines.push({ a: this.from, b: anchor });
    if (this.lines.length > 8) this.lines.shift();
    this.from = this.to = null;
  }

  cancel() {
    if (this.from) this.from = this.to = null;
    else this.lines = [];
  }

  /** Follow the targets that lines are tied to; a line whose target is gone ends. @param {Map<number, import('../types.js').Target>} targets */
  follow(targets) {
    const keep = (/** @type {Anchor|null} */ anchor) => {
      if (!anchor || anchor.id === null) return true;
      const target = targets.get(anchor.id);
      if (target) [anchor.e, anchor.n] = [target.e, target.n];
      return Boolean(target);
    };
    this.lines = this.lines.filter(({ a, b }) => keep(a) && keep(b));
    if (!keep(this.from)) this.from = this.to = null;
  }

  /** @param {CanvasRenderingContext2D} context @param {import('../draw/targets.js').Scene} scene */
  draw(context, scene) {
    const lines = this.from && this.to ? [...this.lines, { a: this.from, b: this.to }] : this.lines;
    const { ink } = scene.theme;
    for (const { a, b } of lines) {
      const [ax, ay] = scene.view.toScreen(a.e, a.n);
      const [bx, by] = scene.view.toScreen(b.e, b.n);
      context.strokeStyle = ink.tool;
      context.lineWidth = 1.3;
      context.beginPath();
      context.moveTo(ax, ay);
      context.lineTo(bx, by);
      context.stroke();
      context.fillStyle = ink.tool;
      for (const [x, y] of [[ax, ay], [bx, by]]) {
        context.beginPath();
        context.arc(x, y, 2.5, 0, 2 * Math.PI);
        context.fill();
      }
      const { metres, degrees } = rangeBearing(a, b);
      const closing = closingSpeed(a, b, scene.picture.targets);
      const eta = closing > 1 ? `  ${countdown(metres / closing)}` : '';
      const text = `${bearing(degrees)}T  ${distance(metres)}${eta}`;
      context.font = '600 11px system-ui, sans-serif';
      context.textAlign = 'center';
      context.textBaseline = 'middle';
      const w = context.measureText(text).width + 10;
      const [x, y] = [(ax + bx) / 2, (ay + by) / 2 - 12];
      context.fillStyle = ink.toolBack;
      context.fillRect(x - w / 2, y - 9, w, 18);
      context.fillStyle = ink.tool;
      context.fillText(text, x, y + 0.5);
    }
  }
}

/** @param {Anchor} a @param {Anchor} b @param {Map<number, import('../types.js').Target>} targets @returns {number} m/s */
function closingSpeed(a, b, targets) {
  const v = (/** @type {Anchor} */ one) => {
    const target = one.id === null ? undefined : targets.get(one.id);
    return target ? [target.ve, target.vn] : [0, 0];
  };
  const [ave, avn] = v(a);
  const [bve, bvn] = v(b);
  const range = Math.hypot(b.e - a.e, b.n - a.n);
  return range > 0 ? -((b.e - a.e) * (bve - ave) + (b.n - a.n) * (bvn - avn)) / range : 0;
}
