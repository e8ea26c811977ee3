// The airport's GeoJSON as shapes in local metres.

import { Projection } from '../geo/projection.js';

/** @typedef {import('../types.js').MapFeature} MapFeature */
/** @typedef {import('../types.js').RunwayShape} RunwayShape */
/** @typedef {import('../types.js').AirportMap} AirportMap */

const RAD = Math.PI / 180;

/**
 * @param {any} document a FeatureCollection with AMDB kinds
 * @returns {AirportMap}
 * @throws {Error} when it is not one
 */
export function readAirport(document) {
  if (document?.type !== 'FeatureCollection' || !Array.isArray(document.features)) {
    throw new Error('the airport map is not a GeoJSON FeatureCollection');
  }
  const about = { ...document, ...(document.airport ?? {}), ...(document.properties ?? {}) };
  const projection = referenceOf(about, document.features);
  /** @type {MapFeature[]} */
  const features = [];
  for (const raw of document.features) features.push(...readFeature(raw, projection));
  return {
    icao: String(about.icao ?? ''),
    name: String(about.name ?? ''),
    attribution: String(about.attribution || '© OpenStreetMap contributors'),
    projection,
    features,
    runways: readRunways(features),
    bounds: boundsOf(features),
  };
}

/** @param {any} about @param {any[]} features @returns {Projection} */
function referenceOf(about, features) {
  const point = about.reference_point ?? about.reference ?? about;
  const pair = Array.isArray(point) ? point : Array.isArray(point?.coordinates) ? point.coordinates : null;
  const lon = Number(pair ? pair[0] : (point.longitude ?? point.lon ?? about.longitude));
  const lat = Number(pair ? pair[1] : (point.latitude ?? point.lat ?? about.latitude));
  if (Number.isFinite(lon) && Number.isFinite(lat)) return new Projection(lat, lon);
  const found = features.find((one) => /ReferencePoint/i.test(String(one?.properties?.kind)));
  if (found?.geometry?.type === 'Point') return new Projection(found.geometry.coordinates[1], found.geometry.coordinates[0]);
  throw new Error('the airport map has no reference point');
}

/** @param {any} raw @param {Projection} projection @returns {MapFeature[]} one for each part of its geometry */
function readFeature(raw, projection) {
  const geometry = raw?.geometry;
  const properties = raw?.properties ?? {};
  const local = (/** @type {number[]} */ p) => projection.toLocal(p[0], p[1]);
  /** @type {{shape: 'polygon'|'line'|'point', rings: number[][][]}[]} */
  const parts = [];
  const add = (/** @type {any} */ g) => {
    const c = g?.coordinates;
    switch (g?.type) {
      case 'Polygon': parts.push({ shape: 'polygon', rings: oriented(c.map((/** @type {any} */ r) => r.map(local))) }); break;
      case 'MultiPolygon': for (const one of c) add({ type: 'Polygon', coordinates: one }); break;
      case 'LineString': parts.push({ shape: 'line', rings: [c.map(local)] }); break;
      case 'MultiLineString': for (const one of c) add({ type: 'LineString', coordinates: one }); break;
      case 'Point': parts.push({ shape: 'point', rings: [[local(c)]] }); break;
      case 'MultiPoint': for (const one of c) add({ type: 'Point', coordinates: one }); break;
      case 'GeometryCollection': for (const one of g.geometries ?? []) add(one); break;
      default: break;
    }
  };
  add(geometry);
  return parts.filter((part) => part.rings[0]?.length).map((part) => ({
    id: String(raw.id ?? properties.id ?? ''),
    kind: String(properties.kind ?? properties.feattype ?? ''),
    name: String(properties.name ?? properties.ref ?? ''),
    properties,
    ...part,
    centre: centreOf(part.shape, part.rings[0]),
  }));
}

/** Outer ring one way, holes the other, so that shapes can be filled together. @param {number[][][]} rings */
function oriented(rings) {
  return rings.map((ring, i) => ((area(ring) > 0) === (i === 0) ? ring : [...ring].reverse()));
}

/** @param {number[][]} ring @returns {number} signed area, m^2 */
export function area(ring) {
  let sum = 0;
  for (let i = 0, j = ring.length - 1; i < ring.length; j = i, i += 1) {
    sum += ring[j][0] * ring[i][1] - ring[i][0] * ring[j][1];
  }
  return sum / 2;
}

/** @param {'polygon'|'line'|'point'} shape @param {number[][]} ring @returns {{e: number, n: number}} */
function centreOf(shape, ring) {
  if (shape === 'line') return pointAlong(ring, 0.5);
  let e = 0;
  let n = 0;
  const open = ring.length > 1 && shape === 'polygon' ? ring.slice(0, -1) : ring;
  for (const [x, y] of open) {
    e += x;
    n += y;
  }
  return { e: e / open.length, n: n / open.length };
}

/** @param {number[][]} line @param {number} share 0..1 @returns {{e: number, n: number}} */
export function pointAlong(line, share) {
  let total = 0;
  for (let i = 1; i < line.length; i += 1) total += Math.hypot(line[i][0] - line[i - 1][0], line[i][1] - line[i - 1][1]);
  let left = total * share;
  for (let i = 1; i < line.length; i += 1) {
    const step = Math.hypot(line[i][0] - line[i - 1][0], line[i][1] - line[i - 1][1]);
    if (left <= step && step > 0) {
      const f = left / step;
      return { e: line[i - 1][0] + f * (line[i][0] - line[i - 1][0]), n: line[i - 1][1] + f * (line[i][1] - line[i - 1][1]) };
    }
    left -= step;
  }
  const last = line[line.length - 1];
  return { e: last[0], n: last[1] };
}

