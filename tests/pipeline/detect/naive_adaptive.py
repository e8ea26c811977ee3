"""What the tile kernels of the adaptive detector do, as its definition says it: in steps of amplitude, as real numbers.

The kernels add saturating bytes, eight tiles at a time, and carry a 16-bit fixed point. Here a limit is found by trying
every amplitude, and an offset is one number that moves by a share of an error, over a tile's cells as arrays. All
values are multiples of 1/256 below 2**15, so that double precision is exact.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.kernels.tiles import BASE, CENTRE, CLASS, FLOOR, FREE, KEEP, LEAST, MEAN, STILL, WET

Whole = NDArray[np.int64]
Real = NDArray[np.float64]

AMPLITUDES = range(-128, 128)
"""All that a cell can hold, less 128."""

GREATEST = 128 - 1 / 256
"""The greatest number of a byte and its 1/256 steps."""


def limits(offset: Whole, rules: Whole) -> Whole:
    """(64) the greatest amplitude that is not shown. offset: (64). rules: (8 tiles, 8) signed bytes."""
    return np.array([_limit(int(offset[j]), rules[j // 8].tolist()) for j in range(64)])


def _limit(offset: int, rule: list[int]) -> int:
    hidden = [x for x in AMPLITUDES if x <= max(offset + rule[BASE], rule[FLOOR])]
    return max(hidden, default=AMPLITUDES[0])


def learn(
    cells: Whole, offset: Whole, fine: Whole, rules: Whole, strict: Whole, gains: list[int], most: list[int]
) -> tuple[Whole, Whole, Whole]:
    """The offsets and fines that follow, and (8, 3) what each tile's sums gain: count, residuals, magnitudes."""
    amplitude, texture = _tiles(cells) - 128.0, _tiles(offset)
    rule = {name: rules[:, [name]].astype(float) for name in (MEAN, WET, KEEP, CENTRE, LEAST)}
    kind = np.broadcast_to(rules[:, [CLASS]] & 3, (8, 8))
    free, still = ((rules[:, [CLASS]] & flag) > 0 for flag in (FREE, STILL))

    ground = _byte(texture + rule[MEAN])
    residual = _byte(amplitude - np.maximum(ground, rule[WET]))
    ordinary = residual <= rule[KEEP]
    rain_alone = (kind == 3) & (ground < rule[WET])
    counted = np.maximum(np.where(rain_alone, rule[CENTRE], residual), rule[LEAST])
    sums = [ordinary, ((counted - rule[LEAST]) % 256) * ordinary, np.abs(counted) * ordinary]

    bound = _tiles(strict) > 0
    kind, free = np.where(bound, np.minimum(kind, 1), kind), free & ~bound
    follows = (ordinary | free) & ~still
    error = np.where(follows, _byte(counted - rule[CENTRE]), 0.0)
    common = np.floor(error.mean(axis=1, keepdims=True) + 0.5)
    share = np.array(gains[:4])[kind] / 256
    moved = error * share
    paved = follows & (kind == 0)
    moved = np.where(paved, np.clip(moved + common * gains[4] / 256, -128, GREATEST), moved)
    following = np.clip(texture + _tiles(fine) / 256 + moved, -128, GREATEST)
    following = np.minimum(following, np.array(most, float)[kind])
    whole = np.floor(following)
    return (
        whole.astype(np.int64).ravel(),
        ((following - whole) * 256).astype(np.int64).ravel(),
        np.stack([one.sum(axis=1) for one in sums], axis=1).astype(np.int64),
    )


def _tiles(values: Whole) -> Real:
    return values.reshape(8, 8).astype(np.float64)


def _byte(values: Real) -> Real:
    """No number leaves the range of a signed byte."""
    return np.clip(values, AMPLITUDES[0], AMPLITUDES[-1])
