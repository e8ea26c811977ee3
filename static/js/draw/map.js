// The map: surfaces, markings and names. Drawn only when the view, the palette or a runway's state changes.

import { pointAlong } from '../model/airport.js';

/** @typedef {import('../types.js').AirportMap} AirportMap */
/** @typedef {import('../types.js').MapFeature} MapFeature */
/** @typedef {import('../types.js').RunwayShape} RunwayShape */
/** @typedef {import('../types.js').RunwayState} RunwayState */
/** @typedef {import('../types.js').Theme} Theme */
/** @typedef {import('../geo/viewport.js').Viewport} Viewport */

/** Order of drawing, ink and the scale from which it is seen. @type {[RegExp, string, number][]} */
const SURFACES = [
  [/^(Grass|Airport|Aerodrome)/, 'grass', 0],
  [/Water/, 'water', 0],
  [/Road/, 'road', 0.08],
  [/Apron|Deicing/, 'apron', 0],
  [/Shoulder|Stopway|Blast|RunwayDisplacedArea/, 'shoulder', 0],
  [/^Taxiway(Element|Intersection|Area)?$/, 'taxiway', 0],
  [/^Runway(Element|Intersection)$/, 'runway', 0],
  [/Building|VerticalPolygon|Terminal|Hangar|Tower/, 'building', 0],
];

/** A name is not repeated nearer than this. */
const REPEAT_PX = 220;

/** Shapes gathered into one path for each ink, so that a redraw is a dozen fills. */
export class MapLayer {
  /** @param {AirportMap} airport */
  constructor(airport) {
    this.airport = airport;
    /** @type {{ink: string, from: number, fill: Path2D, line: Path2D}[]} */
    this.surfaces = SURFACES.map(([, ink, from]) => ({ ink, from, fill: new Path2D(), line: new Path2D() }));
    this.guide = new Path2D();
    this.stands = new Path2D();
    /** @type {MapFeature[]} */
    this.holds = [];
    /** @type {{text: string, points: {e: number, n: number}[], ink: string, from: number, size: number, weight: number}[]} */
    this.names = [];
    /** names stand on guidance lines where there are any, else in the middle of the surface */
    this.guided = airport.features.some((one) => one.kind === 'TaxiwayGuidanceLine' && one.name);
    /** stands that have a place of their own; their lines and areas need not be named again */
    this.located = new Set(airport.features.filter((one) => one.kind === 'ParkingStandLocation').map((one) => one.name));
    for (const feature of airport.features) this.sort(feature);
    this.names.sort((a, b) => b.weight - a.weight);
  }

  /** @param {MapFeature} feature */
  sort(feature) {
    const { kind, shape, name } = feature;
    if (/Hold/.test(kind)) {
      this.holds.push(feature);
    } else if (/Stand/.test(kind)) {
      if (shape !== 'point') trace(this.stands, feature);
      if (name && (kind === 'ParkingStandLocation' || !this.located.has(name))) this.name(feature, 'textStand', 0.75, 10, 1);
    } else if (/Guidance|TaxiwayLine|AsrnEdge/i.test(kind)) {
      if (shape === 'line') trace(this.guide, feature);
      if (name && this.guided) this.name(feature, 'text', 0.14, 11, 3);
    } else if (kind === 'VerticalPointStructure') {
      if (name) this.name(feature, 'textBuilding', 0.3, 10, 2);
    } else {
      const at = SURFACES.findIndex(([pattern]) => pattern.test(kind));
      if (at < 0) return;
      if (shape === 'polygon') trace(this.surfaces[at].fill, feature);
      else if (shape === 'line') trace(this.surfaces[at].line, feature);
      const ink = SURFACES[at][1];
      if (ink === 'taxiway' && name && !this.guided) this.name(feature, 'text', 0.14, 11, 3);
      if (ink === 'building' && name && name.length < 28) this.name(feature, 'textBuilding', 0.3, 10, 2);
    }
  }

  /** @param {MapFeature} feature @param {string} ink @param {number} from @param {number} size @param {number} weight */
  name(feature, ink, from, size, weight) {
    const line = feature.properties.centreline ?? feature.properties.centerline;
    let points = [feature.centre];
    if (Array.isArray(line) && line.length > 1) {
      const local = line.map((p) => this.airport.projection.toLocal(p[0], p[1]));
      points = [0.5, 0.2, 0.8].map((share) => pointAlong(local, share));
    } else if (feature.shape === 'line') {
      points = [0.5, 0.2, 0.8].map((share) => pointAlong(feature.rings[0], share));
    }
    this.names.push({ text: feature.name, points, ink, from, size, weight });
  }

