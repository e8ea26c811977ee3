// Who is near a holding position.

/** @typedef {import('../types.js').MapFeature} MapFeature */

/**
 * Distance within which a target belongs to a holding position, m: half of the longest aircraft (38), since its middle
 * is shown and its nose stands at the bar, and a stop of up to 37 m short of it.
 */
export const HOLD_REACH_M = 75;

/** @param {number[][]} line @param {number} e @param {number} n @returns {number} m; of a line of one point, to that point */
export function distanceToLine(line, e, n) {
  let least = Infinity;
  for (let i = 0; i < line.length; i += 1) {
    const [e0, n0] = line[Math.max(0, i - 1)];
    const [de, dn] = [line[i][0] - e0, line[i][1] - n0];
    const squared = de * de + dn * dn;
    const share = squared > 0 ? Math.min(1, Math.max(0, ((e - e0) * de + (n - n0) * dn) / squared)) : 0;
    least = Math.min(least, Math.hypot(e0 + share * de - e, n0 + share * dn - n));
  }
  return least;
}

/**
 * @param {MapFeature[]} holds @param {{east_m: number, north_m: number}} track
 * @returns {boolean} it is within the reach of one of them
 */
export const isNearHold = (holds, track) =>
  holds.some(({ rings }) => distanceToLine(rings[0], track.east_m, track.north_m) <= HOLD_REACH_M);
