"""The hysteresis extractor from its definition, by comparing all pairs of cells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Cells = NDArray[np.bool_]


def linked(a: NDArray[np.int64], b: NDArray[np.int64], window: NDArray[np.int64]) -> bool:
    """Whether two cells (row, range cell) lie in each other's window; window: (ranges) its rows."""
    return bool(abs(a[1] - b[1]) <= 1 and abs(a[0] - b[0]) <= min(window[a[1]], window[b[1]]))


def kept_cells(seeds: Cells, growth: Cells, window: NDArray[np.int64]) -> Cells:
    """The seeds, and the cells of growth that have a seed in their window."""
    kept = seeds.copy()
    at = np.argwhere(seeds)
    for cell in np.argwhere(growth & ~seeds):
        kept[tuple(cell)] = any(linked(cell, seed, window) for seed in at)
    return kept


def hysteresis_components(seeds: Cells, growth: Cells, window: NDArray[np.int64]) -> list[frozenset[tuple[int, int]]]:
    """The plots as sets of cells. seeds, growth: (rows, ranges)."""
    at = np.argwhere(kept_cells(seeds, growth, window))
    label = np.arange(len(at))
    for a in range(len(at)):
        for b in range(a):
            if label[a] != label[b] and linked(at[a], at[b], window):
                label[label == label[a]] = label[b]
    return [frozenset(map(tuple, at[label == one].tolist())) for one in np.unique(label)]
