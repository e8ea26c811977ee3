// The calls over plain HTTP. Each throws an Error whose message can be shown.

/**
 * @param {string} path @param {RequestInit} [init] @param {number} [limitMs]
 * @returns {Promise<Response>}
 */
async function call(path, init = {}, limitMs = 10000) {
  const response = await fetch(path, { ...init, signal: AbortSignal.timeout(limitMs), credentials: 'same-origin' });
  if (response.ok) return response;
  let detail = '';
  try {
    const body = await response.json();
    detail = typeof body.detail === 'string' ? body.detail : '';
  } catch {
    // no body to explain it
  }
  throw new Error(detail || `${response.status} ${response.statusText}`);
}

/**
 * Ask why the live feed cannot be opened: a browser does not tell the answer to a WebSocket. The feed refuses the pages
 * that may not write, and what may not write is answered by 403 before anything else is looked at.
 * @returns {Promise<string>} '' when the page is not refused, or the service cannot be reached
 */
export async function fetchRefusal() {
  const response = await fetch('api/v1/live', { method: 'POST', signal: AbortSignal.timeout(4000), credentials: 'same-origin' }).catch(() => null);
  if (response?.status !== 403) return '';
  const body = await response.json().catch(() => null);
  return typeof body?.detail === 'string' ? body.detail : 'refused by a proxy (403)';
}

/** @returns {Promise<any>} the airport as GeoJSON */
export const fetchAirport = async () => (await call('api/v1/airport.geojson', {}, 30000)).json();

/** @returns {Promise<import('../types.js').Alert[]>} the alerts cleared last, newest first; none when nothing is stored */
export async function fetchCleared() {
  const document = await (await call('api/v1/alerts?state=cleared&limit=20')).json();
  return Array.isArray(document?.alerts) ? document.alerts : [];
}

/** @param {number} id @param {string} by @returns {Promise<any>} */
export async function acknowledge(id, by) {
  const response = await call(`api/v1/alerts/${id}/acknowledge`, {
    method: 'POST', headers: { 'content-type': 'application/json' }, body: JSON.stringify({ by }),
  });
  return response.json().catch(() => null);
}

/** @param {string} id @param {Record<string, unknown>} change @returns {Promise<any>} */
export async function setRunway(id, change) {
  const response = await call(`api/v1/runways/${encodeURIComponent(id)}/state`, {
    method: 'PUT', headers: { 'content-type': 'application/json' }, body: JSON.stringify(change),
  });
  return response.json().catch(() => null);
}

/** @param {string} radar @returns {Promise<import('../types.js').RadarParts>} */
export const fetchParts = async (radar) => (await call(`api/v1/radars/${encodeURIComponent(radar)}/parts`)).json();

/**
 * Have other parts work on a radar's video; they may have to be compiled first.
 * @param {string} radar @param {Record<string, {name: string}>} order @returns {Promise<import('../types.js').RadarParts>}
 */
export async function chooseParts(radar, order) {
  const response = await call(`api/v1/radars/${encodeURIComponent(radar)}/parts`, {
    method: 'PUT', headers: { 'content-type': 'application/json' }, body: JSON.stringify(order),
  }, 120000);
  return response.json();
}

/** @returns {Promise<import('../types.js').ReplayState>} where the replay stands */
export const fetchReplay = async () => (await call('api/v1/replay', { cache: 'no-store' }, 4000)).json();

/**
 * @param {{playing?: boolean, speed?: number, time?: number}} order what is left out stays
 * @returns {Promise<import('../types.js').ReplayState>}
 */
export async function steerReplay(order) {
  const response = await call('api/v1/replay', {
    method: 'PUT', headers: { 'content-type': 'application/json' }, body: JSON.stringify(order),
  }, 60000);
  return response.json();
}

/**
 * @typedef {object} VideoPicture
 * @property {ImageBitmap} image
 * @property {number} west  m
 * @property {number} south
 * @property {number} east
 * @property {number} north
 * @property {number|null} time
 */

/**
 * The newest radar picture with the corners it covers; null when there is none.
 * @param {string} radar @param {import('../geo/projection.js').Projection} projection @param {string} ink
 * @returns {Promise<VideoPicture|null>}
 */
export async function fetchVideo(radar, projection, ink) {
  const response = await call(`api/v1/radars/${encodeURIComponent(radar)}/video.png?palette=${ink}`, { cache: 'no-store' });
  const corners = cornersOf(response.headers, projection);
  if (!corners) return null;
  const image = await createImageBitmap(await response.blob());
  const time = Number.parseFloat(response.headers.get('x-airside-time') ?? '');
  return { image, ...corners, time: Number.isFinite(time) ? time : null };
}

/**
 * @param {Headers} headers @param {import('../geo/projection.js').Projection} projection
 * @returns {{west: number, south: number, east: number, north: number}|null}
 */
export function cornersOf(headers, projection) {
  const of = (/** @type {string} */ name) => Number.parseFloat(headers.get(`x-airside-${name}`) ?? '');
  const metres = ['west-m', 'south-m', 'east-m', 'north-m'].map(of);
  if (metres.every(Number.isFinite)) return { west: metres[0], south: metres[1], east: metres[2], north: metres[3] };
  const degrees = ['west', 'south', 'east', 'north'].map(of);
  if (!degrees.every(Number.isFinite)) return null;
  const [west, south] = projection.toLocal(degrees[0], degrees[1]);
  const [east, north] = projection.toLocal(degrees[2], degrees[3]);
  return { west, south, east, north };
}
