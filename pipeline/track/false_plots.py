"""How many false plots a radar makes where, learnt from tracks that came to nothing."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from pipeline.kernels.compiled import allocating
from pipeline.sites import RadarSite
from pipeline.tables.arrays import Floats

REACH = 0.5
"""A false plot strays by about this many cells of the grid, so it is shared among four."""

CELL_M = 12.0
"""Side of a cell of the grid: some resolution cells of a surface radar, so that clutter fills it in a few minutes."""

MEMORY_TURNS = 60.0
"""Turns over which the average reaches: clutter changes with rain and with what is parked, in minutes. Tied to a
one-second antenna."""

MOST_CELLS = 1024
"""Cells a side at most: 8 MB."""

FIRST_TURNS = 4.0
"""Turns without false plots that the first average begins with, so that one false plot is not yet a habit."""

LARGEST_SCALE = 1e9
"""At which the scale is taken into all cells; far below where a double loses digits."""


@dataclass(slots=True, eq=False)
class FalsePlots:
    """False plots a turn in square cells of `step` m, as an average over about `memory` turns.

    west, south: corner of the grid, m. rate: (rows, columns), multiplied by `scale`, which grows instead of all cells
    fading one by one. turns: how many were averaged so far. closed: absolute row up to which turns were counted.
    coming: (k, 3) place in m and number of false plots, which count from the next turn on.
    """

    west: float
    south: float
    step: float
    memory: float
    rate: Floats
    scale: float = 1.0
    turns: int = 0
    closed: int = 0
    coming: Floats = field(default_factory=lambda: np.empty((0, 3)))

    @classmethod
    def around(cls, site: RadarSite, step: float = CELL_M, memory: float = MEMORY_TURNS) -> FalsePlots:
        """An empty map of all that a radar covers; `step` grows where there would be more than MOST_CELLS a side."""
        reach = site.video.first_range_m + site.video.ranges * site.video.range_step_m + 2 * step
        step = max(step, 2 * reach / MOST_CELLS)
        cells = math.ceil(2 * reach / step) + 1
        return cls(site.east - reach, site.north - reach, step, memory, np.zeros((cells, cells)))

    def turn(self, closed_to: int, azimuths: int) -> None:
        """The antenna came to `closed_to`: what was learnt since the last turn counts; whole turns are averaged.

        To be called at the same row of every turn.
        """
        _spread(self._cells(self.coming[:, :2]), self.coming[:, 2] * (self._gain * self.scale), self.rate)
        self.coming = self.coming[:0]
        if closed_to < self.closed or self.turns == 0:
            self.closed = closed_to
            self.turns = max(self.turns, 1)
        while closed_to - self.closed >= azimuths:
            self.closed += azimuths
            self.turns += 1
            self.scale /= 1.0 - self._gain
        if self.scale > LARGEST_SCALE:
            self.rate /= self.scale
            self.scale = 1.0

    @property
    def _gain(self) -> float:
        return max(1.0 / self.memory, 1.0 / (self.turns + FIRST_TURNS))

    def learn(self, found: Floats) -> None:
        """At places east and north in m there were so many false plots: (n, 3)."""
        self.coming = np.concatenate([self.coming, found])

    def _cells(self, place: Floats) -> Floats:
        return np.asarray((place - (self.west, self.south)) / self.step - REACH)


@allocating
def _spread(cell: Floats, amount: Floats, rate: Floats) -> None:
    rows, columns = rate.shape
    for k in range(len(cell)):
        x, y = cell[k, 0], cell[k, 1]
        if not (0.0 <= x < columns - 1 and 0.0 <= y < rows - 1):
            continue
        i, j = int(y), int(x)
        v, u = y - i, x - j
        rate[i, j] += amount[k] * (1 - v) * (1 - u)
        rate[i, j + 1] += amount[k] * (1 - v) * u
        rate[i + 1, j] += amount[k] * v * (1 - u)
        rate[i + 1, j + 1] += amount[k] * v * u


@allocating
def learnt_rate(rate: Floats, x: float, y: float) -> float:
    """The rate at a place, in cells from the middle of the first, between the middles of four cells; 0 outside."""
    rows, columns = rate.shape
    if not (0.0 <= x < columns - 1 and 0.0 <= y < rows - 1):
        return 0.0
    i, j = int(y), int(x)
    v, u = y - i, x - j
    low = rate[i, j] * (1 - u) + rate[i, j + 1] * u
    return float(low * (1 - v) + (rate[i + 1, j] * (1 - u) + rate[i + 1, j + 1] * u) * v)
