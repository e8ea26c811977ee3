import assert from 'node:assert/strict';
import { test } from 'node:test';

import { angle, bearing, clock, compact, countdown, distance, duration, knots, number } from '../../../static/js/model/format.js';
import { labelText, nameOf, numberOf } from '../../../static/js/model/label_text.js';
import { LabelLayer } from '../../../static/js/draw/labels.js';
import { HOLD_REACH_M, distanceToLine } from '../../../static/js/model/holds.js';
import { SLOTS, placeLabels, slotOffset } from '../../../static/js/model/placement.js';
import { roundLength } from '../../../static/js/draw/overlay.js';

const screen = { width: 1000, height: 800 };
const request = (id, x, y, more = {}) => ({ id, x, y, radius: 8, w: 60, h: 30, slot: -1, must: false, pinned: null, ...more });
const symbolsOf = (requests) => requests.map(({ id, x, y, radius }) => ({ id, x, y, radius }));
const boxOf = (one, requests) => {
  const { x, y, w, h } = requests.find((r) => r.id === one.id);
  return [x + one.dx, y + one.dy, x + one.dx + w, y + one.dy + h];
};
const overlap = (a, b) => Math.max(0, Math.min(a[2], b[2]) - Math.max(a[0], b[0])) * Math.max(0, Math.min(a[3], b[3]) - Math.max(a[1], b[1]));

function random(seed) {
  let state = seed;
  return () => {
    state = (state * 1664525 + 1013904223) % 4294967296;
    return state / 4294967296;
  };
}

test('a label never lies over its own symbol, in any place', () => {
  for (let slot = 0; slot < SLOTS; slot += 1) {
    const [dx, dy] = slotOffset(slot, 8, 60, 30);
    assert.equal(overlap([dx, dy, dx + 60, dy + 30], [-8, -8, 8, 8]), 0, `slot ${slot}`);
  }
});

test('labels that fit do not overlap one another nor a symbol', () => {
  const next = random(7);
  for (let round = 0; round < 20; round += 1) {
    const requests = Array.from({ length: 60 }, (_, i) => request(i + 1, 50 + 900 * next(), 50 + 700 * next()));
    const placed = placeLabels(requests, symbolsOf(requests), screen).filter((one) => one.visible);
    assert.ok(placed.length > 40);
    const boxes = placed.map((one) => boxOf(one, requests));
    // those that found no free place may cover a little, never much
    for (let i = 0; i < boxes.length; i += 1) {
      for (let j = 0; j < i; j += 1) assert.ok(overlap(boxes[i], boxes[j]) <= 0.12 * 60 * 30);
    }
  }
});

test('a place is kept while it is free, and left when it is taken by someone more important', () => {
  const alone = [request(1, 500, 400, { slot: 5 })];
  assert.equal(placeLabels(alone, symbolsOf(alone), screen)[0].slot, 5);
  const [dx, dy] = slotOffset(0, 8, 60, 30);
  const pair = [request(2, 500 + 2 * 30, 400 - 20, { slot: 0, must: true }), request(1, 500 + 60, 400 - 22, { slot: 0 })];
  const [first, second] = placeLabels(pair, symbolsOf(pair), screen);
  assert.equal(first.slot, 0);
  assert.notEqual(second.slot, 0);
  assert.ok(dx > 0 && dy < 0);
});

test('at the edge labels turn inwards', () => {
  const requests = [request(1, 995, 5), request(2, 4, 790)];
  for (const one of placeLabels(requests, symbolsOf(requests), screen)) {
    const [x0, y0, x1, y1] = boxOf(one, requests);
    assert.ok(x0 >= 0 && y0 >= 0 && x1 <= 1000 && y1 <= 800);
  }
});

test('in a crowd the important are shown, the others give way; a pinned label stays', () => {
  const requests = Array.from({ length: 80 }, (_, i) => request(i + 1, 500 + (i % 9), 400 + (i % 7), { must: i < 3 }));
  requests[79].pinned = { dx: 123, dy: 45 };
  const placed = placeLabels(requests, symbolsOf(requests), screen);
  assert.ok(placed.slice(0, 3).every((one) => one.visible));
  assert.ok(placed.slice(3, 79).some((one) => !one.visible));
  assert.deepEqual([placed[79].dx, placed[79].dy, placed[79].visible], [123, 45, true]);
});

const bare = { id: 17, time: 0, east_m: 0, north_m: 0, speed_mps: null, course_deg: null, heading_deg: null, class: null, callsign: null, phase: null, zone: null, runway: null, simulated: null };

