"""The store of tracks: one row a hypothesis of a target, room for `capacity` rows, the first `n` in use.

Each part that keeps something of a track has records of its own; the tracker has those of this file.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pipeline.contracts.filter import Column, record_of
from pipeline.kernels.records import octets_of, take
from pipeline.tables.arrays import Array

NEVER = -np.inf
"""The time of what has not happened."""

ENDED = 255
"""The phase of a row whose track has ended; it is removed with the next clearing of the store."""

OTHER_SENSORS = 2
"""Columns of the evidence besides those of the radars: nodes, then reports."""

TRACK: Mapping[str, Column] = {
    "uid": Column("i8"),
    "target": Column("i8"),
    "log_weight": Column("f8"),
    "id": Column("i8"),
    "number": Column("u2"),
    "phase": Column("u1"),
    "state": Column("f8", (4,)),
    "covariance": Column("f8", (4, 4)),
    "updated": Column("f8"),
    "born": Column("f8"),
    "birthplace": Column("f8", (2,)),
    "moved": Column("?"),
    "hits": Column("i4"),
    "length": Column("f8", (), np.nan),
    "width": Column("f8", (), np.nan),
    "heading": Column("f8", (), np.nan),
    "axis_bearing": Column("f8", (), np.nan),
    "moving": Column("?"),
    "extent_count": Column("i4"),
    "altitude": Column("f4", (), np.nan),
    "on_ground": Column("?", (), True),
    "category": Column("u1"),
    "claimed": Column("u1"),
    "named": Column("?"),
    "address": Column("U7", (), ""),
    "callsign": Column("U8", (), ""),
    "misfit_reports": Column("i4"),
    "radar_time": Column("f8", (), NEVER),
    "node_time": Column("f8", (), NEVER),
    "report_time": Column("f8", (), NEVER),
    "latency_sd": Column("f8"),
    "plot_since": Column("f8", (), np.inf),
    "plot_position": Column("f8", (2,), np.nan),
    "plot_variance": Column("f8"),
    "simulated": Column("?"),
    "duplicate_checks": Column("i4"),
    "fragment_checks": Column("i4"),
    "least_half_extent": Column("f8"),
    "radar": Column("i2", (), -1),
}

EVIDENCE: Mapping[str, Column] = {
    "history": Column("u4"),
    "looks": Column("i4"),
    "misses": Column("i4"),
    "score": Column("f8"),
}

LOOK: Mapping[str, Column] = {
    "last": Column("i8"),
    "wake": Column("i8"),
    "planned": Column("?"),
    "covered": Column("?"),
    "row": Column("i8"),
    "near": Column("i8"),
    "due": Column("i8"),
    "time": Column("f8"),
    "guard": Column("f8"),
}


class TrackStore:
    """Records of `capacity` rows in order of birth; columns by name are views of them.

    rows: the tracker's records. uid: of the row, never used again. target: uid of the row that a target began with;
    rows of one target are hypotheses of it. log_weight: of the row among those of its target. phase: TrackPhase or
    ENDED. state, covariance: (4,), (4, 4) what the filter said of position m and velocity m/s on the ground after the
    last measurement, at `time`. named: bears an address. birthplace: m, where it was first seen. moved: has come away
    from its birthplace for good. axis_bearing: rad modulo pi, direction of the long axis as the radar sees it. moving:
    fast enough that the course gives the heading. extent_count: extents taken so far. claimed: TargetCategory of its
    reports. misfit_reports: reports in a row of its address that did not fit. duplicate_checks, fragment_checks: checks
    in a row that found it to duplicate another track, or to be a fragment of one. least_half_extent: m, half the least
    length and width of a target seen in fragments, 0 for others. radar: index of the radar whose plot began it, -1 for
    another sensor. radar_time, node_time, report_time: UTC s of the newest contribution. latency_sd: s, how unsure the
    latency of its reports is. plot_since: UTC s of the first plot. plot_position, plot_variance: m and m^2 of the
    newest plot, at radar_time. The others are those of `Tracks`.

    time: UTC s to which the filter's columns belong; the filter sets it. filter: the filter's records.
    evidence: (capacity, radars + OTHER_SENSORS) records: hits by look, newest in bit 0; how many of its bits count;
    looks in a row without a hit of any sensor; natural logarithm of how much better a target explains what the sensor
    saw than false plots do.
    look: (capacity, radars) records: absolute row of the radar's last look at the track; number of the mark at which
    the next is to be thought of; whether it is planned; whether the radar covers the place; row and UTC s of the
    planned look; marks from which plots may lie in its gate, and at which its whole gate is closed; rows that the gate
    reaches to both sides.
    """

    def __init__(self, capacity: int, radars: int, filter_columns: Mapping[str, Column]) -> None:
        self.capacity = capacity
        self.n = 0
        self.last_uid = 0
        self._fresh = {
            "rows": _one(TRACK),
            "filter": _one(filter_columns),
            "evidence": _one(EVIDENCE),
            "look": _one(LOOK),
        }
        self.rows = np.zeros(capacity, self._fresh["rows"].dtype)
        self.filter = np.zeros(capacity, self._fresh["filter"].dtype)
        self.evidence = np.zeros((capacity, radars + OTHER_SENSORS), self._fresh["evidence"].dtype)
        self.look = np.zeros((capacity, radars), self._fresh["look"].dtype)
        self.time = np.zeros(capacity)
        self._octets = {name: octets_of(getattr(self, name)) for name in self._fresh}
        self._fresh_octets = {
            name: np.tile(octets_of(one), octets.shape[1] // one.dtype.itemsize)
            for (name, octets), one in zip(self._octets.items(), self._fresh.values(), strict=True)
        }
        self._columns = {name: self.rows[name] for name in TRACK}
        self.rows["phase"] = ENDED

    def __getattr__(self, name: str) -> Array:
        """A column of the tracker's records, of all rows."""
        try:
            made: Array = self.__dict__["_columns"][name]
        except KeyError:
            raise AttributeError(name) from None
        return made

    def records(self, rows: Array) -> Array:
        """Copies of the tracker's records of rows (k,)."""
        return take(self.rows, rows)

    def append(self, rows: int) -> slice:
        """Make up to `rows` new rows with default values; fewer when the store is full.

        What has ended makes room when it must, so that rows known by number before are others afterwards.
        """
        if self.n + rows > self.capacity:
            self.clear_ended()
        return self._extend(rows)

    def _extend(self, rows: int) -> slice:
        """As many new rows as fit behind those in use."""
        made = slice(self.n, min(self.n + rows, self.capacity))
        for name, octets in self._octets.items():
            octets[made] = self._fresh_octets[name]
        count = made.stop - made.start
        uid = np.arange(self.last_uid + 1, self.last_uid + 1 + count)
        self.rows["uid"][made] = self.rows["target"][made] = uid
        self.time[made] = 0.0
        self.last_uid += count
        self.n = made.stop
        return made

    def copy_rows(self, rows: Array) -> Array:
        """Further rows that hold what `rows` hold, but for their uid and the filter's columns; fewer when full.

        No row moves: who asks goes on with the numbers of its rows.
        """
        made = self._extend(len(rows))
        into = np.arange(made.start, made.stop)
        rows = rows[: len(into)]
        uid = self.rows["uid"][made].copy()
        for name in ("rows", "evidence", "look"):
            self._octets[name][into] = self._octets[name][rows]
        self.rows["uid"][made] = uid
        return into

    def clear_ended(self) -> None:
        """Remove the rows that have ended; the others keep their order."""
        kept = np.flatnonzero(self.rows["phase"][: self.n] != ENDED)
        if len(kept) == self.n:
            return
        first = int(np.argmax(self.rows["phase"][: self.n] == ENDED))
        for octets in (*self._octets.values(), self.time):
            octets[first : len(kept)] = octets[kept[first:]]
        self.rows["phase"][len(kept) : self.n] = ENDED
        self.n = len(kept)

    def save(self) -> dict[str, Any]:
        """Copies of all columns of the rows in use, by kind of record, and the counters of the store."""
        made: dict[str, Any] = {"time": self.time[: self.n].copy(), "last_uid": self.last_uid}
        for kind in self._fresh:
            records = getattr(self, kind)[: self.n]
            made[kind] = {name: records[name].copy() for name in records.dtype.names}
        return made

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Take what `save` gave. Raises ValueError when it does not fit the capacity, the radars or the filter."""
        n = len(saved["time"])
        for kind in self._fresh:
            records, columns = getattr(self, kind), saved[kind]
            fits = n <= self.capacity and set(columns) == set(records.dtype.names)
            if not fits or any(one.shape != records[name][:n].shape for name, one in columns.items()):
                raise ValueError("the saved tracks do not fit this tracker")
        for kind in self._fresh:
            records = getattr(self, kind)
            for name, column in saved[kind].items():
                records[name][:n] = column
        self.time[:n] = saved["time"]
        self.rows["phase"][n:] = ENDED
        self.n, self.last_uid = n, int(saved["last_uid"])


def _one(columns: Mapping[str, Column]) -> Array:
    """A record of one fresh row."""
    made = np.zeros(1, record_of(columns))
    for name, one in columns.items():
        made[name] = one.fill
    return made
