"""Slow, obvious twins of the detectors that keep a level of each cell or look at the cells about it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from pipeline.detect.ca import CellAveraging
from pipeline.detect.calibration import mean_offsets_db, power_mean_offsets_db
from pipeline.detect.clutter_map import SETTLED, ClutterMap, ClutterMapState
from pipeline.detect.window import Window
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


def window_cells(
    window: Window, scans: NDArray[np.uint8], keep: NDArray[np.bool_]
) -> Iterator[tuple[int, int, int, NDArray[np.uint8]]]:
    """Scan, row, range cell and the received amplitudes of the window about it. scans, keep: as in `strip`."""
    azimuths, ranges = scans.shape[1:]
    swept = scans.reshape(-1, ranges)
    heard = keep.ravel()
    for absolute in np.flatnonzero(heard):
        for j in range(ranges):
            inside = []
            for back in range(window.sweeps + 1):
                if absolute - back < 0 or not heard[absolute - back]:
                    continue
                for other in range(j - window.guard - window.side, j + window.guard + window.side + 1):
                    guarded = back <= window.near and abs(other - j) <= window.guard
                    if 0 <= other < ranges and not guarded:
                        inside.append(swept[absolute - back, other])
            yield absolute // azimuths, absolute % azimuths, j, np.array(inside, np.uint8)


def cell_averaging_limit(part: CellAveraging, inside: NDArray[np.uint8], independent: int, db_per_step: float) -> int:
    """The limit of one cell by the text."""
    if len(inside) == 0:
        return 255
    if part.domain == "power":
        level = 10 * np.log10(np.mean(10 ** (inside * db_per_step / 10))) / db_per_step
        above = power_mean_offsets_db(part.pfa, db_per_step, independent)[independent] / db_per_step
    else:
        level = inside.astype(int).sum() / len(inside)
        above = mean_offsets_db(part.pfa, db_per_step, independent)[independent] / db_per_step
    return int(min(np.floor(level + above + 0.5), 255))
