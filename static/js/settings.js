// What the controller has chosen: kept in the browser, overridden by the address of the page.

/** @typedef {import('./types.js').LabelLevel} LabelLevel */

const KEY = 'airside.display.v1';
export const VECTORS = Object.freeze([0, 5, 10, 30, 60]);
export const HISTORIES = Object.freeze([0, 5, 10, 30]);
/** @type {readonly LabelLevel[]} */
export const LABELS = Object.freeze(/** @type {LabelLevel[]} */ (['off', 'short', 'full']));
export const PALETTES = Object.freeze(['night', 'day', 'contrast']);

/**
 * @typedef {object} Choices
 * @property {number} vector  seconds ahead
 * @property {number} history  dots
 * @property {LabelLevel} labels
 * @property {string} palette
 * @property {boolean} radar
 * @property {number} radarOpacity  0..1
 * @property {boolean} list  the target list is open
 */

/** @type {Choices} */
export const DEFAULTS = Object.freeze({
  vector: 10, history: 5, labels: /** @type {LabelLevel} */ ('full'), palette: 'night', radar: false, radarOpacity: 0.7,
  list: false,
});

/**
 * Take only what is known and in range; anything else falls back to the default.
 * @param {Record<string, unknown>} raw @returns {Choices}
 */
export function sane(raw) {
  const opacity = Number(raw.radarOpacity);
  return {
    vector: VECTORS.includes(Number(raw.vector)) ? Number(raw.vector) : DEFAULTS.vector,
    history: HISTORIES.includes(Number(raw.history)) ? Number(raw.history) : DEFAULTS.history,
    labels: LABELS.includes(/** @type {LabelLevel} */ (raw.labels)) ? /** @type {LabelLevel} */ (raw.labels) : DEFAULTS.labels,
    palette: PALETTES.includes(String(raw.palette)) ? String(raw.palette) : DEFAULTS.palette,
    radar: raw.radar === undefined ? DEFAULTS.radar : raw.radar === true || raw.radar === 'true' || raw.radar === '1',
    radarOpacity: raw.radarOpacity !== undefined && opacity >= 0 && opacity <= 1 ? opacity : DEFAULTS.radarOpacity,
    list: raw.list === true || raw.list === 'true' || raw.list === '1',
  };
}

/**
 * @template T
 * @param {readonly T[]} among @param {T} current @param {number} [step]
 * @returns {T} the one after it
 */
export function next(among, current, step = 1) {
  const at = among.indexOf(current);
  return among[(at + step + among.length) % among.length];
}

/** The choices, and whoever wants to hear of a change. */
export class Settings {
  /** @param {Pick<Storage, 'getItem'|'setItem'>|null} storage @param {URLSearchParams} query */
  constructor(storage, query) {
    this.storage = storage;
    this.choices = sane({ ...this.stored(), ...Object.fromEntries(query) });
    /** @type {((choices: Choices) => void)[]} */
    this.listeners = [];
    /** @type {Set<string>} changed by hand: what the address says of them no longer holds */
    this.touched = new Set();
    /** @type {() => void} */
    this.onSet = () => {};
  }

  /** @returns {Record<string, unknown>} */
  stored() {
    try {
      const value = JSON.parse(this.storage?.getItem(KEY) ?? '{}');
      return value && typeof value === 'object' ? value : {};
    } catch {
      return {};
    }
  }

  /** @param {Partial<Choices>} changes */
  set(changes) {
    this.choices = sane({ ...this.choices, ...changes });
    try {
      this.storage?.setItem(KEY, JSON.stringify(this.choices));
    } catch {
      // a browser that keeps nothing still shows the picture
    }
    for (const key of Object.keys(changes)) this.touched.add(key);
    for (const listener of this.listeners) listener(this.choices);
    this.onSet();
  }

  /** @param {(choices: Choices) => void} listener called now and at every change */
  watch(listener) {
    this.listeners.push(listener);
    listener(this.choices);
  }
}

/**
 * The view that the page's address asks for: metres east and north, pixels a metre, degrees up.
 * @param {URLSearchParams} query
 * @returns {{east: number, north: number, scale: number, rotation: number}|null}
 */
export function viewFromQuery(query) {
  const [east, north, scale] = ['e', 'n', 'z'].map((key) => Number.parseFloat(query.get(key) ?? ''));
  if (![east, north, scale].every(Number.isFinite) || scale <= 0) return null;
  const rotation = Number.parseFloat(query.get('r') ?? '0');
  return { east, north, scale, rotation: Number.isFinite(rotation) ? (rotation * Math.PI) / 180 : 0 };
}

/** @param {{east: number, north: number, scale: number, rotation: number}} view @param {URLSearchParams} query */
export function viewToQuery(view, query) {
  query.set('e', view.east.toFixed(0));
  query.set('n', view.north.toFixed(0));
  query.set('z', view.scale.toPrecision(4));
  const degrees = Math.round((view.rotation * 180) / Math.PI);
  if (degrees) query.set('r', String(degrees));
  else query.delete('r');
  return query;
}
