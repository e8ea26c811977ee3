// The display as a whole: what is selected, what is drawn, and the panels around it.

import { drawFurniture, drawLinks } from './draw/overlay.js';
import { LabelLayer } from './draw/labels.js';
import { MapLayer } from './draw/map.js';
import { RadarLayer } from './draw/radar.js';
import { Stage } from './draw/stage.js';
import { advance, drawTargets, radiusOf } from './draw/targets.js';
import { PictureState } from './feed/picture.js';
import { Viewport } from './geo/viewport.js';
import { nearest } from './input/pointer.js';
import { Ruler } from './input/ruler.js';
import { needsAttention } from './panels/alerts.js';
import { applyTheme } from './themes/index.js';

/** @typedef {import('./types.js').Target} Target */

const PLACE_EVERY_MS = 240;
const FLASH_MS = 1100;

/** Canvases, selection and view. Panels are told through `onChange`. */
export class Display {
  /** @param {HTMLElement} host @param {import('./settings.js').Settings} settings */
  constructor(host, settings) {
    this.host = host;
    this.settings = settings;
    this.picture = new PictureState();
    this.view = new Viewport();
    this.stage = new Stage(host, this.view);
    this.labels = new LabelLayer();
    this.ruler = new Ruler();
    /** @type {MapLayer|null} */
    this.map = null;
    /** @type {number|null} */
    this.selected = null;
    this.following = false;
    this.still = matchMedia('(prefers-reduced-motion: reduce)');
    /** @type {() => void} */
    this.onChange = () => {};
    this.placedMs = -Infinity;
    this.placedView = -1;
    this.drawnMs = 0;
    this.alertVersion = -1;
    this.statusVersion = -1;
    this.radar = new RadarLayer(() => this.touch(1));
    /** @type {import('./draw/targets.js').Scene} */
    this.scene = {
      picture: this.picture, view: this.view, theme: applyTheme(settings.choices.palette), choices: settings.choices,
      selected: null, hovered: null, alerted: new Map(), unacknowledged: new Set(), flashOn: true,
      holds: [], occupants: new Set(),
    };
    this.stage.add('map', (context) => this.drawMap(context), false);
    this.stage.add('radar', (context) => this.radar.draw(context, this.view, this.stage.ratio, this.scene.theme), false);
    this.stage.add('tracks', (context, nowMs) => drawTargets(context, this.scene, nowMs), true);
    this.stage.add('labels', (context, nowMs) => this.drawLabels(context, nowMs), true);
    this.stage.before = (nowMs) => this.prepare(nowMs);
    settings.watch((choices) => this.choose(choices));
    new ResizeObserver(() => this.stage.fit()).observe(host);
    this.stage.fit();
  }

  /** @param {number} layer redraw it in the next frame */
  touch(layer) {
    const found = this.stage.layers[layer];
    if (found) found.dirty = true;
  }

  /** @param {import('./settings.js').Choices} choices */
  choose(choices) {
    if (this.scene.theme.name !== choices.palette) this.scene.theme = applyTheme(choices.palette);
    this.scene.choices = choices;
    this.radar.ink = choices.palette === 'day' ? 'blue' : choices.palette === 'contrast' ? 'amber' : 'green';
    this.placedMs = -Infinity;
    if (this.radar.on !== choices.radar || this.radar.opacity !== choices.radarOpacity) this.radar.set(choices.radar, choices.radarOpacity);
    this.stage.invalidate();
  }

  /** @param {import('./types.js').AirportMap} airport */
  setAirport(airport) {
    this.map = new MapLayer(airport);
    this.scene.holds = this.map.holds;
    this.radar.projection = airport.projection;
    this.touch(0);
  }

  /** Show the whole airport. */
  home() {
    if (this.map) this.view.fit(this.map.airport.bounds);
    this.following = false;
    this.onChange();
  }

  /** @returns {Map<string, 'information'|'alarm'>} the worst live stage by runway */
  alertedRunways() {
    /** @type {Map<string, 'information'|'alarm'>} */
    const stages = new Map();
    for (const { runway, stage } of this.picture.alerts.values()) if (runway && stages.get(runway) !== 'alarm') stages.set(runway, stage);
    return stages;
  }

