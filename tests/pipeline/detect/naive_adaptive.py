"""The tile kernels of the adaptive detector, cell by cell in whole numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.kernels.tiles import BASE, CENTRE, CLASS, FLOOR, FREE, KEEP, LEAST, MEAN, STILL, WET

Whole = NDArray[np.int64]


def _fits(value: int) -> int:
    return min(max(value, -128), 127)


def limits(offset: Whole, rules: Whole) -> Whole:
    """(64) signed limits. offset: (64). rules: (8 tiles, 8) signed bytes."""
    rule = rules[np.arange(64) // 8]
    return np.array([max(_fits(o + r[BASE]), r[FLOOR]) for o, r in zip(offset.tolist(), rule.tolist(), strict=True)])


def learn(
    cells: Whole, offset: Whole, fine: Whole, rules: Whole, strict: Whole, gains: list[int], most: list[int]
) -> tuple[Whole, Whole, Whole]:
    """The offsets and fines that follow, and (8, 3) what each tile's sums gain: count, residuals, magnitudes."""
    new_offset, new_fine, sums = offset.copy(), fine.copy(), np.zeros((8, 3), np.int64)
    errors, numbers, following = np.zeros(64, np.int64), np.zeros(64, np.int64), np.zeros(64, bool)
    for j in range(64):
        r = rules[j // 8].tolist()
        own = _fits(int(offset[j]) + r[MEAN])
        residual = _fits(int(cells[j]) - 128 - max(own, r[WET]))
        kept = residual <= r[KEEP]
        if r[CLASS] & 3 == 3 and own < r[WET]:
            residual = r[CENTRE]
        bounded = max(residual, r[LEAST])
        if kept:
            sums[j // 8] += (1, (bounded - r[LEAST]) % 256, abs(bounded))
        number, free, still = r[CLASS] & 3, bool(r[CLASS] & FREE), bool(r[CLASS] & STILL)
        if strict[j]:
            number, free = min(number, 1), False
        following[j], numbers[j] = (kept or free) and not still, number
        errors[j] = _fits(bounded - r[CENTRE]) if following[j] else 0
    for j in range(64):
        change = int(errors[j]) * gains[numbers[j]]
        if numbers[j] == 0 and following[j]:
            together = (int(errors[j // 8 * 8 : j // 8 * 8 + 8].sum()) + 4) >> 3
            change = min(max(change + together * gains[4], -32768), 32767)
        moved = min(max(256 * int(offset[j]) + int(fine[j]) + change, -32768), 32767)
        moved = min(moved, 256 * most[numbers[j]])
        new_offset[j], new_fine[j] = moved >> 8, moved & 255
    return new_offset, new_fine, sums
