// The live feed: connect, greet, subscribe, resume, and never trust silence.

export const SUBPROTOCOL = 'airside.v1.json';
const FIRST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 8000;
const TOPICS = ['tracks', 'alerts', 'status'];

/** @typedef {'connecting'|'live'|'waiting'} LinkState */

/**
 * @typedef {object} LiveOptions
 * @property {string} url
 * @property {(message: Record<string, any>) => void} onMessage  every message but the greetings
 * @property {(state: LinkState) => void} onState
 * @property {() => void} [onRefused]  a connection ended before it was open
 * @property {() => {epoch: string, seq: number}|null} position  what has been taken in, to resume from
 * @property {(url: string, protocol: string) => WebSocket} [open]
 * @property {() => number} [random]
 */

/** One connection kept alive for the life of the page. */
export class LiveFeed {
  /** @param {LiveOptions} options */
  constructor(options) {
    this.options = options;
    this.open = options.open ?? ((url, protocol) => new WebSocket(url, protocol));
    /** @type {WebSocket|null} */
    this.socket = null;
    this.failures = 0;
    /** seconds between pictures, from the welcome */
    this.periodS = 1;
    this.lastMessageMs = -Infinity;
    this.openedMs = -Infinity;
    this.counters = { messages: 0, unreadable: 0, connects: 0, errors: 0 };
    /** @type {ReturnType<typeof setTimeout>|undefined} */
    this.timer = undefined;
    this.stopped = false;
  }

  /** Connect, and go on connecting until `stop`. */
  start() {
    this.stopped = false;
    this.connect();
  }

  /** End the connection for good. */
  stop() {
    this.stopped = true;
    clearTimeout(this.timer);
    this.drop();
  }

  /** Give up this connection and make a new one at once (a gap was seen, or the feed fell silent). */
  restart() {
    if (this.stopped) return;
    this.drop();
    this.again(0);
  }

  drop() {
    const socket = this.socket;
    this.socket = null;
    if (!socket) return;
    socket.onopen = socket.onmessage = socket.onclose = socket.onerror = null;
    try {
      socket.close();
    } catch {
      // it was not open
    }
  }

  connect() {
    clearTimeout(this.timer);
    this.timer = undefined;
    this.options.onState('connecting');
    this.counters.connects += 1;
    this.openedMs = performance.now();
    let socket;
    try {
      socket = this.open(this.options.url, SUBPROTOCOL);
    } catch {
      this.again();
      return;
    }
    this.socket = socket;
    let opened = false;
    socket.onopen = () => {
      opened = true;
      const resume = this.options.position();
      this.send(resume ? { type: 'hello', resume } : { type: 'hello' });
    };
    socket.onmessage = (event) => this.take(event.data);
    socket.onclose = (event) => {
      if (this.socket !== socket) return;
      this.socket = null;
      if (!opened) this.options.onRefused?.();
      this.again(event.code === 1013 ? LONGEST_WAIT_MS : undefined);
    };
    socket.onerror = () => {};
  }

  /** @param {number} [waitMs] */
  again(waitMs) {
    if (this.stopped || this.timer !== undefined) return;
    this.options.onState('waiting');
    const random = this.options.random ?? Math.random;
    const wait = waitMs ?? Math.min(LONGEST_WAIT_MS, FIRST_WAIT_MS * 2 ** this.failures) * (0.75 + 0.5 * random());
    this.failures = Math.min(8, this.failures + 1);
    this.timer = setTimeout(() => this.connect(), wait);
  }

  /** @param {Record<string, unknown>} message */
  send(message) {
    if (this.socket?.readyState === 1) this.socket.send(JSON.stringify(message));
  }

  /** @param {unknown} data */
  take(data) {
    this.lastMessageMs = performance.now();
    this.counters.messages += 1;
    /** @type {Record<string, any>} */
    let message;
    try {
      message = JSON.parse(String(data));
    } catch {
      this.counters.unreadable += 1;
      return;
    }
    if (!message || typeof message !== 'object') {
      this.counters.unreadable += 1;
      return;
    }
    if (message.type === 'welcome') {
      if (message.period_s > 0) this.periodS = message.period_s;
      this.failures = 0;
      this.options.onMessage(message);
      this.send({ id: 1, type: 'subscribe', topics: TOPICS });
      this.options.onState('live');
      return;
    }
    this.options.onMessage(message);
  }

  /**
   * Ask now and then: a socket that is open but says nothing is given up.
   * @param {number} nowMs
   */
  watch(nowMs) {
    if (!this.socket || this.timer !== undefined) return;
    const quiet = nowMs - Math.max(this.lastMessageMs, this.openedMs);
    if (quiet > Math.max(5000, 4000 * this.periodS)) this.restart();
  }
}
