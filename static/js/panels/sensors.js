// Sensor health: status in words and shape, age, rates of loss.

import { compact, duration, isNumber } from '../model/format.js';
import { byId, el, keyed, setText } from './dom.js';

/** @typedef {import('../types.js').SensorState} SensorState */

/** Counters that are no loss. */
const GOOD = /^(sweeps|taken|datagrams|messages|received|blocks|scans|turns|plots|events|reports|bytes|sent|records)/;
const MARKS = { ok: '●', degraded: '◐', silent: '✕', waiting: '○' };

/** @param {SensorState} sensor @returns {[string, number][]} what was dropped, by reason */
export const drops = (sensor) =>
  Object.entries(sensor.counters ?? {}).filter(([name, count]) => isNumber(count) && count > 0 && !GOOD.test(name));

/** One row a sensor; the rest of its counters in the tooltip. */
export class SensorPanel {
  /** @param {import('../feed/picture.js').PictureState} picture */
  constructor(picture) {
    this.picture = picture;
    this.list = byId('sensor-list');
  }

  update() {
    const sensors = [...this.picture.sensors.values()];
    byId('sensor-none').hidden = sensors.length > 0;
    const poor = sensors.filter((one) => one.status !== 'ok').length;
    setText(byId('sensor-count'), poor ? `${poor} of ${sensors.length} not ok` : sensors.length ? `${sensors.length} ok` : '');
    keyed(this.list, sensors, (one) => one.id, () => el('li', { class: 'sensor' },
      el('span', { class: 'sensor-mark', 'aria-hidden': 'true' }), el('span', { class: 'sensor-name' }), el('span', { class: 'sensor-state' }),
      el('span', { class: 'sensor-age' }), el('span', { class: 'sensor-drops' })), (element, one) => this.fill(element, one));
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
    const lost = drops(sensor);
    const detail = [sensor.detail, ...lost.map(([name, count]) => `${name} ${compact(count)}`)].filter(Boolean).join(' · ');
    setText(part('.sensor-drops'), detail);
    part('.sensor-drops').hidden = !detail;
    element.title = Object.entries(sensor.counters ?? {}).map(([name, count]) => `${name}: ${count}`).join('\n');
  }
}
