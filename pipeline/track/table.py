"""The tracker's own table: one column a fact, room for `capacity` tracks, the first `n` rows are alive."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.tables.arrays import Array

NEVER = -np.inf
"""The time of what has not happened."""

_COLUMNS: dict[str, tuple[str, tuple[int, ...], Any]] = {
    "uid": ("i8", (), 0),
    "id": ("i8", (), 0),
    "number": ("u2", (), 0),
    "time": ("f8", (), 0.0),
    "state": ("f8", (4,), 0.0),
    "covariance": ("f8", (4, 4), 0.0),
    "phase": ("u1", (), 0),
    "velocity_unknown": ("?", (), True),
    "updated": ("f8", (), 0.0),
    "born": ("f8", (), 0.0),
    "birthplace": ("f8", (2,), 0.0),
    "moved": ("?", (), False),
    "hits": ("i4", (), 0),
    "misses": ("i4", (), 0),
    "history": ("u4", (), 0),
    "looks": ("i4", (), 0),
    "score": ("f8", (), 0.0),
    "length": ("f8", (), np.nan),
    "width": ("f8", (), np.nan),
    "heading": ("f8", (), np.nan),
    "axis_bearing": ("f8", (), np.nan),
    "moving": ("?", (), False),
    "extent_count": ("i4", (), 0),
    "altitude": ("f8", (), np.nan),
    "on_ground": ("?", (), True),
    "category": ("u1", (), 0),
    "claimed": ("u1", (), 0),
    "address": ("U6", (), ""),
    "callsign": ("U8", (), ""),
    "misfit_reports": ("i4", (), 0),
    "radar_time": ("f8", (), NEVER),
    "node_time": ("f8", (), NEVER),
    "report_time": ("f8", (), NEVER),
    "simulated": ("?", (), False),
    "duplicate_checks": ("i4", (), 0),
    "fragment_checks": ("i4", (), 0),
    "least_half_extent": ("f8", (), 0.0),
    "radar": ("i2", (), -1),
}


class TrackTable:
    """Columns of `capacity` rows of which the first `n` are alive, in order of birth.

    looked: (radars, capacity) int64, absolute row of each radar's last look at the track.
    velocity_unknown: one position was taken; the second gives the velocity. birthplace: m, where it was first seen.
    moved: has come away from its birthplace for good. history: hits by look, newest in bit 0. looks: how many of its
    bits count. score: natural logarithm of how much better a target explains its plots than false plots do.
    axis_bearing: rad modulo pi, direction of the long axis as the radar sees it. moving: fast enough that the course
    gives the heading. extent_count: extents taken so far. claimed: TargetCategory of its reports. misfit_reports:
    reports in a row of its address that did not fit. duplicate_checks: checks in a row that found it to duplicate
    another track. fragment_checks: checks in a row that found it to be a fragment of another. least_half_extent: m,
    half the least length and width of a target seen in fragments, 0 for others. radar: index of the radar whose plot
    began it, -1 for another sensor. radar_time, node_time, report_time: UTC s of the newest contribution.
    The other columns are those of `Tracks`.
    """

    uid: Array
    id: Array
    number: Array
    time: Array
    state: Array
    covariance: Array
    phase: Array
    velocity_unknown: Array
    updated: Array
    born: Array
    birthplace: Array
    moved: Array
    hits: Array
    misses: Array
    history: Array
    looks: Array
    score: Array
    length: Array
    width: Array
    heading: Array
    axis_bearing: Array
    moving: Array
    extent_count: Array
    altitude: Array
    on_ground: Array
    category: Array
    claimed: Array
    address: Array
    callsign: Array
    misfit_reports: Array
    radar_time: Array
    node_time: Array
    report_time: Array
    simulated: Array
    duplicate_checks: Array
    fragment_checks: Array
    least_half_extent: Array
    radar: Array

    def __init__(self, capacity: int, radars: int) -> None:
        self.capacity = capacity
        self.n = 0
        self.last_uid = 0
        for name, (dtype, shape, fill) in _COLUMNS.items():
            setattr(self, name, np.full((capacity, *shape), fill, dtype=dtype))
        self.looked = np.zeros((radars, capacity), dtype=np.int64)

    def append(self, rows: int) -> slice:
        """Make up to `rows` new rows with default values; fewer when the table is full."""
        made = slice(self.n, min(self.n + rows, self.capacity))
        for name, (_, _, fill) in _COLUMNS.items():
            getattr(self, name)[made] = fill
        count = made.stop - made.start
        self.uid[made] = np.arange(self.last_uid + 1, self.last_uid + 1 + count)
        self.last_uid += count
        self.n = made.stop
        return made

    def keep(self, mask: Array) -> None:
        """Keep the living rows of the mask (n,), in order."""
        rows = np.flatnonzero(mask)
        for name in _COLUMNS:
            column = getattr(self, name)
            column[: len(rows)] = column[rows]
        self.looked[:, : len(rows)] = self.looked[:, rows]
        self.n = len(rows)

    def save(self) -> dict[str, Any]:
        """Copies of all living rows and the counters of the table."""
        columns = {name: getattr(self, name)[: self.n].copy() for name in _COLUMNS}
        return {**columns, "looked": self.looked[:, : self.n].copy(), "last_uid": self.last_uid}

    def restore(self, saved: dict[str, Any]) -> None:
        """Take what `save` gave. Raises ValueError when it does not fit the capacity or the radars."""
        n = len(saved["uid"])
        if n > self.capacity or saved["looked"].shape != (len(self.looked), n):
            raise ValueError("the saved tracks do not fit this tracker")
        for name in _COLUMNS:
            getattr(self, name)[:n] = saved[name]
        self.looked[:, :n] = saved["looked"]
        self.n, self.last_uid = n, int(saved["last_uid"])
