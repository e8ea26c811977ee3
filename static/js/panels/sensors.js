// Sensor health: status in words and shape, age, what was lost by reason.

import { compact, duration, isNumber } from '../model/format.js';
import { byId, el, keyed, setText } from './dom.js';

/** @typedef {import('../types.js').SensorState} SensorState */

/** @type {Record<string, string>} what the top bar says of states that operators had set and a restart took away */
const RESET = { runways: 'RUNWAY STATE – CHECK', restart: 'ALERTS RESET BY RESTART' };

/** @param {SensorState} sensor @returns {string} what of an operator's is to be looked at, '' when nothing */
export const resetOf = (sensor) => (sensor.kind === 'store' && RESET[sensor.id]) || '';

/** Words in the name of a counter that mean loss or trouble; everything else is how much was done. */
const TROUBLE = new Set(('lost late duplicate reordered dropped wrong malformed truncated oversized refused failed failures missing degraded '
  + 'no silent ahead behind rebased steps overflow errors incomplete backwards jump step restart sequence compressed undelivered skipped implausible retries held').split(' '));
const MARKS = { ok: '●', degraded: '◐', silent: '✕', waiting: '○' };

/** @param {SensorState} sensor @returns {[string, number][]} what was lost or went wrong, by reason */
export const drops = (sensor) => Object.entries(sensor.counters ?? {})
  .filter(([name, count]) => isNumber(count) && count > 0 && name.split('_').some((word) => TROUBLE.has(word)));

/** An offset (s) below this is not worth a word. */
const CLOCK_SHOWN_S = 0.1;

/** @param {SensorState} sensor @returns {string} how far its clock is off, unless its detail says so already */
export const offClock = ({ clock_offset_s: offset, detail }) => (!isNumber(offset) || Math.abs(offset) < CLOCK_SHOWN_S
  || /ahead|behind/.test(detail) ? '' : `clock ${offset > 0 ? '+' : '−'}${Math.abs(offset).toFixed(1)} s`);

/** One row a sensor, with what it lost; a click on its name shows all its counters. */
export class SensorPanel {
  /** @param {import('../feed/picture.js').PictureState} picture */
  constructor(picture) {
    this.picture = picture;
    this.list = byId('sensor-list');
    /** @type {Set<string>} those whose counters are all shown */
    this.open = new Set();
  }

  update() {
    const sensors = [...this.picture.sensors.values()];
    this.warn(sensors);
    byId('sensor-none').hidden = sensors.length > 0;
    const poor = sensors.filter((one) => one.status !== 'ok').length;
    setText(byId('sensor-count'), poor ? `${poor} of ${sensors.length} not ok` : sensors.length ? `${sensors.length} ok` : '');
    keyed(this.list, sensors, (one) => one.id, (one) => el('li', { class: 'sensor' },
      el('span', { class: 'sensor-mark', 'aria-hidden': 'true' }), this.nameButton(one.id), el('span', { class: 'sensor-state' }),
      el('span', { class: 'sensor-age' }), el('span', { class: 'sensor-drops' }), el('dl', { class: 'sensor-all', hidden: true })),
    (element, one) => this.fill(element, one));
  }

  /** Say in the top bar which radars do not tell all, and what a restart has reset. @param {SensorState[]} sensors */
  warn(sensors) {
    const poor = sensors.filter((one) => (one.kind === 'radar' || resetOf(one)) && (one.status === 'degraded' || one.status === 'silent'));
    const chip = byId('degraded');
    chip.hidden = poor.length === 0;
    setText(chip, poor.map((one) => `${MARKS[/** @type {keyof typeof MARKS} */ (one.status)]} ${resetOf(one) || `${one.id} ${one.status}`}`).join('  '));
    chip.title = poor.map((one) => `${one.kind === 'radar' ? `radar ${one.id}: ` : ''}${one.detail || one.status}`).join('\n');
  }

  /** @param {HTMLElement} element @param {SensorState} sensor */
  fill(element, sensor) {
    const part = (/** @type {string} */ name) => /** @type {HTMLElement} */ (element.querySelector(name));
    element.className = `sensor is-${sensor.status}`;
    setText(part('.sensor-mark'), MARKS[/** @type {keyof typeof MARKS} */ (sensor.status)] ?? '?');
    setText(part('.sensor-name'), `${sensor.id}${sensor.simulated ? ' (sim)' : ''}`);
    setText(part('.sensor-state'), sensor.status);
    const age = isNumber(sensor.last) ? this.picture.time - sensor.last : NaN;
    setText(part('.sensor-age'), isNumber(age) ? (age < 1.5 ? 'now' : duration(age)) : '–');
    const said = [sensor.detail, offClock(sensor), ...drops(sensor).map(([name, count]) => `${words(name)} ${compact(count)}`)].filter(Boolean).join(' · ');
    setText(part('.sensor-drops'), said);
    part('.sensor-drops').hidden = !said;
    const open = this.open.has(sensor.id);
    part('.sensor-name').setAttribute('aria-expanded', String(open));
    part('.sensor-all').hidden = !open;
    const all = Object.entries(sensor.counters ?? {});
    const rows = open ? all : [];
    keyed(part('.sensor-all'), rows, ([name]) => name, ([name]) => el('div', {}, el('dt', { text: words(name) }), el('dd')),
      (row, [, count]) => setText(/** @type {HTMLElement} */ (row.querySelector('dd')), String(count)));
    if (open && !all.length) setText(part('.sensor-all'), 'it counts nothing');
  }

  /** @param {string} id @returns {HTMLElement} */
  nameButton(id) {
    return el('button', { type: 'button', class: 'sensor-name plain', title: 'All its counters', 'aria-expanded': 'false', onclick: () => {
      if (!this.open.delete(id)) this.open.add(id);
      this.update();
    } });
  }
}

/** @param {string} name @returns {string} */
const words = (name) => name.replaceAll('_', ' ');
