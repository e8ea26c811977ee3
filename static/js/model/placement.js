// Where labels go: greedy over eight places at two distances, important ones first, the last place kept while it is free.

/**
 * @typedef {object} Request
 * @property {number} id
 * @property {number} x  the target on the screen
 * @property {number} y
 * @property {number} radius  of its symbol
 * @property {number} w  size of the label
 * @property {number} h
 * @property {number} slot  the place it had, -1 for none
 * @property {boolean} must  show it even where it overlaps
 * @property {{dx: number, dy: number}|null} pinned  put there by hand
 */

/**
 * @typedef {object} Placed
 * @property {number} id
 * @property {number} slot
 * @property {number} dx  corner of the box from the target
 * @property {number} dy
 * @property {boolean} visible
 */

const CELL = 96;
const GAPS = [12, 30];
/** right-up first, as on paper strips; then the other corners, then the sides */
const DIRECTIONS = [[1, -1], [1, 1], [-1, -1], [-1, 1], [1, 0], [-1, 0], [0, -1], [0, 1]];
/** Number of places a label may have. */
export const SLOTS = DIRECTIONS.length * GAPS.length;

/**
 * @param {number} slot @param {number} radius @param {number} w @param {number} h
 * @returns {[number, number]} corner of the box from the target
 */
export function slotOffset(slot, radius, w, h) {
  const [ux, uy] = DIRECTIONS[slot % DIRECTIONS.length];
  const gap = GAPS[Math.floor(slot / DIRECTIONS.length)] + radius;
  const reach = ux && uy ? gap * 0.75 : gap;
  return [ux > 0 ? reach : ux < 0 ? -reach - w : -w / 2, uy > 0 ? reach : uy < 0 ? -reach - h : -h / 2];
}

/**
 * @param {number} from where a box begins @param {number} size of it @param {number} room from 0 to here
 * @returns {number} where it has to begin to lie in the room; at 0 when it is too big for it
 */
export const clampInto = (from, size, room) => Math.max(0, Math.min(from, room - size));

/** Boxes on a grid of cells, so that a question costs a few comparisons. */
class Boxes {
  constructor() {
    /** @type {Map<number, number[]>} */
    this.cells = new Map();
    /** @type {number[]} x0, y0, x1, y1, owner a box */
    this.data = [];
  }

  /** @param {number} x0 @param {number} y0 @param {number} x1 @param {number} y1 @param {number} owner */
  add(x0, y0, x1, y1, owner) {
    const at = this.data.length;
    this.data.push(x0, y0, x1, y1, owner);
    for (let i = Math.floor(x0 / CELL); i <= Math.floor(x1 / CELL); i += 1) {
      for (let j = Math.floor(y0 / CELL); j <= Math.floor(y1 / CELL); j += 1) {
        const key = i * 65536 + j;
        const cell = this.cells.get(key);
        if (cell) cell.push(at);
        else this.cells.set(key, [at]);
      }
    }
  }

  /**
   * @param {number} x0 @param {number} y0 @param {number} x1 @param {number} y1 @param {number} owner not counted
   * @returns {number} area covered, square pixels (a box over a border of cells may count twice: it is still not free)
   */
  overlap(x0, y0, x1, y1, owner) {
    let area = 0;
    for (let i = Math.floor(x0 / CELL); i <= Math.floor(x1 / CELL); i += 1) {
      for (let j = Math.floor(y0 / CELL); j <= Math.floor(y1 / CELL); j += 1) {
        for (const at of this.cells.get(i * 65536 + j) ?? []) {
          if (this.data[at + 4] === owner) continue;
          const w = Math.min(x1, this.data[at + 2]) - Math.max(x0, this.data[at]);
          const h = Math.min(y1, this.data[at + 3]) - Math.max(y0, this.data[at + 1]);
          if (w > 0 && h > 0) area += w * h;
        }
      }
    }
    return area;
  }
}

/**
 * Place labels, in the order given (most important first). Symbols are obstacles too.
 * @param {Request[]} requests
 * @param {{x: number, y: number, radius: number, id: number}[]} symbols everything that must not be covered
 * @param {{width: number, height: number}} screen
 * @returns {Placed[]}
 */
export function placeLabels(requests, symbols, screen) {
  const boxes = new Boxes();
  for (const s of symbols) boxes.add(s.x - s.radius, s.y - s.radius, s.x + s.radius, s.y + s.radius, s.id);
  return requests.map((request) => {
    const placed = request.pinned ? pinnedPlace(request) : bestPlace(request, boxes, screen);
    if (placed.visible) {
      const x = request.x + placed.dx;
      const y = request.y + placed.dy;
      boxes.add(x, y, x + request.w, y + request.h, -request.id - 1);
    }
    return placed;
  });
}

/** @param {Request} request @returns {Placed} */
function pinnedPlace(request) {
  const { dx, dy } = request.pinned ?? { dx: 0, dy: 0 };
  return { id: request.id, slot: -1, dx, dy, visible: true };
}

/** @param {Request} request @param {Boxes} boxes @param {{width: number, height: number}} screen @returns {Placed} */
function bestPlace(request, boxes, screen) {
  const { id, x, y, radius, w, h } = request;
  let best = -1;
  let bestCost = Infinity;
  let bestOverlap = 0;
  const order = request.slot >= 0 ? [request.slot] : [];
  for (let slot = 0; slot < SLOTS; slot += 1) if (slot !== request.slot) order.push(slot);
  for (const slot of order) {
    const [dx, dy] = slotOffset(slot, radius, w, h);
    const x0 = clampInto(x + dx, w, screen.width);
    const y0 = clampInto(y + dy, h, screen.height);
    const covered = boxes.overlap(x0 - 2, y0 - 1, x0 + w + 2, y0 + h + 1, id);
    const outside = Math.abs(x0 - x - dx) + Math.abs(y0 - y - dy);
    const cost = covered + 6 * outside * h + (slot === request.slot ? 0 : 12 + 3 * slot);
    if (cost < bestCost) {
      best = slot;
      bestCost = cost;
      bestOverlap = covered;
    }
    if (covered === 0 && outside === 0) break;
  }
  const [dx, dy] = slotOffset(best, radius, w, h);
  const visible = request.must || bestOverlap < 0.12 * w * h;
  return {
    id, slot: visible ? best : -1, dx: clampInto(x + dx, w, screen.width) - x, dy: clampInto(y + dy, h, screen.height) - y, visible,
  };
}
