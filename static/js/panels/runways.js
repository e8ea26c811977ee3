// The runway strip: what is on each runway, what comes, how it is used; and the menu to set that.

import { setRunway } from '../feed/rest.js';
import { countdown, isNumber } from '../model/format.js';
import { nameOf } from '../model/label_text.js';
import { NO_COMMANDS, byId, el, keyed, setText } from './dom.js';

/** @typedef {import('../types.js').RunwayState} RunwayState */

const ARRIVAL_SOON_S = 30;
/** How long a change of a runway can be undone with one click, s. */
export const UNDO_S = 10;

/** One card a runway. */
export class RunwayPanel {
  /**
   * @param {import('../feed/picture.js').PictureState} picture
   * @param {{onError: (text: string) => void, onOpen: (runway: string) => void}} hooks
   */
  constructor(picture, hooks) {
    this.picture = picture;
    this.hooks = hooks;
    this.list = byId('runway-list');
    /** @type {Map<string, 'information'|'alarm'>} */
    this.alerted = new Map();
    /** @type {HTMLElement|null} */
    this.menu = null;
    /** @type {Map<string, {before: RunwayState, untilMs: number}>} changes that can be undone, by runway */
    this.undoable = new Map();
    document.addEventListener('pointerdown', (event) => {
      if (this.menu && event.target instanceof Node && !this.menu.parentElement?.contains(event.target)) this.close();
    });
  }

  /** @param {Map<string, 'information'|'alarm'>} alerted */
  update(alerted) {
    this.alerted = alerted;
    const states = [...this.picture.runways.values()];
    byId('runway-none').hidden = states.length > 0;
    keyed(this.list, states, (one) => one.id, (one) => this.make(one), (element, one) => this.fill(element, one));
  }

  /** @param {RunwayState} state @returns {HTMLElement} */
  make(state) {
    return el('li', { class: 'runway' },
      el('button', { class: 'runway-name', type: 'button', title: 'Show on the map', text: state.id, onclick: () => this.hooks.onOpen(state.id) }),
      el('span', { class: 'runway-chips' }),
      el('button', { class: 'runway-set', type: 'button', 'aria-haspopup': 'menu', 'aria-expanded': 'false', 'aria-label': `Set runway ${state.id}`, text: 'Set', onclick: (/** @type {Event} */ event) => this.toggle(state.id, event) }),
      el('span', { class: 'runway-traffic' }),
      el('button', { class: 'runway-undo', type: 'button', hidden: true, onclick: () => this.undo(state.id) }));
  }

  /** @param {HTMLElement} element @param {RunwayState} state */
  fill(element, state) {
    const replay = this.picture.mode === 'replay';
    const set = /** @type {HTMLButtonElement} */ (element.querySelector('.runway-set'));
    set.disabled = replay;
    set.title = replay ? NO_COMMANDS : '';
    if (replay && this.menu) this.close();
    this.fillUndo(/** @type {HTMLElement} */ (element.querySelector('.runway-undo')), state.id);
    const occupants = state.occupants ?? [];
    const soon = isNumber(state.next_arrival_s) && state.next_arrival_s <= ARRIVAL_SOON_S;
    const stage = this.alerted.get(state.id);
    const chips = [];
    if (!state.open) chips.push(['closed', '✕ CLOSED']);
    else if (state.in_use) chips.push(['use', `${state.in_use} in use`]);
    else chips.push(['idle', 'not in use']);
    if (state.visibility === 'low') chips.push(['lvp', 'LVP']);
    if (occupants.length) chips.push(['busy', '● OCCUPIED']);
    const text = chips.map((one) => one.join(':')).join('|');
    const box = /** @type {HTMLElement} */ (element.querySelector('.runway-chips'));
    if (box.dataset.text !== text) {
      box.dataset.text = text;
      box.replaceChildren(...chips.map(([kind, words]) => el('span', { class: `chip ${kind}`, text: words })));
    }
    element.className = ['runway', !state.open && 'is-closed', occupants.length && 'is-busy', soon && occupants.length && 'is-hot', stage && `is-${stage}`].filter(Boolean).join(' ');
    const name = (/** @type {number} */ id) => {
      const track = this.picture.targets.get(id)?.track;
      return track ? nameOf(track) : `#${id}`;
    };
    const parts = [];
    if (occupants.length) parts.push(`On: ${occupants.slice(0, 3).map(name).join(', ')}${occupants.length > 3 ? ` +${occupants.length - 3}` : ''}`);
    if (isNumber(state.next_arrival_s)) parts.push(`Arr ${state.next_arrival !== null && state.next_arrival !== undefined ? `${name(state.next_arrival)} ` : ''}${countdown(state.next_arrival_s)}`);
    setText(/** @type {HTMLElement} */ (element.querySelector('.runway-traffic')), parts.join('   '));
  }

