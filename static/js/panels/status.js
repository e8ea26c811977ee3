// The top bar and the banner: who we are, what kind of picture this is, how old it is, and whether it still comes.

import { clock, date } from '../model/format.js';
import { byId, setText } from './dom.js';

/** @typedef {'ok'|'late'|'lost'|'starting'|'fault'} Health */

const FAULT_FRAMES = 5;

/**
 * @param {number} nowMs @param {number} lastMessageMs @param {number} lastPictureMs local clock of the newest tracks
 * @param {number} periodS @param {number} startMs local clock when the page began to wait
 * @param {number} pace seconds of picture time in a second of this clock; 0 while a replay is paused, which then sends no tracks
 * @param {number} paceMs local clock since when it has been so
 * @returns {Health} lost: nothing at all for twice the period (2 s at least); late: messages come, but no new tracks
 */
export function healthOf(nowMs, lastMessageMs, lastPictureMs, periodS, startMs = 0, pace = 1, paceMs = -Infinity) {
  const limit = Math.max(2, 2 * periodS) * 1000;
  if (lastPictureMs === -Infinity && nowMs - startMs < 2 * limit) return 'starting';
  if (nowMs - lastMessageMs > limit) return 'lost';
  const awaitedMs = Math.max(lastPictureMs, pace > 0 ? paceMs : nowMs);
  if (nowMs - awaitedMs > Math.max(3000, 3 * periodS * 1000) / Math.min(1, pace || 1)) return 'late';
  return 'ok';
}

/**
 * @param {Health} health @param {number} age s, of the picture @param {string} link
 * @param {string} refusal why the service does not let this page in
 * @returns {string}
 */
export function bannerText(health, age, link, refusal = '') {
  if (health === 'fault') return 'DISPLAY FAULT – part of the picture cannot be drawn, do not use it; reload the page';
  if (health === 'late') return Number.isFinite(age) ? `PICTURE LATE – no new tracks for ${Math.round(age)} s` : 'PICTURE LATE – connected, but no tracks yet';
  if (health !== 'lost') return '';
  const again = refusal ? ` – refused: ${refusal}` : link === 'live' ? '' : ' – reconnecting…';
  return Number.isFinite(age) ? `FEED LOST – this picture is ${Math.round(age)} s old, do not use it${again}` : `NO FEED – no picture${again}`;
}

/** Shows what `healthOf` finds. */
export class StatusBar {
  constructor() {
    this.banner = byId('banner');
    this.age = byId('data-age');
    this.utc = byId('data-clock');
    this.badge = byId('mode');
    this.startMs = performance.now();
    this.toastTimer = 0;
    /** why the service does not let this page in, '' when it does */
    this.refusal = '';
    /** @type {Health} */
    this.health = 'starting';
  }

  /**
   * @param {import('../feed/picture.js').PictureState} picture @param {import('../feed/live.js').LiveFeed} feed
   * @param {import('../feed/live.js').LinkState} link @param {number} failing frames in a row that could not be drawn
   * @param {number} nowMs
   */
  update(picture, feed, link, failing, nowMs) {
    const found = healthOf(nowMs, feed.lastMessageMs, picture.timeMs, feed.periodS, this.startMs, picture.pace, picture.paceMs);
    const health = found !== 'lost' && failing >= FAULT_FRAMES ? 'fault' : found;
    this.health = health;
    const age = (nowMs - picture.timeMs) / 1000;
    setText(this.utc, clock(picture.time));
    const replay = picture.mode === 'replay';
    byId('data-date').hidden = !replay;
    setText(byId('data-date'), date(picture.time));
    byId('data-clock-title').title = replay ? 'time of the recording, UTC' : 'time of the picture, UTC';
    if (picture.pace === 0) setText(this.age, 'paused');
    else setText(this.age, Number.isFinite(age) ? `${age < 10 ? age.toFixed(1) : Math.round(age)} s` : '–');
    document.body.dataset.health = health;
    document.body.dataset.mode = picture.mode;
    const starting = health === 'starting';
    const text = bannerText(health, age, link, this.refusal);
    this.banner.hidden = !text;
    setText(this.banner, text);
    this.banner.dataset.kind = health;
    const mode = picture.mode;
    this.badge.hidden = mode === 'live';
    setText(this.badge, mode === 'demo' ? 'DEMO · simulated' : mode === 'replay' ? 'REPLAY · not live' : mode);
    setText(byId('link'), starting ? 'connecting' : health === 'ok' ? (replay ? 'connected' : 'live') : this.refusal ? 'refused' : health);
    setText(byId('count'), `${picture.targets.size} targets`);
  }

  /** Say something for a few seconds. @param {string} text @param {'note'|'error'} [kind] */
  toast(text, kind = 'note') {
    const box = byId('toast');
    box.textContent = text;
    box.dataset.kind = kind;
    box.hidden = false;
    clearTimeout(this.toastTimer);
    this.toastTimer = window.setTimeout(() => { box.hidden = true; }, kind === 'error' ? 8000 : 2500);
  }
}
