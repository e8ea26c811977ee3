import assert from 'node:assert/strict';
import { test } from 'node:test';

import { Projection } from '../../../static/js/geo/projection.js';
import { Viewport } from '../../../static/js/geo/viewport.js';
import { rangeBearing } from '../../../static/js/input/ruler.js';
import { area, readAirport } from '../../../static/js/model/airport.js';

const near = (a, b, tolerance, what) => assert.ok(Math.abs(a - b) <= tolerance, `${what ?? ''} ${a} is not ${b} within ${tolerance}`);

test('the projection agrees with the azimuthal equidistant frame of the service', () => {
  // reference values from pyproj: +proj=aeqd +lat_0=48.7277723 +lon_0=2.3594929 +datum=WGS84
  const orly = new Projection(48.7277723, 2.3594929);
  for (const [lon, lat, east, north] of [[2.40, 48.74, 2979.374, 1360.5678], [2.31, 48.7, -3643.1842, -3087.2137], [2.3594929, 48.7277723, 0, 0]]) {
    const [e, n] = orly.toLocal(lon, lat);
    near(e, east, 0.05, 'east');
    near(n, north, 0.05, 'north');
  }
});

test('the projection has an inverse, also across the date line', () => {
  for (const [latitude, longitude] of [[48.7, 2.4], [-36.8, 179.99], [0, -179.999], [78.2, 15.5]]) {
    const projection = new Projection(latitude, longitude);
    for (const [east, north] of [[0, 0], [3500, -2100], [-4200, 5000]]) {
      const [lon, lat] = projection.toGeodetic(east, north);
      const [e, n] = projection.toLocal(lon, lat);
      near(e, east, 0.01);
      near(n, north, 0.01);
      const [e2, n2] = projection.toLocal(lon > 180 ? lon - 360 : lon < -180 ? lon + 360 : lon, lat);
      near(e2, east, 0.01);
      near(n2, north, 0.01);
    }
  }
});

function view(rotation = 0) {
  const made = new Viewport();
  made.resize(1200, 800);
  made.centre(100, -50, 0.4);
  made.setRotation(rotation);
  return made;
}

test('screen and metres are inverse under pan, zoom and rotation', () => {
  for (const rotation of [0, 0.7, 3, 5.9]) {
    const v = view(rotation);
    v.zoomAt(1.7, 200, 90);
    v.pan(33, -71);
    for (const [e, n] of [[0, 0], [812, -400], [-3000, 2500]]) {
      const [x, y] = v.toScreen(e, n);
      const [e2, n2] = v.toLocal(x, y);
      near(e2, e, 1e-6);
      near(n2, n, 1e-6);
    }
  }
});

test('north is up, east is right; rotated to 090, east is up', () => {
  const v = view();
  const [x0, y0] = v.toScreen(100, -50);
  assert.deepEqual([x0, y0], [600, 400]);
  near(v.toScreen(200, -50)[0], 640, 1e-9);
  near(v.toScreen(100, 50)[1], 360, 1e-9);
  v.setRotation(Math.PI / 2);
  near(v.toScreen(200, -50)[1], 360, 1e-9);
});

test('zooming keeps the point under the cursor, and the scale stays in its bounds', () => {
  const v = view(1.1);
  const before = v.toLocal(321, 654);
  v.zoomAt(2.5, 321, 654);
  const after = v.toLocal(321, 654);
  near(after[0], before[0], 1e-6);
  near(after[1], before[1], 1e-6);
  for (let i = 0; i < 80; i += 1) v.zoomAt(2, 10, 10);
  assert.ok(v.scale <= 20);
  for (let i = 0; i < 80; i += 1) v.zoomAt(0.5, 10, 10);
  assert.ok(v.scale > 0.01);
});

test('fitting shows all four corners at any rotation', () => {
  const box = { west: -2000, east: 1800, south: -900, north: 1400 };
  for (const rotation of [0, 0.5, 1.6, 4]) {
    const v = view(rotation);
    v.fit(box);
    for (const e of [box.west, box.east]) {
      for (const n of [box.south, box.north]) {
        const [x, y] = v.toScreen(e, n);
        assert.ok(x >= 0 && x <= 1200 && y >= 0 && y <= 800, `${x} ${y}`);
      }
    }
  }
});

test('range and bearing', () => {
  const { metres, degrees } = rangeBearing({ id: null, e: 0, n: 0 }, { id: null, e: -300, n: 400 });
  near(metres, 500, 1e-9);
  near(degrees, 323.13, 0.01);
});

const projection = new Projection(50, 8);
const ring = (points) => points.map(([e, n]) => projection.toGeodetic(e, n));
const strip = ring([[-1000, -22], [1000, -22], [1000, 22], [-1000, 22], [-1000, -22]]);

test('a runway is read from its polygon and its thresholds', () => {
  const map = readAirport({
    type: 'FeatureCollection', icao: 'XXXX', name: 'Nowhere', reference: { latitude: 50, longitude: 8 },
    features: [
      { type: 'Feature', id: 'r', properties: { kind: 'RunwayElement', runway: '09/27', name: '09/27' }, geometry: { type: 'Polygon', coordinates: [strip] } },
      { type: 'Feature', id: 't', properties: { kind: 'RunwayThreshold', runway: '09/27', designator: '27' }, geometry: { type: 'Point', coordinates: projection.toGeodetic(800, 0) } },
      { type: 'Feature', id: 'x', properties: { kind: 'Building' }, geometry: null },
    ],
  });
  assert.equal(map.runways.length, 1);
  const [runway] = map.runways;
  near(runway.width, 44, 0.1);
  const west = runway.ends.find((one) => one.designator === '09');
  const east = runway.ends.find((one) => one.designator === '27');
  near(west.e, -1000, 0.5);
  near(east.e, 800, 0.5);
  near(map.bounds.west, -1000, 0.5);
});

test('holes run the other way than the outline, whatever the file says', () => {
  const outer = ring([[0, 0], [0, 100], [100, 100], [100, 0], [0, 0]]);
  const inner = ring([[20, 20], [20, 60], [60, 60], [60, 20], [20, 20]]);
  const map = readAirport({
    type: 'FeatureCollection', reference: { latitude: 50, longitude: 8 },
    features: [{ type: 'Feature', properties: { kind: 'ApronElement' }, geometry: { type: 'MultiPolygon', coordinates: [[outer, inner]] } }],
  });
  const [a, b] = map.features[0].rings.map(area);
  assert.ok(a > 0 && b < 0);
});

test('a document that is no map, or has no reference point, is refused with words', () => {
  assert.throws(() => readAirport(null), /FeatureCollection/);
  assert.throws(() => readAirport({ type: 'FeatureCollection', features: [] }), /reference point/);
});
