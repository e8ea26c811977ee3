// The list of all targets, with search.

import { knots, number } from '../model/format.js';
import { classOf, isCoasting, isStanding, nameOf, numberOf, placeOf } from '../model/label_text.js';
import { coastedS } from '../model/motion.js';
import { byId, el, keyed, setText } from './dom.js';

/** @typedef {import('../types.js').Track} Track */

const SHAPES = { aircraft: '✈', vehicle: '■', unknown: '◇' };
const SHOWN = 200;

/**
 * @param {Track} track @param {string} words what is looked for, any order @param {string} kind '' for every class
 * @returns {boolean}
 */
export function matches(track, words, kind) {
  if (kind && (kind === 'moving' ? isStanding(track) : classOf(track) !== kind)) return false;
  const text = `${nameOf(track)} ${numberOf(track)} ${track.address ?? ''} ${track.runway ?? ''} ${track.zone ?? ''} ${track.phase ?? ''}`.toLowerCase();
  return words.toLowerCase().split(/\s+/).every((one) => text.includes(one));
}

/** The drawer on the left. */
export class TargetList {
  /** @param {import('../feed/picture.js').PictureState} picture @param {{onOpen: (id: number) => void, onToggle: () => void}} hooks */
  constructor(picture, hooks) {
    this.picture = picture;
    this.hooks = hooks;
    this.drawer = byId('list');
    this.rows = byId('list-rows');
    this.search = /** @type {HTMLInputElement} */ (byId('list-search'));
    this.kind = /** @type {HTMLSelectElement} */ (byId('list-kind'));
    this.search.addEventListener('input', () => this.update(null));
    this.kind.addEventListener('change', () => this.update(null));
    this.search.addEventListener('keydown', (event) => {
      if (event.key === 'Enter') this.openFirst();
    });
    this.rows.addEventListener('keydown', (event) => this.onKey(event));
    byId('list-close').addEventListener('click', hooks.onToggle);
  }

  /** @param {boolean} open */
  setOpen(open) {
    this.drawer.hidden = !open;
    byId('list-toggle').setAttribute('aria-expanded', String(open));
    this.update(null);
  }

  focus() {
    this.search.focus();
    this.search.select();
  }

  /** Take the focus: to the selected target, else the first one, else the search. @param {number|null} selected */
  enter(selected) {
    this.update(selected);
    const rows = this.buttons();
    const row = rows.find((one) => one.getAttribute('aria-current') === 'true') ?? rows[0];
    if (row) row.focus();
    else this.focus();
  }

  /** @returns {HTMLElement[]} */
  buttons() {
    return [...this.rows.querySelectorAll('button')];
  }

  /** Up and down go through the rows. @param {KeyboardEvent} event */
  onKey(event) {
    const step = event.key === 'ArrowDown' ? 1 : event.key === 'ArrowUp' ? -1 : 0;
    if (!step) return;
    const rows = this.buttons();
    const at = rows.indexOf(/** @type {HTMLElement} */ (document.activeElement));
    rows[Math.min(rows.length - 1, Math.max(0, at + step))]?.focus();
    event.preventDefault();
    event.stopPropagation();
  }

  openFirst() {
    const first = this.rows.querySelector('button');
    if (first instanceof HTMLElement) first.click();
  }

  /** @param {number|null} selected */
  update(selected) {
    if (this.drawer.hidden) return;
    const all = [...this.picture.targets.values()].map((one) => one.track);
    const found = all.filter((one) => matches(one, this.search.value.trim(), this.kind.value))
      .sort((a, b) => nameOf(a).localeCompare(nameOf(b), 'en', { numeric: true }));
    setText(byId('list-count'), found.length === all.length ? `${all.length}` : `${found.length} of ${all.length}`);
    keyed(this.rows, found.slice(0, SHOWN), (one) => String(one.id),
      (one) => el('li', {}, el('button', { type: 'button', onclick: () => this.hooks.onOpen(one.id) },
        el('span', { class: 'row-mark', 'aria-hidden': 'true' }), el('span', { class: 'row-name' }), el('span', { class: 'row-place' }), el('span', { class: 'row-speed' }))),
      (element, one) => this.fill(element, one, selected));
  }

  /** @param {HTMLElement} element @param {Track} track @param {number|null} selected */
  fill(element, track, selected) {
    const part = (/** @type {string} */ name) => /** @type {HTMLElement} */ (element.querySelector(name));
    const kind = classOf(track);
    const target = this.picture.targets.get(track.id);
    const coasting = isCoasting(track, target ? coastedS(target, this.picture.time) : 0);
    element.className = `row is-${kind}${coasting ? ' is-coasting' : ''}`;
    if (selected !== null) part('button').setAttribute('aria-current', String(track.id === selected));
    part('button').setAttribute('aria-label', `${nameOf(track)}, ${kind}`);
    setText(part('.row-mark'), SHAPES[kind]);
    setText(part('.row-name'), nameOf(track));
    setText(part('.row-place'), placeOf(track));
    setText(part('.row-speed'), coasting ? 'coast' : isStanding(track) ? '–' : number(knots(track.speed_mps), 0, 'kt'));
  }
}
