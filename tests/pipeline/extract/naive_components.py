"""Slow, obvious twins of the kernels that link cells to components."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def linked_components(cells: NDArray[np.bool_], reach: NDArray[np.int64]) -> list[frozenset[tuple[int, int]]]:
    """Connected components by comparing all pairs of cells. cells: (rows, ranges). reach: (ranges, row distances)
    greatest range distance of linked cells, -1 for none; the smaller of two cells' holds."""
    at = np.argwhere(cells)
    label = np.arange(len(at))
    for a in range(len(at)):
        for b in range(a):
            rows, away = abs(at[a] - at[b])
            if rows >= reach.shape[1] or label[a] == label[b]:
                continue
            if away <= min(reach[at[a, 1], rows], reach[at[b, 1], rows]):
                label[label == label[a]] = label[b]
    return [frozenset(map(tuple, at[label == one].tolist())) for one in np.unique(label)]


def grown_cells(seeds: NDArray[np.bool_], growth: NDArray[np.bool_], reach: NDArray[np.int64]) -> NDArray[np.bool_]:
    """The detected cells, and the growth with a detected cell near: in its range cell or the next, not farther in rows
    than `reach` (as above) links at both cells."""
    kept = seeds.copy()
    farthest = (reach >= 0).sum(axis=1) - 1
    row, cell = np.nonzero(seeds)
    for i, j in np.argwhere(growth):
        near = (abs(cell - j) <= 1) & (abs(row - i) <= np.minimum(farthest[j], farthest[cell]))
        kept[i, j] |= bool(near.any())
    return kept
