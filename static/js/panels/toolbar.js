// The controls under the picture, bound to the settings.

import { HISTORIES, LABELS, PALETTES, VECTORS, next } from '../settings.js';
import { byId, el } from './dom.js';

/** @typedef {import('../settings.js').Settings} Settings */

/**
 * @param {Settings} settings
 * @returns {Record<'vector'|'history'|'labels'|'palette'|'radar', () => void>} what the keys do
 */
export function bindToolbar(settings) {
  group('tool-vector', 'Speed vector, seconds', VECTORS, (value) => (value ? `${value}` : 'off'), (value) => settings.set({ vector: value }), () => settings.choices.vector, settings);
  group('tool-history', 'History dots', HISTORIES, (value) => (value ? `${value}` : 'off'), (value) => settings.set({ history: value }), () => settings.choices.history, settings);
  group('tool-labels', 'Labels', LABELS, String, (value) => settings.set({ labels: value }), () => settings.choices.labels, settings);
  group('tool-palette', 'Palette', PALETTES, String, (value) => settings.set({ palette: value }), () => settings.choices.palette, settings);
  const radar = byId('tool-radar');
  const opacity = /** @type {HTMLInputElement} */ (byId('tool-opacity'));
  radar.addEventListener('click', () => settings.set({ radar: !settings.choices.radar }));
  opacity.addEventListener('input', () => settings.set({ radarOpacity: Number(opacity.value) / 100, radar: true }));
  settings.watch((choices) => {
    radar.setAttribute('aria-pressed', String(choices.radar));
    opacity.value = String(Math.round(choices.radarOpacity * 100));
  });
  return {
    vector: () => settings.set({ vector: next(VECTORS, settings.choices.vector) }),
    history: () => settings.set({ history: next(HISTORIES, settings.choices.history) }),
    labels: () => settings.set({ labels: next(LABELS, settings.choices.labels) }),
    palette: () => settings.set({ palette: next(PALETTES, settings.choices.palette) }),
    radar: () => settings.set({ radar: !settings.choices.radar }),
  };
}

/**
 * A row of buttons of which one is chosen.
 * @template T
 * @param {string} id @param {string} label @param {readonly T[]} values @param {(value: T) => string} words
 * @param {(value: T) => void} choose @param {() => T} current @param {Settings} settings
 */
function group(id, label, values, words, choose, current, settings) {
  const box = byId(id);
  box.setAttribute('role', 'group');
  box.setAttribute('aria-label', label);
  const buttons = values.map((value) => el('button', { type: 'button', text: words(value), onclick: () => choose(value) }));
  box.append(...buttons);
  settings.watch(() => {
    buttons.forEach((button, i) => button.setAttribute('aria-pressed', String(values[i] === current())));
  });
}
