// Start: build the display, connect the feed, bind keys, pointer and panels.

import { Display } from './display.js';
import { LiveFeed } from './feed/live.js';
import { fetchAirport, fetchCleared, fetchRefusal } from './feed/rest.js';
import { exposeHook } from './hook.js';
import { onKey } from './input/keys.js';
import { bindPointer } from './input/pointer.js';
import { angle } from './model/format.js';
import { readAirport } from './model/airport.js';
import { AlertPanel, needsAttention } from './panels/alerts.js';
import { byId, setText } from './panels/dom.js';
import { makeHelp } from './panels/help.js';
import { TargetList } from './panels/list.js';
import { ProcessingPanel } from './panels/processing.js';
import { ReplayBar } from './panels/replay.js';
import { RunwayPanel } from './panels/runways.js';
import { SensorPanel } from './panels/sensors.js';
import { StatusBar } from './panels/status.js';
import { TargetPanel } from './panels/target.js';
import { bindToolbar } from './panels/toolbar.js';
import { Settings, viewFromQuery, viewToQuery } from './settings.js';
import { Sound } from './sound.js';

const PANELS_EVERY_MS = 250;
const LIST_EVERY_MS = 1000;

/** @returns {Storage|null} none where the browser forbids it */
function storage() {
  try {
    return window.localStorage;
  } catch {
    return null;
  }
}

const query = new URLSearchParams(location.search);
const settings = new Settings(storage(), query);
const host = byId('stage');
const display = new Display(host, settings);
const { picture, view, stage, ruler } = display;
const status = new StatusBar();
const sound = new Sound();
const error = (/** @type {string} */ text) => status.toast(text, 'error');

const alerts = new AlertPanel(picture, { onOpen: (alert) => display.showAlert(alert), onError: error });
const runways = new RunwayPanel(picture, { onError: error, onOpen: (id) => display.showRunway(id) });
const sensors = new SensorPanel(picture);
const replay = new ReplayBar(picture, host, { onError: error });
const processing = new ProcessingPanel(picture, { onError: error });
const target = new TargetPanel(picture, {
  onClose: () => display.select(null),
  onFollow: () => follow(),
  onCentre: () => {
    const found = display.selected === null ? undefined : picture.targets.get(display.selected);
    if (found) view.centre(found.e, found.n, Math.max(view.scale, 0.8));
  },
});
const list = new TargetList(picture, { onOpen: (id) => display.select(id, true), onToggle: () => actions.list() });
const tools = bindToolbar(settings);
const help = makeHelp();
settings.watch((choices) => list.setOpen(choices.list));
settings.onSet = () => saveView();

/** @type {import('./feed/live.js').LinkState} */
let link = 'connecting';
const feed = new LiveFeed({
  url: new URL('api/v1/live', document.baseURI).href.replace(/^http/, 'ws'),
  position: () => picture.position(),
  onState: (state) => {
    link = state;
    if (state === 'live') status.refusal = '';
  },
  onRefused: async () => { status.refusal = await fetchRefusal(); },
  onMessage: (message) => {
    const before = picture.alertVersion;
    if (picture.apply(message, performance.now()) === 'gap') feed.restart();
    // an alert does not wait for the panels' rhythm
    if (picture.alertVersion !== before) refresh();
  },
});

function follow() {
  if (display.selected === null) return;
  display.following = !display.following;
  display.onChange();
}

function measure() {
  ruler.active = !ruler.active;
  if (!ruler.active) ruler.from = ruler.to = null;
  byId('tool-measure').setAttribute('aria-pressed', String(ruler.active));
  if (ruler.active) status.toast('Measure: click two places or targets; Esc clears, m ends');
}

function toggleSound() {
  const on = sound.toggle();
  byId('sound').setAttribute('aria-pressed', String(on));
  setText(byId('sound'), on ? 'sound on' : 'sound off');
}

/** @type {import('./input/keys.js').KeyActions} */
const actions = {
  ...tools,
  pan: (dx, dy) => {
    display.following = false;
    view.pan(dx, dy);
    saveView();
  },
  zoom: (factor) => {
    view.zoomAt(factor, view.width / 2, view.height / 2);
    saveView();
  },
  rotate: (degrees) => {
    view.rotate((degrees * Math.PI) / 180);
    saveView();
  },
  northUp: () => {
    view.setRotation(0);
    saveView();
  },
  home: () => {
    display.home();
    saveView();
  },
  acknowledge: () => alerts.acknowledgeOldest(),
  search: () => {
    settings.set({ list: true });
    list.focus();
  },
  list: () => {
    settings.set({ list: !settings.choices.list });
    if (settings.choices.list) list.enter(display.selected);
    else host.focus();
  },
  measure,
  follow,
  sound: toggleSound,
  play: () => replay.toggle(),
  skip: (seconds) => replay.skip(seconds),
  speed: (step) => replay.faster(step),
  help: help.toggle,
  escape: () => {
    runways.close();
    if (ruler.from || ruler.lines.length) ruler.cancel();
    else if (ruler.active) measure();
    else display.select(null);
  },
};
document.addEventListener('keydown', (event) => {
  if (/** @type {HTMLDialogElement} */ (byId('help')).open) return;
  if (onKey(event, actions)) event.preventDefault();
});

