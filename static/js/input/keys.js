// The keyboard. Letters act anywhere but in a field; arrows act unless a control needs them.

/**
 * @typedef {object} KeyActions
 * @property {(dx: number, dy: number) => void} pan
 * @property {(factor: number) => void} zoom
 * @property {(degrees: number) => void} rotate
 * @property {() => void} northUp
 * @property {() => void} home
 * @property {() => void} acknowledge
 * @property {() => void} vector
 * @property {() => void} history
 * @property {() => void} labels
 * @property {() => void} palette
 * @property {() => void} radar
 * @property {() => void} search
 * @property {() => void} list
 * @property {() => void} measure
 * @property {() => void} follow
 * @property {() => void} sound
 * @property {() => boolean} play  false when nothing is replayed
 * @property {(seconds: number) => boolean} skip
 * @property {(step: number) => boolean} speed
 * @property {() => void} help
 * @property {() => void} escape
 */

/** Every key with its words: the help overlay is made from this. @type {[string, string][]} */
export const KEYS = [
  ['← ↑ → ↓', 'pan'], ['+ −', 'zoom'], ['q e', 'rotate'], ['n', 'north up'], ['0', 'whole airport'], ['a', 'acknowledge: alarms first, then the oldest'],
  ['v', 'speed vector'], ['h', 'history dots'], ['l', 'labels: off, short, full'], ['p', 'palette: night, day, contrast'],
  ['r', 'radar video'], ['/', 'search a target'], ['t', 'target list, ↑ ↓ through it'], ['m', 'measure range and bearing'], ['f', 'follow the selected target'],
  ['s', 'sound on or off'], ['Tab', 'through alerts and controls'], ['Esc', 'close, deselect, end measuring'], ['?', 'this help'],
];
/** @type {[string, string][]} */
export const MOUSE = [
  ['drag', 'pan'], ['wheel', 'zoom at the cursor'], ['Shift + drag, wheel', 'rotate'], ['click', 'select a target; the dotted circle holds its position with 95 %'],
  ['drag a label', 'pin it'], ['double click a label', 'release it'],
];

/** Keys that do something in a replay only. @type {[string, string][]} */
export const REPLAY_KEYS = [
  ['space', 'play, pause'], [', .', '10 s back, 10 s on'], ['[ ]', 'slower, faster'],
];

const PAN_PX = 80;
export const SKIP_S = 10;

/**
 * @param {KeyboardEvent} event @param {KeyActions} act
 * @returns {boolean} the key was used
 */
export function onKey(event, act) {
  if (event.ctrlKey || event.metaKey || event.altKey) return false;
  const focus = event.target instanceof HTMLElement ? event.target : null;
  if (event.key === 'Escape') {
    focus?.blur();
    act.escape();
    return true;
  }
  if (focus?.matches('input:not([type=range]), select, textarea, [contenteditable]')) return false;
  const ranged = Boolean(focus?.matches('input[type=range]'));
  switch (event.key) {
    case 'ArrowLeft': if (ranged) return false; act.pan(PAN_PX, 0); return true;
    case 'ArrowRight': if (ranged) return false; act.pan(-PAN_PX, 0); return true;
    case 'ArrowUp': if (ranged) return false; act.pan(0, PAN_PX); return true;
    case 'ArrowDown': if (ranged) return false; act.pan(0, -PAN_PX); return true;
    case '+': case '=': act.zoom(1.25); return true;
    case '-': case '−': act.zoom(0.8); return true;
    case '0': act.home(); return true;
    case '/': act.search(); return true;
    case '?': act.help(); return true;
    case ' ': return focus?.matches('button, a, summary, select, [role=button]') ? false : act.play();
    case ',': return act.skip(-SKIP_S);
    case '.': return act.skip(SKIP_S);
    case '[': return act.speed(-1);
    case ']': return act.speed(1);
    default: break;
  }
  /** @type {Record<string, () => void>} */
  const letters = {
    q: () => act.rotate(-10), e: () => act.rotate(10), n: act.northUp, a: act.acknowledge, v: act.vector, h: act.history,
    l: act.labels, p: act.palette, r: act.radar, t: act.list, m: act.measure, f: act.follow, s: act.sound,
  };
  const letter = letters[event.key.toLowerCase()];
  if (!letter) return false;
  letter();
  return true;
}
