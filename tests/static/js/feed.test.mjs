import assert from 'node:assert/strict';
import { test, mock } from 'node:test';

import { LiveFeed } from '../../../static/js/feed/live.js';
import { onKey } from '../../../static/js/input/keys.js';
import { matches } from '../../../static/js/panels/list.js';
import { drops, resetOf } from '../../../static/js/panels/sensors.js';
import { bannerText, healthOf } from '../../../static/js/panels/status.js';
import { DEFAULTS, Settings, next, sane, viewFromQuery, viewToQuery, VECTORS } from '../../../static/js/settings.js';

class Socket {
  constructor() {
    this.readyState = 0;
    this.sent = [];
  }

  open() {
    this.readyState = 1;
    this.onopen();
  }

  send(text) { this.sent.push(JSON.parse(text)); }

  say(message) { this.onmessage({ data: typeof message === 'string' ? message : JSON.stringify(message) }); }

  close() { this.closed = true; }

  die(code = 1006) { this.onclose({ code }); }
}

function feed(position = () => null) {
  const sockets = [];
  const messages = [];
  const states = [];
  const made = new LiveFeed({
    url: 'ws://x/api/v1/live', position, random: () => 0.5, onMessage: (m) => messages.push(m), onState: (s) => states.push(s),
    open: (_url, protocol) => {
      assert.equal(protocol, 'airside.v1.json');
      sockets.push(new Socket());
      return sockets.at(-1);
    },
  });
  return { made, sockets, messages, states };
}

test('greets, subscribes after the welcome, passes messages on, counts what is not JSON', () => {
  const { made, sockets, messages, states } = feed();
  made.start();
  sockets[0].open();
  assert.deepEqual(sockets[0].sent, [{ type: 'hello' }]);
  sockets[0].say({ type: 'welcome', epoch: 'e', seq: 1, period_s: 0.25 });
  assert.equal(sockets[0].sent[1].type, 'subscribe');
  assert.deepEqual(sockets[0].sent[1].topics, ['tracks', 'alerts', 'status']);
  sockets[0].say({ type: 'heartbeat', seq: 1 });
  for (const bad of ['{', '3', 'null']) sockets[0].say(bad);
  assert.equal(made.counters.unreadable, 3);
  assert.deepEqual(messages.map((m) => m.type), ['welcome', 'heartbeat']);
  assert.equal(states.at(-1), 'live');
  assert.equal(made.periodS, 0.25);
  made.stop();
});

test('comes back with growing pauses, tells where it stood, and waits long when told to', () => {
  mock.timers.enable({ apis: ['setTimeout'] });
  try {
    const { made, sockets } = feed(() => ({ epoch: 'e', seq: 42 }));
    made.start();
    const waits = [500, 1000, 2000, 4000, 8000, 8000];
    waits.forEach((wait, i) => {
      sockets.at(-1).die();
      mock.timers.tick(wait - 1);
      assert.equal(sockets.length, i + 1);
      mock.timers.tick(1);
      assert.equal(sockets.length, i + 2);
    });
    sockets.at(-1).open();
    assert.deepEqual(sockets.at(-1).sent, [{ type: 'hello', resume: { epoch: 'e', seq: 42 } }]);
    sockets.at(-1).say({ type: 'welcome', epoch: 'e', seq: 50 });
    const count = sockets.length;
    sockets.at(-1).die(1013);
    mock.timers.tick(7999);
    assert.equal(sockets.length, count);
    mock.timers.tick(1);
    assert.equal(sockets.length, count + 1);
    made.stop();
    mock.timers.tick(60_000);
    assert.equal(sockets.length, count + 1);
  } finally {
    mock.timers.reset();
  }
});

test('an open but silent connection is given up', () => {
  mock.timers.enable({ apis: ['setTimeout'] });
  try {
    const { made, sockets } = feed();
    made.start();
    sockets[0].open();
    made.watch(performance.now() + 3000);
    assert.equal(sockets.length, 1);
    made.watch(performance.now() + 6000);
    assert.ok(sockets[0].closed);
    mock.timers.tick(0);
    assert.equal(sockets.length, 2);
    made.stop();
  } finally {
    mock.timers.reset();
  }
});

test('health: lost without messages, late without tracks, starting at first', () => {
  assert.equal(healthOf(1000, -Infinity, -Infinity, 1, 0), 'starting');
  assert.equal(healthOf(9000, -Infinity, -Infinity, 1, 0), 'lost');
  assert.equal(healthOf(9000, 8500, -Infinity, 1, 0), 'late');
  assert.equal(healthOf(9000, 8500, 8400, 1, 0), 'ok');
  assert.equal(healthOf(9000, 6900, 6900, 0.25, 0), 'lost');
  assert.equal(healthOf(9000, 7100, 7100, 0.25, 0), 'ok');
  assert.equal(healthOf(9000, 8900, 5000, 1, 0), 'late');
  assert.equal(healthOf(9000, 4900, 4900, 2, 0), 'lost');
});

