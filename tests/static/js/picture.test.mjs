import assert from 'node:assert/strict';
import { test } from 'node:test';

import { PictureState } from '../../../static/js/feed/picture.js';
import { FADE_MS, MAX_EXTRAPOLATION_S, moveTarget, newTarget, positionAt, headingAt, wrapAngle } from '../../../static/js/model/motion.js';

const track = (id, more = {}) => ({
  id, time: 100, lat: null, lon: null, east_m: 10 * id, north_m: 0, speed_mps: 10, course_deg: 90, heading_deg: 90, length_m: 38,
  width_m: 34, class: 'aircraft', callsign: `AFR${id}`, address: null, phase: 'confirmed', zone: null, runway: null,
  sources: ['radar'], accuracy_m: 3, simulated: true, ...more,
});
const snapshot = (tracks, more = {}) => ({ type: 'snapshot', topic: 'tracks', epoch: 'e1', seq: 10, time: 100, mode: 'demo', tracks, ...more });

function started() {
  const picture = new PictureState();
  picture.apply({ type: 'welcome', epoch: 'e1', seq: 10, airport: 'LFPO', mode: 'demo' }, 0);
  picture.apply(snapshot([track(1), track(2)]), 0);
  return picture;
}

test('a snapshot replaces everything, a delta changes some of it', () => {
  const picture = started();
  const outcome = picture.apply({
    type: 'delta', topic: 'tracks', seq: 11, prev: 10, time: 101, upd: [{ id: 1, east_m: 20, speed_mps: null }], add: [track(3)], del: [{ id: 2, reason: 'ended' }],
  }, 1000);
  assert.equal(outcome, 'applied');
  assert.deepEqual([...picture.targets.keys()].sort(), [1, 3]);
  assert.equal(picture.targets.get(1).track.east_m, 20);
  assert.equal(picture.targets.get(1).track.callsign, 'AFR1');
  assert.deepEqual(picture.position(), { epoch: 'e1', seq: 11 });
  picture.apply(snapshot([track(7)], { seq: 20 }), 2000);
  assert.deepEqual([...picture.targets.keys()], [7]);
});

test('a number that is deleted and added in one message is the new target', () => {
  const picture = started();
  picture.apply({ type: 'delta', seq: 11, prev: 10, time: 101, upd: [], add: [track(2, { callsign: 'NEW' })], del: [{ id: 2, reason: 'ended' }] }, 0);
  assert.equal(picture.targets.get(2).track.callsign, 'NEW');
});

test('a gap is noticed and nothing is shown on top of it', () => {
  const picture = started();
  assert.equal(picture.apply({ type: 'delta', seq: 14, prev: 13, time: 104, upd: [{ id: 1, east_m: 999 }] }, 0), 'gap');
  assert.equal(picture.targets.get(1).track.east_m, 10);
  assert.equal(picture.position(), null);
  assert.equal(picture.counters.gaps, 1);
});

test('alerts and status run ahead of the tracks and do not move the place to resume from', () => {
  const picture = started();
  picture.apply({ type: 'alert', seq: 15, op: 'raise', alert: { id: 1, stage: 'alarm', state: 'new', targets: [] } }, 0);
  picture.apply({ type: 'status', seq: 15, sensors: [], runways: [] }, 0);
  assert.deepEqual(picture.position(), { epoch: 'e1', seq: 10 });
  assert.equal(picture.apply({ type: 'delta', seq: 16, prev: 10, time: 101, upd: [] }, 0), 'applied');
});

test('a new epoch needs a new snapshot', () => {
  const picture = started();
  picture.apply({ type: 'welcome', epoch: 'e2', seq: 0 }, 0);
  assert.equal(picture.position(), null);
  assert.equal(picture.apply({ type: 'delta', seq: 1, prev: 0, upd: [] }, 0), 'ignored');
});

