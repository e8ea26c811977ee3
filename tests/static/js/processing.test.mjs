import assert from 'node:assert/strict';
import { test } from 'node:test';

import { cutWords, learningWords, orderOf } from '../../../static/js/panels/processing.js';

const hybrid = { name: 'hybrid', pfa: 1e-6 };
const adaptive = { name: 'adaptive', pfa: 1e-6 };
const manhattan = { name: 'manhattan', min_cells: 1 };
const state = (changes = {}) => ({
  radar: 'smr-1', running: { detect: adaptive, extract: manhattan }, next: null, scans_left: null, plots_a_scan: 100, ms_a_turn: {}, cut: {},
  available: {}, ...changes,
});

test('only what differs from what runs is asked for', () => {
  assert.deepEqual(orderOf(state(), new Map()), {});
  assert.deepEqual(orderOf(state(), new Map([['detect', 'adaptive'], ['extract', 'manhattan']])), {});
  assert.deepEqual(orderOf(state(), new Map([['detect', 'hybrid'], ['extract', 'manhattan']])), { detect: { name: 'hybrid' } });
  assert.deepEqual(orderOf(state(), new Map([['unheard', 'of']])), {});
});

test('while something learns, to go back is a change', () => {
  const learning = state({ next: { detect: hybrid, extract: manhattan }, scans_left: 3 });
  assert.deepEqual(orderOf(learning, new Map([['detect', 'hybrid']])), {});
  assert.deepEqual(orderOf(learning, new Map([['detect', 'adaptive']])), { detect: { name: 'adaptive' } });
});

test('learning is told with what changes and how long it takes', () => {
  assert.equal(learningWords(state()), '');
  assert.equal(learningWords(state({ next: { detect: hybrid, extract: manhattan }, scans_left: 1 })), 'hybrid takes over in 1 turn');
  const both = { detect: hybrid, extract: { name: 'manhattan', min_cells: 2 } };
  assert.equal(learningWords(state({ next: both, scans_left: 12 })), 'hybrid and manhattan take over in 12 turns');
});

test('cuts are told by what was cut', () => {
  assert.equal(cutWords(state()), '');
  assert.equal(cutWords(state({ cut: { degraded_sweeps: 312, runs_dropped: 5 } })), '312 sweeps cut · 5 runs left out');
});
