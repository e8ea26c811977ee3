// The stacked canvases, and the rhythm in which they are drawn.

const MAX_RATIO = 2;
const LIVE_FRAME_MS = 62;

/**
 * @typedef {object} Layer
 * @property {HTMLCanvasElement} canvas
 * @property {CanvasRenderingContext2D} context
 * @property {(context: CanvasRenderingContext2D, nowMs: number) => void} draw
 * @property {boolean} live  drawn in every frame; otherwise only when the view or its data changed
 * @property {boolean} dirty
 */

/** Canvases of one size that share a viewport. A layer whose drawing fails is counted and does not stop the others. */
export class Stage {
  /** @param {HTMLElement} host @param {import('../geo/viewport.js').Viewport} viewport */
  constructor(host, viewport) {
    this.host = host;
    this.viewport = viewport;
    /** @type {Layer[]} */
    this.layers = [];
    this.ratio = 1;
    this.seenVersion = -1;
    this.lastLiveMs = -Infinity;
    this.hurryUntilMs = -Infinity;
    this.errors = 0;
    /** frames in a row in which something could not be drawn */
    this.failing = 0;
    this.frames = 0;
    /** ms that drawing a live frame took, smoothed */
    this.costMs = 0;
    /** @type {((nowMs: number) => void)|null} called before the layers of a live frame */
    this.before = null;
    this.lastError = '';
  }

  /** @param {string} name @param {Layer['draw']} draw @param {boolean} live @returns {Layer} */
  add(name, draw, live) {
    const canvas = document.createElement('canvas');
    canvas.className = `layer layer-${name}`;
    canvas.setAttribute('aria-hidden', 'true');
    const context = canvas.getContext('2d');
    if (!context) throw new Error('this browser has no 2D canvas');
    this.host.append(canvas);
    const layer = { canvas, context, draw, live, dirty: true };
    this.layers.push(layer);
    return layer;
  }

  /** Take the size of the host. */
  fit() {
    const { clientWidth, clientHeight } = this.host;
    const ratio = Math.min(MAX_RATIO, window.devicePixelRatio || 1);
    const w = Math.max(1, Math.round(clientWidth * ratio));
    const h = Math.max(1, Math.round(clientHeight * ratio));
    this.ratio = ratio;
    for (const layer of this.layers) {
      if (layer.canvas.width !== w || layer.canvas.height !== h) {
        layer.canvas.width = w;
        layer.canvas.height = h;
        layer.dirty = true;
      }
    }
    if (this.viewport.width !== clientWidth || this.viewport.height !== clientHeight) {
      this.viewport.resize(clientWidth, clientHeight);
    }
  }

  /** Draw at the full rate for a while (the view is being moved). @param {number} [ms] */
  hurry(ms = 250) {
    this.hurryUntilMs = performance.now() + ms;
  }

  /** Draw everything anew in the next frame. */
  invalidate() {
    for (const layer of this.layers) layer.dirty = true;
    this.lastLiveMs = -Infinity;
  }

  start() {
    const loop = (/** @type {number} */ nowMs) => {
      requestAnimationFrame(loop);
      this.frame(nowMs);
    };
    requestAnimationFrame(loop);
  }

  /** @param {number} nowMs */
  frame(nowMs) {
    const moved = this.seenVersion !== this.viewport.version;
    // on a slow machine the picture takes at most half of the time there is
    const pause = Math.max(LIVE_FRAME_MS, 2 * this.costMs);
    const due = moved || nowMs < this.hurryUntilMs || nowMs - this.lastLiveMs >= pause - 4;
    if (!due && !this.layers.some((one) => one.dirty)) return;
    this.seenVersion = this.viewport.version;
    const start = performance.now();
    const errors = this.errors;
    if (due) {
      this.lastLiveMs = nowMs;
      this.frames += 1;
      this.attempt(() => this.before?.(start));
    }
    for (const layer of this.layers) {
      if (!(layer.live ? due : moved || layer.dirty)) continue;
      layer.dirty = false;
      this.attempt(() => {
        const { context } = layer;
        context.setTransform(1, 0, 0, 1, 0, 0);
        context.globalAlpha = 1;
        context.clearRect(0, 0, layer.canvas.width, layer.canvas.height);
        context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
        layer.draw(context, start);
      });
    }
    if (due) this.failing = this.errors > errors ? this.failing + 1 : 0;
    if (due) this.costMs += 0.1 * (performance.now() - start - this.costMs);
  }

  /** @param {() => void} work */
  attempt(work) {
    try {
      work();
    } catch (error) {
      this.errors += 1;
      this.lastError = String(error);
      if (this.errors <= 3) console.error('drawing failed', error);
    }
  }
}
