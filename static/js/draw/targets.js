// Symbols, vectors, history and alert rings of every target.

import { classOf, isCoasting, isStanding } from '../model/label_text.js';
import { axisOf, coastedS, headingAt, positionAt } from '../model/motion.js';
import { FAREWELL_MS } from '../feed/picture.js';
import { drawSymbol, extentOf, symbolRadius } from './symbols.js';

/** @typedef {import('../types.js').Target} Target */
/** @typedef {import('../geo/viewport.js').Viewport} Viewport */
/** @typedef {import('../types.js').Theme} Theme */

/**
 * @typedef {object} Scene
 * @property {import('../feed/picture.js').PictureState} picture
 * @property {Viewport} view
 * @property {Theme} theme
 * @property {import('../settings.js').Choices} choices
 * @property {number|null} selected
 * @property {number|null} hovered
 * @property {Map<number, 'information'|'alarm'>} alerted
 * @property {Set<number>} unacknowledged  targets of alarms nobody has acknowledged
 * @property {boolean} flashOn
 * @property {import('../types.js').MapFeature[]} holds  the holding positions of the map
 * @property {Set<number>} occupants  of any runway's protection area
 */

/** An ellipse of accuracy smaller than this lies within every symbol and is not drawn, px. */
const ACCURACY_FROM = 4;
const RAD = Math.PI / 180;

/** Bring every target to where it is now. @param {Scene} scene @param {number} nowMs */
export function advance(scene, nowMs) {
  const { picture, view } = scene;
  for (const group of [picture.targets, picture.leaving]) {
    for (const target of group.values()) {
      [target.e, target.n] = positionAt(target, nowMs, picture.pace);
      [target.x, target.y] = view.toScreen(target.e, target.n);
    }
  }
}

/** @param {Target} target @param {number} scale @returns {number} px */
export function radiusOf(target, scale) {
  const kind = classOf(target.track);
  return symbolRadius(kind, extentOf(kind, target.track.length_m, target.track.width_m)[0], scale);
}

/** @param {Target} target @param {Viewport} view @param {number} margin px @returns {boolean} */
export const onScreen = (target, view, margin) =>
  target.x > -margin && target.y > -margin && target.x < view.width + margin && target.y < view.height + margin;

/** @param {CanvasRenderingContext2D} context @param {Scene} scene @param {number} nowMs */
export function drawTargets(context, scene, nowMs) {
  const { picture, view } = scene;
  const shown = [...picture.targets.values()].filter((one) => onScreen(one, view, 400));
  drawHistory(context, scene, shown);
  drawVectors(context, scene, shown);
  for (const target of picture.leaving.values()) {
    context.globalAlpha = Math.max(0, 1 - (nowMs - target.goneMs) / FAREWELL_MS) * 0.6;
    drawOne(context, scene, target, nowMs);
  }
  context.globalAlpha = 1;
  // important ones last, so that they lie on top
  const rank = (/** @type {Target} */ t) => (t.track.id === scene.selected ? 3 : scene.alerted.has(t.track.id) ? 2 : isStanding(t.track) ? 0 : 1);
  shown.sort((a, b) => rank(a) - rank(b));
  for (const target of shown) drawOne(context, scene, target, nowMs);
}

/** @param {Scene} scene @param {Target} target @returns {string} */
function inkOf(scene, target) {
  const stage = scene.alerted.get(target.track.id);
  if (stage === 'alarm') return scene.theme.ink.alarm;
  if (stage === 'information') return scene.theme.ink.info;
  return scene.theme.ink[classOf(target.track)];
}

/** @param {CanvasRenderingContext2D} context @param {Scene} scene @param {Target} target @param {number} nowMs */
function drawOne(context, scene, target, nowMs) {
  const { track } = target;
  const { view, theme } = scene;
  const kind = classOf(track);
  const [length, width] = extentOf(kind, track.length_m, track.width_m);
  const heading = headingAt(target, nowMs);
  const hollow = isCoasting(track, coastedS(target, scene.picture.time)) || track.phase === 'tentative';
  const ink = inkOf(scene, target);
  if (hollow) context.globalAlpha *= 0.85;
  const axis = axisOf(track);
  drawSymbol(context, target.x, target.y, view.scale, view.rotation, { kind, heading, axis, length, width, hollow, ink, halo: theme.ink.halo });
  if (hollow) context.globalAlpha = 1;
  const stage = scene.alerted.get(track.id);
  const radius = symbolRadius(kind, length, view.scale) + 6;
  if (stage) drawRing(context, scene, target, radius, stage);
  if (track.id === scene.selected || track.id === scene.hovered) {
    context.strokeStyle = theme.ink.select;
    context.lineWidth = track.id === scene.selected ? 1.6 : 1;
    corners(context, target.x, target.y, radius + (stage ? 7 : 0));
    if (track.id === scene.selected) drawAccuracy(context, scene, target);
  }
}

