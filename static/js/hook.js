// `window.airside`: read-only figures for tests and for curious people. It can change nothing.

/**
 * @param {import('./display.js').Display} display @param {import('./feed/live.js').LiveFeed} feed
 * @param {import('./panels/status.js').StatusBar} status @param {import('./panels/replay.js').ReplayBar} replay
 */
export function exposeHook(display, feed, status, replay) {
  const { picture, view, stage } = display;
  const hook = {
    /** counts of everything */
    counts: () => ({
      targets: picture.targets.size, alerts: picture.alerts.size, cleared: picture.cleared.length, runways: picture.runways.size,
      sensors: picture.sensors.size, labels: display.labels.shown, labelsHidden: display.labels.hidden, frames: stage.frames,
      drawErrors: stage.errors, radarPictures: display.radar.pictures.size,
      feed: { ...feed.counters }, picture: { ...picture.counters },
    }),
    /** where each target is drawn: metres and screen */
    positions: () => [...picture.targets.values()].map(({ track, e, n, x, y }) => ({ id: track.id, e, n, x, y })),
    /** the labels that are drawn: whose, what they say, and their box on the screen */
    labels: () => [...picture.targets.values()].filter((one) => display.labels.isDrawn(one, view)).map(({ track, label, x, y }) => ({
      id: track.id, first: label.text?.first, second: label.text?.second, x: x + label.sx, y: y + label.sy, w: label.w, h: label.h,
    })),
    /** the view */
    view: () => ({ east: view.east, north: view.north, scale: view.scale, rotation: view.rotation, width: view.width, height: view.height }),
    alerts: () => picture.liveAlerts().map(({ id, stage: level, state }) => ({ id, stage: level, state })),
    choices: () => ({ ...display.settings.choices }),
    selected: () => display.selected,
    health: () => status.health,
    frameCostMs: () => stage.costMs,
    lastError: () => stage.lastError,
    position: () => picture.position(),
    time: () => picture.time,
    replay: () => (replay.state ? { ...replay.state } : null),
  };
  Object.defineProperty(window, 'airside', { value: Object.freeze(hook), writable: false });
}
