// The tones of the alerts. A browser lets a page sound only after a click, so until then the page says "sound off".

const REPEAT_MS = 2500;

/** ALARM: two notes, again and again until acknowledged. INFORMATION: one soft note, once. */
export class Sound {
  constructor() {
    /** @type {AudioContext|null} */
    this.context = null;
    this.armed = false;
    /** @type {Map<number, string>} stage that has been sounded, by alert */
    this.sounded = new Map();
    this.lastAlarmMs = -Infinity;
  }

  /** Turn on or off; must be called from a click or a key. @returns {boolean} it is on now */
  toggle() {
    if (this.armed) {
      this.armed = false;
      this.context?.suspend().catch(() => {});
      return false;
    }
    try {
      this.context ??= new AudioContext();
      this.context.resume().catch(() => {});
      this.armed = true;
      this.note(660, 0, 0.12, 0.06);
    } catch {
      this.armed = false;
    }
    return this.armed;
  }

  /**
   * @param {import('./types.js').Alert[]} alerts live ones @param {(alert: import('./types.js').Alert) => boolean} open
   * @param {number} nowMs
   */
  update(alerts, open, nowMs) {
    const live = new Set(alerts.map((one) => one.id));
    for (const id of this.sounded.keys()) if (!live.has(id)) this.sounded.delete(id);
    let alarm = false;
    for (const alert of alerts) {
      if (alert.aural === false || !open(alert)) continue;
      if (alert.stage === 'alarm') alarm = true;
      else if (!this.sounded.has(alert.id) && this.armed) this.note(587, 0, 0.25, 0.08);
      this.sounded.set(alert.id, alert.stage);
    }
    if (alarm && this.armed && nowMs - this.lastAlarmMs >= REPEAT_MS) {
      this.lastAlarmMs = nowMs;
      for (const at of [0, 0.36]) {
        this.note(988, at, 0.16, 0.16);
        this.note(784, at + 0.17, 0.16, 0.16);
      }
    }
  }

  /** @param {number} hertz @param {number} after s @param {number} seconds @param {number} level */
  note(hertz, after, seconds, level) {
    const { context } = this;
    if (!context) return;
    const start = context.currentTime + after;
    const tone = context.createOscillator();
    const gain = context.createGain();
    tone.type = 'triangle';
    tone.frequency.value = hertz;
    gain.gain.setValueAtTime(0, start);
    gain.gain.linearRampToValueAtTime(level, start + 0.015);
    gain.gain.setValueAtTime(level, start + seconds - 0.04);
    gain.gain.linearRampToValueAtTime(0, start + seconds);
    tone.connect(gain).connect(context.destination);
    tone.start(start);
    tone.stop(start + seconds + 0.02);
  }
}
