"""The bearings of a radar's plots: which plots are looked at, what is expected of them, what the table then says."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.contracts.bearing import BearingEstimator, Expected, TargetView
from pipeline.sites import RadarSite
from pipeline.tables import Plots

Floats = NDArray[np.float64]

LEAST_LENGTH, MOST_LENGTH = 15.0, 100.0
"""m: plots shorter than this are no aircraft, longer ones are buildings."""

LEAST_CELLS = 12
"""Cells below which a plot has no shape."""

PARTS_OF_TURN, MOST_A_PART = 32, 16
"""So many plots get a bearing in each such part of a turn; the others are counted."""

MARGIN = 12.0
"""m of ground shown about a plot."""

NEAR = 15.0
"""m: a plot belongs to an expectation that is as near as this, or as half its own length."""


@dataclass(frozen=True, eq=False)
class Expectations:
    """What tracks expect: places and headings, one row a track; never changed, only replaced.

    east, north: m from the airport's reference point. heading, sd: rad. Raises ValueError for columns of different
    lengths.
    """

    east: Floats
    north: Floats
    heading: Floats
    sd: Floats

    @classmethod
    def of(cls, east: ArrayLike, north: ArrayLike, heading: ArrayLike, sd: ArrayLike) -> Expectations:
        """Copies of the columns; rows with a number that is not finite, or an sd that is not above 0, are left out."""
        table = [np.array(one, np.float64, ndmin=1).ravel() for one in (east, north, heading, sd)]
        if len({len(one) for one in table}) != 1:
            raise ValueError("east, north, heading and sd must be of one length")
        good = np.isfinite(np.stack(table)).all(axis=0) & (table[3] > 0)
        return cls(*(one[good] for one in table))

    def table(self) -> Floats:
        """(4, n) the columns in order."""
        return np.stack([self.east, self.north, self.heading, self.sd])

    def at(self, east: float, north: float, length: float) -> Expected | None:
        """The nearest expectation, if it is near enough for a plot of this length."""
        if not len(self.east):
            return None
        apart = np.hypot(self.east - east, self.north - north)
        best = int(np.argmin(apart))
        if not apart[best] <= max(NEAR, length / 2):
            return None
        return Expected(float(self.heading[best] % (2 * math.pi)), float(self.sd[best]))


NOTHING_EXPECTED = Expectations.of([], [], [], [])


class PlotBearings:
    """Gives plots their bearings with one part. expected: what tracks expect; swapped as a whole, from any thread."""

    def __init__(self, site: RadarSite, part: BearingEstimator) -> None:
        self.site = site
        self.part = part
        self.expected = NOTHING_EXPECTED
        self.counters = {"bearings": 0, "bearings_left_out": 0}
        self._state = part.start(site)
        self._sector = -1
        self._used = 0

    @property
    def place(self) -> tuple[int, int]:
        """(sector of the turn, plots looked at in it) so far."""
        return self._sector, self._used

    @place.setter
    def place(self, place: tuple[int, int]) -> None:
        self._sector, self._used = place

    def __call__(self, plots: Plots, newest: NDArray[np.uint8]) -> Plots:
        """The plots with bearings where the part finds any; those of the cells stay elsewhere.

        newest: (azimuths, ranges) uint8 the newest turn, in which the plots' sweeps are. Which plots are looked at
        does not depend on how many are handed over at once.
        """
        sized = (plots.length >= LEAST_LENGTH) & (plots.length <= MOST_LENGTH) & (plots.cells >= LEAST_CELLS)
        chosen = [int(k) for k in np.flatnonzero(sized) if self._room_for(plots, int(k))]
        if not chosen:
            return plots
        bearing, sd = plots.bearing.copy(), plots.bearing_sd.copy()
        nose, kind = plots.nose_known.copy(), plots.type.copy()
        expected = self.expected
        for k in chosen:
            near = expected.at(float(plots.east[k]), float(plots.north[k]), float(plots.length[k]))
            made = self.part(view_of(plots, k, newest, self.site), near, self._state)
            if math.isfinite(made.bearing) and math.isfinite(made.sd):
                bearing[k], sd[k], nose[k], kind[k] = made.bearing, made.sd, made.nose_known, made.type
                self.counters["bearings"] += 1
        return replace(plots, bearing=bearing, bearing_sd=sd, nose_known=nose, type=kind)

    def _room_for(self, plots: Plots, k: int) -> bool:
        """Whether the part of the turn in which the plot ends has room for one more."""
        video = self.site.video
        first, rows = int(plots.window[k, 0]), int(plots.window[k, 1])
        # the scan is that of the centroid, which may lie past north
        scan = int(plots.scan[k]) - (first * video.azimuth_step_rad > plots.azimuth[k])
        sector = (scan * video.azimuths + first + rows - 1) * PARTS_OF_TURN // video.azimuths
        if sector != self._sector:
            self._sector, self._used = sector, 0
        self._used += 1
        if self._used > MOST_A_PART:
            self.counters["bearings_left_out"] += 1
            return False
        return True


def view_of(plots: Plots, k: int, newest: NDArray[np.uint8], site: RadarSite) -> TargetView:
    """The video about a plot: a margin before it and in range, and the one row after it that must have been swept for
    the plot to be complete (rows after that may still be those of the turn before)."""
    azimuths, ranges = newest.shape
    first, rows, near, deep = (int(one) for one in plots.window[k])
    cross = max(float(plots.range[k]), site.video.range_step_m) * site.video.azimuth_step_rad
    before = min(math.ceil(MARGIN / cross), azimuths // 8)
    beside = math.ceil(MARGIN / site.video.range_step_m)
    low, high = max(near - beside, 0), min(near + deep + beside, ranges)
    rows = min(rows, azimuths - before - 1)
    taken = np.arange(first - before, first + rows + 1) % azimuths
    return TargetView(
        amplitude=np.ascontiguousarray(newest[taken, low:high]),
        azimuth=(int(taken[0]) + 0.5) * site.video.azimuth_step_rad,
        range_m=site.video.first_range_m + low * site.video.range_step_m,
        plot=(before, rows, near - low, deep),
    )
