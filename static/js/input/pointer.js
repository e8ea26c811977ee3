// Mouse, pen and touch on the picture: pan, zoom at the cursor, rotate, pick, drag labels, measure.

const PICK_PX = 14;
const DRAG_PX = 4;

/** @typedef {import('../types.js').Target} Target */

/**
 * @typedef {object} PointerHooks
 * @property {(x: number, y: number) => Target|null} pick
 * @property {(x: number, y: number) => Target|null} labelAt
 * @property {(id: number|null) => void} onSelect
 * @property {(id: number|null) => void} onHover
 * @property {(x: number, y: number) => void} onCursor
 * @property {() => void} onMoved  the view was moved by hand
 * @property {import('./ruler.js').Ruler} ruler
 */

/**
 * The nearest target within reach.
 * @param {Iterable<Target>} targets @param {number} x @param {number} y @param {(target: Target) => number} radius
 * @returns {Target|null}
 */
export function nearest(targets, x, y, radius) {
  let best = null;
  let least = Infinity;
  for (const target of targets) {
    const away = Math.hypot(target.x - x, target.y - y);
    if (away < least && away <= Math.max(PICK_PX, radius(target))) [best, least] = [target, away];
  }
  return best;
}

/**
 * @param {HTMLElement} host @param {import('../geo/viewport.js').Viewport} view
 * @param {import('../draw/stage.js').Stage} stage @param {PointerHooks} hooks
 */
export function bindPointer(host, view, stage, hooks) {
  /** @type {Map<number, {x: number, y: number}>} */
  const fingers = new Map();
  /** @type {{x: number, y: number, moved: boolean, label: Target|null, dx: number, dy: number}|null} */
  let press = null;
  const at = (/** @type {MouseEvent} */ event) => {
    const box = host.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  };
  const anchor = (/** @type {number} */ x, /** @type {number} */ y) => {
    const target = hooks.pick(x, y);
    const [e, n] = target ? [target.e, target.n] : view.toLocal(x, y);
    return { id: target ? target.track.id : null, e, n };
  };

  host.addEventListener('pointerdown', (event) => {
    if (event.button > 1 || event.target instanceof HTMLElement && event.target.closest('button, input, select')) return;
    const p = at(event);
    host.focus({ preventScroll: true });
    host.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, p);
    const label = hooks.ruler.active ? null : hooks.labelAt(p.x, p.y);
    press = { ...p, moved: false, label, dx: label ? p.x - label.x - label.label.sx : 0, dy: label ? p.y - label.y - label.label.sy : 0 };
  });

  host.addEventListener('pointermove', (event) => {
    const p = at(event);
    hooks.onCursor(p.x, p.y);
    const before = fingers.get(event.pointerId);
    if (!before || !press) {
      if (hooks.ruler.from) {
        hooks.ruler.to = anchor(p.x, p.y);
        stage.hurry(100);
      }
      hooks.onHover((hooks.pick(p.x, p.y) ?? hooks.labelAt(p.x, p.y))?.track.id ?? null);
      return;
    }
    if (!press.moved && Math.hypot(p.x - press.x, p.y - press.y) < DRAG_PX) return;
    press.moved = true;
    stage.hurry();
    if (press.label) {
      const { label } = press.label;
      const place = { dx: p.x - press.dx - press.label.x, dy: p.y - press.dy - press.label.y };
      label.pinned = place;
      [label.dx, label.dy, label.sx, label.sy] = [place.dx, place.dy, place.dx, place.dy];
    } else if (fingers.size === 2) {
      pinch(event.pointerId, before, p);
    } else if (event.shiftKey) {
      view.rotate(-(p.x - before.x) * 0.006);
    } else {
      view.pan(p.x - before.x, p.y - before.y);
    }
    if (!press.label) hooks.onMoved();
    fingers.set(event.pointerId, p);
  });

  /** @param {number} id @param {{x: number, y: number}} before @param {{x: number, y: number}} p */
  function pinch(id, before, p) {
    const other = [...fingers].find(([key]) => key !== id)?.[1];
    if (!other) return;
    const old = Math.hypot(before.x - other.x, before.y - other.y);
    const now = Math.hypot(p.x - other.x, p.y - other.y);
    if (old > 4 && now > 4) view.zoomAt(now / old, (p.x + other.x) / 2, (p.y + other.y) / 2);
    view.pan((p.x - before.x) / 2, (p.y - before.y) / 2);
  }

  const release = (/** @type {PointerEvent} */ event) => {
    const p = fingers.get(event.pointerId);
    fingers.delete(event.pointerId);
    if (!press || !p || fingers.size) return;
    const { moved, label } = press;
    press = null;
    if (moved || event.type === 'pointercancel') return;
    if (hooks.ruler.active) hooks.ruler.click(anchor(p.x, p.y));
    else hooks.onSelect((hooks.pick(p.x, p.y) ?? label)?.track.id ?? null);
    stage.hurry(100);
  };
  host.addEventListener('pointerup', release);
  host.addEventListener('pointercancel', release);
  host.addEventListener('pointerleave', () => hooks.onHover(null));

  host.addEventListener('dblclick', (event) => {
    const p = at(event);
    const found = hooks.labelAt(p.x, p.y) ?? hooks.pick(p.x, p.y);
    if (found) found.label.pinned = null;
    else {
      view.zoomAt(2, p.x, p.y);
      hooks.onMoved();
    }
  });

  host.addEventListener('wheel', (event) => {
    event.preventDefault();
    const p = at(event);
    const step = event.deltaMode === 1 ? event.deltaY * 30 : event.deltaY;
    const bounded = Math.max(-240, Math.min(240, step));
    if (event.shiftKey) view.rotate((bounded || event.deltaX) * 0.0015);
    else view.zoomAt(Math.exp(-bounded * 0.0022), p.x, p.y);
    stage.hurry();
    hooks.onMoved();
  }, { passive: false });
}
