// How a target moves between updates: dead reckoning with a bound, and old errors that fade instead of jumping.

/** @typedef {import('../types.js').Track} Track */
/** @typedef {import('../types.js').Target} Target */

/** No target is carried on further than this without news, s. */
export const MAX_EXTRAPOLATION_S = 2.5;
/** The time in which a correction fades to a third, ms. */
export const FADE_MS = 280;
/** A correction greater than this is another place, not a correction, m. */
export const SNAP_M = 250;
/** Slower than this a target stands, m/s. */
export const STANDING_MPS = 0.5;
/** A history dot this often, s. */
export const HISTORY_STEP_S = 2;
const HISTORY_MAX = 31;
const RAD = Math.PI / 180;

/** @param {unknown} value @returns {value is number} */
const finite = (value) => typeof value === 'number' && Number.isFinite(value);

/** @param {number} angle rad @returns {number} the same angle in -pi..pi */
export function wrapAngle(angle) {
  const turn = 2 * Math.PI;
  const wrapped = ((angle % turn) + turn) % turn;
  return wrapped > Math.PI ? wrapped - turn : wrapped;
}

/** @param {Track} track @returns {[number, number]} velocity east and north, m/s */
export function velocity(track) {
  if (!finite(track.speed_mps) || !finite(track.course_deg) || track.speed_mps < STANDING_MPS) return [0, 0];
  const course = track.course_deg * RAD;
  return [track.speed_mps * Math.sin(course), track.speed_mps * Math.cos(course)];
}

/** @param {Track} track @returns {number|null} where it points, rad; the course when only that is known */
export function pointing(track) {
  if (finite(track.heading_deg)) return track.heading_deg * RAD;
  if (finite(track.course_deg) && finite(track.speed_mps) && track.speed_mps >= 1) return track.course_deg * RAD;
  return null;
}

/** @param {Track} track @returns {number|null} rad, along which it is longer than wide; its nose may be at either end */
export const axisOf = (track) => (finite(track.axis_deg) ? track.axis_deg * RAD : null);

/**
 * A target new to the screen.
 * @param {Track} track @param {number} pictureTime UTC s @param {number} nowMs @returns {Target}
 */
export function newTarget(track, pictureTime, nowMs) {
  const [ve, vn] = velocity(track);
  return {
    track, baseMs: nowMs, ageS: age(track, pictureTime), ve, vn, offsetE: 0, offsetN: 0,
    heading: pointing(track), headingOffset: 0, goneMs: 0, coastingSince: track.phase === 'coasting' ? pictureTime : NaN,
    history: [{ e: track.east_m, n: track.north_m, t: track.time }],
    label: { slot: -1, dx: 0, dy: 0, sx: NaN, sy: NaN, w: 0, h: 0, visible: false, pinned: null, text: null },
    x: 0, y: 0, e: track.east_m, n: track.north_m,
  };
}

/** @param {Target} target @param {number} pictureTime UTC s @returns {number} seconds that it has coasted, 0 when it does not */
export function coastedS(target, pictureTime) {
  const since = pictureTime - target.coastingSince;
  return finite(since) ? Math.max(0, since) : 0;
}

/** @param {Track} track @param {number} pictureTime @returns {number} */
function age(track, pictureTime) {
  const value = pictureTime - track.time;
  return finite(value) ? Math.min(MAX_EXTRAPOLATION_S, Math.max(0, value)) : 0;
}

/**
 * Where the target is shown at `nowMs`.
 * @param {Target} target @param {number} nowMs
 * @param {number} [pace] seconds of picture time in a second of this clock: 1 unless a replay has another speed, 0 while it is paused
 * @returns {[number, number]} m
 */
export function positionAt(target, nowMs, pace = 1) {
  const since = Math.max(0, nowMs - target.baseMs);
  const dt = Math.min(MAX_EXTRAPOLATION_S * Math.max(1, pace), target.ageS + (since / 1000) * pace);
  const fade = Math.exp(-since / FADE_MS);
  return [
    target.track.east_m + target.ve * dt + target.offsetE * fade,
    target.track.north_m + target.vn * dt + target.offsetN * fade,
  ];
}

/** @param {Target} target @param {number} nowMs @returns {number|null} rad */
export function headingAt(target, nowMs) {
  if (target.heading === null) return null;
  return target.heading + target.headingOffset * Math.exp(-Math.max(0, nowMs - target.baseMs) / FADE_MS);
}

/**
 * Go on from where the target is shown now at another pace, without a jump.
 * @param {Target} target @param {number} nowMs @param {number} old @param {number} pace
 */
export function repace(target, nowMs, old, pace) {
  const since = Math.max(0, nowMs - target.baseMs);
  const fade = Math.exp(-since / FADE_MS);
  target.ageS = Math.min(MAX_EXTRAPOLATION_S * Math.max(1, old), target.ageS + (since / 1000) * old);
  // what the slower pace may not reach is a correction, and fades
  const beyond = target.ageS - Math.min(target.ageS, MAX_EXTRAPOLATION_S * Math.max(1, pace));
  target.ageS -= beyond;
  target.offsetE = target.offsetE * fade + target.ve * beyond;
  target.offsetN = target.offsetN * fade + target.vn * beyond;
  target.headingOffset *= fade;
  target.baseMs = nowMs;
}

/**
 * Take a newer state without a jump: what the old picture was off by fades away.
 * @param {Target} target @param {Track} track @param {number} pictureTime UTC s @param {number} nowMs
 * @param {number} [pace] as for `positionAt`
 */
export function moveTarget(target, track, pictureTime, nowMs, pace = 1) {
  const [e, n] = positionAt(target, nowMs, pace);
  const heading = headingAt(target, nowMs);
  if (track.phase !== 'coasting') target.coastingSince = NaN;
  else if (target.track.phase !== 'coasting') target.coastingSince = pictureTime;
  target.track = track;
  target.baseMs = nowMs;
  target.ageS = age(track, pictureTime);
  [target.ve, target.vn] = velocity(track);
  target.offsetE = 0;
  target.offsetN = 0;
  const [e1, n1] = positionAt(target, nowMs, pace);
  if (Math.hypot(e - e1, n - n1) <= SNAP_M * Math.max(1, pace)) {
    target.offsetE = e - e1;
    target.offsetN = n - n1;
  } else {
    target.history.length = 0;
  }
  target.heading = pointing(track) ?? target.heading;
  target.headingOffset = 0;
  if (heading !== null && target.heading !== null) target.headingOffset = wrapAngle(heading - target.heading);
  remember(target, track);
}

/** @param {Target} target @param {Track} track */
function remember(target, track) {
  const last = target.history[target.history.length - 1];
  if (last && track.time < last.t) target.history.length = 0;
  else if (last && track.time - last.t < HISTORY_STEP_S) return;
  target.history.push({ e: track.east_m, n: track.north_m, t: track.time });
  if (target.history.length > HISTORY_MAX) target.history.splice(0, target.history.length - HISTORY_MAX);
}