bindPointer(host, view, stage, {
  pick: (x, y) => display.pick(x, y),
  labelAt: (x, y) => display.labels.at(display.scene, x, y),
  onSelect: (id) => display.select(id),
  onHover: (id) => {
    if (display.scene.hovered === id) return;
    display.hover(/** @type {number} */ (id));
    host.classList.toggle('is-target', id !== null);
  },
  onCursor: (x, y) => showCursor(x, y),
  onMoved: () => {
    display.following = false;
    saveView();
  },
  ruler,
});

/** @param {number} x @param {number} y */
function showCursor(x, y) {
  const projection = display.map?.airport.projection;
  if (!projection) return;
  const [lon, lat] = projection.toGeodetic(...view.toLocal(x, y));
  setText(byId('cursor'), `${angle(lat, 'lat')}  ${angle(lon, 'lon')}`);
}

let saveTimer = 0;
/** Put the view into the page's address, so that it can be shared and survives a reload. */
function saveView() {
  clearTimeout(saveTimer);
  saveTimer = window.setTimeout(() => {
    const now = viewToQuery(view, new URLSearchParams(location.search));
    for (const key of settings.touched) now.delete(key);
    if (display.selected !== null) now.set('track', String(display.selected));
    else now.delete('track');
    try {
      history.replaceState(null, '', `?${now}`);
    } catch {
      // some browsers limit how often; the next one will do
    }
  }, 400);
}

for (const [id, act] of /** @type {[string, () => void][]} */ ([
  ['sound', toggleSound], ['list-toggle', actions.list], ['tool-measure', measure], ['tool-home', actions.home], ['tool-north', actions.northUp],
])) byId(id).addEventListener('click', act);

let listMs = 0;
let statusVersion = -1;
/** The panels' own slow rhythm; a fault in one does not stop the others. */
function refresh() {
  const nowMs = performance.now();
  /** @type {(() => void)[]} */
  const work = [
    () => feed.watch(nowMs),
    () => status.update(picture, feed, link, stage.failing, nowMs),
    () => replay.update(nowMs),
    () => alerts.update(),
    () => runways.update(display.alertedRunways()),
    () => sensors.update(),
    () => processing.update(nowMs),
    () => target.update(display.selected, display.following),
    () => {
      // no alert sounds while a replay is paused
      const live = picture.pace === 0 ? [] : picture.liveAlerts();
      sound.update(live, needsAttention, nowMs);
      byId('sound').classList.toggle('is-wanted', !sound.armed && live.some(needsAttention));
    },
    () => display.radar.poll(picture.sensors.values(), nowMs),
    () => {
      if (statusVersion !== picture.statusVersion) display.touch(0);
      statusVersion = picture.statusVersion;
    },
    () => {
      if (nowMs - listMs < LIST_EVERY_MS) return;
      listMs = nowMs;
      list.update(display.selected);
    },
  ];
  for (const one of work) stage.attempt(one);
}
display.onChange = () => {
  target.update(display.selected, display.following);
  list.update(display.selected);
  saveView();
};

/** Fetch the map, again and again until it is there: tracks are shown meanwhile. @param {number} waitMs */
async function loadAirport(waitMs = 1000) {
  try {
    const airport = readAirport(await fetchAirport());
    display.setAirport(airport);
    setText(byId('airport'), [airport.icao, airport.name].filter(Boolean).join('  '));
    document.title = `${airport.icao || 'Airside'} – Airside`;
    setText(byId('credit'), airport.attribution);
    byId('loading').hidden = true;
    const asked = viewFromQuery(query);
    stage.fit();
    if (asked) {
      view.setRotation(asked.rotation);
      view.centre(asked.east, asked.north, asked.scale);
    } else {
      view.fit(airport.bounds);
    }
  } catch (fault) {
    setText(byId('loading'), `No map yet (${fault instanceof Error ? fault.message : fault}); trying again…`);
    setTimeout(() => loadAirport(Math.min(15000, waitMs * 2)), waitMs);
  }
}

const track = Number.parseInt(query.get('track') ?? '', 10);
if (Number.isFinite(track)) display.select(track);
exposeHook(display, feed, status, replay);
stage.start();
feed.start();
setInterval(refresh, PANELS_EVERY_MS);
loadAirport();
fetchCleared().then((past) => {
  // alerts cleared later in the recording have not happened yet at the time shown
  if (picture.mode === 'replay') return;
  for (const alert of past.reverse()) if (!picture.alerts.has(alert.id)) picture.clear(alert);
}).catch(() => {});
