"""One target whose echo falls into several plots in one turn: their common centre and extent."""

from __future__ import annotations

import math

import numpy as np

from pipeline.tables.arrays import Array, Floats


def join_split_plots(
    member: Array, position: Floats, cells: Array, extent: Floats, direction: Floats
) -> tuple[Floats, Floats]:
    """Centre (k, 2) m and extent (k, 3) of k targets.

    member: (p,) the target of each plot; the first k plots are one of each target, in order. position: (p, 2) m.
    cells: (p,) number of cells, by which the centre is weighed. extent: (p, 3) length m, width m and direction rad of
    each plot, nan where unknown. direction: (k,) rad of the targets, along and across which their extent is measured
    from end to end. A target of one plot keeps what that says.
    """
    k = len(direction)
    weight = np.maximum(cells, 1).astype(np.float64)
    total = np.bincount(member, weight, k)
    centre = np.stack([np.bincount(member, weight * position[:, axis], k) / total for axis in (0, 1)], axis=1)
    split = np.bincount(member, minlength=k) > 1
    made = extent[:k].copy()
    turn = np.nan_to_num(extent[:, 2]) - direction[member]
    for axis, (s, c) in enumerate(((np.sin(direction), np.cos(direction)), (np.cos(direction), -np.sin(direction)))):
        along = position[:, 0] * s[member] + position[:, 1] * c[member]
        lean = np.abs(np.cos(turn)) if axis == 0 else np.abs(np.sin(turn))
        half = 0.5 * np.maximum(extent[:, 0] * lean, extent[:, 1] * np.sqrt(1 - lean**2))
        low, high = np.full(k, np.inf), np.full(k, -np.inf)
        np.minimum.at(low, member, along - half)
        np.maximum.at(high, member, along + half)
        made[split, axis] = (high - low)[split]
    made[split, 2] = direction[split] % math.pi
    return np.where(split[:, None], centre, position[:k]), made
