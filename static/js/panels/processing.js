// The parts that work on each radar's video: what runs, what it costs, and the choice of others while it runs.

import { chooseParts, fetchParts } from '../feed/rest.js';
import { compact, isNumber } from '../model/format.js';
import { byId, el, keyed, setText } from './dom.js';

/** @typedef {import('../types.js').RadarParts} RadarParts */

const POLL_MS = 2000;
const STAGES = Object.freeze({ detect: 'Detector', extract: 'Extractor', bearing: 'Bearing' });

/** @param {string} verb @returns {string} */
const titleOf = (verb) => STAGES[/** @type {keyof typeof STAGES} */ (verb)] ?? verb;

/**
 * What is asked for beyond what runs (or is about to).
 * @param {RadarParts} state @param {Map<string, string>} wanted names by verb
 * @returns {Record<string, {name: string}>}
 */
export function orderOf(state, wanted) {
  const coming = state.next ?? state.running;
  const changed = [...wanted].filter(([verb, name]) => coming[verb] && coming[verb].name !== name);
  return Object.fromEntries(changed.map(([verb, name]) => [verb, { name }]));
}

/** @param {RadarParts} state @returns {string} what was cut lately; empty when nothing was */
export function cutWords(state) {
  const words = { degraded_sweeps: 'sweeps cut', runs_dropped: 'runs left out', queue_dropped_sweeps: 'sweeps dropped' };
  return Object.entries(state.cut ?? {}).map(([name, count]) => `${compact(count)} ${words[/** @type {keyof typeof words} */ (name)] ?? name}`).join(' · ');
}

/** @param {RadarParts} state @returns {string} what learns; empty when nothing does */
export function learningWords(state) {
  if (!state.next || !isNumber(state.scans_left)) return '';
  const { next, running } = state;
  const names = Object.keys(next).filter((verb) => JSON.stringify(next[verb]) !== JSON.stringify(running[verb])).map((verb) => next[verb].name);
  return `${names.join(' and ')} ${names.length > 1 ? 'take' : 'takes'} over in ${state.scans_left} ${state.scans_left === 1 ? 'turn' : 'turns'}`;
}

/** One card a radar, filled only while the panel is open. */
export class ProcessingPanel {
  /**
   * @param {import('../feed/picture.js').PictureState} picture
   * @param {{onError: (text: string) => void}} hooks
   */
  constructor(picture, hooks) {
    this.picture = picture;
    this.hooks = hooks;
    this.section = byId('processing');
    this.box = /** @type {HTMLDetailsElement} */ (byId('processing-open'));
    this.list = byId('processing-list');
    /** @type {Map<string, RadarParts>} */
    this.states = new Map();
    /** @type {Map<string, Map<string, string>>} by radar: the names picked by hand, by verb, not yet sent */
    this.wanted = new Map();
    /** @type {Set<string>} radars whose answer is awaited */
    this.busy = new Set();
    this.askedMs = -Infinity;
    this.box.addEventListener('toggle', () => {
      this.askedMs = -Infinity;
      if (!this.box.open) this.wanted.clear();
    });
  }

  /** @param {number} nowMs */
  update(nowMs) {
    const radars = [...this.picture.sensors.values()].filter((one) => one.kind === 'radar' && Object.keys(one.parts ?? {}).length);
    // a replay works on what was detected then: there is nothing to choose
    this.section.hidden = radars.length === 0 || this.picture.mode === 'replay';
    if (this.section.hidden) return;
    setText(byId('processing-short'), this.box.open || radars.length !== 1 ? '' : Object.values(radars[0].parts ?? {}).join(' · '));
    if (!this.box.open) return;
    if (nowMs - this.askedMs >= POLL_MS && !document.hidden) {
      this.askedMs = nowMs;
      for (const one of radars) this.ask(one.id);
    }
    keyed(this.list, radars.filter((one) => this.states.has(one.id)), (one) => one.id, (one) => this.make(one.id),
      (element, one) => this.fill(element, one.id));
  }

  /** @param {string} radar */
  async ask(radar) {
    if (this.busy.has(radar)) return;
    try {
      this.states.set(radar, await fetchParts(radar));
    } catch {
      // the next question may be answered
    }
  }

