"""What the readers of recordings have in common."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.contract import Refused
from app.ingest.wire_json import EARLIEST, LATEST
from pipeline.sites import RadarSite
from pipeline.tables import Sweeps, VideoFormat

MAX_AZIMUTHS, MAX_RANGES, MAX_CELLS = 65536, 16384, 1 << 27


SHORTEST_TURN_S, LONGEST_TURN_S = 0.02, 120.0
"""Turns of an antenna that are believed: an air defence radar takes 12 s, a surface movement radar 1 s."""


class RecordingError(Refused):
    """A recording that cannot be read; the message names the file and the reason."""


@dataclass(frozen=True)
class Recording:
    """A recording that is open. site: its radar, at the origin. scans: turns in it, None when that is not known.

    blocks: gives the blocks of sweeps from the beginning; raises RecordingError where the file turns out to be damaged.
    counters: what was read and what was left out, by reason; grows while blocks are read. notes: what had to be assumed
    or converted, for people. source: SAC and SIC of its messages, None when it has none.
    """

    path: Path
    site: RadarSite
    scans: int | None
    blocks: Callable[[], Iterator[Sweeps]]
    counters: Counter[str] = field(default_factory=Counter)
    notes: tuple[str, ...] = ()
    source: tuple[int, int] | None = None


def blocks_of_turn(
    scan: int, amplitude: NDArray[np.uint8], begin: float, period: float, blocks: int
) -> Iterator[Sweeps]:
    """One turn (azimuths, ranges) uint8 that took `period` seconds from `begin` on, in `blocks` blocks."""
    azimuths = len(amplitude)
    parts = min(blocks, azimuths)
    edges = [-(-i * azimuths // parts) for i in range(parts + 1)]
    for low, high in pairwise(edges):
        row = np.arange(low, high, dtype=np.int32)
        turn = (row + 0.5) / azimuths
        yield Sweeps(
            radar=0, scan=scan, row=row, azimuth=2 * math.pi * turn, time=begin + turn * period,
            amplitude=np.ascontiguousarray(amplitude[low:high]), last=high == azimuths,
        )  # fmt: skip


def turns_of(
    path: Path, times: NDArray[np.float64], period: float | None
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """(begin, period) of each turn, and the usual period."""
    if not len(times) or not bool(np.isfinite(times).all()):
        raise RecordingError(f"{path}: times must be finite numbers")
    steps = np.diff(times)
    if len(steps) and steps.min() <= 0:
        raise RecordingError(f"{path}: time steps back after turn {int(np.argmin(steps > 0))}")
    usual = period if period is not None else (float(np.median(steps)) if len(steps) else 1.0)
    if not SHORTEST_TURN_S <= usual <= LONGEST_TURN_S:
        raise RecordingError(
            f"{path}: no radar turns once in {usual:g} s ({SHORTEST_TURN_S:g} to {LONGEST_TURN_S:g} s are believed): "
            "times and period must be in seconds"
        )
    # a turn that was not recorded must not slow down the one before it
    periods = np.append(np.where(steps > 1.5 * usual, usual, steps), usual)
    return times, periods, usual


def in_seconds(times: NDArray[Any]) -> tuple[NDArray[np.float64], str]:
    """(UTC seconds of times, what they were taken for or ""): numpy's own dates, or numbers so large that they can
    only be milli-, micro- or nanoseconds since 1970.
    """
    if times.dtype.kind == "M":
        return times.astype("datetime64[ns]").astype(np.int64) / 1e9, "times are dates of numpy, taken as UTC"
    seconds = times.astype(np.float64)
    for power, unit in ((3, "milliseconds"), (6, "microseconds"), (9, "nanoseconds")):
        smaller = seconds / 10.0**power
        if len(seconds) and bool(((smaller >= EARLIEST) & (smaller < LATEST)).all()):
            return smaller, f"times are in {unit}, taken as such"
    return seconds, ""


def video_format(path: Path, shape: tuple[int, int], period: float, words: Mapping[str, Any]) -> VideoFormat:
    """The format of turns of `shape`, with what the file says in `words`. Raises RecordingError."""
    azimuths, ranges = shape
    if not 16 <= azimuths <= MAX_AZIMUTHS or not 16 <= ranges <= MAX_RANGES or azimuths * ranges > MAX_CELLS:
        raise RecordingError(f"{path}: {azimuths} azimuths of {ranges} cells cannot be used")
    return VideoFormat(
        azimuths=azimuths,
        ranges=ranges,
        first_range_m=number_of(path, words, "first_range_m", 0.0, 0.0),
        range_step_m=number_of(path, words, "range_step_m", 3.0, 1e-3),
        beamwidth_rad=math.radians(number_of(path, words, "beamwidth_deg", max(0.18, 360 / azimuths), 1e-6)),
        period_s=period,
        db_per_step=number_of(path, words, "db_per_step", 0.3125, 1e-6),
    )


def number_of(path: Path, words: Mapping[str, Any], name: str, default: float, least: float) -> float:
    """A finite number from `least` on. Raises RecordingError."""
    try:
        value = float(words.get(name, default))
    except (TypeError, ValueError) as error:
        raise RecordingError(f"{path}: {name} must be a number") from error
    if not math.isfinite(value) or value < least or value > 1e6:
        raise RecordingError(f"{path}: {name} {value:g} is out of range")
    return value
