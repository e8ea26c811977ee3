"""One radar's antenna as seen so far: its period, what it has closed, and the marks that wait for a decision."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from pipeline.tables import SectorPlots
from pipeline.tables.arrays import Array, Floats
from pipeline.tables.marks import MARKS_A_TURN, first_mark, mark_row, marks_between

LEAST_TURN, MOST_TURNS = 64, 4
"""What is less than this fraction of a turn, or more turns, does not teach the period: too short to time, or the feed
was interrupted."""

PERIOD_FACTOR = 4.0
"""A measured period more than so many times longer or shorter than the radar's nominal one is a fault of its times."""

PERIOD_GAIN = 0.25
"""Fraction of a new measurement of the period that is taken per turn: antennas change speed in wind within some
turns."""

HELD_BACK_TURNS = 0.5
"""Turns by which the newest sweep may be ahead of the row that is closed: a large echo that is open holds it back."""

MARK_AHEAD_TURNS = 1
"""Turns beyond the closed row, from which on the number of a mark is wrong: an open echo holds that row back by half a
turn at most."""

AHEAD_TURNS = 0.1
"""Turns by which plots may say that the antenna is ahead of the newest sweep; their times are those of centroids."""

STEP_MEMORY_S = 60.0
"""Time within which most of the longest wait between two deliveries of a radar is forgotten: many turns of any antenna,
so that one large block among small ones is still waited for. No wait is taken for longer than a turn, as no block is:
a feed that was interrupted does not make the others wait the next time."""

PATIENCE, LEAST_PATIENCE_S = 1.5, 0.5
"""A radar is waited for so many times its longest wait between two deliveries, and s more: what a network may stall.
The others are held back by as much once, when it falls silent."""

NO_MARK = -1

NO_ROW = -(1 << 40)
"""A row long past."""