test('settings survive anything that lies in the store or the address', () => {
  assert.deepEqual(sane({}), { ...DEFAULTS });
  assert.deepEqual(sane({ vector: 7, history: 'x', labels: 'loud', palette: '__proto__', radarOpacity: 4 }), { ...DEFAULTS });
  const broken = new Settings({ getItem: () => '{', setItem: () => { throw new Error('full'); } }, new URLSearchParams('palette=day&vector=60'));
  assert.equal(broken.choices.palette, 'day');
  assert.equal(broken.choices.vector, 60);
  let heard = 0;
  broken.watch(() => { heard += 1; });
  broken.set({ labels: 'off' });
  assert.equal(heard, 2);
  assert.equal(broken.choices.labels, 'off');
  assert.equal(next(VECTORS, 60), 0);
});

test('the view goes into the address and back', () => {
  const query = viewToQuery({ east: 120.4, north: -3, scale: 0.25, rotation: Math.PI / 2 }, new URLSearchParams('palette=day'));
  assert.equal(query.get('palette'), 'day');
  const back = viewFromQuery(query);
  assert.deepEqual([back.east, back.north, back.scale], [120, -3, 0.25]);
  assert.ok(Math.abs(back.rotation - Math.PI / 2) < 1e-9);
  for (const bad of ['', 'e=1&n=2', 'e=1&n=2&z=-1', 'e=x&n=2&z=1']) assert.equal(viewFromQuery(new URLSearchParams(bad)), null);
});

test('keys act, but not with Ctrl', () => {
  globalThis.HTMLElement ??= class {};
  const calls = [];
  const act = new Proxy({}, { get: (_t, name) => (...args) => calls.push([name, ...args]) });
  const press = (key, more = {}) => onKey({ key, target: null, ...more }, act);
  for (const key of ['ArrowLeft', '+', '-', 'q', 'N', '/', '?', 'Escape', 'a']) assert.equal(press(key), true, key);
  assert.deepEqual(calls.map(([name]) => name), ['pan', 'zoom', 'zoom', 'rotate', 'northUp', 'search', 'help', 'escape', 'acknowledge']);
  assert.equal(press('r', { ctrlKey: true }), false);
  assert.equal(press('Tab'), false);
});

test('the list finds targets by any word', () => {
  const track = { id: 12, callsign: 'AFR45', address: '39abcd', class: 'aircraft', runway: '06/24', zone: null, speed_mps: 5, phase: 'confirmed' };
  assert.ok(matches(track, '', ''));
  assert.ok(matches(track, '24 afr', 'aircraft'));
  assert.ok(matches(track, '#12', 'moving'));
  assert.ok(!matches(track, 'afr', 'vehicle'));
  assert.ok(!matches(track, 'baw', ''));
});

test('of a sensor only what means loss or trouble is shown unasked', () => {
  const counters = {
    octets: 7, cells_detected: 5, confirmed: 2, absorbed: 9, plots: 4, sectors_sent: 3, lost: 1, late: 0, wrong_cell_count: 2,
    queue_dropped_blocks: 3, missing_sweeps: 4, no_time: 5, plots_below_min_cells: 6, node_events: 8, deliver_failed: 1, identified: 2,
  };
  const sensor = { id: 'a', kind: 'radar', status: 'ok', last: 0, simulated: false, detail: '', counters };
  assert.deepEqual(drops(sensor).map(([name]) => name), ['lost', 'wrong_cell_count', 'queue_dropped_blocks', 'missing_sweeps', 'no_time', 'deliver_failed']);
  assert.deepEqual(drops({ ...sensor, counters: { lost: Number.NaN } }), []);
});

test('a connection that ends before it is open may have been refused, and the banner says why', () => {
  let refused = 0;
  const { made, sockets } = feed();
  made.options.onRefused = () => { refused += 1; };
  made.start();
  sockets[0].die();
  assert.equal(refused, 1);
  made.restart();
  clearTimeout(made.timer);
  made.connect();
  sockets.at(-1).open();
  sockets.at(-1).die();
  assert.equal(refused, 1, 'a connection that was open was let in');
  made.stop();
  assert.match(bannerText('lost', NaN, 'waiting', 'the page comes from elsewhere'), /^NO FEED .*refused: the page comes from elsewhere/);
  assert.match(bannerText('lost', NaN, 'waiting'), /reconnecting/);
});

test('what a restart took away is told in the top bar, and only that', () => {
  assert.equal(resetOf({ id: 'runways', kind: 'store' }), 'RUNWAY STATE – CHECK');
  assert.equal(resetOf({ id: 'restart', kind: 'store' }), 'ALERTS RESET BY RESTART');
  assert.equal(resetOf({ id: 'database', kind: 'store' }), '');
  assert.equal(resetOf({ id: 'runways', kind: 'radar' }), '');
});