  /** Everything that is needed before the layers of a frame. @param {number} nowMs */
  prepare(nowMs) {
    const { scene, picture } = this;
    picture.sweep(nowMs);
    if (this.alertVersion !== picture.alertVersion) {
      this.alertVersion = picture.alertVersion;
      scene.alerted = picture.alertedTargets();
      scene.unacknowledged = new Set([...picture.alerts.values()].filter((one) => one.stage === 'alarm' && needsAttention(one)).flatMap((one) => one.targets.map((t) => t.track)));
      this.placedMs = -Infinity;
      this.touch(0);
    }
    if (this.statusVersion !== picture.statusVersion) {
      this.statusVersion = picture.statusVersion;
      scene.occupants = new Set([...picture.runways.values()].flatMap((one) => one.occupants ?? []));
    }
    scene.selected = this.selected;
    scene.flashOn = this.still.matches || nowMs % FLASH_MS < FLASH_MS * 0.55;
    if (this.following && this.selected !== null) {
      const target = picture.targets.get(this.selected);
      if (target) this.view.centre(target.e, target.n);
    }
    advance(scene, nowMs);
    this.ruler.follow(picture.targets);
  }

  /** @param {CanvasRenderingContext2D} context */
  drawMap(context) {
    this.map?.draw(context, this.view, this.stage.ratio, this.scene.theme, this.picture.runways, this.alertedRunways());
  }

  /** @param {CanvasRenderingContext2D} context @param {number} nowMs */
  drawLabels(context, nowMs) {
    const turned = this.placedView !== this.view.version && !this.following;
    if (nowMs - this.placedMs >= PLACE_EVERY_MS || (turned && nowMs - this.placedMs >= 80)) {
      this.placedMs = nowMs;
      this.placedView = this.view.version;
      this.labels.place(context, this.scene, this.map?.designators(this.view));
    }
    const ease = this.still.matches ? 1 : 1 - Math.exp(-Math.min(200, nowMs - this.drawnMs) / 90);
    this.drawnMs = nowMs;
    drawLinks(context, this.scene);
    this.labels.draw(context, this.scene, ease);
    this.ruler.draw(context, this.scene);
    drawFurniture(context, this.scene);
  }

  /** @param {number} x @param {number} y @returns {Target|null} */
  pick(x, y) {
    return nearest(this.picture.targets.values(), x, y, (target) => radiusOf(target, this.view.scale));
  }

  /** @param {number|null} id @param {boolean} [show] bring it to the middle when it is not on the screen */
  select(id, show = false) {
    this.selected = id;
    if (id === null) this.following = false;
    const target = id === null ? undefined : this.picture.targets.get(id);
    if (show && target) {
      const [x, y] = this.view.toScreen(target.e, target.n);
      const margin = 60;
      if (x < margin || y < margin || x > this.view.width - margin || y > this.view.height - margin) this.view.centre(target.e, target.n);
    }
    this.placedMs = -Infinity;
    this.stage.hurry(60);
    this.onChange();
  }

  /** @param {number} id */
  hover(id) {
    if (this.scene.hovered === id) return;
    this.scene.hovered = id;
    this.placedMs = -Infinity;
    this.stage.hurry(60);
  }

  /** Bring an alert into the picture: its targets, at a scale that shows them. @param {import('./types.js').Alert} alert */
  showAlert(alert) {
    const points = [];
    for (const one of alert.targets) {
      const target = this.picture.targets.get(one.track);
      if (target) points.push([target.e, target.n]);
      else if (Number.isFinite(one.east_m) && Number.isFinite(one.north_m)) points.push([Number(one.east_m), Number(one.north_m)]);
    }
    if (!points.length) {
      if (alert.runway) this.showRunway(alert.runway);
      return;
    }
    const es = points.map((p) => p[0]);
    const ns = points.map((p) => p[1]);
    const pad = 250;
    this.following = false;
    this.view.fit({ west: Math.min(...es) - pad, east: Math.max(...es) + pad, south: Math.min(...ns) - pad, north: Math.max(...ns) + pad }, 0.1);
    this.select(alert.targets[0]?.track ?? null);
  }

  /** @param {string} id */
  showRunway(id) {
    const runway = this.map?.airport.runways.find((one) => one.id === id);
    if (!runway) return;
    const [a, b] = runway.ends;
    this.following = false;
    this.view.fit({ west: Math.min(a.e, b.e) - 150, east: Math.max(a.e, b.e) + 150, south: Math.min(a.n, b.n) - 150, north: Math.max(a.n, b.n) + 150 });
    this.onChange();
  }
}
