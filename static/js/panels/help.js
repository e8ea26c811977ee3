// The help overlay: keys, mouse, and what the signs mean.

import { KEYS, MOUSE, REPLAY_KEYS } from '../input/keys.js';
import { byId, el } from './dom.js';

/** @type {[string, string][]} */
const SIGNS = [
  ['✈', 'aircraft; true size when zoomed in'], ['■', 'vehicle'], ['◇', 'not identified'], ['○', 'aircraft, heading unknown'],
  ['┄ hollow', 'coasting: not seen, age in the label; or tentative, with ?'], ['SIM', 'simulated target'], ['◐', 'degraded: something is left out; the sensor list says what'],
  ['◆ dashed ring', 'information alert'], ['▲ double ring', 'alarm; flashes until acknowledged'],
];

/** Fill the dialog once. @returns {{toggle: () => void, close: () => void}} */
export function makeHelp() {
  const dialog = /** @type {HTMLDialogElement} */ (byId('help'));
  for (const [id, rows] of /** @type {[string, [string, string][]][]} */ ([['help-keys', KEYS], ['help-mouse', MOUSE], ['help-replay', REPLAY_KEYS], ['help-signs', SIGNS]])) {
    byId(id).append(...rows.flatMap(([key, words]) => [el('dt', { text: key }), el('dd', { text: words })]));
  }
  const toggle = () => (dialog.open ? dialog.close() : dialog.showModal());
  byId('help-toggle').addEventListener('click', toggle);
  dialog.addEventListener('click', (event) => {
    if (event.target === dialog) dialog.close();
  });
  return { toggle, close: () => dialog.close() };
}