test('what cannot be understood is counted and changes nothing', () => {
  const picture = started();
  for (const message of [{ type: 'weather' }, { type: 'snapshot', topic: 'moon' }, { type: 'delta', topic: 'moon' }]) assert.equal(picture.apply(message, 0), 'ignored');
  assert.equal(picture.counters.unknown, 3);
  picture.apply({ type: 'snapshot', topic: 'tracks', tracks: 'none' }, 0);
  picture.apply({ type: 'alert', op: 'raise' }, 0);
  assert.equal(picture.counters.bad, 2);
  assert.equal(picture.targets.size, 2);
  picture.apply({ type: 'delta', seq: 11, prev: 10, upd: [{ id: 99 }, null], add: [{ id: 5, east_m: null, north_m: 2 }], del: [null, { id: 77 }] }, 0);
  assert.equal(picture.counters.bad, 5);
  assert.equal(picture.targets.size, 2);
});

test('alerts: alarms first, cleared ones to the history, a snapshot clears what it does not name', () => {
  const picture = started();
  const alert = (id, stage, more = {}) => ({ id, stage, state: 'new', rule: 'x', text: '', raised_at: 100 + id, targets: [{ track: 1 }], runway: '06/24', ...more });
  picture.apply({ type: 'alert', op: 'raise', seq: 11, alert: alert(1, 'information') }, 0);
  picture.apply({ type: 'alert', op: 'raise', seq: 11, alert: alert(2, 'alarm') }, 0);
  assert.deepEqual(picture.liveAlerts().map((one) => one.id), [2, 1]);
  assert.equal(picture.alertedTargets().get(1), 'alarm');
  picture.apply({ type: 'alert', op: 'clear', seq: 12, alert: alert(2, 'alarm', { state: 'cleared' }) }, 0);
  assert.deepEqual(picture.cleared.map((one) => one.id), [2]);
  picture.apply({ type: 'snapshot', topic: 'alerts', seq: 12, alerts: [] }, 0);
  assert.equal(picture.alerts.size, 0);
  assert.deepEqual(picture.cleared.map((one) => one.id).sort(), [1, 2]);
});

test('an update moves nothing at once, and the correction fades', () => {
  const target = newTarget(track(1, { speed_mps: 10, course_deg: 90 }), 100, 0);
  const before = positionAt(target, 1000);
  assert.ok(Math.abs(before[0] - 20) < 1e-9);
  moveTarget(target, track(1, { time: 101, east_m: 23, north_m: 4 }), 101, 1000);
  positionAt(target, 1000).forEach((value, i) => assert.ok(Math.abs(value - before[i]) < 1e-9));
  const later = positionAt(target, 1000 + 10 * FADE_MS);
  assert.ok(Math.abs(later[1] - 4) < 0.01);
});

test('a target is not carried on for ever, and a standing one not at all', () => {
  const target = newTarget(track(1), 100, 0);
  assert.ok(Math.abs(positionAt(target, 60_000)[0] - (10 + 10 * MAX_EXTRAPOLATION_S)) < 1e-6);
  const standing = newTarget(track(1, { speed_mps: 0.2, course_deg: null }), 100, 0);
  assert.deepEqual(positionAt(standing, 2000), [10, 0]);
  const unknown = newTarget(track(1, { speed_mps: null, course_deg: null, heading_deg: null }), 100, 0);
  assert.deepEqual(positionAt(unknown, 2000), [10, 0]);
  assert.equal(headingAt(unknown, 0), null);
});

test('a far jump is another place: no gliding across the airport', () => {
  const target = newTarget(track(1), 100, 0);
  moveTarget(target, track(1, { time: 101, east_m: 3000 }), 101, 1000);
  assert.equal(positionAt(target, 1000)[0], 3000);
  assert.equal(target.history.length, 1);
});

test('headings turn the short way through north', () => {
  const target = newTarget(track(1, { heading_deg: 350 }), 100, 0);
  moveTarget(target, track(1, { time: 101, heading_deg: 10 }), 101, 1000);
  const halfway = wrapAngle(headingAt(target, 1000 + FADE_MS * Math.LN2));
  assert.ok(Math.abs(halfway) < 1e-9, `${halfway}`);
});

test('the history is bounded and ends when time steps back', () => {
  const target = newTarget(track(1), 100, 0);
  for (let k = 1; k < 200; k += 1) moveTarget(target, track(1, { time: 100 + k, east_m: 10 * k }), 100 + k, 1000 * k);
  assert.equal(target.history.length, 31);
  moveTarget(target, track(1, { time: 50 }), 50, 300_000);
  assert.equal(target.history.length, 1);
});
