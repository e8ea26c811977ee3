"""Measurements as the parts of a tracker see them: one row each, whatever kind of sensor they come from."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pipeline.tables.arrays import Array, Floats


class Measured(NamedTuple):
    """Measurements, m rows; NaN where a sensor does not say.

    time: (m,) UTC s. position: (m, 2) m east and north. noise: (m, 2, 2) m^2, with that of the centroid of an extended
    target. bearing, bearing_sd: (m,) rad, long axis of the echo modulo pi. speed, course, velocity_sd: (m,) m/s, rad
    from north, and m/s of each component of that velocity. altitude: (m,) m. extent: (m, 3) length m, width m and
    direction rad of the echo. cells: (m,) int32 resolution cells of the echo. sensor: (m,) int32, the column of the
    evidence that the measurement belongs to. image: (m,) int32, row of a pool of images, -1 for none.
    """

    time: Floats
    position: Floats
    noise: Floats
    bearing: Floats
    bearing_sd: Floats
    speed: Floats
    course: Floats
    velocity_sd: Floats
    altitude: Floats
    extent: Floats
    cells: Array
    sensor: Array
    image: Array

    @classmethod
    def of(cls, time: Floats, position: Floats, noise: Floats, **columns: Any) -> Measured:
        """Measurements of positions, with the other columns as far as they are given; a scalar is repeated."""
        records = np.empty(len(time), RECORD)
        for name in cls._fields[3:]:
            records[name] = columns.pop(name, _UNKNOWN[name])
        if columns:
            raise TypeError(f"measurements have no column {next(iter(columns))!r}")
        records["time"], records["position"], records["noise"] = time, position, noise
        return cls.view(records)

    @classmethod
    def view(cls, records: Array) -> Measured:
        """The columns of records that have at least the fields of RECORD, without a copy."""
        return cls(*(records[name] for name in cls._fields))

    def rows(self, chosen: Any) -> Measured:
        """Those of an index array, a mask or a slice, as records of their own."""
        records = np.empty(len(self.time[chosen]), RECORD)
        for name, column in zip(self._fields, self, strict=True):
            records[name] = column[chosen]
        return self.view(records)


_FIELDS: tuple[tuple[str, str, tuple[int, ...], float], ...] = (
    ("time", "f8", (), np.nan),
    ("position", "f8", (2,), np.nan),
    ("noise", "f8", (2, 2), np.nan),
    ("bearing", "f8", (), np.nan),
    ("bearing_sd", "f8", (), np.nan),
    ("speed", "f8", (), np.nan),
    ("course", "f8", (), np.nan),
    ("velocity_sd", "f8", (), np.nan),
    ("altitude", "f8", (), np.nan),
    ("extent", "f8", (3,), np.nan),
    ("cells", "i4", (), 0),
    ("sensor", "i4", (), 0),
    ("image", "i4", (), -1),
)

RECORD_FIELDS = [(name, kind, shape) for name, kind, shape, _ in _FIELDS]
"""The fields of a measurement as a numpy record; the columns of all measurements are views of such records, so that
kernels are compiled for one layout."""

RECORD = np.dtype(RECORD_FIELDS, align=True)

_UNKNOWN = {name: fill for name, _, _, fill in _FIELDS}


class Hypotheses(NamedTuple):
    """What each track may have taken: sets of measurements with weights, as compressed rows.

    track_first: (n + 1,) int32, the hypotheses of each track. plot_first: (h + 1,) int32, the measurements of each
    hypothesis; none is a miss. plot: (p,) int32, rows of the measurements. log_weight: (h,) natural logarithms. A
    filter makes one of the hypotheses of a track; their weights then sum to 1. An association that is branching answers
    likelihood ratios to a miss instead: they tell which of the rows of a target explains it better.
    """

    track_first: Array
    plot_first: Array
    plot: Array
    log_weight: Floats

    @classmethod
    def single(cls, plot: Array) -> Hypotheses:
        """One hypothesis a track: the measurement `plot` (n,), -1 for a miss."""
        n = len(plot)
        track_first = np.arange(n + 1, dtype=np.int32)
        plot_first = np.zeros(n + 1, np.int32)
        hit = plot >= 0
        np.cumsum(hit, out=plot_first[1:])
        return cls(track_first, plot_first, plot[hit].astype(np.int32), np.zeros(n))

    def of_track(self, track: int) -> list[tuple[Array, float]]:
        """The sets of measurements of one track with their logarithmic weights, for parts that do without kernels."""
        first = self.plot_first
        each = range(self.track_first[track], self.track_first[track + 1])
        return [(self.plot[first[h] : first[h + 1]], float(self.log_weight[h])) for h in each]
