// The picture as it stands: the feed's messages folded into targets, alerts, runways and sensors.

import { moveTarget, newTarget, repace } from '../model/motion.js';

/** @typedef {import('../types.js').Track} Track */
/** @typedef {import('../types.js').Target} Target */
/** @typedef {import('../types.js').Alert} Alert */

const CLEARED_KEPT = 50;
/** How long a target that left the feed may still fade on the screen, ms. */
export const FAREWELL_MS = 600;

/** @typedef {'applied'|'ignored'|'gap'} Outcome */

/** Everything the display knows, changed only by `apply`. */
export class PictureState {
  constructor() {
    /** @type {Map<number, Target>} */
    this.targets = new Map();
    /** @type {Map<number, Target>} left the feed, fading */
    this.leaving = new Map();
    /** @type {Map<number, Alert>} */
    this.alerts = new Map();
    /** @type {Alert[]} newest first */
    this.cleared = [];
    /** @type {Map<string, import('../types.js').RunwayState>} */
    this.runways = new Map();
    /** @type {Map<string, import('../types.js').SensorState>} */
    this.sensors = new Map();
    /** @type {string|null} */
    this.epoch = null;
    /** place of the newest tracks in the stream; alerts and status run ahead of it and do not move it */
    this.seq = -1;
    /** UTC s of the newest picture */
    this.time = NaN;
    /** local clock when it came */
    this.timeMs = -Infinity;
    this.mode = 'live';
    /** seconds of picture time in a second of this clock: 1 unless a replay has another speed, 0 while it is paused */
    this.pace = 1;
    /** local clock when the pace was set */
    this.paceMs = -Infinity;
    this.airport = '';
    /** true once a snapshot of this epoch is in */
    this.complete = false;
    this.counters = { snapshots: 0, deltas: 0, alerts: 0, gaps: 0, unknown: 0, bad: 0, lagging: 0 };
    /** counts changes, so that panels know when to redraw */
    this.version = 0;
    this.statusVersion = 0;
    this.alertVersion = 0;
  }

  /** @returns {{epoch: string, seq: number}|null} where to resume from */
  position() {
    return this.epoch !== null && this.complete ? { epoch: this.epoch, seq: this.seq } : null;
  }

  /**
   * Take one message in.
   * @param {Record<string, any>} message @param {number} nowMs local clock
   * @returns {Outcome}
   */
  apply(message, nowMs) {
    if (message.mode) this.mode = String(message.mode);
    if (this.mode === 'replay' && message.epoch && message.epoch !== this.epoch) this.begin(String(message.epoch));
    switch (message.type) {
      case 'welcome':
        return this.welcome(message);
      case 'snapshot':
        return this.snapshot(message, nowMs);
      case 'delta':
        return this.delta(message, nowMs);
      case 'alert':
        return this.alert(message);
      case 'status':
        return this.status(message);
      case 'heartbeat':
        return 'applied';
      case 'lagging':
        this.counters.lagging += 1;
        return 'applied';
      case 'result':
        if (message.ok === false) this.counters.bad += 1;
        return 'applied';
      default:
        this.counters.unknown += 1;
        return 'ignored';
    }
  }

  /** The replay was set to another time: all targets and alerts shown so far are void. @param {string} epoch */
  begin(epoch) {
    this.epoch = epoch;
    this.complete = false;
    this.targets.clear();
    this.leaving.clear();
    this.alerts.clear();
    this.cleared = [];
    this.alertVersion += 1;
    this.version += 1;
  }

  /** @param {number} pace as of `pace` @param {number} nowMs */
  setPace(pace, nowMs) {
    if (pace === this.pace) return;
    for (const target of this.targets.values()) repace(target, nowMs, this.pace, pace);
    for (const target of this.leaving.values()) repace(target, nowMs, this.pace, pace);
    this.pace = pace;
    this.paceMs = nowMs;
  }

  /** @param {Record<string, any>} message @returns {Outcome} */
  welcome(message) {
    if (message.airport) this.airport = String(message.airport);
    if (this.epoch !== message.epoch) {
      this.epoch = message.epoch ?? null;
      this.complete = false;
    }
    return 'applied';
  }

  /** @param {Record<string, any>} message @param {number} nowMs @returns {Outcome} */
  snapshot(message, nowMs) {
    if (message.topic === 'alerts') return this.alertSnapshot(message);
    if (message.topic === 'status') return this.status(message);
    if (message.topic !== undefined && message.topic !== 'tracks') {
      this.counters.unknown += 1;
      return 'ignored';
    }
    if (!Array.isArray(message.tracks)) return this.bad();
    this.counters.snapshots += 1;
    if (message.epoch !== undefined && message.epoch !== null) this.epoch = message.epoch;
    this.clock(message, nowMs);
    const seen = new Set();
    for (const track of message.tracks) {
      if (!usable(track)) {
        this.counters.bad += 1;
        continue;
      }
      seen.add(track.id);
      this.put(track, nowMs);
    }
    for (const id of [...this.targets.keys()]) if (!seen.has(id)) this.remove(id, nowMs);
    this.complete = true;
    return 'applied';
  }