@dataclass(slots=True, eq=False)
class RadarClock:
    """One radar's antenna as seen so far. period: s a turn. closed_to: absolute row that is closed.

    time: UTC s at which the antenna passed that row; the newest sweep, of UTC `newest`, may be well past it, since a
    large echo still open holds the row back.
    mark, mark_time: (k,) numbers and UTC s of the marks that were passed and not decided at. mark_period: (k,) s a turn
    as learnt up to each. last_mark: number and UTC s of the newest mark learnt from; NO_MARK before.
    inferred: number of the newest mark whose time was inferred, as its sector brought none.
    decided, decided_time: number and UTC s of the newest mark that was decided at. step: s, longest wait between two
    deliveries of late.
    """

    period: float
    closed_to: int = 0
    time: float = -np.inf
    newest: float = -np.inf
    mark: Array = field(default_factory=lambda: np.empty(0, np.int64))
    mark_time: Floats = field(default_factory=lambda: np.empty(0))
    mark_period: Floats = field(default_factory=lambda: np.empty(0))
    last_mark: int = NO_MARK
    last_mark_time: float = -np.inf
    inferred: int = NO_MARK
    decided: int = NO_MARK
    decided_time: float = -np.inf
    step: float = 0.0

    def heard(self, sector: SectorPlots, azimuths: int, nominal: float) -> None:
        """A sector was closed: its marks are to be decided at, and teach the period."""
        before = self.closed_to
        rows, passed = sector.closed_to - before, sector.time - self.newest
        waited = min(max(passed, 0.0), max(self.period, nominal))
        self.step = max(waited, self.step * math.exp(-waited / STEP_MEMORY_S))
        if len(sector.mark) or self.last_mark != NO_MARK:
            self.closed_to, self.newest = sector.closed_to, sector.time
            self._take_marks(sector.mark, sector.mark_time, azimuths, nominal)
            return
        if math.isfinite(passed) and passed > 0 and azimuths // LEAST_TURN <= rows <= MOST_TURNS * azimuths:
            self._learn(passed * azimuths / rows, rows / azimuths, nominal)
        due = min(self.time + rows * self.period / azimuths, sector.time)
        self.time = due if due > sector.time - HELD_BACK_TURNS * self.period else sector.time
        self.closed_to, self.newest = sector.closed_to, sector.time

    def infer_marks(self, sector: SectorPlots, azimuths: int) -> None:
        """Marks of a sector that brought none: their times follow from that of the closed row."""
        if len(sector.mark) or self.last_mark != NO_MARK:
            return
        before = int(mark_row(self.inferred, azimuths)) if self.inferred != NO_MARK else sector.closed_from
        after = max(self.closed_to - azimuths, before)
        mark = marks_between(after + 1, self.closed_to + 1, azimuths)
        if not len(mark):
            return
        self.inferred = int(mark[-1])
        time = self.time - (self.closed_to - mark_row(mark, azimuths)) * (self.period / azimuths)
        self._append(mark, time, np.full(len(mark), self.period))

    def set_by(self, rows: Array, times: Floats, azimuths: int) -> None:
        """Plots tell at what time the antenna was at their row, where no sector has brought marks."""
        if len(rows) and self.last_mark == NO_MARK:
            told = float(np.median(times + (self.closed_to - rows) * (self.period / azimuths)))
            earliest = self.newest - HELD_BACK_TURNS * self.period
            if earliest <= told <= self.newest + AHEAD_TURNS * self.period:
                self.time = told

    def awaited(self, newest: float, began: float) -> bool:
        """Whether the other radars wait for this one, since it may still deliver something older.

        newest: UTC s of the newest sweep of all radars. began: of the first; one that has not delivered yet is waited
        for at the begin.
        """
        if not math.isfinite(self.decided_time):
            return 0.0 <= newest - began <= PATIENCE * max(self.period, self.step) + LEAST_PATIENCE_S
        patience = PATIENCE * self.step + LEAST_PATIENCE_S
        held_back = HELD_BACK_TURNS * self.period
        return newest - self.newest <= patience and newest - self.decided_time <= patience + held_back

    def ready(self, azimuths: int) -> int:
        """How many of the marks that wait are closed: every plot before them has been delivered."""
        if not len(self.mark):
            return 0
        after = first_mark(self.closed_to + 1, azimuths)
        return len(self.mark) if self.mark[-1] < after else int(np.searchsorted(self.mark, after))

    def spend(self, marks: int) -> None:
        """The first `marks` that waited are decided."""
        self.decided, self.decided_time = int(self.mark[marks - 1]), float(self.mark_time[marks - 1])
        self.mark, self.mark_time = self.mark[marks:], self.mark_time[marks:]
        self.mark_period = self.mark_period[marks:]

    def antenna(self, azimuths: int) -> tuple[float, float, int]:
        """UTC s at an absolute row, s a turn, and that row."""
        if self.last_mark == NO_MARK:
            return self.time, self.period, self.closed_to
        return self.last_mark_time, self.period, int(mark_row(self.last_mark, azimuths))

    def decided_row(self, azimuths: int) -> int:
        """Absolute row of the newest mark that was decided at; NO_ROW before the first."""
        return int(mark_row(self.decided, azimuths)) if self.decided != NO_MARK else NO_ROW

    def shift(self, seconds: float) -> None:
        """All times become later by `seconds`."""
        self.time += seconds
        self.newest += seconds
        self.last_mark_time += seconds
        self.decided_time += seconds
        self.mark_time = self.mark_time + seconds

    def _take_marks(self, mark: Array, time: Floats, azimuths: int, nominal: float) -> None:
        periods, kept = [], []
        for number, at in zip(mark.tolist(), time.tolist(), strict=True):
            turns, passed = (number - self.last_mark) / MARKS_A_TURN, at - self.last_mark_time
            if not at <= self.newest or (self.last_mark != NO_MARK and (turns <= 0 or not passed > 0)):
                continue
            if mark_row(number, azimuths) > self.closed_to + MARK_AHEAD_TURNS * azimuths:
                continue
            if self.last_mark == NO_MARK:
                self.period = nominal  # what sectors without marks told of it depends on how they were cut
            if self.last_mark != NO_MARK and turns <= MOST_TURNS:
                self._learn(passed / turns, turns, nominal)
            self.last_mark, self.last_mark_time = number, at
            periods.append(self.period)
            kept.append((number, at))
        if kept:
            numbers, times = zip(*kept, strict=True)
            self._append(np.array(numbers, np.int64), np.array(times), np.array(periods))

    def _append(self, mark: Array, time: Floats, period: Floats) -> None:
        if not len(self.mark):
            self.mark, self.mark_time, self.mark_period = mark, time, period
            return
        self.mark = np.concatenate([self.mark, mark])
        self.mark_time = np.concatenate([self.mark_time, time])
        self.mark_period = np.concatenate([self.mark_period, period])

    def _learn(self, turn: float, turns: float, nominal: float) -> None:
        if nominal / PERIOD_FACTOR <= turn <= nominal * PERIOD_FACTOR:
            self.period += (turn - self.period) * min(1.0, PERIOD_GAIN * turns)
