"""Places sorted into square cells: who looks for what is near visits some cells instead of all places."""

from __future__ import annotations

import math

import numpy as np

from pipeline.kernels.compiled import allocating
from pipeline.tables.arrays import Array, Floats

CELLS_PER_PLOT, LEAST_CELLS = 4, 64
"""Of the search grid at most for each measurement, and for all, so that one stray measurement does not make it
large."""


@allocating
def sort_into_cells(position: Floats, plots: Array, cell: float) -> tuple[Array, Array, Floats]:
    """Sort places into square cells of about `cell` m, larger where they would be many.

    position: (m, 2) m. plots: (k,) rows of it that count. Gives the first of each cell in `order` (cells + 1,), `order`
    (k,) the rows by cell, and (5,) west and south in m, the side of a cell in m, columns and rows of cells.
    """
    m = len(plots)
    west, east, south, north = np.inf, -np.inf, np.inf, -np.inf
    for j in plots:
        west, east = min(west, position[j, 0]), max(east, position[j, 0])
        south, north = min(south, position[j, 1]), max(north, position[j, 1])
    most = max(CELLS_PER_PLOT * m, LEAST_CELLS)
    wide, high = max(east - west, 1.0), max(north - south, 1.0)
    cell = max(cell, math.sqrt(wide * high / most), wide / most, high / most)
    nx, ny = int(wide / cell) + 1, int(high / cell) + 1
    start, order, where = np.zeros(nx * ny + 1, np.int32), np.empty(m, np.int32), np.empty(m, np.int32)
    for o in range(m):
        j = plots[o]
        where[o] = int((position[j, 1] - south) / cell) * nx + int((position[j, 0] - west) / cell)
        start[where[o] + 1] += 1
    for c in range(1, len(start)):
        start[c] += start[c - 1]
    filled = start.copy()
    for o in range(m):
        order[filled[where[o]]] = plots[o]
        filled[where[o]] += 1
    return start, order, np.array([west, south, cell, float(nx), float(ny)])


@allocating
def span(low: float, high: float, cell: float, cells: int) -> tuple[int, int]:
    """Cells [from, to) of `cells` of side `cell` that an interval touches, from 0 at the edge of the first."""
    if high < 0.0 or low > cells * cell:
        return 0, 0
    return max(int(low / cell), 0) if low > 0.0 else 0, min(int(high / cell) + 1, cells)
