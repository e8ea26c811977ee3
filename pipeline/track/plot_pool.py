"""The plots of one radar that wait for their decision, as records made once when they come in."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from pipeline.airport.model import SurfaceKind
from pipeline.contracts.measured import RECORD_FIELDS
from pipeline.kernels.compiled import allocating
from pipeline.kernels.records import plain, take_records
from pipeline.tables import Plots
from pipeline.tables.arrays import Array, Floats
from pipeline.track.shape import fill_extent

POOL = np.dtype(
    [
        *RECORD_FIELDS,
        ("covariance", "f8", (2, 2)),
        ("row", "i8"),
        ("spent", "?"),
        ("long", "?"),
        ("surface", "u1"),
    ],
    align=True,
)
"""A measurement with covariance: m^2, that of the plot itself; row: absolute row of its azimuth; spent: a track took
it, or it began one; long: its own length is that of an aircraft; surface: SurfaceKind at its place."""

GOOD, INVALID, LATE, FUTURE, STALE = 0, 1, 2, 3, 4
"""What is found of a plot."""

LARGEST_VARIANCE = 1e6
"""m^2, of both axes of a plot: worse than 1 km is no position."""

FARTHEST_PLOT = 1e6
"""m from the airport in each direction: no surface radar sees so far."""

PAVED = np.isin(np.arange(256), (SurfaceKind.RUNWAY, SurfaceKind.TAXIWAY, SurfaceKind.APRON, SurfaceKind.ROAD))
"""(256,) by SurfaceKind: where targets are at home and false plots are few."""


FIRST_ROOM = 256
"""Plots that there is room for at first; it grows with what comes."""

INSERTION_MOST = 128
"""Plots up to which sorting by insertion alone is faster than sorting by row first."""


class PlotPool:
    """The plots of one radar that wait, by row, then time and place, so that nothing depends on how they came.

    They stay where they are in memory between calls: making arrays of records is slow in numpy, which looks at each
    field.
    """

    def __init__(self) -> None:
        self._records, self._spare = np.empty(FIRST_ROOM, POOL), np.empty(FIRST_ROOM, POOL)
        self._n = 0

    def __len__(self) -> int:
        return self._n

    @property
    def records(self) -> Array:
        """(n,) records, as a view that holds until the pool is changed."""
        made: Array = self._records[: self._n]
        return made

    def take_in(
        self, plots: Plots, bounds: tuple[float, float, float], clock: tuple[float, float, int], azimuths: int,
        sensor: int, aircraft_length: float,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Append records of the plots that can be true; they (k,), as a view, and how many (5,) were GOOD .. STALE.

        bounds: UTC s before which a plot is late and after which it lies in the future, absolute row before which it is
        stale. clock: UTC s at an absolute row, s a turn, and that row. To be followed by `sort`.
        """
        many, found = len(plots.time), np.zeros(5, np.int64)
        self._make_room(self._n + many)
        made = self._records[self._n : self._n + many]
        good = _pool(
            plain(plots.time), plain(plots.east), plain(plots.north), plain(plots.covariance), plain(plots.range),
            plain(plots.azimuth), plain(plots.range_extent), plain(plots.azimuth_extent), plain(plots.length),
            plain(plots.width), plain(plots.bearing), plain(plots.bearing_sd), plain(plots.cells), bounds, clock,
            azimuths, sensor, aircraft_length, made, found,
        )  # fmt: skip
        self._n += good
        return made[:good], found

    def sort(self) -> None:
        """Put what was appended in its place."""
        records = self.records
        order = np.arange(self._n) if self._n <= INSERTION_MOST else np.argsort(records["row"], kind="stable")
        if _sort(records, order):
            take_records(records, order, self._spare)
            self._records, self._spare = self._spare, self._records

    def copies(self, rows: Array) -> Array:
        """Copies of the records of rows (k,), as a view that holds until the next call."""
        take_records(self._records, rows, self._spare)
        made: Array = self._spare[: len(rows)]
        return made

    def drop_spent(self) -> None:
        """Remove the plots that are spent."""
        self._n = _drop_spent(self._records, self._n)

    def clear(self) -> None:
        """Remove all."""
        self._n = 0

    def save(self) -> dict[str, Array]:
        """Copies of all columns (n, ...) by name."""
        return {name: self.records[name].copy() for name in POOL.names or ()}

    @classmethod
    def of(cls, columns: Mapping[str, Array]) -> PlotPool:
        """A pool of all its columns (n, ...) by name, as `save` gave them."""
        made = cls()
        made._make_room(len(columns["row"]))
        made._n = len(columns["row"])
        for name in POOL.names or ():
            made.records[name] = columns[name]
        return made

    def _make_room(self, wanted: int) -> None:
        if wanted > len(self._records):
            records, self._spare = np.empty(2 * wanted, POOL), np.empty(2 * wanted, POOL)
            take_records(self._records, np.arange(self._n), records)
            self._records = records


