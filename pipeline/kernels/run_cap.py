"""A bound on the work that one turn's detections can cause, kept sweep by sweep so that block size does not matter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.kernels.bits import bits_above_raised, bits_of_row, count_runs
from pipeline.kernels.compiled import allocating


@dataclass(frozen=True)
class CapSettings:
    """A bucket of runs: every sweep adds `refill`, every run takes one, and no more than `depth` is saved up."""

    refill: float
    depth: float

    @classmethod
    def of(cls, max_runs: int, azimuths: int) -> CapSettings:
        """The bucket that lets max_runs a turn pass, a quarter of them at once."""
        return cls(refill=max_runs / azimuths, depth=max(max_runs / 4, 1.0))


@allocating
def detect_row(
    cells: Any, limits: Any, growth: Any, bits: Any, grown: Any, cap: Any, budget: Any, degraded: Any, tail: Any
) -> None:
    """Compare one row with its limits, within the bucket.

    cells: (ranges) uint8. limits, growth: (64 * words) uint8; growth may be empty. bits, grown: (words) uint64, to
    fill. cap: refill and depth of the bucket. budget, degraded: the bucket and the count of raised rows, changed. tail:
    see `bits_of_row`. A raised row grows nothing, so that a flood stays bounded for what follows, too.
    """
    budget[0] = min(budget[0] + cap[0], cap[1])
    raised = False
    if bits_of_row(cells, limits.ctypes.data, bits, tail):
        runs = count_runs(bits)
        raised = runs > budget[0]
        if raised:
            degraded[0] += 1
            fit_row(cells, limits.ctypes.data, bits, budget, tail)
        else:
            budget[0] -= runs
    if growth.size:
        if raised:
            for w in range(bits.size):
                grown[w] = bits[w]
        else:
            grow_row(cells, growth.ctypes.data, bits, grown, tail)


@allocating
def grow_row(cells: Any, limits_at: int, bits: Any, grown: Any, tail: Any) -> None:
    """Fill grown with the cells that exceed the limits at the address, and those of bits; the rest as in
    `bits_of_row`."""
    bits_of_row(cells, limits_at, grown, tail)
    for w in range(bits.size):
        grown[w] |= bits[w]


@allocating
def fit_row(cells: Any, limits_at: int, mask: Any, budget: Any, tail: Any) -> None:
    """Take the runs of one row out of the bucket; they do not fit, so the limits are raised until they do.

    Halving finds how much in eight passes, whatever the row: everything is below a limit raised by 255.

    cells: (ranges) uint8. limits_at: address of the row's limits, 64 bytes a word. mask: (words) uint64, rewritten.
    tail: 64 bytes of which those past the row's rest are 0.
    """
    low, high = 0, 255
    while high - low > 1:
        middle = (low + high) // 2
        _raise(cells, limits_at, mask, tail, middle)
        if count_runs(mask) > budget[0]:
            low = middle
        else:
            high = middle
    _raise(cells, limits_at, mask, tail, high)
    budget[0] -= count_runs(mask)


@allocating
def _raise(cells: Any, limits_at: int, mask: Any, tail: Any, raised: int) -> None:
    step = np.uint64(raised)
    whole = cells.size // 64
    for w in range(whole):
        at = np.uintp(64 * w)
        mask[w] = bits_above_raised(cells.ctypes.data + at, limits_at + at, step)
    if cells.size > 64 * whole:
        for j in range(cells.size - 64 * whole):
            tail[j] = cells[64 * whole + j]
        mask[whole] = bits_above_raised(tail.ctypes.data, limits_at + np.uintp(64 * whole), step)
