// What a label says.

import { feet, isNumber, knots } from './format.js';
import { STANDING_MPS } from './motion.js';

/** @typedef {import('../types.js').Track} Track */

/** @param {Track} track @returns {string} its ASTERIX track number; its id where it has none */
export const numberOf = (track) => `#${track.number ?? track.id}`;

/** @param {Track} track @returns {string} the name a controller calls it by: callsign, else the track number */
export const nameOf = (track) => (track.callsign && track.callsign.trim()) || numberOf(track);

/** A target missed for less than this is shown as seen: one turn without an echo is ordinary, s. */
export const COAST_SHOWN_S = 1.5;

/** @param {Track} track @param {number} coastedS seconds that it has coasted @returns {boolean} to be shown as coasting */
export const isCoasting = (track, coastedS) => track.phase === 'coasting' && coastedS >= COAST_SHOWN_S;

/** @param {Track} track @returns {boolean} */
export const isAirborne = (track) => track.on_ground === false;

/** @param {Track} track @returns {boolean} it does not move */
export const isStanding = (track) => !isNumber(track.speed_mps) || track.speed_mps < STANDING_MPS;

/** @param {Track} track @returns {'aircraft'|'vehicle'|'unknown'} */
export function classOf(track) {
  const name = String(track.class ?? '').toLowerCase();
  return name === 'aircraft' || name === 'vehicle' ? name : 'unknown';
}

/**
 * @param {Track} track @param {'short'|'full'} level @param {number} coastedS seconds without a measurement
 * @returns {import('../types.js').LabelText}
 */
export function labelText(track, level, coastedS) {
  const coasting = isCoasting(track, coastedS);
  const first = `${nameOf(track)}${track.phase === 'tentative' ? '?' : ''}`;
  const mark = track.simulated ? 'SIM' : '';
  if (level === 'short') return { first, second: coasting ? `C${Math.round(coastedS)}` : '', mark: '' };
  /** @type {string[]} */
  const parts = [];
  if (coasting) parts.push(`COAST ${Math.round(coastedS)} s`);
  if (isAirborne(track) && isNumber(track.altitude_m)) parts.push(`${Math.round((feet(track.altitude_m) ?? 0) / 10) * 10} ft`);
  const speed = knots(track.speed_mps);
  if (speed !== null && !isStanding(track)) parts.push(`${Math.round(speed)} kt`);
  const place = track.runway ? `RWY ${track.runway}` : shortPlace(track.zone);
  if (place && !coasting) parts.push(place);
  return { first, second: parts.join('  '), mark };
}

/** @param {Track} track @returns {string} where it is, in words a controller uses; map ids are not words */
export function placeOf(track) {
  if (track.runway) return `RWY ${track.runway}`;
  const zone = String(track.zone ?? '').trim();
  return zone.includes('/') || zone.includes(':') ? '' : zone;
}

/** @param {string|null|undefined} zone @returns {string} a taxiway or stand name that fits a label */
export function shortPlace(zone) {
  if (!zone) return '';
  const name = String(zone).trim();
  return name.length <= 6 && !/[:/]/.test(name) && !/^\d{4,}$/.test(name) ? name : '';
}
