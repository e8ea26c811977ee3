// The palettes by name. To add one is to add a file here and its name in settings.js.

import { contrast } from './contrast.js';
import { day } from './day.js';
import { night } from './night.js';

/** @type {Record<string, import('../types.js').Theme>} */
export const themes = { night, day, contrast };

/** @param {string} name @returns {import('../types.js').Theme} */
export function applyTheme(name) {
  const theme = themes[name] ?? night;
  const root = document.documentElement;
  for (const [key, value] of Object.entries(theme.css)) root.style.setProperty(key, value);
  root.dataset.palette = theme.name;
  root.style.colorScheme = theme.name === 'day' ? 'light' : 'dark';
  return theme;
}