  /**
   * @param {CanvasRenderingContext2D} context @param {Viewport} view @param {number} ratio @param {Theme} theme
   * @param {Map<string, RunwayState>} states @param {Map<string, 'information'|'alarm'>} alerted runways with an alert
   */
  draw(context, view, ratio, theme, states, alerted) {
    const ink = theme.map;
    const pixel = 1 / view.scale;
    context.save();
    view.applyTo(context, ratio);
    context.lineJoin = 'round';
    for (const { ink: name, from, fill, line } of this.surfaces) {
      if (view.scale < from) continue;
      context.fillStyle = ink[name];
      context.fill(fill);
      if (name === 'road' || name === 'taxiway') {
        context.strokeStyle = ink[name];
        context.lineWidth = name === 'road' ? 7 : 18;
        context.stroke(line);
      }
      if (name === 'building' && view.scale > 0.12) {
        context.strokeStyle = ink.buildingEdge;
        context.lineWidth = pixel;
        context.stroke(fill);
      }
      if (name === 'runway') {
        context.strokeStyle = ink.runwayEdge;
        context.lineWidth = 1.2 * pixel;
        context.stroke(fill);
      }
    }
    if (view.scale > 0.25) {
      context.strokeStyle = ink.line;
      context.lineWidth = Math.max(0.4, pixel);
      context.stroke(this.guide);
    }
    if (view.scale > 0.35) {
      context.strokeStyle = ink.stand;
      context.lineWidth = pixel;
      context.stroke(this.stands);
    }
    for (const runway of this.airport.runways) {
      this.runway(context, view, runway, theme, states.get(runway.id), alerted.get(runway.id));
    }
    this.holdBars(context, view, theme, states);
    context.restore();
    this.texts(context, view, theme);
  }

  /**
   * @param {CanvasRenderingContext2D} context @param {Viewport} view @param {RunwayShape} runway @param {Theme} theme
   * @param {RunwayState|undefined} state @param {'information'|'alarm'|undefined} stage
   */
  runway(context, view, runway, theme, state, stage) {
    const [a, b] = runway.ends;
    const length = Math.hypot(b.e - a.e, b.n - a.n);
    if (length < 1) return;
    const ink = theme.map;
    const [ue, un] = [(b.e - a.e) / length, (b.n - a.n) / length];
    const at = (/** @type {number} */ along, /** @type {number} */ across) =>
      /** @type {[number, number]} */ ([a.e + ue * along + un * across, a.n + un * along - ue * across]);
    const line = (/** @type {[number, number]} */ p, /** @type {[number, number]} */ q) => {
      context.moveTo(...p);
      context.lineTo(...q);
    };
    const pixel = 1 / view.scale;
    context.strokeStyle = ink.marking;
    context.globalAlpha = 0.75;
    context.lineWidth = Math.max(0.9, 0.8 * pixel);
    context.setLineDash([30, 20]);
    context.beginPath();
    line(at(80, 0), at(length - 80, 0));
    context.stroke();
    context.setLineDash([]);
    if (runway.width * view.scale > 5) {
      const half = runway.width / 2;
      context.lineWidth = 1.8;
      context.beginPath();
      for (const from of [6, length - 36]) {
        for (let k = 0.12; k < 0.9; k += 0.13) {
          line(at(from, half * k), at(from + 30, half * k));
          line(at(from, -half * k), at(from + 30, -half * k));
        }
      }
      context.stroke();
    }
    context.lineWidth = Math.max(1.2, 1.4 * pixel);
    context.beginPath();
    for (const along of [1, length - 1]) line(at(along, runway.width / 2), at(along, -runway.width / 2));
    context.stroke();
    context.globalAlpha = 1;
    if (state && !state.open) {
      const r = Math.max(runway.width * 0.42, 5 * pixel);
      context.strokeStyle = ink.closed;
      context.lineWidth = Math.max(3, 2.2 * pixel);
      context.beginPath();
      for (let s = 0.06; s < 1; s += Math.max(0.11, (60 * pixel) / length)) {
        line(at(s * length - r, r), at(s * length + r, -r));
        line(at(s * length - r, -r), at(s * length + r, r));
      }
      context.stroke();
    }
    if (state?.open && state.visibility === 'low') {
      context.strokeStyle = ink.lowVis;
      context.lineWidth = 2 * pixel;
      context.setLineDash([8 * pixel, 6 * pixel]);
      this.outline(context, at, length, runway.width / 2 + 7 * pixel);
      context.setLineDash([]);
    }
    if (stage) {
      context.strokeStyle = stage === 'alarm' ? theme.ink.alarm : theme.ink.info;
      context.lineWidth = (stage === 'alarm' ? 3 : 2) * pixel;
      if (stage !== 'alarm') context.setLineDash([14 * pixel, 6 * pixel]);
      this.outline(context, at, length, runway.width / 2 + 4 * pixel);
      context.setLineDash([]);
    }
  }

