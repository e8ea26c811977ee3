import assert from 'node:assert/strict';
import { test } from 'node:test';

import { PictureState } from '../../../static/js/feed/picture.js';
import { onKey } from '../../../static/js/input/keys.js';
import { date } from '../../../static/js/model/format.js';
import { MAX_EXTRAPOLATION_S, moveTarget, newTarget, positionAt, repace } from '../../../static/js/model/motion.js';
import { MetAlerts, SPEEDS, nextSpeed, paceOf, shareOf, span, timeAt, usable, within } from '../../../static/js/model/recording.js';
import { healthOf } from '../../../static/js/panels/status.js';

const state = (more = {}) => ({ source: 'a.mcap', begin: 1000, end: 2000, time: 1100, playing: true, speed: 4, gaps: [1500], ...more });
const track = (id, more = {}) => ({
  id, time: 100, east_m: 0, north_m: 0, speed_mps: 10, course_deg: 90, heading_deg: 90, class: 'aircraft', callsign: `AFR${id}`, phase: 'confirmed', ...more,
});
const snapshot = (epoch, tracks, more = {}) => ({ type: 'snapshot', topic: 'tracks', epoch, seq: 10, time: 100, mode: 'replay', tracks, ...more });
const alert = (id, more = {}) => ({ id, rule: 'hold_entry', stage: 'alarm', state: 'new', text: 'x', raised_at: 1200, targets: [], ...more });

test('between two answers the time goes on at the pace, up to the end, and not while it is paused', () => {
  assert.equal(timeAt(state(), 0, 2500), 1110);
  assert.equal(timeAt(state(), 5000, 0), 1100);
  assert.equal(timeAt(state({ time: 1999 }), 0, 60_000), 2000);
  assert.equal(timeAt(state({ playing: false }), 0, 60_000), 1100);
  assert.equal(paceOf(state()), 4);
  assert.equal(paceOf(state({ playing: false })), 0);
  assert.equal(paceOf(state({ time: 2000 })), 0);
});

test('answers that cannot be shown are not taken', () => {
  assert.ok(usable(state()));
  for (const bad of [null, {}, state({ time: null }), state({ end: 0 }), state({ speed: 0 }), state({ begin: 'x' })]) assert.ok(!usable(bad));
});

test('the line: shares, spans, speeds', () => {
  assert.equal(shareOf(state(), 1250), 0.25);
  assert.equal(shareOf(state(), 1), 0);
  assert.equal(shareOf(state({ end: 1000 }), 1000), 0);
  assert.equal(within(state(), 5000), 2000);
  assert.deepEqual([span(0), span(65.9), span(3661), span(-3)], ['0:00', '1:05', '1:01:01', '0:00']);
  assert.equal(nextSpeed(4, 1), 8);
  assert.equal(nextSpeed(4, -1), 2);
  assert.equal(nextSpeed(3, 1), 4);
  assert.equal(nextSpeed(SPEEDS.at(-1), 1), SPEEDS.at(-1));
  assert.equal(nextSpeed(0.1, -1), 0.1);
  assert.equal(date(1_795_778_400), '2026-11-27');
  assert.equal(date(null), '----------');
});

test('alerts that were met stay on the line, once each, with their worst stage', () => {
  const met = new MetAlerts();
  met.take([alert(1, { stage: 'information' }), alert(2, { raised_at: 5000 }), alert(3, { raised_at: null })]);
  met.take([alert(9)]); // the same alert, met again after a seek under another number
  assert.deepEqual(met.of(state()).map(({ time, kind }) => [time, kind]), [[1500, 'gap'], [1200, 'alarm']]);
});

test('a paused replay is not late, however long; and has its time when it goes on', () => {
  assert.equal(healthOf(90_000, 89_500, 1000, 1, 0, 0, 2000), 'ok');
  assert.equal(healthOf(90_000, 1000, 1000, 1, 0, 0, 2000), 'lost');
  assert.equal(healthOf(90_000, 89_500, 1000, 1, 0, 1, 88_000), 'ok');
  assert.equal(healthOf(90_000, 89_500, 1000, 1, 0, 1, 80_000), 'late');
  assert.equal(healthOf(90_000, 89_500, 85_000, 1, 0, 0.5, 0), 'ok');
  assert.equal(healthOf(90_000, 89_500, 83_000, 1, 0, 0.5, 0), 'late');
  assert.equal(healthOf(90_000, 89_500, 86_000, 1, 0, 16, 0), 'late');
});

