"""Plots: what the extractor made of the detections, one row a plot."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.tables.marks import FORMER_MARKS_A_TURN, MARKS_A_TURN, present_marks
from pipeline.tables.schema import Array, Table, column


@dataclass(frozen=True, eq=False)
class Plots(Table):
    """One row a plot, at the time of its own sweep."""

    time: Array = column("f8", "s", "UTC when the antenna swept the plot's centroid")
    radar: Array = column("i2", "", "index of the radar in the engine", default=0)
    scan: Array = column("i8", "", "turn of that radar since start", default=0)
    east: Array = column("f8", "m", "centroid of the cells, east of the airport's reference point")
    north: Array = column("f8", "m", "centroid of the cells, north of the airport's reference point")
    covariance: Array = column("f8", "m^2", "covariance of (east, north)", shape=(2, 2))
    range: Array = column("f8", "m", "slant range of the centroid from its radar")
    azimuth: Array = column("f8", "rad", "azimuth of the centroid from its radar, clockwise from true north")
    range_extent: Array = column("f4", "m", "extent in range")
    azimuth_extent: Array = column("f4", "rad", "extent in azimuth")
    length: Array = column("f4", "m", "extent along the long axis of the cells", default=0.0)
    width: Array = column("f4", "m", "extent across the long axis of the cells", default=0.0)
    cells: Array = column("i4", "", "number of detected cells")
    mean_amplitude: Array = column("f4", "step", "mean log amplitude of the cells")
    peak_amplitude: Array = column("f4", "step", "greatest log amplitude of the cells")
    weighted_east: Array = column(
        "f8", "m", "centroid of the cells weighted by amplitude, east; nan when not made", default=float("nan")
    )
    weighted_north: Array = column(
        "f8", "m", "centroid of the cells weighted by amplitude, north; nan when not made", default=float("nan")
    )
    bearing: Array = column(
        "f4", "rad", "direction of the long axis, modulo pi unless nose_known; or nan", default=float("nan")
    )
    nose_known: Array = column("?", "", "bearing is where the nose points, 0 to 2 pi", default=False)
    type: Array = column("U4", "", "ICAO type that the echo looks like most; empty when not estimated", default="")
    bearing_sd: Array = column("f4", "rad", "standard deviation of bearing, or nan", default=float("nan"))
    window: Array = column(
        "i4", "", "first azimuth row, rows (may pass north), first range cell, cells", shape=(4,), default=0
    )


UNSTATED = 0
"""The marks a turn of a sector that does not state them."""


@dataclass(frozen=True, slots=True, eq=False)
class SectorPlots:
    """What a radar chain hands on after each block: the plots completed since the block before.

    Rows are absolute: scan * azimuths + row. Every plot whose centroid lies before `closed_to` has now been delivered,
    so a track predicted between `closed_from` and `closed_to` that finds no plot has been missed by this radar.
    time: UTC of the newest sweep looked at. degraded: a cap was hit and detections were left out (counted).
    mark: (k,) int64 absolute numbers, ascending, of the azimuth marks (`pipeline.tables.marks`) that the antenna passed
    with the sweeps of this block. mark_time: (k,) float64 UTC s of the first sweep received at or after each mark.
    Marks follow the sweeps received, so they may be ahead of `closed_to`; together they are the same however the sweeps
    were cut into blocks. Both are empty when the source of the sectors does not know them. marks_a_turn: how many marks
    their numbers count in a turn; UNSTATED in sectors read from recordings made before it was told, else MARKS_A_TURN.
    """

    radar: int
    scan: int
    time: float
    closed_from: int
    closed_to: int
    plots: Plots
    degraded: bool = False
    mark: Array = field(default_factory=lambda: np.empty(0, np.int64))
    mark_time: Array = field(default_factory=lambda: np.empty(0, np.float64))
    marks_a_turn: int = UNSTATED

    def __post_init__(self) -> None:
        if self.marks_a_turn == UNSTATED:  # made now, and not read from a recording, which makes no call
            object.__setattr__(self, "marks_a_turn", MARKS_A_TURN)

    def with_present_marks(self) -> SectorPlots:
        """The same with its marks numbered as now; those that stand nowhere now are left out."""
        if self.marks_a_turn == MARKS_A_TURN:
            return self
        mark, time = present_marks(self.mark, self.mark_time, self.marks_a_turn or FORMER_MARKS_A_TURN)
        return replace(self, mark=mark, mark_time=time, marks_a_turn=MARKS_A_TURN)