  /**
   * @param {CanvasRenderingContext2D} context @param {(along: number, across: number) => [number, number]} at
   * @param {number} length @param {number} half
   */
  outline(context, at, length, half) {
    context.beginPath();
    context.moveTo(...at(-half, half));
    context.lineTo(...at(length + half, half));
    context.lineTo(...at(length + half, -half));
    context.lineTo(...at(-half, -half));
    context.closePath();
    context.stroke();
  }

  /** @param {CanvasRenderingContext2D} context @param {Viewport} view @param {Theme} theme @param {Map<string, RunwayState>} states */
  holdBars(context, view, theme, states) {
    if (view.scale < 0.06) return;
    const pixel = 1 / view.scale;
    for (const hold of this.holds) {
      const state = states.get(String(hold.properties.runway ?? ''));
      const busy = Boolean(state?.open && (state.occupants?.length ?? 0) > 0);
      context.strokeStyle = state && !state.open ? theme.map.holdClosed : busy ? theme.map.holdBusy : theme.map.hold;
      context.lineWidth = Math.max(1.5, (busy ? 2.6 : 1.6) * pixel);
      if (hold.properties.derived && !busy) context.setLineDash([4 * pixel, 3 * pixel]);
      context.beginPath();
      const ring = hold.rings[0];
      if (hold.shape === 'point') context.arc(ring[0][0], ring[0][1], 3 * pixel, 0, 2 * Math.PI);
      else ring.forEach(([e, n], i) => (i ? context.lineTo(e, n) : context.moveTo(e, n)));
      context.stroke();
      context.setLineDash([]);
    }
  }

  /** @param {Viewport} view @returns {{text: string, x: number, y: number}[]} where the runway designators stand */
  designators(view) {
    const back = 34 / view.scale;
    return this.airport.runways.flatMap((runway) => runway.ends.map((end) => {
      const [x, y] = view.toScreen(end.e - back * Math.sin(end.heading), end.n - back * Math.cos(end.heading));
      return { text: end.designator, x, y };
    }));
  }

  /** @param {CanvasRenderingContext2D} context @param {Viewport} view @param {Theme} theme */
  texts(context, view, theme) {
    const taken = new Set();
    /** @type {Map<string, [number, number][]>} where each name already stands */
    const written = new Map();
    context.textAlign = 'center';
    context.textBaseline = 'middle';
    context.lineJoin = 'round';
    for (const { text, x, y } of this.designators(view)) {
      claim(taken, x, y, 30);
      this.text(context, text, x, y, '600 14px system-ui, sans-serif', theme.map.textRunway, theme.map.halo);
    }
    for (const { text, points, ink, from, size } of this.names) {
      if (view.scale < from) continue;
      const limit = points.length > 1 && view.scale < 0.6 ? 1 : points.length;
      for (const point of points.slice(0, limit)) {
        const [x, y] = view.toScreen(point.e, point.n);
        if (x < -20 || y < -20 || x > view.width + 20 || y > view.height + 20) continue;
        const same = written.get(text) ?? [];
        if (same.some(([px, py]) => Math.hypot(px - x, py - y) < REPEAT_PX)) continue;
        if (!claim(taken, x, y, Math.max(22, text.length * size * 0.6))) continue;
        written.set(text, [...same, [x, y]]);
        this.text(context, text, x, y, `${ink === 'text' ? 600 : 400} ${size}px system-ui, sans-serif`, theme.map[ink], theme.map.halo);
      }
    }
  }

  /**
   * @param {CanvasRenderingContext2D} context @param {string} text @param {number} x @param {number} y
   * @param {string} font @param {string} ink @param {string} halo
   */
  text(context, text, x, y, font, ink, halo) {
    context.font = font;
    context.strokeStyle = halo;
    context.lineWidth = 3;
    context.globalAlpha = 0.7;
    context.strokeText(text, x, y);
    context.globalAlpha = 1;
    context.fillStyle = ink;
    context.fillText(text, x, y);
  }
}

/** @param {Path2D} path @param {MapFeature} feature */
function trace(path, feature) {
  for (const ring of feature.rings) {
    ring.forEach(([e, n], i) => (i ? path.lineTo(e, n) : path.moveTo(e, n)));
    if (feature.shape === 'polygon') path.closePath();
  }
}

/**
 * Take a piece of the screen for a name. @param {Set<string>} taken @param {number} x @param {number} y @param {number} width
 * @returns {boolean} it was free
 */
function claim(taken, x, y, width) {
  const cells = [];
  const row = Math.floor(y / 18);
  for (let i = Math.floor((x - width / 2) / 24); i <= Math.floor((x + width / 2) / 24); i += 1) {
    for (const j of [row - 1, row, row + 1]) cells.push(`${i},${j}`);
  }
  if (cells.some((one) => taken.has(one))) return false;
  for (const one of cells) if (one.endsWith(`,${row}`)) taken.add(one);
  return true;
}
