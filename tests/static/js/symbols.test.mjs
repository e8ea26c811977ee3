import assert from 'node:assert/strict';
import { test } from 'node:test';

import { drawSymbol } from '../../../static/js/draw/symbols.js';
import { drawTargets } from '../../../static/js/draw/targets.js';

/** A pen that remembers where it went, and what it did. */
function pen() {
  const points = [];
  const arcs = [];
  const ellipses = [];
  const done = [];
  const go = (x, y) => points.push([x, y]);
  const plain = Object.fromEntries(['beginPath', 'closePath', 'setLineDash', 'rect', 'fillRect'].map((name) => [name, () => {}]));
  return {
    points, arcs, ellipses, done, ...plain, globalAlpha: 1, moveTo: go, lineTo: go, arc: (...a) => arcs.push(a), ellipse: (...a) => ellipses.push(a),
    fill: () => done.push('fill'), stroke: () => done.push('stroke'),
  };
}

const look = { kind: 'aircraft', heading: 0, axis: null, length: 40, width: 30, hollow: false, ink: 'blue', halo: 'black' };

/** @returns {[number, number]} extent on the screen, px */
function extent(scale, more, rotation = 0) {
  const made = pen();
  drawSymbol(made, 0, 0, scale, rotation, { ...look, ...more });
  const of = (i) => Math.max(...made.points.map((p) => p[i])) - Math.min(...made.points.map((p) => p[i]));
  return [of(0), of(1), made.done];
}

const near = (found, wanted) => wanted.forEach((one, i) => assert.ok(Math.abs(found[i] - one) < 1e-6, `${found} is not ${wanted}`));

test('zoomed in, targets of every class have their true length, width and heading', () => {
  near(extent(4, {}), [120, 160]);
  near(extent(4, { heading: Math.PI / 2 }), [160, 120]);
  near(extent(4, { heading: Math.PI / 2 }, Math.PI / 2), [120, 160]);
  near(extent(10, { kind: 'vehicle', length: 6, width: 2.5 }), [25, 60]);
  near(extent(4, { kind: 'unknown', length: 20, width: 8 }), [32, 80]);
  near(extent(4, { kind: 'unknown', length: 20, width: 8, heading: Math.PI / 2 }), [80, 32]);
});

test('without a heading the extent is a circle of the length, and an outline alone: the video below it stays visible', () => {
  for (const kind of ['aircraft', 'unknown']) {
    const [w, h, done] = extent(4, { kind, heading: null });
    near([w, h], [160, 160]);
    assert.deepEqual(done, ['stroke']);
  }
});

test('without a heading what is known to be long lies along its axis, with the same shape at both ends', () => {
  const rest = { heading: null, axis: Math.PI / 2 };
  near(extent(4, rest), [160, 120]);
  near(extent(4, { ...rest, kind: 'unknown', length: 20, width: 8 }), [80, 32]);
  near(extent(10, { ...rest, kind: 'vehicle', length: 6, width: 2.5 }), [60, 25]);
  const [w, h, done] = extent(0.05, rest);
  near([w, h], [15, 7.5]);
  assert.deepEqual(done, ['stroke', 'fill']);
  const made = pen();
  drawSymbol(made, 0, 0, 0.05, 0, { ...look, ...rest });
  for (const [x, y] of made.points) assert.ok(made.points.some(([a, b]) => Math.hypot(a + x, b - y) < 1e-9));
});

test('zoomed out, symbols keep a size at which they can be told apart', () => {
  for (const kind of ['aircraft', 'vehicle', 'unknown']) {
    const [w, h] = extent(0.05, { kind, length: 6, width: 3, heading: null });
    assert.ok(w >= 8 && h >= 8 && w < 25 && h < 25, kind);
  }
});

test('the accuracy of the selected target is an ellipse at the scale of the map, of others it is not shown', () => {
  const track = { id: 1, class: 'aircraft', speed_mps: 0, accuracy_m: 12, accuracy_minor_m: 5, accuracy_bearing_deg: 120, length_m: 40, width_m: 30 };
  const target = { track, x: 50, y: 50, e: 0, n: 0, heading: null, headingOffset: 0, baseMs: 0, ve: 0, vn: 0, history: [], goneMs: 0, coastingSince: NaN };
  const scene = {
    picture: { targets: new Map([[1, target]]), leaving: new Map(), time: 0, pace: 1 }, view: { scale: 2, rotation: 0, width: 100, height: 100 },
    theme: { ink: {} }, choices: { history: 0, vector: 0 }, selected: 1, hovered: null, alerted: new Map(), unacknowledged: new Set(),
  };
  const ellipses = (more) => {
    const made = pen();
    drawTargets(made, { ...scene, ...more }, 0);
    return made.ellipses.map((one) => one.slice(0, 5));
  };
  const [[x, y, long, short, turn]] = ellipses({});
  near([x, y, long, short, turn], [50, 50, 24, 10, Math.PI / 6]);
  near([ellipses({ view: { ...scene.view, rotation: 1 } })[0][4]], [Math.PI / 6 - 1]);
  assert.deepEqual(ellipses({ selected: null }), []);
});