  /** @param {string} radar @returns {HTMLElement} */
  make(radar) {
    return el('li', { class: 'processing-radar', 'aria-label': `Processing of radar ${radar}` },
      el('div', { class: 'processing-name', text: radar }), el('div', { class: 'processing-picks' }),
      el('div', { class: 'processing-learning', role: 'status' }, el('progress', { 'aria-hidden': 'true', hidden: true }), el('span', { class: 'processing-words' })),
      el('div', { class: 'processing-figures' }),
      el('div', { class: 'processing-orders', hidden: true },
        el('button', { type: 'button', class: 'processing-apply', text: 'Apply', onclick: () => this.send(radar) }),
        el('button', { type: 'button', class: 'plain', text: 'Keep what runs', onclick: () => this.forget(radar) })));
  }

  /** @param {HTMLElement} element @param {string} radar */
  fill(element, radar) {
    const state = this.states.get(radar);
    if (!state) return;
    const child = (/** @type {string} */ name) => /** @type {HTMLElement} */ (element.querySelector(name));
    const wanted = this.wanted.get(radar) ?? new Map();
    keyed(child('.processing-picks'), Object.keys(state.running), String, (verb) => this.pick(radar, verb, state), (row, verb) => {
      const select = /** @type {HTMLSelectElement} */ (row.querySelector('select'));
      const name = wanted.get(verb) ?? (state.next ?? state.running)[verb].name;
      if (select.value !== name) select.value = name;
      select.setAttribute('aria-disabled', String(this.busy.has(radar)));
      row.classList.toggle('is-changed', name !== state.running[verb].name);
      row.title = state.available[verb].find((one) => one.name === name)?.about ?? '';
      const ms = state.ms_a_turn[verb];
      setText(/** @type {HTMLElement} */ (row.querySelector('.processing-ms')), isNumber(ms) ? `${ms < 10 ? ms.toFixed(1) : Math.round(ms)} ms` : '–');
    });
    const cut = cutWords(state);
    setText(child('.processing-figures'), `${state.plots_a_scan} plots a turn${cut ? `  ◐ ${cut} in 10 s` : ''}`);
    child('.processing-figures').classList.toggle('is-cut', Boolean(cut));
    const changed = Object.keys(orderOf(state, wanted)).length > 0;
    child('.processing-orders').hidden = !changed || this.busy.has(radar);
    const learning = learningWords(state);
    setText(child('.processing-words'), this.busy.has(radar) ? 'being made ready…' : learning);
    const bar = /** @type {HTMLProgressElement} */ (child('progress'));
    bar.hidden = !learning || this.busy.has(radar);
    if (learning && isNumber(state.scans_left)) {
      bar.max = Math.max(Number(bar.dataset.most ?? 1), state.scans_left);
      bar.dataset.most = String(bar.max);
      bar.value = bar.max - state.scans_left;
    } else delete bar.dataset.most;
  }

  /** @param {string} radar @param {string} verb @param {RadarParts} state @returns {HTMLElement} */
  pick(radar, verb, state) {
    const select = el('select', { onchange: () => {
      const wanted = this.wanted.get(radar) ?? new Map();
      this.wanted.set(radar, wanted.set(verb, select.value));
      this.update(performance.now());
    } });
    for (const one of state.available[verb] ?? []) select.append(el('option', { value: one.name, text: one.name, title: one.about }));
    return el('label', { class: 'processing-pick' }, el('span', { class: 'processing-verb', text: titleOf(verb) }), select, el('span', { class: 'processing-ms', title: 'milliseconds a turn' }));
  }

  /** @param {string} radar */
  forget(radar) {
    this.wanted.delete(radar);
    this.focus(radar);
    this.update(performance.now());
  }

  /** From a button that goes to what stays. @param {string} radar */
  focus(radar) {
    const select = this.list.querySelector(`[data-key="${CSS.escape(radar)}"] select`);
    if (select instanceof HTMLElement) select.focus();
  }

  /** @param {string} radar */
  async send(radar) {
    const state = this.states.get(radar);
    if (!state) return;
    const order = orderOf(state, this.wanted.get(radar) ?? new Map());
    this.focus(radar);
    this.busy.add(radar);
    this.update(performance.now());
    try {
      this.states.set(radar, await chooseParts(radar, order));
      this.wanted.delete(radar);
    } catch (error) {
      this.hooks.onError(`Radar ${radar}: ${error instanceof Error ? error.message : error}`);
    } finally {
      this.busy.delete(radar);
      this.update(performance.now());
    }
  }
}