/** @param {MapFeature[]} features @returns {RunwayShape[]} */
export function readRunways(features) {
  /** @type {Map<string, MapFeature[]>} */
  const strips = new Map();
  for (const one of features) {
    if (one.kind !== 'RunwayElement' || one.shape !== 'polygon') continue;
    const id = String(one.properties.runway ?? one.properties.idrwy ?? (one.name || one.id));
    strips.set(id, [...(strips.get(id) ?? []), one]);
  }
  const thresholds = features.filter((one) => one.kind === 'RunwayThreshold');
  return [...strips].map(([id, parts]) => {
    const axis = longAxis(parts.map((one) => one.rings[0]));
    const names = id.split('/');
    /** @type {[import('../types.js').RunwayEndShape, import('../types.js').RunwayEndShape]} */
    const ends = [
      { designator: names[0] ?? '', e: axis.a[0], n: axis.a[1], heading: axis.heading },
      { designator: names[1] ?? '', e: axis.b[0], n: axis.b[1], heading: axis.heading + Math.PI },
    ];
    if (misfit(ends[0].designator, axis.heading) > misfit(ends[0].designator, axis.heading + Math.PI)) {
      [ends[0].designator, ends[1].designator] = [ends[1].designator, ends[0].designator];
    }
    for (const end of ends) {
      const at = thresholds.find((one) => designatorOf(one) === end.designator
        && (one.properties.runway === undefined || String(one.properties.runway) === id));
      if (at) [end.e, end.n] = [at.centre.e, at.centre.n];
    }
    return { id, ends, width: axis.width, rings: parts.flatMap((one) => one.rings) };
  });
}

/** @param {MapFeature} threshold @returns {string} */
function designatorOf(threshold) {
  return String(threshold.properties.designator ?? threshold.properties.idthr ?? threshold.name);
}

/** @param {string} designator @param {number} heading rad @returns {number} rad between the name and the heading */
function misfit(designator, heading) {
  const named = Number.parseInt(designator, 10) * 10 * RAD;
  if (!Number.isFinite(named)) return 0;
  return Math.abs(Math.atan2(Math.sin(named - heading), Math.cos(named - heading)));
}

/**
 * The long axis of a polygon by its second moments of area (vertices alone would lean to where they are dense).
 * @param {number[][][]} rings @returns {{a: number[], b: number[], heading: number, width: number}}
 */
function longAxis(rings) {
  const points = rings.flat();
  const [oe, on] = points[0];
  let [w, me, mn, ee, nn, en] = [0, 0, 0, 0, 0, 0];
  for (const ring of rings) {
    for (let i = 0, j = ring.length - 1; i < ring.length; j = i, i += 1) {
      const [x0, y0, x1, y1] = [ring[j][0] - oe, ring[j][1] - on, ring[i][0] - oe, ring[i][1] - on];
      const cross = x0 * y1 - x1 * y0;
      w += cross / 2;
      me += (cross * (x0 + x1)) / 6;
      mn += (cross * (y0 + y1)) / 6;
      ee += (cross * (x0 * x0 + x0 * x1 + x1 * x1)) / 12;
      nn += (cross * (y0 * y0 + y0 * y1 + y1 * y1)) / 12;
      en += (cross * (x0 * y1 + 2 * x0 * y0 + 2 * x1 * y1 + x1 * y0)) / 24;
    }
  }
  if (w) {
    [me, mn] = [me / w, mn / w];
    [ee, nn, en] = [ee / w - me * me, nn / w - mn * mn, en / w - me * mn];
  }
  [me, mn] = [me + oe, mn + on];
  const heading = 0.5 * Math.atan2(2 * en, nn - ee);
  const [ue, un] = [Math.sin(heading), Math.cos(heading)];
  let [low, high, left, right] = [Infinity, -Infinity, Infinity, -Infinity];
  for (const [e, k] of points) {
    const along = (e - me) * ue + (k - mn) * un;
    const across = (e - me) * un - (k - mn) * ue;
    low = Math.min(low, along);
    high = Math.max(high, along);
    left = Math.min(left, across);
    right = Math.max(right, across);
  }
  const mid = (left + right) / 2;
  const at = (/** @type {number} */ along) => [me + along * ue + mid * un, mn + along * un - mid * ue];
  return { a: at(low), b: at(high), heading, width: right - left };
}

/** @param {MapFeature[]} features @returns {AirportMap['bounds']} */
function boundsOf(features) {
  const wanted = features.filter((one) => /^(Runway|Taxiway|Apron)/.test(one.kind));
  const bounds = { west: Infinity, east: -Infinity, south: Infinity, north: -Infinity };
  for (const { rings } of wanted.length ? wanted : features) {
    for (const ring of rings) {
      for (const [e, n] of ring) {
        bounds.west = Math.min(bounds.west, e);
        bounds.east = Math.max(bounds.east, e);
        bounds.south = Math.min(bounds.south, n);
        bounds.north = Math.max(bounds.north, n);
      }
    }
  }
  return Number.isFinite(bounds.west) ? bounds : { west: -2000, east: 2000, south: -1500, north: 1500 };
}