  /** @param {string} id @param {Event} event */
  toggle(id, event) {
    const button = /** @type {HTMLElement} */ (event.currentTarget);
    const open = button.getAttribute('aria-expanded') === 'true';
    this.close();
    if (open) return;
    const state = this.picture.runways.get(id);
    if (!state) return;
    const choice = (/** @type {string} */ text, /** @type {boolean} */ current, /** @type {Record<string, unknown>} */ change, asks = false) =>
      el('button', { type: 'button', role: 'menuitemradio', 'aria-checked': String(current), text, onclick: () => (asks ? this.confirmClosing(id) : this.send(id, change)) });
    const [a, b] = id.split('/');
    const uses = [a, b].filter(Boolean).map((one) => choice(`In use ${one}`, state.open && state.in_use === one, { in_use: one }));
    this.menu = el('div', { class: 'menu', role: 'menu', 'aria-label': `Runway ${id}` },
      choice('Open', state.open, { open: true }), choice('Closed', !state.open, { open: false }, state.open), el('hr'),
      ...uses, choice('Not in use', !state.in_use, { in_use: '' }), el('hr'),
      choice('Normal visibility', state.visibility !== 'low', { visibility: 'normal' }),
      choice('Low visibility (LVP)', state.visibility === 'low', { visibility: 'low' }));
    this.menu.addEventListener('keydown', (key) => this.onKey(key, button));
    button.setAttribute('aria-expanded', 'true');
    button.parentElement?.append(this.menu);
    /** @type {HTMLElement|null} */ (this.menu.querySelector('[aria-checked="true"]') ?? this.menu.querySelector('button'))?.focus();
  }

  /** @param {KeyboardEvent} event @param {HTMLElement} button */
  onKey(event, button) {
    const items = /** @type {HTMLElement[]} */ ([...(this.menu?.querySelectorAll('button') ?? [])]);
    const at = items.indexOf(/** @type {HTMLElement} */ (document.activeElement));
    if (event.key === 'ArrowDown') items[(at + 1) % items.length].focus();
    else if (event.key === 'ArrowUp') items[(at - 1 + items.length) % items.length].focus();
    else if (event.key === 'Escape') {
      this.close();
      button.focus();
    } else return;
    event.preventDefault();
    event.stopPropagation();
  }

  /** Ask before a runway is closed: the menu becomes the question. @param {string} id */
  confirmClosing(id) {
    const question = `Close runway ${id}?`;
    const yes = el('button', { type: 'button', role: 'menuitem', class: 'menu-danger', text: `Close runway ${id}`, onclick: () => this.send(id, { open: false }) });
    const no = el('button', { type: 'button', role: 'menuitem', text: 'Cancel', onclick: () => this.leave() });
    this.menu?.setAttribute('aria-label', question);
    this.menu?.replaceChildren(el('p', { class: 'menu-question', text: `${question} Traffic on it raises alerts.` }), yes, no);
    // an Enter too many does not close it
    no.focus();
  }

  /** @param {HTMLElement} button @param {string} id */
  fillUndo(button, id) {
    const left = Math.ceil(((this.undoable.get(id)?.untilMs ?? 0) - performance.now()) / 1000);
    if (left <= 0) this.undoable.delete(id);
    button.hidden = left <= 0 || this.picture.mode === 'replay';
    setText(button, `Undo (${left} s)`);
    button.setAttribute('aria-label', `Undo the change of runway ${id}`);
  }

  /** Set a runway to what it was before the last change from here. @param {string} id */
  undo(id) {
    const before = this.undoable.get(id)?.before;
    if (!before) return;
    const { open, in_use, visibility } = before;
    this.send(id, open ? { open, in_use: in_use ?? '', visibility } : { open, visibility }, false);
  }

  /** Close the menu and give the focus back to its button. */
  leave() {
    const button = this.menu?.parentElement?.querySelector('.runway-set');
    this.close();
    if (button instanceof HTMLElement) button.focus();
  }

  close() {
    const button = this.menu?.parentElement?.querySelector('.runway-set');
    button?.setAttribute('aria-expanded', 'false');
    this.menu?.remove();
    this.menu = null;
  }

  /** @param {string} id @param {Record<string, unknown>} change @param {boolean} [undoable] */
  async send(id, change, undoable = true) {
    this.leave();
    const before = this.picture.runways.get(id);
    try {
      const state = (await setRunway(id, change))?.runway;
      this.undoable.delete(id);
      if (before && undoable) this.undoable.set(id, { before, untilMs: performance.now() + 1000 * UNDO_S });
      if (state?.id === id) {
        this.picture.runways.set(id, state);
        this.picture.statusVersion += 1;
      }
    } catch (error) {
      this.hooks.onError(`Runway ${id}: ${error instanceof Error ? error.message : error}`);
    }
  }
}
