// What lies over the labels: alert link lines, compass, scale bar.

/** @typedef {import('./targets.js').Scene} Scene */

/** @param {CanvasRenderingContext2D} context @param {Scene} scene */
export function drawLinks(context, scene) {
  const { picture, theme } = scene;
  for (const alert of picture.alerts.values()) {
    const points = alert.targets.map((one) => picture.targets.get(one.track)).filter((one) => one !== undefined);
    if (points.length < 2) continue;
    const alarm = alert.stage === 'alarm';
    context.strokeStyle = alarm ? theme.ink.alarm : theme.ink.info;
    context.lineWidth = alarm ? 1.8 : 1.2;
    context.setLineDash(alarm ? [] : [7, 5]);
    context.globalAlpha = 0.85;
    context.beginPath();
    points.forEach((one, i) => (i ? context.lineTo(one.x, one.y) : context.moveTo(one.x, one.y)));
    context.stroke();
    context.setLineDash([]);
    context.globalAlpha = 1;
  }
}

/** @param {number} pixels wanted at most @param {number} scale px/m @returns {number} a round number of metres */
export function roundLength(pixels, scale) {
  const most = pixels / scale;
  const power = 10 ** Math.floor(Math.log10(most));
  return ([5, 2, 1].find((one) => one * power <= most) ?? 1) * power;
}

/** @param {CanvasRenderingContext2D} context @param {Scene} scene */
export function drawFurniture(context, scene) {
  const { view, theme } = scene;
  context.strokeStyle = theme.ink.textDim;
  context.fillStyle = theme.ink.textDim;
  const metres = roundLength(150, view.scale);
  const width = metres * view.scale;
  const x = 18;
  const y = view.height - 20;
  context.lineWidth = 1.5;
  context.beginPath();
  context.moveTo(x, y - 5);
  context.lineTo(x, y);
  context.lineTo(x + width, y);
  context.lineTo(x + width, y - 5);
  context.stroke();
  context.font = '11px system-ui, sans-serif';
  context.textAlign = 'left';
  context.textBaseline = 'alphabetic';
  context.fillText(metres >= 1000 ? `${metres / 1000} km` : `${metres} m`, x + 4, y - 6);
  compass(context, view.width - 36, view.height - 50, view.rotation, theme);
}

/**
 * @param {CanvasRenderingContext2D} context @param {number} x @param {number} y @param {number} rotation rad
 * @param {import('../types.js').Theme} theme
 */
function compass(context, x, y, rotation, theme) {
  context.save();
  context.translate(x, y);
  context.rotate(-rotation);
  context.strokeStyle = theme.ink.textDim;
  context.fillStyle = theme.ink.textDim;
  context.lineWidth = 1.4;
  context.beginPath();
  context.moveTo(0, -17);
  context.lineTo(6, 12);
  context.lineTo(0, 7);
  context.lineTo(-6, 12);
  context.closePath();
  context.stroke();
  context.beginPath();
  context.moveTo(0, -17);
  context.lineTo(0, 7);
  context.lineTo(-6, 12);
  context.closePath();
  context.fill();
  context.font = '600 11px system-ui, sans-serif';
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  context.fillText('N', 0, -25);
  context.restore();
}
