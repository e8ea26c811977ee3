"""Which tracks are near others: only those need to be looked at more closely."""

from __future__ import annotations

import numpy as np

from pipeline.kernels.cells import sort_into_cells, span
from pipeline.kernels.compiled import allocating
from pipeline.tables.arrays import Array, Floats
from pipeline.track.core import Core

MARGIN_M = 20.0
"""By which the search reaches further than the pairs that are wanted: filters do not move all targets along their
velocity, as the search does."""


def close_rows(core: Core, rows: Array, time: float, reach: float, marked: Array | None = None) -> Array:
    """Those of `rows` (k,) that may have another within `reach` m in east and in north at `time` UTC s, in their order.

    marked: (k,) mask, of which one of each pair must be. Nothing nearer than `reach` is left out, but more may be in.
    """
    if len(rows) < 2 or (marked is not None and not marked.any()):
        return rows[:0]
    near = np.zeros(len(rows), np.bool_)
    every = np.ones(len(rows), np.bool_) if marked is None else marked
    _search(core.store.rows, core.store.time, rows, time, every, reach + MARGIN_M, near)
    return np.asarray(rows[near])


@allocating
def _search(
    tracks: Array, own_time: Floats, rows: Array, time: float, marked: Array, reach: float, near: Array
) -> None:
    place = np.empty((len(rows), 2))
    for k in range(len(rows)):
        x, dt = tracks[rows[k]]["state"], time - own_time[rows[k]]
        place[k, 0], place[k, 1] = x[0] + dt * x[2], x[1] + dt * x[3]
    start, order, grid = sort_into_cells(place, np.arange(len(rows)), reach)
    west, south, cell, nx, ny = grid[0], grid[1], grid[2], int(grid[3]), int(grid[4])
    for i in range(len(rows)):
        if not marked[i]:
            continue
        x_from, x_to = span(place[i, 0] - reach - west, place[i, 0] + reach - west, cell, nx)
        y_from, y_to = span(place[i, 1] - reach - south, place[i, 1] + reach - south, cell, ny)
        for cy in range(y_from, y_to):
            for o in range(start[cy * nx + x_from], start[cy * nx + x_to] if x_to > x_from else 0):
                j = order[o]
                if j != i and abs(place[j, 0] - place[i, 0]) <= reach and abs(place[j, 1] - place[i, 1]) <= reach:
                    near[i] = near[j] = True
