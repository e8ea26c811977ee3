"""Cells of another length brought to those of the grid."""

from __future__ import annotations

import numpy as np

from pipeline.kernels.compiled import allocating


@allocating
def resampled(one, source, rules):  # type: ignore[no-untyped-def]
    """(first column, cells) of a message on the grid; cells beyond the grid are left out.

    Each grid cell gets the greatest of the cells whose centres lie in it, so that no echo is lost, or, where they are
    longer than the grid's, the one that it lies in.
    """
    ratio = rules.cell_fs / one[4]
    first, end = one[3], one[3] + one[5]
    low = max(int(np.ceil((first - 0.5) / ratio)), rules.first_cell)
    high = min(int(np.ceil((end - 0.5) / ratio)), rules.first_cell + rules.ranges)
    cells = np.empty(max(high - low, 0), np.uint8)
    for i in range(len(cells)):
        place = low + i
        begin = max(int(np.ceil((place - 0.5) * ratio)), first)
        stop = min(int(np.ceil((place + 0.5) * ratio)), end)
        if stop <= begin:
            begin = min(max(int(np.floor(place * ratio + 0.5)), first), end - 1)
            stop = begin + 1
        cells[i] = source[begin - first : stop - first].max()
    return low - rules.first_cell, cells
