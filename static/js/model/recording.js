// Where a replay stands, between two answers of the service; and what its line shows.

/** @typedef {import('../types.js').ReplayState} ReplayState */

/** The paces that are offered; the service takes any from 0.1 to 64. */
export const SPEEDS = Object.freeze([0.5, 1, 2, 4, 8, 16]);

/** @param {any} state @returns {state is ReplayState} it can be shown */
export function usable(state) {
  return Boolean(state) && [state.begin, state.end, state.time, state.speed].every(Number.isFinite) && state.end >= state.begin && state.speed > 0;
}

/** @param {ReplayState} state @returns {number} seconds of the recording in a second of this clock; 0 when it stands still */
export const paceOf = (state) => (state.playing && state.time < state.end ? state.speed : 0);

/**
 * @param {ReplayState} state @param {number} askedMs local clock when it was answered @param {number} nowMs
 * @returns {number} UTC s of the recording
 */
export function timeAt(state, askedMs, nowMs) {
  const since = Math.max(0, nowMs - askedMs) / 1000;
  return within(state, state.time + since * paceOf(state));
}

/** @param {ReplayState} state @param {number} time @returns {number} the nearest time that is in the recording */
export const within = (state, time) => Math.min(state.end, Math.max(state.begin, time));

/** @param {ReplayState} state @param {number} time @returns {number} 0 at the beginning, 1 at the end */
export function shareOf(state, time) {
  const length = state.end - state.begin;
  return length > 0 ? (within(state, time) - state.begin) / length : 0;
}

/** @param {number} speed @param {number} step @returns {number} the next offered speed, the same at either end */
export function nextSpeed(speed, step) {
  const among = step > 0 ? SPEEDS.filter((one) => one > speed) : SPEEDS.filter((one) => one < speed);
  return (step > 0 ? among[0] : among[among.length - 1]) ?? speed;
}

/** @param {number} seconds @returns {string} m:ss, or h:mm:ss from an hour on */
export function span(seconds) {
  const s = Math.max(0, Math.floor(seconds));
  const pad = (/** @type {number} */ value) => String(value).padStart(2, '0');
  const hours = Math.floor(s / 3600);
  return `${hours ? `${hours}:${pad(Math.floor(s / 60) % 60)}` : Math.floor(s / 60)}:${pad(s % 60)}`;
}

/** @typedef {{time: number, kind: 'gap'|'information'|'alarm', words: string}} Mark */

/** The alerts that were met while the recording was shown; a seek does not forget them. */
export class MetAlerts {
  constructor() {
    /** @type {Map<string, Mark>} by rule and time */
    this.marks = new Map();
  }

  /** @param {Iterable<import('../types.js').Alert>} alerts */
  take(alerts) {
    for (const { rule, raised_at: time, stage, text } of alerts) {
      if (typeof time !== 'number' || !Number.isFinite(time)) continue;
      const key = `${rule} ${time.toFixed(1)}`;
      if (stage === 'alarm' || !this.marks.has(key)) this.marks.set(key, { time, kind: stage === 'alarm' ? 'alarm' : 'information', words: text });
    }
  }

  /** @param {ReplayState} state @returns {Mark[]} of gaps and alerts, those in the recording */
  of(state) {
    const gaps = (state.gaps ?? []).filter(Number.isFinite).map((time) => ({ time, kind: /** @type {const} */ ('gap'), words: 'gap in the recording' }));
    return [...gaps, ...this.marks.values()].filter(({ time }) => time >= state.begin && time <= state.end);
  }
}
