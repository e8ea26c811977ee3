// In a replay: play, pause, pace and seek, and the words on the picture that say it is no live traffic.

import { fetchReplay, steerReplay } from '../feed/rest.js';
import { clock, date, isNumber } from '../model/format.js';
import { MetAlerts, SPEEDS, nextSpeed, paceOf, shareOf, span, timeAt, usable, within } from '../model/recording.js';
import { byId, el, keyed, setText } from './dom.js';

/** @typedef {import('../types.js').ReplayState} ReplayState */

/** How often the service is asked where the replay stands. */
const POLL_MS = 500;
/** Words REPLAY over the picture: three columns of four. */
const WATERMARKS = 12;
/** A space as wide as a figure. */
const FIGURE_SPACE = '\u2007';
/** The picture's own time is shown unless it is this far (s of the recording, at the recorded pace) from where the replay stands. */
const APART_S = 3;

/** The bar under the picture; hidden unless the feed says that this is a replay. */
export class ReplayBar {
  /**
   * @param {import('../feed/picture.js').PictureState} picture @param {HTMLElement} stage
   * @param {{onError: (text: string) => void}} hooks
   */
  constructor(picture, stage, hooks) {
    this.picture = picture;
    this.hooks = hooks;
    this.bar = byId('replay');
    this.seek = /** @type {HTMLInputElement} */ (byId('replay-seek'));
    this.play = byId('replay-play');
    this.hint = byId('replay-hint');
    this.met = new MetAlerts();
    /** @type {ReplayState|null} */
    this.state = null;
    this.answeredMs = -Infinity;
    this.askedMs = -Infinity;
    /** questions and orders are numbered, so that an old answer does not undo a newer order */
    this.number = 0;
    this.held = false;
    /** @type {string|null} of the feed when the service was last asked */
    this.epoch = null;
    this.mark = this.watermark(stage);
    this.speeds = SPEEDS.map((speed) => el('button', { type: 'button', text: `${speed}×`, onclick: () => this.steer({ speed }) }));
    byId('replay-speed').append(...this.speeds);
    this.play.addEventListener('click', () => this.toggle());
    byId('replay-back').addEventListener('click', () => this.skip(-10));
    byId('replay-on').addEventListener('click', () => this.skip(10));
    this.seek.addEventListener('input', () => {
      this.held = true;
      this.update(performance.now());
    });
    this.seek.addEventListener('change', () => {
      this.held = false;
      this.steer({ time: Number(this.seek.value) });
    });
    this.seek.addEventListener('pointermove', (event) => this.point(event));
    this.seek.addEventListener('pointerleave', () => { this.hint.hidden = true; });
  }

  /** @param {HTMLElement} stage @returns {{faint: HTMLElement, plate: HTMLElement, time: HTMLElement, note: HTMLElement}} */
  watermark(stage) {
    const faint = el('div', { class: 'watermark', 'aria-hidden': 'true', hidden: true });
    for (let i = 0; i < WATERMARKS; i += 1) faint.append(el('span'));
    // over the map and the radar, under targets and labels
    stage.insertBefore(faint, stage.querySelector('.layer-tracks'));
    const time = el('span', { class: 'plate-time' });
    const note = el('span', { class: 'plate-note' });
    const plate = el('div', { class: 'plate', hidden: true }, el('b', { text: 'REPLAY' }), time, note);
    stage.parentElement?.append(plate);
    return { faint, plate, time, note };
  }

  /** @param {number} nowMs */
  update(nowMs) {
    const on = this.picture.mode === 'replay';
    this.mark.faint.hidden = this.mark.plate.hidden = !on;
    this.bar.hidden = !on || !this.state;
    if (!on) {
      this.state = null;
      this.picture.setPace(1, nowMs);
      return;
    }
    if (this.epoch !== this.picture.epoch) {
      // another client, or this one, moved the replay to another time
      this.epoch = this.picture.epoch;
      this.askedMs = -Infinity;
    }
    if (nowMs - this.askedMs >= POLL_MS && !document.hidden) this.ask(nowMs);
    this.met.take(this.picture.alerts.values());
    this.say();
    if (this.state) this.fill(this.state, nowMs);
  }

  /** The words on the picture: the time of what is shown. */
  say() {
    const { time } = this.picture;
    const words = `${date(time)} ${clock(time)} UTC`;
    setText(this.mark.time, words);
    setText(this.mark.note, !this.state ? 'not live' : paceOf(this.state) ? `not live · ${this.state.speed}×` : 'not live · paused');
    for (const one of this.mark.faint.children) setText(one, `REPLAY ${words}`);
  }