test('label texts: names, null-safe, coasting age, simulated mark', () => {
  assert.deepEqual(labelText(bare, 'full', 0), { first: '#17', second: '', mark: '' });
  const full = labelText({ ...bare, callsign: 'AFR12QK', speed_mps: 10, runway: '06/24', simulated: true }, 'full', 0);
  assert.deepEqual(full, { first: 'AFR12QK', second: '19 kt  RWY 06/24', mark: 'SIM' });
  const coasting = labelText({ ...bare, phase: 'coasting', speed_mps: 10 }, 'full', 4.2);
  assert.equal(coasting.second, 'COAST 4 s  19 kt');
  const missedOnce = labelText({ ...bare, phase: 'coasting', speed_mps: 10 }, 'full', 1.4);
  assert.equal(missedOnce.second, '19 kt');
  assert.equal(labelText({ ...bare, phase: 'coasting' }, 'short', 0).second, '');
  assert.equal(labelText({ ...bare, phase: 'tentative' }, 'short', 0).first, '#17?');
  assert.equal(labelText({ ...bare, zone: 'way/123456' }, 'full', 0).second, '');
});

test('a track is called by its ASTERIX number, and by its id where it has none', () => {
  assert.equal(numberOf({ ...bare, id: 2 ** 40, number: 17 }), '#17');
  assert.equal(numberOf({ ...bare, id: 2 ** 40, number: null }), '#1099511627776');
  assert.equal(nameOf({ ...bare, id: 5000, number: 17 }), '#17');
  assert.equal(nameOf({ ...bare, id: 5000, number: 17, callsign: 'AFR1' }), 'AFR1');
});

test('numbers as text', () => {
  assert.equal(bearing(359.7), '360°');
  assert.equal(bearing(null), '–');
  assert.equal(bearing(-10), '350°');
  assert.equal(clock(3661), '01:01:01');
  assert.equal(clock(Number.NaN), '--:--:--');
  assert.equal(clock(1e300), '--:--:--');
  assert.equal(duration(59.4), '59 s');
  assert.equal(duration(185), '3:05');
  assert.equal(duration(3600), '1 h 00');
  assert.equal(countdown(-3), '0:00');
  assert.equal(distance(999), '999 m');
  assert.match(distance(1852), /1\.85 km · 1\.00 NM/);
  assert.equal(compact(1234567), '1.2M');
  assert.equal(angle(-33.5, 'lat'), '33°30′00″S');
  assert.equal(angle(2.999999, 'lon'), '003°00′00″E');
  assert.equal(number(undefined, 1, 'kt'), '–');
  assert.ok(Math.abs(knots(10) - 19.438) < 0.001);
});

test('the scale bar is a round length that fits', () => {
  for (const scale of [0.013, 0.1, 0.2345, 1, 7.7, 19]) {
    const metres = roundLength(150, scale);
    assert.ok(metres * scale <= 150 && metres * scale > 59, `${metres} at ${scale}`);
    assert.match(String(metres), /^(0\.)?0*[125]0*$/);
  }
});

test('no label is cut at an edge, however crowded it is there', () => {
  const next = random(3);
  for (let round = 0; round < 20; round += 1) {
    const requests = Array.from({ length: 40 }, (_, i) => request(i + 1, 940 + 60 * next(), 200 + 60 * next(), { must: true, w: 60 + 60 * next() }));
    for (const one of placeLabels(requests, symbolsOf(requests), screen)) {
      const [x0, y0, x1, y1] = boxOf(one, requests);
      assert.ok(x0 >= 0 && y0 >= 0 && x1 <= 1000.001 && y1 <= 800.001, `${x0} ${x1}`);
    }
  }
});

const hold = { rings: [[[100, 0], [100, 40]]] };
const scene = { alerted: new Map(), occupants: new Set([8]), holds: [hold], selected: null, hovered: null };
const standing = (id, east_m, more = {}) => ({ track: { ...bare, id, east_m, north_m: 20, speed_mps: 0, ...more }, label: { pinned: null } });

test('what stands at a holding position, on a runway or in an alert is labelled at every scale', () => {
  const layer = new LabelLayer();
  const level = (target, with_ = scene) => layer.level('full', target, layer.priority(with_, target), 0.01, true);
  assert.equal(level(standing(1, 100 - HOLD_REACH_M + 1)), 'full');
  assert.equal(level(standing(2, 100 - HOLD_REACH_M - 1)), 'off', 'others that stand keep their names to themselves');
  assert.equal(level(standing(3, 5000, { runway: '06/24' })), 'full');
  assert.equal(level(standing(8, 5000)), 'full', 'in the protection area of a runway');
  assert.equal(level(standing(4, 5000), { ...scene, alerted: new Map([[4, 'information']]) }), 'full');
  assert.equal(layer.level('off', standing(1, 100), 60, 1, false), 'off', 'labels off are off');
});

test('the distance to a holding bar is to the line, not to its middle or its ends', () => {
  assert.equal(distanceToLine(hold.rings[0], 110, 10), 10);
  assert.equal(distanceToLine(hold.rings[0], 100, 70), 30);
  assert.equal(distanceToLine([[3, 4]], 0, 0), 5);
});
