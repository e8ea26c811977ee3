"""Tracks: what is believed about each target, one row a track."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum, IntFlag

import numpy as np

from pipeline.tables.schema import Array, Table, column


class TrackPhase(IntEnum):
    """Where a track stands in its life."""

    TENTATIVE = 0
    CONFIRMED = 1
    COASTING = 2


class TargetClass(IntEnum):
    """What a target is held to be."""

    UNKNOWN = 0
    AIRCRAFT = 1
    VEHICLE = 2


class Source(IntFlag):
    """Which kinds of sensor contributed to a track within their last few seconds."""

    NONE = 0
    RADAR = 1
    NODE = 2
    REPORT = 4


@dataclass(frozen=True, eq=False)
class Tracks(Table):
    """One row a track, each at its own time."""

    id: Array = column("i8", "", "1, 2, 3, ... in the order of confirmation, never given again in a run")
    time: Array = column("f8", "s", "UTC to which the state belongs")
    state: Array = column("f8", "m, m/s", "east, north, velocity east, velocity north", shape=(4,))
    covariance: Array = column("f8", "m, m/s", "covariance of state", shape=(4, 4))
    phase: Array = column("u1", "", "TrackPhase", default=0)
    updated: Array = column("f8", "s", "UTC of the last measurement", default=0.0)
    born: Array = column("f8", "s", "UTC of the first measurement", default=0.0)
    hits: Array = column("i4", "", "measurements taken so far", default=0)
    misses: Array = column("i4", "", "looks in a row that should have seen it and did not", default=0)
    length: Array = column("f4", "m", "smoothed extent along the heading; nan when unknown", default=float("nan"))
    width: Array = column("f4", "m", "smoothed extent across the heading; nan when unknown", default=float("nan"))
    heading: Array = column("f4", "rad", "where the nose points; nan when unknown", default=float("nan"))
    axis: Array = column(
        "f4",
        "rad",
        "bearing of the long axis, in [0, pi), as radars see it; nan unless clearly longer than wide",
        default=float("nan"),
    )
    altitude: Array = column("f4", "m", "height above the airport; nan when unknown", default=float("nan"))
    on_ground: Array = column("?", "", "held to be on the ground", default=True)
    category: Array = column("u1", "", "TargetClass", default=0)
    address: Array = column("U7", "", "24-bit address, '~' before one not of ICAO; empty when unknown", default="")
    callsign: Array = column("U8", "", "flight or vehicle identification; empty when unknown", default="")
    sources: Array = column("u1", "", "Source flags", default=0)
    simulated: Array = column("?", "", "rests on simulated input", default=False)
    zone: Array = column("i4", "", "index of the airport feature it is on, -1 for none", default=-1)
    runway: Array = column("i2", "", "index of the runway whose strip it is in, -1 for none", default=-1)
    number: Array = column("u2", "", "ASTERIX track number, 1 .. 4095, given again after a rest; 0 for none", default=0)

    @property
    def shown_number(self) -> Array:
        """(n,) int64, what displays and texts call each track: its number; its id where it has none.

        Both are never mixed up: a track is without number only where none are given, or while 4095 others bear them
        all, so that its id is above 4095.
        """
        return np.where(self.number > 0, self.number, self.id)