/**
 * Information: one dashed ring. Alarm: two solid rings, flashing until acknowledged.
 * @param {CanvasRenderingContext2D} context @param {Scene} scene @param {Target} target @param {number} radius
 * @param {'information'|'alarm'} stage
 */
function drawRing(context, scene, target, radius, stage) {
  const alarm = stage === 'alarm';
  const hot = alarm && scene.unacknowledged.has(target.track.id);
  context.strokeStyle = alarm ? scene.theme.ink.alarm : scene.theme.ink.info;
  context.lineWidth = alarm ? 2 : 1.6;
  if (!alarm) context.setLineDash([5, 4]);
  context.beginPath();
  context.arc(target.x, target.y, radius, 0, 2 * Math.PI);
  context.stroke();
  context.setLineDash([]);
  if (alarm && (!hot || scene.flashOn)) {
    context.lineWidth = hot ? 3 : 1.5;
    context.beginPath();
    context.arc(target.x, target.y, radius + 5, 0, 2 * Math.PI);
    context.stroke();
  }
}

/**
 * The ellipse that holds the position with 95 %.
 * @param {CanvasRenderingContext2D} context @param {Scene} scene @param {Target} target
 */
function drawAccuracy(context, scene, target) {
  const { accuracy_m: major, accuracy_minor_m: minor, accuracy_bearing_deg: bearing } = target.track;
  const radius = (major ?? 0) * scene.view.scale;
  if (radius < ACCURACY_FROM) return;
  // the canvas counts angles clockwise from its right
  const turn = ((bearing ?? 0) - 90) * RAD - scene.view.rotation;
  context.lineWidth = 1;
  context.setLineDash([2, 3]);
  context.beginPath();
  context.ellipse(target.x, target.y, radius, (minor ?? major ?? 0) * scene.view.scale, turn, 0, 2 * Math.PI);
  context.stroke();
  context.setLineDash([]);
}

/** @param {CanvasRenderingContext2D} context @param {number} x @param {number} y @param {number} r */
function corners(context, x, y, r) {
  const k = Math.min(6, r * 0.6);
  context.beginPath();
  for (const [sx, sy] of [[1, 1], [1, -1], [-1, 1], [-1, -1]]) {
    context.moveTo(x + sx * (r - k), y + sy * r);
    context.lineTo(x + sx * r, y + sy * r);
    context.lineTo(x + sx * r, y + sy * (r - k));
  }
  context.stroke();
}

/** @param {CanvasRenderingContext2D} context @param {Scene} scene @param {Target[]} shown */
function drawHistory(context, scene, shown) {
  const count = scene.choices.history;
  if (!count) return;
  const { view } = scene;
  context.fillStyle = scene.theme.ink.history;
  for (let back = count; back >= 1; back -= 1) {
    context.globalAlpha = 0.12 + 0.6 * (1 - back / (count + 1));
    context.beginPath();
    for (const target of shown) {
      const dot = target.history[target.history.length - 1 - back];
      if (!dot || isStanding(target.track)) continue;
      const [x, y] = view.toScreen(dot.e, dot.n);
      if (Math.hypot(x - target.x, y - target.y) < 5) continue;
      context.moveTo(x + 1.5, y);
      context.arc(x, y, 1.5, 0, 2 * Math.PI);
    }
    context.fill();
  }
  context.globalAlpha = 1;
}

/** @param {CanvasRenderingContext2D} context @param {Scene} scene @param {Target[]} shown */
function drawVectors(context, scene, shown) {
  const seconds = scene.choices.vector;
  if (!seconds) return;
  const { view } = scene;
  context.strokeStyle = scene.theme.ink.vector;
  context.lineWidth = 1.2;
  for (const dashed of [false, true]) {
    context.setLineDash(dashed ? [4, 4] : []);
    context.beginPath();
    for (const target of shown) {
      const coasting = isCoasting(target.track, coastedS(target, scene.picture.time));
      if (coasting !== dashed || isStanding(target.track) || Math.hypot(target.ve, target.vn) < 1) continue;
      const [x, y] = view.toScreen(target.e + target.ve * seconds, target.n + target.vn * seconds);
      context.moveTo(target.x, target.y);
      context.lineTo(x, y);
    }
    context.stroke();
  }
  context.setLineDash([]);
}
