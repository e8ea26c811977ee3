// Everything that is known of the selected target.

import { angle, bearing, clock, feet, knots, number } from '../model/format.js';
import { classOf, nameOf, numberOf, placeOf } from '../model/label_text.js';
import { byId, el, setText } from './dom.js';

/** @typedef {import('../types.js').Track} Track */

/** @param {Track} track @returns {[string, string][]} */
export function rowsOf(track) {
  const size = track.length_m ? `${number(track.length_m, 0)} × ${number(track.width_m, 0, 'm')}` : '–';
  /** @type {[string, string][]} */
  const rows = [
    ['Class', classOf(track)], ['Phase', track.phase ?? '–'], ['Speed', number(knots(track.speed_mps), 1, 'kt')],
    ['Course', bearing(track.course_deg)], ['Heading', bearing(track.heading_deg)],
    ['Height', track.on_ground === false ? number(feet(track.altitude_m), 0, 'ft') : 'on ground'],
    ['Runway', track.runway ?? '–'], ['Place', (track.runway ? '' : placeOf(track)) || '–'], ['Size', size], ['Address', track.address ?? '–'],
    ['Accuracy', number(track.accuracy_m, 1, 'm')], ['Sources', (track.sources ?? []).join(', ') || '–'],
    ['Position', `${angle(track.lat ?? NaN, 'lat')} ${angle(track.lon ?? NaN, 'lon')}`], ['Time', `${clock(track.time)} UTC`],
  ];
  if (track.simulated) rows.push(['Origin', 'simulated']);
  return rows;
}

/** The panel of the selected target; hidden when nothing is. */
export class TargetPanel {
  /** @param {import('../feed/picture.js').PictureState} picture @param {{onClose: () => void, onFollow: () => void, onCentre: () => void}} hooks */
  constructor(picture, hooks) {
    this.picture = picture;
    /** @type {Track|null} what was shown last */
    this.last = null;
    this.panel = byId('target');
    this.name = byId('target-name');
    this.table = byId('target-table');
    byId('target-close').addEventListener('click', hooks.onClose);
    byId('target-follow').addEventListener('click', hooks.onFollow);
    byId('target-centre').addEventListener('click', hooks.onCentre);
    /** @type {Map<string, HTMLElement>} */
    this.cells = new Map();
  }

  /** @param {number|null} selected @param {boolean} following */
  update(selected, following) {
    const track = selected === null ? undefined : this.picture.targets.get(selected)?.track;
    this.panel.hidden = selected === null;
    if (selected === null) return;
    byId('target-follow').setAttribute('aria-pressed', String(following));
    if (!track) {
      setText(this.name, `${this.last?.id === selected ? numberOf(this.last) : `#${selected}`} – gone`);
      this.panel.classList.add('is-gone');
      return;
    }
    this.panel.classList.remove('is-gone');
    this.last = track;
    setText(this.name, `${nameOf(track)}${track.callsign ? `  ${numberOf(track)}` : ''}`);
    const rows = rowsOf(track);
    const known = new Set(rows.map(([key]) => key));
    for (const [key, cell] of this.cells) if (cell.parentElement) cell.parentElement.hidden = !known.has(key);
    for (const [key, value] of rows) {
      let cell = this.cells.get(key);
      if (!cell) {
        cell = el('dd');
        this.cells.set(key, cell);
        this.table.append(el('div', {}, el('dt', { text: key }), cell));
      }
      setText(cell, value);
    }
  }
}