test('a new epoch of a replay forgets everything of before', () => {
  const picture = new PictureState();
  picture.apply({ type: 'welcome', epoch: 'a', seq: 1, mode: 'replay' }, 0);
  picture.apply(snapshot('a', [track(1), track(2)]), 0);
  picture.apply({ type: 'alert', epoch: 'a', seq: 11, mode: 'replay', op: 'raise', alert: alert(1) }, 0);
  picture.apply({ type: 'alert', epoch: 'a', seq: 12, mode: 'replay', op: 'clear', alert: alert(2) }, 0);
  assert.equal(picture.cleared.length, 1);
  picture.apply(snapshot('b', [track(2, { east_m: 90 })], { time: 20 }), 1000);
  assert.deepEqual([...picture.targets.keys()], [2]);
  assert.equal(picture.leaving.size, 0);
  assert.equal(positionAt(picture.targets.get(2), 1000, 1)[0], 90, 'it stands where it was then, it does not glide there');
  assert.equal(picture.alerts.size, 0);
  assert.equal(picture.cleared.length, 0);
  picture.apply({ type: 'snapshot', topic: 'alerts', epoch: 'b', seq: 10, mode: 'replay', alerts: [alert(7)] }, 1000);
  assert.deepEqual([...picture.alerts.keys()], [7]);
  assert.equal(picture.cleared.length, 0);
});

test('a new epoch of a live service keeps what was cleared', () => {
  const picture = new PictureState();
  picture.apply({ ...snapshot('a', [track(1)]), mode: 'live' }, 0);
  picture.apply({ type: 'alert', epoch: 'a', seq: 12, mode: 'live', op: 'clear', alert: alert(2) }, 0);
  picture.apply({ ...snapshot('b', [track(1)]), mode: 'live' }, 0);
  assert.equal(picture.cleared.length, 1);
});

test('targets move at the pace of the replay and stand still while it is paused, without a jump', () => {
  const target = newTarget(track(1), 100, 0);
  assert.equal(positionAt(target, 500, 4)[0], 20);
  assert.equal(positionAt(target, 60_000, 4)[0], 10 * 4 * MAX_EXTRAPOLATION_S);
  repace(target, 500, 4, 0);
  assert.ok(Math.abs(positionAt(target, 500, 0)[0] - 20) < 1e-9);
  assert.ok(Math.abs(positionAt(target, 90_000, 0)[0] - 20) < 1e-9);
  repace(target, 90_000, 0, 1);
  assert.ok(Math.abs(positionAt(target, 90_100, 1)[0] - 21) < 1e-9);
  const fast = newTarget(track(1), 100, 0);
  repace(fast, 2000, 4, 0);
  assert.ok(Math.abs(positionAt(fast, 2000, 0)[0] - 80) < 1e-9);
  moveTarget(fast, track(1, { time: 108, east_m: 80 }), 108, 2100, 0);
  assert.ok(Math.abs(positionAt(fast, 9000, 0)[0] - 80) < 1e-6);
});

test('the pace of the picture takes hold of all targets', () => {
  const picture = new PictureState();
  picture.apply(snapshot('a', [track(1)]), 0);
  picture.setPace(0, 500);
  assert.equal(picture.paceMs, 500);
  const [e] = positionAt(picture.targets.get(1), 5000, picture.pace);
  assert.ok(Math.abs(e - 5) < 1e-9);
});

test('the keys of a replay act only in one, and space leaves buttons alone', () => {
  globalThis.HTMLElement ??= class {};
  const calls = [];
  let replaying = true;
  const act = new Proxy({}, { get: (_t, name) => (...args) => { calls.push([name, ...args]); return replaying; } });
  const press = (key, target = null) => onKey({ key, target }, act);
  for (const key of [' ', ',', '.', '[', ']']) assert.equal(press(key), true, key);
  assert.deepEqual(calls, [['play'], ['skip', -10], ['skip', 10], ['speed', -1], ['speed', 1]]);
  const button = Object.assign(new globalThis.HTMLElement(), { matches: (words) => words.split(', ').includes('button') });
  assert.equal(press(' ', button), false);
  assert.equal(calls.length, 5);
  replaying = false;
  assert.equal(press(' '), false);
});
