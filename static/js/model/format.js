// Numbers and times as text; every function takes null and never throws.

const KNOTS = 3600 / 1852;
const FEET = 1 / 0.3048;

/** @param {unknown} value @returns {value is number} */
export const isNumber = (value) => typeof value === 'number' && Number.isFinite(value);

/** @param {number|null|undefined} mps @returns {number|null} */
export const knots = (mps) => (isNumber(mps) ? mps * KNOTS : null);

/** @param {number|null|undefined} metres @returns {number|null} */
export const feet = (metres) => (isNumber(metres) ? metres * FEET : null);

/** @param {number|null|undefined} value @param {number} [digits] @param {string} [unit] */
export const number = (value, digits = 0, unit = '') =>
  isNumber(value) ? `${value.toFixed(digits)}${unit && ` ${unit}`}` : '–';

/** @param {number|null|undefined} degrees @returns {string} three digits, 001..360 */
export function bearing(degrees) {
  if (!isNumber(degrees)) return '–';
  const whole = ((Math.round(degrees) % 360) + 360) % 360;
  return `${String(whole === 0 ? 360 : whole).padStart(3, '0')}°`;
}

/** @param {number|null|undefined} utc seconds @returns {string} hh:mm:ss */
export function clock(utc) {
  if (!isNumber(utc)) return '--:--:--';
  const date = new Date(utc * 1000);
  return Number.isNaN(date.getTime()) ? '--:--:--' : date.toISOString().slice(11, 19);
}

/** @param {number|null|undefined} utc seconds @returns {string} yyyy-mm-dd */
export function date(utc) {
  if (!isNumber(utc)) return '----------';
  const made = new Date(utc * 1000);
  return Number.isNaN(made.getTime()) ? '----------' : made.toISOString().slice(0, 10);
}

/** @param {number|null|undefined} seconds @returns {string} 12 s, 3:05, 1 h 20 */
export function duration(seconds) {
  if (!isNumber(seconds)) return '–';
  const s = Math.max(0, Math.round(seconds));
  if (s < 60) return `${s} s`;
  if (s < 3600) return `${Math.floor(s / 60)}:${String(s % 60).padStart(2, '0')}`;
  return `${Math.floor(s / 3600)} h ${String(Math.floor((s % 3600) / 60)).padStart(2, '0')}`;
}

/** @param {number|null|undefined} seconds @returns {string} m:ss to go */
export function countdown(seconds) {
  if (!isNumber(seconds)) return '–';
  const s = Math.max(0, Math.round(seconds));
  return `${Math.floor(s / 60)}:${String(s % 60).padStart(2, '0')}`;
}

/** @param {number|null|undefined} metres @returns {string} */
export function distance(metres) {
  if (!isNumber(metres)) return '–';
  if (metres < 1000) return `${Math.round(metres)} m`;
  return `${(metres / 1000).toFixed(2)} km · ${(metres / 1852).toFixed(2)} NM`;
}

/** @param {number} count @returns {string} 999, 12.3k, 4.1M */
export function compact(count) {
  if (!isNumber(count)) return '–';
  if (Math.abs(count) < 1000) return String(Math.round(count));
  if (Math.abs(count) < 1e6) return `${(count / 1e3).toFixed(count < 1e5 ? 1 : 0)}k`;
  return `${(count / 1e6).toFixed(1)}M`;
}

/** @param {number} degrees @param {'lat'|'lon'} axis @returns {string} 48°43′24″N */
export function angle(degrees, axis) {
  if (!isNumber(degrees)) return '–';
  const total = Math.round(Math.abs(degrees) * 3600);
  const side = axis === 'lat' ? (degrees < 0 ? 'S' : 'N') : degrees < 0 ? 'W' : 'E';
  const d = String(Math.floor(total / 3600)).padStart(axis === 'lat' ? 2 : 3, '0');
  const m = String(Math.floor((total % 3600) / 60)).padStart(2, '0');
  return `${d}°${m}′${String(total % 60).padStart(2, '0')}″${side}`;
}
