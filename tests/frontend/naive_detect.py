"""Slow, obvious twins of the detectors that keep a level of each cell or look at the cells about it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pipeline.detect.clutter_map import SETTLED, ClutterMap, ClutterMapState
from pipeline.tables import Sweeps


def clutter_map_limits(
    part: ClutterMap, blocks: Sequence[Sweeps], state: ClutterMapState
) -> tuple[list[NDArray[np.int64]], NDArray[np.int64]]:
    """Limits of each block and the level left, cell by cell in whole numbers (state: only its constants are used)."""
    level = np.zeros(state.level.shape, np.int64)
    heard = np.zeros(len(level), int)
    limits = []
    for block in blocks:
        made = np.empty(block.amplitude.shape, np.int64)
        for i, row in enumerate(block.row):
            age = min(heard[row], len(state.above) - 1)
            heard[row] += 1
            for j, x in enumerate(block.amplitude[i].astype(int)):
                old = int(level[row, j])
                made[i, j] = min(max((old + int(state.above[age]) + 128) // 256, 0), 255)
                if part.anti_masking in ("freeze", "both") and x > made[i, j]:
                    continue
                error = 256 * x - old
                if part.anti_masking in ("limit", "both") and age >= SETTLED:
                    error = min(error, state.limit_units)
                level[row, j] = old + (error * int(state.gain[age]) + 8192) // 16384
        limits.append(made)
    return limits, level
