// The radar's own video under everything that moves.

import { fetchVideo } from '../feed/rest.js';

const PERIOD_MS = 1000;
const REST_MS = 5000;

/** Fetches the picture of each radar about once a second while it is wanted, and draws the newest. */
export class RadarLayer {
  /** @param {() => void} changed called when there is something new to draw */
  constructor(changed) {
    this.changed = changed;
    /** @type {import('../geo/projection.js').Projection|null} */
    this.projection = null;
    /** @type {Map<string, import('../feed/rest.js').VideoPicture>} */
    this.pictures = new Map();
    /** @type {Map<string, number>} when each radar may be asked next */
    this.due = new Map();
    /** @type {Set<string>} */
    this.asking = new Set();
    this.failures = 0;
    this.on = false;
    this.opacity = 0.7;
    /** the server's palette that suits ours */
    this.ink = 'green';
  }

  /** @param {boolean} on @param {number} opacity */
  set(on, opacity) {
    this.on = on;
    this.opacity = opacity;
    if (!on) {
      for (const one of this.pictures.values()) one.image.close();
      this.pictures.clear();
      this.due.clear();
    }
    this.changed();
  }

  /** @param {Iterable<import('../types.js').SensorState>} sensors @param {number} nowMs */
  poll(sensors, nowMs) {
    if (!this.on || !this.projection || document.hidden) return;
    for (const { id, kind, status } of sensors) {
      if (!/radar|smr/i.test(kind) || this.asking.has(id) || nowMs < (this.due.get(id) ?? 0)) continue;
      if (status === 'waiting' || status === 'silent') {
        this.forget(id);
        continue;
      }
      this.asking.add(id);
      this.fetch(id).finally(() => this.asking.delete(id));
    }
  }

  /** @param {string} id */
  async fetch(id) {
    if (!this.projection) return;
    try {
      const picture = await fetchVideo(id, this.projection, this.ink);
      this.due.set(id, performance.now() + PERIOD_MS);
      if (!picture) return;
      if (!this.on) {
        picture.image.close();
        return;
      }
      this.pictures.get(id)?.image.close();
      this.pictures.set(id, picture);
      this.changed();
    } catch {
      this.failures += 1;
      this.due.set(id, performance.now() + REST_MS);
      this.forget(id);
    }
  }

  /** An old radar picture must not look like a new one. @param {string} id */
  forget(id) {
    const old = this.pictures.get(id);
    if (!old) return;
    old.image.close();
    this.pictures.delete(id);
    this.changed();
  }

  /**
   * @param {CanvasRenderingContext2D} context @param {import('../geo/viewport.js').Viewport} view @param {number} ratio
   * @param {import('../types.js').Theme} theme
   */
  draw(context, view, ratio, theme) {
    if (!this.on) return;
    context.save();
    view.applyTo(context, ratio);
    context.globalAlpha = this.opacity;
    context.imageSmoothingEnabled = true;
    context.globalCompositeOperation = theme.name === 'day' ? 'source-over' : 'lighter';
    for (const { image, west, south, east, north } of this.pictures.values()) {
      context.save();
      context.translate(west, north);
      context.scale((east - west) / image.width, -(north - south) / image.height);
      context.drawImage(image, 0, 0);
      context.restore();
    }
    context.restore();
  }
}
