"""Radar video: a block of consecutive sweeps, and the detections made on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.tables.schema import TableError


@dataclass(frozen=True, slots=True)
class VideoFormat:
    """The grid a radar's video is brought to: constant for the life of a chain.

    azimuths: sweeps a turn. ranges: cells a sweep. first_range_m: slant range of the centre of cell 0.
    range_step_m: metres between cell centres. beamwidth_rad: two-way azimuth resolution. period_s: nominal turn.
    db_per_step: decibels of one 8-bit step of the log amplifier.
    """

    azimuths: int = 4096
    ranges: int = 1024
    first_range_m: float = 0.0
    range_step_m: float = 3.0
    beamwidth_rad: float = float(np.deg2rad(0.18))
    period_s: float = 1.0
    db_per_step: float = 0.3125

    @property
    def azimuth_step_rad(self) -> float:
        """Radians between two sweeps of the grid."""
        return 2 * np.pi / self.azimuths

    @property
    def words(self) -> int:
        """64-bit words that hold one detection bit for each range cell of a sweep."""
        return (self.ranges + 63) // 64


@dataclass(frozen=True, slots=True, eq=False)
class Sweeps:
    """A block of consecutive sweeps of one radar: a whole scan, a sector, or one sweep. Never crosses north.

    radar: index of the radar in the engine. scan: counts the turns since start. row: (n,) int32 ascending position of
    each sweep in the azimuth grid, 0 .. azimuths-1 (a missing sweep is a missing row). azimuth: (n,) float64 rad from
    true north, centre of the sweep. time: (n,) float64 s UTC. amplitude: (n, ranges) uint8 log amplitude, C order.
    last: this block ends its scan (the antenna passed north). arrival: UTC s when the newest of it arrived at this
    host; nan when unknown.
    Raises TableError when shapes or dtypes do not fit.
    """

    radar: int
    scan: int
    row: NDArray[np.int32]
    azimuth: NDArray[np.float64]
    time: NDArray[np.float64]
    amplitude: NDArray[np.uint8]
    last: bool = False
    arrival: float = float("nan")

    def __post_init__(self) -> None:
        n = len(self.row)
        if self.amplitude.ndim != 2 or self.amplitude.dtype != np.uint8 or len(self.amplitude) != n:
            raise TableError(f"sweeps: amplitude must be uint8 of {n} rows, not {self.amplitude.shape}")
        if len(self.azimuth) != n or len(self.time) != n:
            raise TableError("sweeps: row, azimuth and time must have one length")
        if n > 1 and bool(np.any(np.diff(self.row) <= 0)):
            raise TableError("sweeps: rows must ascend")

    def __len__(self) -> int:
        return len(self.row)


@dataclass(frozen=True, slots=True, eq=False)
class Detections:
    """One bit a cell of a block: bit j % 64 of word j // 64 is range cell j. mask: (n, words) uint64.

    degraded: the block hit the detector's cap on runs. growth: (n, words) uint64, or None: the cells above a lower
    threshold, for extractors that grow plots out of the detected cells (`Detector.start`, growth_db).
    """

    mask: NDArray[np.uint64]
    degraded: bool = False
    growth: NDArray[np.uint64] | None = None

    def cells(self, ranges: int) -> NDArray[np.bool_]:
        """The same as (n, ranges) booleans, for tests and pictures; not for the hot path."""
        bits = np.unpackbits(self.mask.view(np.uint8), axis=1, bitorder="little")
        return bits[:, :ranges].astype(np.bool_)