  /** @param {ReplayState} state @param {number} nowMs */
  fill(state, nowMs) {
    const running = paceOf(state) > 0;
    const time = this.held ? Number(this.seek.value) : this.timeNow(state, nowMs);
    this.bar.classList.toggle('is-running', running);
    this.bar.title = state.source;
    this.play.title = running ? 'Pause (space)' : 'Play (space)';
    this.play.setAttribute('aria-label', running ? 'Pause' : 'Play');
    setText(byId('replay-date'), date(time));
    setText(byId('replay-time'), clock(time));
    setText(byId('replay-begin'), clock(state.begin));
    setText(byId('replay-end'), clock(state.end));
    const whole = span(state.end - state.begin);
    // padded to one width, or the slider would change its length under the pointer
    setText(byId('replay-done'), `${span(time - state.begin).padStart(whole.length, FIGURE_SPACE)} / ${whole}`);
    this.speeds.forEach((button, i) => button.setAttribute('aria-pressed', String(SPEEDS[i] === state.speed)));
    for (const [key, value] of /** @type {['min'|'max', number][]} */ ([['min', state.begin], ['max', state.end]])) {
      if (Number(this.seek[key]) !== value) this.seek[key] = String(value);
    }
    if (!this.held) this.seek.value = String(time);
    this.seek.style.setProperty('--done', `${100 * shareOf(state, time)}%`);
    this.seek.setAttribute('aria-valuetext', `${date(time)} ${clock(time)} UTC`);
    keyed(byId('replay-marks'), this.met.of(state), (one) => `${one.kind} ${one.time}`, (one) => {
      const made = el('i', { class: `mark-${one.kind}` });
      made.style.left = `${100 * shareOf(state, one.time)}%`;
      return made;
    }, () => {});
  }

  /** @param {ReplayState} state @param {number} nowMs @returns {number} UTC s of the recording */
  timeNow(state, nowMs) {
    const expected = timeAt(state, this.answeredMs, nowMs);
    const shown = this.picture.time;
    return isNumber(shown) && this.picture.complete && Math.abs(shown - expected) < APART_S * Math.max(1, state.speed) ? within(state, shown) : expected;
  }

  /** Say what lies under the pointer. @param {PointerEvent} event */
  point(event) {
    const { state } = this;
    if (!state) return;
    const box = this.seek.getBoundingClientRect();
    const inset = 7; // half of the knob: at either end of the line its middle is this far inside
    const share = Math.min(1, Math.max(0, (event.clientX - box.left - inset) / Math.max(1, box.width - 2 * inset)));
    const time = state.begin + share * (state.end - state.begin);
    const near = this.met.of(state).find((one) => Math.abs(shareOf(state, one.time) - share) * box.width < 5);
    setText(this.hint, near ? `${clock(near.time)}  ${near.words}` : clock(time));
    this.hint.style.left = `${Math.min(box.width - 40, Math.max(40, inset + share * (box.width - 2 * inset)))}px`;
    this.hint.hidden = false;
  }

  /** @param {number} nowMs */
  async ask(nowMs) {
    this.askedMs = nowMs;
    const number = this.number;
    try {
      const state = await fetchReplay();
      if (number === this.number) this.take(state);
    } catch {
      // asked again soon; the feed shows when the service is gone
    }
  }

  /** @param {unknown} state */
  take(state) {
    if (!usable(state)) return;
    this.state = state;
    this.answeredMs = performance.now();
    this.picture.setPace(paceOf(state), this.answeredMs);
    this.update(this.answeredMs);
  }

  /** @param {{playing?: boolean, speed?: number, time?: number}} order */
  async steer(order) {
    this.number += 1;
    const number = this.number;
    // shown at once, until the service answers
    if (this.state) this.take({ ...this.state, time: timeAt(this.state, this.answeredMs, performance.now()), ...order });
    try {
      const state = await steerReplay(order);
      if (number === this.number) this.take(state);
    } catch (error) {
      this.hooks.onError(`Replay: ${error instanceof Error ? error.message : error}`);
      this.askedMs = -Infinity;
    }
  }

  /** @returns {boolean} something is replayed */
  toggle() {
    const { state } = this;
    if (!state) return false;
    const running = paceOf(state) > 0;
    // from the end it begins again
    this.steer(!running && state.time >= state.end ? { playing: true, time: state.begin } : { playing: !running });
    return true;
  }

  /** @param {number} seconds @returns {boolean} something is replayed */
  skip(seconds) {
    const { state } = this;
    if (!state) return false;
    this.steer({ time: within(state, this.timeNow(state, performance.now()) + seconds) });
    return true;
  }

  /** @param {number} step @returns {boolean} something is replayed */
  faster(step) {
    const { state } = this;
    if (!state) return false;
    const speed = nextSpeed(state.speed, step);
    if (speed !== state.speed) this.steer({ speed });
    return true;
  }
}