  /** @param {Record<string, any>} message @param {number} nowMs @returns {Outcome} */
  delta(message, nowMs) {
    if (message.topic !== undefined && message.topic !== 'tracks') {
      this.counters.unknown += 1;
      return 'ignored';
    }
    if (!this.complete) return 'ignored';
    if (typeof message.prev === 'number' && message.prev > this.seq) {
      this.counters.gaps += 1;
      this.complete = false;
      return 'gap';
    }
    this.counters.deltas += 1;
    this.clock(message, nowMs);
    // deleted first: a number may be given to a new target in the same message
    for (const gone of message.del ?? []) this.remove(typeof gone === 'number' ? gone : gone?.id, nowMs);
    for (const track of message.add ?? []) {
      if (usable(track)) this.put(track, nowMs);
      else this.counters.bad += 1;
    }
    for (const change of message.upd ?? []) {
      const target = this.targets.get(change?.id);
      const track = target && { ...target.track, ...change };
      if (track && usable(track)) this.put(track, nowMs);
      else this.counters.bad += 1;
    }
    return 'applied';
  }

  /** @param {Record<string, any>} message @returns {Outcome} */
  alertSnapshot(message) {
    if (!Array.isArray(message.alerts)) return this.bad();
    const live = new Set(message.alerts.map((one) => one?.id));
    for (const [id, alert] of this.alerts) {
      if (live.has(id)) continue;
      this.alerts.delete(id);
      this.clear({ ...alert, state: 'cleared' });
    }
    for (const alert of message.alerts) this.putAlert(alert);
    this.alertVersion += 1;
    return 'applied';
  }

  /** @param {Record<string, any>} message @returns {Outcome} */
  alert(message) {
    const alert = message.alert;
    if (!alert || typeof alert.id !== 'number') return this.bad();
    this.counters.alerts += 1;
    this.putAlert(message.op === 'clear' ? { ...alert, state: 'cleared' } : alert);
    this.alertVersion += 1;
    return 'applied';
  }

  /** @param {Alert} alert */
  putAlert(alert) {
    if (!alert || typeof alert.id !== 'number') return;
    const whole = { ...alert, targets: Array.isArray(alert.targets) ? alert.targets : [] };
    if (whole.state === 'cleared') {
      this.alerts.delete(whole.id);
      this.clear(whole);
    } else {
      this.alerts.set(whole.id, whole);
    }
  }

  /** @param {Alert} alert */
  clear(alert) {
    this.cleared = [alert, ...this.cleared.filter((one) => one.id !== alert.id)].slice(0, CLEARED_KEPT);
  }

  /** @param {Record<string, any>} message @returns {Outcome} */
  status(message) {
    if (Array.isArray(message.runways)) this.runways = new Map(message.runways.map((one) => [one.id, one]));
    if (Array.isArray(message.sensors)) this.sensors = new Map(message.sensors.map((one) => [one.id, one]));
    this.statusVersion += 1;
    return 'applied';
  }

  /** @param {Record<string, any>} message @param {number} nowMs */
  clock(message, nowMs) {
    if (typeof message.seq === 'number') this.seq = message.seq;
    if (typeof message.time === 'number' && Number.isFinite(message.time)) this.time = message.time;
    this.timeMs = nowMs;
    this.version += 1;
  }

  /** @returns {Outcome} */
  bad() {
    this.counters.bad += 1;
    return 'ignored';
  }

  /** @param {Track} track @param {number} nowMs */
  put(track, nowMs) {
    const target = this.targets.get(track.id);
    if (target) moveTarget(target, track, this.time, nowMs, this.pace);
    else this.targets.set(track.id, newTarget(track, this.time, nowMs));
    this.leaving.delete(track.id);
  }

  /** @param {number} id @param {number} nowMs */
  remove(id, nowMs) {
    const target = this.targets.get(id);
    if (!target) return;
    this.targets.delete(id);
    target.goneMs = nowMs;
    this.leaving.set(id, target);
  }

  /** Forget those that have faded. @param {number} nowMs */
  sweep(nowMs) {
    for (const [id, target] of this.leaving) if (nowMs - target.goneMs > FAREWELL_MS) this.leaving.delete(id);
  }

  /** @returns {Alert[]} live alerts, alarms first, then the oldest first */
  liveAlerts() {
    const rank = (/** @type {Alert} */ a) => (a.stage === 'alarm' ? 0 : 1);
    return [...this.alerts.values()].sort((a, b) => rank(a) - rank(b) || (a.raised_at ?? 0) - (b.raised_at ?? 0));
  }

  /** @returns {Map<number, 'information'|'alarm'>} the worst live stage by target */
  alertedTargets() {
    /** @type {Map<number, 'information'|'alarm'>} */
    const stages = new Map();
    for (const alert of this.alerts.values()) {
      for (const { track } of alert.targets) if (stages.get(track) !== 'alarm') stages.set(track, alert.stage);
    }
    return stages;
  }
}

/** @param {any} track @returns {track is Track} it can be drawn */
function usable(track) {
  return Boolean(track) && Number.isInteger(track.id) && Number.isFinite(track.east_m) && Number.isFinite(track.north_m);
}
