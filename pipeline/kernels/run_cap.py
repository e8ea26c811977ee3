"""A bound on the work that one turn's detections can cause, kept sweep by sweep so that block size does not matter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from pipeline.kernels.bits import bits_above_raised, count_runs

RAISE_STEPS = 8
"""A row with too many runs is compared again with limits this many steps higher, as often as it takes."""


@dataclass(frozen=True)
class CapSettings:
    """A bucket of runs: every sweep adds `refill`, every run takes one, and no more than `depth` is saved up."""

    refill: float
    depth: float

    @classmethod
    def of(cls, max_runs: int, azimuths: int) -> CapSettings:
        """The bucket that lets max_runs a turn pass, a quarter of them at once."""
        return cls(refill=max_runs / azimuths, depth=max(max_runs / 4, 1.0))


@njit(nogil=True, cache=True)
def fit_row(cells: Any, limits_at: int, mask: Any, budget: Any, tail: Any) -> None:
    """Take the runs of one row out of the bucket; they do not fit, so the limits are raised until they do.

    cells: (ranges) uint8. limits_at: address of the row's limits, 64 bytes a word. mask: (words) uint64, rewritten when
    needed. tail: 64 bytes of which those past the row's rest are 0.
    """
    runs = count_runs(mask)
    raised = 0
    whole = cells.size // 64
    while runs > budget[0]:
        raised = min(raised + RAISE_STEPS, 255)
        step = np.uint64(raised)
        for w in range(whole):
            at = np.uintp(64 * w)
            mask[w] = bits_above_raised(cells.ctypes.data + at, limits_at + at, step)
        if cells.size > 64 * whole:
            for j in range(cells.size - 64 * whole):
                tail[j] = cells[64 * whole + j]
            mask[whole] = bits_above_raised(tail.ctypes.data, limits_at + np.uintp(64 * whole), step)
        runs = count_runs(mask)
    budget[0] -= runs
