"""When the beam of a radar passes each track, and whether all that its gate can hold has been delivered by then."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.kernels.compiled import allocating
from pipeline.sites import RadarSite
from pipeline.tables.arrays import Array, Floats

TWO_PI = 2 * math.pi

LEAST_TURN, MOST_TURNS = 64, 4
"""A sector of less than this fraction of a turn, or of more turns, does not teach the period: too short to time, or the
feed was interrupted."""

PERIOD_FACTOR = 4.0
"""A measured period more than so many times longer or shorter than the radar's nominal one is a fault of its times."""

PERIOD_GAIN = 0.25
"""Fraction of a new measurement of the period that is taken per turn: antennas change speed in wind within some
turns."""

HELD_BACK_TURNS = 0.5
"""Turns by which the newest sweep may be ahead of the row that is closed: a large echo that is open holds it back."""

AHEAD_TURNS = 0.1
"""Turns by which plots may say that the antenna is ahead of the newest sweep; their times are those of centroids."""

ACCELERATION_SPREAD = 4.0
"""m^2/s^3, times the cube of the time ahead: variance of the position of a target that accelerates at random, 2 m in
the first second. Only tells when all that a gate can hold has been delivered."""

EXTENT_VARIANCE = 0.1
"""Variance of a centroid, as a fraction of the squared length of its target: a standard deviation of a third of it."""

RANGE_MARGIN_CELLS = 2.0
"""Range cells by which the gate reaches further: an echo is wider than its target by about one at either end."""

MOST_GUARD = 0.25
"""rad to both sides that a look waits for at most: a loose track near the radar is not worth a long delay."""

LEAST_DISTANCE = 1.0
"""m; a target nearer to the radar is taken to be this far when its gate is turned into an angle."""

MARGIN_ROWS = 1.0
"""Rows by which the gate is wider, for azimuths are rounded down to rows."""


@dataclass(slots=True)
class RadarClock:
    """One radar's antenna as seen so far. period: s a turn. closed_to: absolute row that is closed.

    time: UTC s at which the antenna passed that row; the newest sweep, of UTC `newest`, may be well past it, since a
    large echo still open holds the row back.
    """

    period: float
    closed_to: int = 0
    time: float = -np.inf
    newest: float = -np.inf

    def heard(self, closed_to: int, newest: float, azimuths: int, nominal: float) -> None:
        """A sector was closed; the period is learnt from what passed since the last."""
        rows, passed = closed_to - self.closed_to, newest - self.newest
        if math.isfinite(passed) and passed > 0 and azimuths // LEAST_TURN <= rows <= MOST_TURNS * azimuths:
            turn = passed * azimuths / rows
            if nominal / PERIOD_FACTOR <= turn <= nominal * PERIOD_FACTOR:
                self.period += (turn - self.period) * min(1.0, PERIOD_GAIN * rows / azimuths)
        due = min(self.time + rows * self.period / azimuths, newest)
        self.time = due if due > newest - HELD_BACK_TURNS * self.period else newest
        self.closed_to, self.newest = closed_to, newest

    def set_by(self, rows: Array, times: Floats, azimuths: int) -> None:
        """Plots tell at what time the antenna was at their row."""
        if len(rows):
            told = float(np.median(times + (self.closed_to - rows) * (self.period / azimuths)))
            earliest = self.newest - HELD_BACK_TURNS * self.period
            if earliest <= told <= self.newest + AHEAD_TURNS * self.period:
                self.time = told


@dataclass(frozen=True, slots=True, eq=False)
class Looks:
    """For each track (n,): row int64 absolute row of the look that is next or now, time UTC s of it, guard rows on
    both sides that its gate covers, due: everything in its gate has been delivered, covered: in range of the radar
    and not looked at within the last half turn.
    """

    row: Array
    time: Floats
    guard: Floats
    due: Array
    covered: Array


def plan_looks(
    site: RadarSite, clock: RadarClock, time: Array, state: Array, covariance: Array, extent: Floats, looked: Array,
    gate: float, max_gate_m: float,
) -> Looks:  # fmt: skip
    """Looks of one radar at all tracks. extent: (n, 2) length and width in m. looked: rows of the looks before."""
    n, video = len(time), site.video
    made = Looks(np.empty(n, np.int64), np.empty(n), np.empty(n), np.empty(n, np.bool_), np.empty(n, np.bool_))
    radar = np.array(
        [
            site.east,
            site.north,
            video.azimuths,
            max(video.first_range_m - video.range_step_m, 0.0),
            video.first_range_m + (video.ranges - 0.5) * video.range_step_m,
            clock.period,
            clock.time,
            video.beamwidth_rad,
            video.range_step_m,
        ]
    )
    _plan(
        radar, clock.closed_to, time, state, covariance, extent, looked, gate, max_gate_m,
        made.row, made.time, made.guard, made.due, made.covered,
    )  # fmt: skip
    return made


@allocating
def _plan(
    radar: Floats, closed_to: int, time: Floats, state: Floats, cov: Floats, extent: Floats, looked: Array,
    gate: float, max_gate: float, row: Array, at: Floats, guard: Floats, due: Array, covered: Array,
) -> None:  # fmt: skip
    east, north, azimuths = radar[0], radar[1], int(radar[2])
    period, now, beamwidth, step = radar[5], radar[6], radar[7], radar[8]
    for i in range(len(time)):
        if looked[i] + azimuths // 2 > closed_to:
            row[i], at[i], guard[i], due[i], covered[i] = looked[i] + azimuths, now, 0.0, False, False
            continue
        x, p = state[i], cov[i]
        dt = now - time[i]
        r = np.int64(0)
        for turn in range(2):
            e, n = x[0] + dt * x[2] - east, x[1] + dt * x[3] - north
            azimuth = math.atan2(e, n) % TWO_PI
            modulo = min(int(azimuth / TWO_PI * azimuths), azimuths - 1)
            if turn == 0:
                after = looked[i] + azimuths // 2
                r = after + 1 + (modulo - after - 1) % azimuths
                if r < closed_to - 2 * azimuths:
                    r += (closed_to - r) // azimuths * azimuths
            else:
                r += (modulo - r + azimuths // 2) % azimuths - azimuths // 2
            dt = now - (closed_to - r) * period / azimuths - time[i]
        distance = math.sqrt(e * e + n * n)
        spread = p[0, 0] + p[1, 1] + 2 * dt * (p[0, 2] + p[1, 3]) + dt * dt * (p[2, 2] + p[3, 3])
        manoeuvre, centroid = ACCELERATION_SPREAD * abs(dt) ** 3, EXTENT_VARIANCE * extent[i, 0] ** 2
        spread += manoeuvre + (distance * beamwidth) ** 2 + step * step + centroid
        reach = min(math.sqrt(gate * max(spread, 0.0)), max_gate) + 0.5 * extent[i, 0] + RANGE_MARGIN_CELLS * step
        guard[i] = min(reach / max(distance, LEAST_DISTANCE), MOST_GUARD) / TWO_PI * azimuths + MARGIN_ROWS
        # a scan left out is one look, not as many as turns went by
        late = int((closed_to - guard[i] - r) // azimuths)
        if late > 0:
            r += late * azimuths
            dt += late * period
        row[i], at[i] = r, time[i] + dt
        due[i] = r + guard[i] <= closed_to
        covered[i] = radar[3] <= distance <= radar[4]