@allocating
def _sort(pool: Array, order: Array) -> bool:
    """Sort `order` (k,), rows of a pool, by insertion; whether anything is to be moved."""
    moved = False
    for k in range(len(order)):
        one, j = order[k], k - 1
        while j >= 0 and _before(pool[one], pool[order[j]]):
            order[j + 1] = order[j]
            j -= 1
        order[j + 1] = one
        moved |= one != k or j + 1 != k
    return moved


@allocating
def _drop_spent(records: Array, n: int) -> int:
    """Move together the records that are not spent; how many."""
    kept = 0
    for k in range(n):
        if not records[k]["spent"]:
            if kept != k:
                records[kept] = records[k]
            kept += 1
    return kept


@allocating
def _before(one: Array, other: Array) -> bool:
    if one["row"] != other["row"]:
        return bool(one["row"] < other["row"])
    if one["time"] != other["time"]:
        return bool(one["time"] < other["time"])
    a, b = one["position"], other["position"]
    return bool(a[0] < b[0] or (a[0] == b[0] and a[1] < b[1]))


@allocating
def _pool(
    time: Floats, east: Floats, north: Floats, covariance: Floats, distance: Floats, azimuth: Floats, deep: Array,
    turn: Array, length: Array, width: Array, bearing: Array, bearing_sd: Array, cells: Array,
    bounds: tuple[float, float, float], clock: tuple[float, float, int], azimuths: int, sensor: int,
    aircraft_length: float, out: Array, found: Array,
) -> int:  # fmt: skip
    made = 0
    for k in range(len(time)):
        c = covariance[k]
        what = _judge(time[k], east[k], north[k], distance[k], azimuth[k], c, bounds)
        row = np.int64(0)
        if what == GOOD:
            own = int(azimuth[k] % (2.0 * math.pi) / (2.0 * math.pi) * azimuths) % azimuths
            about = clock[2] - (clock[0] - time[k]) / clock[1] * azimuths
            row = own + np.int64(np.rint((about - own) / azimuths)) * azimuths
            what = STALE if row < bounds[2] else GOOD
        found[what] += 1
        if what != GOOD:
            continue
        one = out[made]
        made += 1
        one["time"], one["row"], one["sensor"], one["image"], one["spent"] = time[k], row, sensor, -1, False
        one["position"][0], one["position"][1] = east[k], north[k]
        one["bearing"], one["bearing_sd"], one["cells"] = bearing[k], bearing_sd[k], cells[k]
        one["speed"] = one["course"] = one["velocity_sd"] = one["altitude"] = np.nan
        one["long"], one["surface"] = length[k] >= aircraft_length, 0
        extent = one["extent"]
        fill_extent(length[k], width[k], bearing[k], deep[k], turn[k], distance[k], azimuth[k], extent)
        for i in range(2):
            for j in range(2):
                one["covariance"][i, j] = one["noise"][i, j] = c[i, j]
    return made


@allocating
def _judge(
    time: float, east: float, north: float, distance: float, azimuth: float, c: Floats,
    bounds: tuple[float, float, float],
) -> int:  # fmt: skip
    if not (math.isfinite(time) and math.isfinite(azimuth) and math.isfinite(distance)):
        return INVALID
    if not math.hypot(east, north) < FARTHEST_PLOT:
        return INVALID
    if not (c[0, 0] > 0.0 and c[0, 0] * c[1, 1] > c[0, 1] * c[1, 0] and c[0, 0] + c[1, 1] < LARGEST_VARIANCE):
        return INVALID
    if not (math.isfinite(c[0, 1]) and math.isfinite(c[1, 0])):
        return INVALID
    return LATE if time < bounds[0] else FUTURE if time > bounds[1] else GOOD


@allocating
def add_centroid_noise(extent: Floats, centroid_sd: float, noise: Floats) -> None:
    """Add to noise (2, 2) m^2 that of an extended target's centroid, `centroid_sd` of its length and of its width."""
    direction = extent[2]
    along, across = (centroid_sd * extent[0]) ** 2, (centroid_sd * extent[1]) ** 2
    if not math.isfinite(direction):
        direction, across = 0.0, along
    s, c = math.sin(direction), math.cos(direction)
    noise[0, 0] += along * s * s + across * c * c
    noise[1, 1] += along * c * c + across * s * s
    noise[0, 1] += (along - across) * s * c
    noise[1, 0] += (along - across) * s * c
