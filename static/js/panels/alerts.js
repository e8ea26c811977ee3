// The alert list: alarms first, acknowledge, and what has been cleared.

import { acknowledge } from '../feed/rest.js';
import { clock, duration, isNumber } from '../model/format.js';
import { NO_COMMANDS, byId, el, keyed, setText } from './dom.js';

/** @typedef {import('../types.js').Alert} Alert */

/** @type {Record<string, string>} */
const RULES = {
  runway_occupied: 'Runway occupied', hold_entry: 'Hold crossed', opposite_direction: 'Opposite direction',
  closed_runway: 'Closed runway in use',
};

/** @param {Alert} alert @returns {boolean} it still asks for attention */
export const needsAttention = (alert) => alert.state === 'new' || alert.state === 'ongoing';

/**
 * @typedef {object} AlertPanelHooks
 * @property {(alert: Alert) => void} onOpen
 * @property {(text: string) => void} onError
 */

/** The panel; `update` after every change and once a second. */
export class AlertPanel {
  /** @param {import('../feed/picture.js').PictureState} picture @param {AlertPanelHooks} hooks */
  constructor(picture, hooks) {
    this.picture = picture;
    this.hooks = hooks;
    this.list = byId('alert-list');
    this.history = byId('alert-history');
    this.none = byId('alert-none');
    this.count = byId('alert-count');
    this.spoken = byId('announce');
    /** @type {Set<number>} sent, not yet answered */
    this.sending = new Set();
    /** @type {Map<number, string>} */
    this.told = new Map();
  }

  update() {
    const live = this.picture.liveAlerts();
    keyed(this.list, live, (one) => String(one.id), (one) => this.make(one), (element, one) => this.fill(element, one));
    const past = this.picture.cleared.slice(0, 12);
    keyed(this.history, past, (one) => String(one.id), (one) => this.makePast(one), (element, one) => this.fillPast(element, one));
    this.none.hidden = live.length > 0;
    byId('alert-past').hidden = past.length === 0;
    const open = live.filter(needsAttention).length;
    setText(this.count, live.length ? `${live.length}${open ? ` · ${open} open` : ''}` : '');
    for (const alert of live) this.tell(alert);
  }

  /** Say a new stage once to a screen reader. @param {Alert} alert */
  tell(alert) {
    if (this.told.get(alert.id) === alert.stage) return;
    this.told.set(alert.id, alert.stage);
    if (this.told.size > 200) this.told.delete(this.told.keys().next().value ?? -1);
    this.spoken.textContent = `${alert.stage === 'alarm' ? 'Alarm' : 'Information'}: ${alert.text}`;
  }

  /** @param {Alert} alert @returns {HTMLElement} */
  make(alert) {
    const open = el('button', { class: 'alert-open', type: 'button', title: 'Show on the map', onclick: () => this.hooks.onOpen(this.newest(alert)) },
      el('span', { class: 'alert-head' }, el('span', { class: 'alert-stage' }), el('span', { class: 'alert-runway' }), el('span', { class: 'alert-age' })),
      el('span', { class: 'alert-text' }), el('span', { class: 'alert-detail' }));
    const ack = el('button', { class: 'alert-ack', type: 'button', onclick: () => this.acknowledge(alert.id) });
    return el('li', { class: 'alert' }, open, ack);
  }

  /** @param {Alert} alert @returns {Alert} */
  newest(alert) {
    return this.picture.alerts.get(alert.id) ?? alert;
  }

  /** @param {HTMLElement} element @param {Alert} alert */
  fill(element, alert) {
    const open = needsAttention(alert);
    const alarm = alert.stage === 'alarm';
    element.className = `alert ${alarm ? 'alarm' : 'information'} ${open ? 'open' : 'acknowledged'}`;
    const part = (/** @type {string} */ name) => /** @type {HTMLElement} */ (element.querySelector(name));
    setText(part('.alert-stage'), alarm ? '▲ ALARM' : '◆ INFO');
    setText(part('.alert-runway'), alert.runway ? `RWY ${alert.runway}` : '');
    setText(part('.alert-age'), isNumber(alert.raised_at) ? duration(this.picture.time - alert.raised_at) : '');
    setText(part('.alert-text'), alert.text || RULES[alert.rule] || alert.rule);
    const names = alert.targets.map((one) => one.callsign || `#${one.number ?? one.track}`).join(' · ');
    const eta = isNumber(alert.time_to_threshold_s) ? `  threshold in ${duration(alert.time_to_threshold_s).replace(' ', '\u00a0')}` : '';
    setText(part('.alert-detail'), [`${names}${eta}`, `since ${clock(alert.raised_at)}${alert.holding_point ? `  hold ${alert.holding_point}` : ''}${alert.degraded ? '  degraded' : ''}${alert.simulated ? '  SIM' : ''}`].filter(Boolean).join('\n'));
    const button = /** @type {HTMLButtonElement} */ (part('.alert-ack'));
    // in a replay only what was acknowledged then is told
    button.hidden = open && this.picture.mode === 'replay';
    button.disabled = !open || this.sending.has(alert.id);
    setText(button, open ? (this.sending.has(alert.id) ? '…' : 'ACK') : 'ACK’D');
    const label = open ? `Acknowledge alert ${alert.id}: ${alert.text}` : `Acknowledged${alert.acknowledged_by ? ` by ${alert.acknowledged_by}` : ''}`;
    button.setAttribute('aria-label', label);
    button.title = open ? 'Acknowledge (a)' : label;
  }

  /** @param {Alert} alert @returns {HTMLElement} */
  makePast(alert) {
    return el('li', { class: 'past' }, el('span', { class: 'past-time' }), el('span', { class: 'past-text', text: alert.text }), el('span', { class: 'past-why' }));
  }

  /** @param {HTMLElement} element @param {Alert} alert */
  fillPast(element, alert) {
    const part = (/** @type {string} */ name) => /** @type {HTMLElement} */ (element.querySelector(name));
    setText(part('.past-time'), clock(alert.cleared_at ?? alert.updated_at));
    setText(part('.past-why'), [alert.worst_stage === 'alarm' ? 'ALARM' : '', alert.runway, alert.clear_reason].filter(Boolean).join(' · '));
  }

  /** @param {number} id */
  async acknowledge(id) {
    if (this.picture.mode === 'replay') {
      this.hooks.onError(NO_COMMANDS);
      return;
    }
    if (this.sending.has(id)) return;
    this.sending.add(id);
    this.update();
    try {
      const answer = await acknowledge(id, 'display');
      const known = this.picture.alerts.get(id);
      if (known && needsAttention(known)) this.picture.apply({ type: 'alert', op: 'ack', alert: { ...known, ...(answer?.alert ?? {}), state: 'acknowledged' } }, performance.now());
    } catch (error) {
      this.hooks.onError(`Acknowledge failed: ${error instanceof Error ? error.message : error}`);
    } finally {
      this.sending.delete(id);
      this.update();
    }
  }

  /** Acknowledge the one that has waited longest; alarms before informations. */
  acknowledgeOldest() {
    const first = this.picture.liveAlerts().find((one) => needsAttention(one) && !this.sending.has(one.id));
    if (first) this.acknowledge(first.id);
  }
}
