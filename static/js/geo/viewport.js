// The one affine between local metres and the screen: pan, zoom at a point, rotate.

const MIN_SCALE = 0.012;
const MAX_SCALE = 20;

/** What part of the airport is on the screen. Distances on the screen are CSS pixels. */
export class Viewport {
  constructor() {
    this.east = 0;
    this.north = 0;
    /** pixels a metre */
    this.scale = 0.2;
    /** rad: the bearing that is up */
    this.rotation = 0;
    this.width = 1;
    this.height = 1;
    /** counts the changes, so that layers know when to redraw */
    this.version = 0;
    // the matrix: x = a east + c north + tx, y = b east + d north + ty
    this.a = 1;
    this.b = 0;
    this.c = 0;
    this.d = -1;
    this.tx = 0;
    this.ty = 0;
    this.refresh();
  }

  /** Recompute the matrix after a change of any field. */
  refresh() {
    const c = Math.cos(this.rotation) * this.scale;
    const s = Math.sin(this.rotation) * this.scale;
    this.a = c;
    this.b = -s;
    this.c = -s;
    this.d = -c;
    this.tx = this.width / 2 - (this.a * this.east + this.c * this.north);
    this.ty = this.height / 2 - (this.b * this.east + this.d * this.north);
    this.version += 1;
  }

  /** @param {number} east @param {number} north @returns {[number, number]} */
  toScreen(east, north) {
    return [this.a * east + this.c * north + this.tx, this.b * east + this.d * north + this.ty];
  }

  /** @param {number} x @param {number} y @returns {[number, number]} */
  toLocal(x, y) {
    const k = 1 / (this.scale * this.scale);
    const dx = x - this.tx;
    const dy = y - this.ty;
    return [(this.a * dx + this.b * dy) * k, (this.c * dx + this.d * dy) * k];
  }

  /**
   * Set a canvas's transform so that it draws in metres.
   * @param {CanvasRenderingContext2D} context @param {number} ratio device pixels a CSS pixel
   */
  applyTo(context, ratio) {
    context.setTransform(
      this.a * ratio, this.b * ratio, this.c * ratio, this.d * ratio, this.tx * ratio, this.ty * ratio,
    );
  }

  /** @param {number} width @param {number} height */
  resize(width, height) {
    this.width = Math.max(1, width);
    this.height = Math.max(1, height);
    this.refresh();
  }

  /** @param {number} dx pixels to the right @param {number} dy pixels down */
  pan(dx, dy) {
    const [e0, n0] = this.toLocal(0, 0);
    const [e1, n1] = this.toLocal(dx, dy);
    this.east -= e1 - e0;
    this.north -= n1 - n0;
    this.refresh();
  }

  /**
   * Zoom by a factor; the point under (x, y) stays where it is.
   * @param {number} factor @param {number} x @param {number} y
   */
  zoomAt(factor, x, y) {
    const [e, n] = this.toLocal(x, y);
    this.scale = Math.min(MAX_SCALE, Math.max(MIN_SCALE, this.scale * factor));
    this.refresh();
    const [sx, sy] = this.toScreen(e, n);
    this.pan(x - sx, y - sy);
  }

  /** Turn about the middle. @param {number} angle rad, clockwise change of the bearing that is up */
  rotate(angle) {
    this.setRotation(this.rotation + angle);
  }

  /** @param {number} rotation rad */
  setRotation(rotation) {
    const turn = 2 * Math.PI;
    this.rotation = ((rotation % turn) + turn) % turn;
    if (turn - this.rotation < 1e-9) this.rotation = 0;
    this.refresh();
  }

  /** @param {number} east @param {number} north @param {number} [scale] */
  centre(east, north, scale) {
    this.east = east;
    this.north = north;
    if (scale !== undefined) this.scale = Math.min(MAX_SCALE, Math.max(MIN_SCALE, scale));
    this.refresh();
  }

  /**
   * Show the whole of a rectangle given in metres.
   * @param {{west: number, east: number, south: number, north: number}} bounds @param {number} [margin] share left free
   */
  fit(bounds, margin = 0.06) {
    const c = Math.abs(Math.cos(this.rotation));
    const s = Math.abs(Math.sin(this.rotation));
    const w = Math.max(1, bounds.east - bounds.west);
    const h = Math.max(1, bounds.north - bounds.south);
    const scale = Math.min(this.width / (w * c + h * s), this.height / (w * s + h * c)) * (1 - 2 * margin);
    this.centre((bounds.west + bounds.east) / 2, (bounds.south + bounds.north) / 2, scale);
  }
}
