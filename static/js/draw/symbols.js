// What targets look like: silhouettes at true scale when there is room, clear small symbols when there is not.

/** Aircraft seen from above, nose to the north, length and span 1. */
const AIRCRAFT = shape([
  [0, 0.5], [0.02, 0.487], [0.038, 0.455], [0.048, 0.4], [0.05, 0.13], [0.145, 0.075], [0.148, 0.125], [0.198, 0.125], [0.202, 0.042],
  [0.5, -0.13], [0.5, -0.165], [0.22, -0.075], [0.05, -0.055], [0.044, -0.31], [0.18, -0.415], [0.18, -0.455], [0.022, -0.43], [0, -0.5],
], true);
/** The symbol when it is small: broader limbs, so that it stays one shape. */
const AIRCRAFT_SMALL = shape([
  [0, 0.56], [0.09, 0.4], [0.1, 0.16], [0.5, -0.12], [0.5, -0.26], [0.1, -0.12], [0.09, -0.32], [0.24, -0.44], [0.24, -0.54],
  [0, -0.48],
], true);
const BOX = shape([[-0.5, -0.5], [-0.5, 0.5], [0.5, 0.5], [0.5, -0.5]], false);
const DIAMOND = shape([[0, 0.6], [0.6, 0], [0, -0.6], [-0.6, 0]], false);
const DISC = shape(Array.from({ length: 20 }, (_, i) => [
  0.5 * Math.cos((i * Math.PI) / 10), 0.5 * Math.sin((i * Math.PI) / 10),
]), false);

/** Long, and the same at both ends: the axis is known, the nose is not. */
const CAPSULE = [1, -1].flatMap((end) => Array.from({ length: 13 }, (_, i) => {
  const angle = (i * Math.PI) / 12;
  return [end * 0.5 * Math.cos(angle), end * (0.3 + 0.2 * Math.sin(angle))];
}));

/** @param {number[][]} points @param {boolean} mirror @returns {number[][]} */
function shape(points, mirror) {
  return mirror ? [...points, ...[...points].reverse().map(([x, y]) => [-x, y])] : points;
}

/** Width of a small capsule over its length. */
const CAPSULE_WIDTH = 0.5;

const MIN_AIRCRAFT = 15;
const MIN_VEHICLE = 8;
const MIN_UNKNOWN = 9;
/** A symbol whose true length reaches this is drawn at its true extent, px: smaller ones would not be told apart. */
const TRUE_FROM = 24;

/**
 * @typedef {object} SymbolLook
 * @property {'aircraft'|'vehicle'|'unknown'} kind
 * @property {number|null} heading  rad from true north
 * @property {number|null} axis  rad from true north, the long axis where it is known; looked at without a heading
 * @property {number} length  m
 * @property {number} width  m
 * @property {boolean} hollow
 * @property {string} ink
 * @property {string} halo
 */

/** @param {SymbolLook['kind']} kind @param {number|null} length @param {number|null} width @returns {[number, number]} m */
export function extentOf(kind, length, width) {
  const l = length && length > 1 ? length : kind === 'aircraft' ? 38 : kind === 'vehicle' ? 6 : 10;
  const w = width && width > 0.5 ? width : kind === 'aircraft' ? 34 : kind === 'vehicle' ? 2.6 : 10;
  return [l, w];
}

/** @param {SymbolLook['kind']} kind @param {number} length @param {number} scale px/m @returns {number} px about the target */
export function symbolRadius(kind, length, scale) {
  const least = kind === 'aircraft' ? MIN_AIRCRAFT : kind === 'vehicle' ? MIN_VEHICLE : MIN_UNKNOWN;
  return Math.min(60, Math.max(least, length * scale) / 2);
}

/**
 * @param {CanvasRenderingContext2D} context in CSS pixels @param {number} x @param {number} y
 * @param {number} scale px/m @param {number} rotation rad, the bearing that is up @param {SymbolLook} look
 */
export function drawSymbol(context, x, y, scale, rotation, look) {
  const { kind, heading } = look;
  const along = heading ?? look.axis;
  let points = DISC;
  let [w, h] = [11, 11];
  // what has no nose to show is an outline at true scale, so that the video below it stays visible
  const outline = look.length * scale >= TRUE_FROM && (kind === 'unknown' || (kind === 'aircraft' && heading === null));
  if (kind === 'vehicle') {
    h = Math.max(MIN_VEHICLE, look.length * scale);
    w = Math.max(MIN_VEHICLE * (along === null ? 1 : 0.75), look.width * scale);
    points = BOX;
  } else if (outline) {
    // along its axis the extent is length by width; without one it is somewhere in the circle
    h = look.length * scale;
    w = along === null ? h : look.width * scale;
    points = along === null ? DISC : kind === 'unknown' ? BOX : CAPSULE;
  } else if (kind === 'unknown') {
    h = w = Math.max(MIN_UNKNOWN, Math.min(24, Math.max(look.length, look.width) * scale * 0.7));
    points = DIAMOND;
  } else if (heading !== null) {
    h = Math.max(MIN_AIRCRAFT, look.length * scale);
    w = look.length * scale >= MIN_AIRCRAFT ? look.width * scale : h * 0.95;
    points = h > 30 ? AIRCRAFT : AIRCRAFT_SMALL;
  } else if (along !== null) {
    h = Math.max(MIN_AIRCRAFT, look.length * scale);
    w = h * CAPSULE_WIDTH;
    points = CAPSULE;
  }
  const turn = along === null || (kind === 'unknown' && !outline) ? 0 : along - rotation;
  trace(context, points, x, y, Math.cos(turn), Math.sin(turn), w, h);
  if (outline) {
    context.strokeStyle = look.ink;
    context.lineWidth = 1.6;
    if (look.hollow) context.setLineDash([4, 3]);
    context.stroke();
    context.setLineDash([]);
    return;
  }
  if (kind === 'unknown' || look.hollow) {
    context.fillStyle = look.halo;
    const alpha = context.globalAlpha;
    context.globalAlpha = alpha * 0.85;
    context.fill();
    context.globalAlpha = alpha;
    context.strokeStyle = look.ink;
    context.lineWidth = Math.max(w, h) > 26 ? 1.6 : 1.2;
    // dashes on a small symbol are only a scribble
    const dashed = look.hollow && Math.max(w, h) > 26;
    if (dashed) context.setLineDash([4, 3]);
    context.stroke();
    if (dashed) context.setLineDash([]);
    return;
  }
  context.strokeStyle = look.halo;
  context.lineWidth = 2;
  context.stroke();
  context.fillStyle = look.ink;
  context.fill();
}

/**
 * @param {CanvasRenderingContext2D} context @param {number[][]} points @param {number} x @param {number} y
 * @param {number} c @param {number} s @param {number} w @param {number} h
 */
function trace(context, points, x, y, c, s, w, h) {
  context.beginPath();
  for (let i = 0; i < points.length; i += 1) {
    const px = points[i][0] * w;
    const py = points[i][1] * h;
    const sx = x + px * c + py * s;
    const sy = y + px * s - py * c;
    if (i) context.lineTo(sx, sy);
    else context.moveTo(sx, sy);
  }
  context.closePath();
}
