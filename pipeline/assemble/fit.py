"""Whether the cells of a message fit the grid."""

from __future__ import annotations

from pipeline.assemble.state import (
    REFUSED_DURATION,
    REFUSED_FIRST,
    REFUSED_REACH,
    REFUSED_SOURCE,
    REFUSED_WHY,
    WRONG_CELL_COUNT,
    WRONG_GEOMETRY,
)
from pipeline.kernels.compiled import allocating


@allocating
def fits(one, rules, refused, counts):  # type: ignore[no-untyped-def]
    """Cells and cell duration are such as the grid can take."""
    if not same_cells(one, rules.cell_fs):
        if rules.resample == 1:
            return True
        counts[WRONG_GEOMETRY] += 1
        refuse(one, WRONG_GEOMETRY, refused)
        return False
    column = one[3] - rules.first_cell
    if column < 0 or column + one[5] > rules.ranges:
        counts[WRONG_CELL_COUNT] += 1
        refuse(one, WRONG_CELL_COUNT, refused)
        return False
    return True


@allocating
def same_cells(one, cell_fs):  # type: ignore[no-untyped-def]
    """The last cell of the message lies within half a cell of where the grid has it."""
    return abs(one[4] - cell_fs) * (one[3] + one[5]) <= 0.5 * cell_fs


@allocating
def refuse(one, why, refused):  # type: ignore[no-untyped-def]
    """Note what does not fit, so that it can be told."""
    if refused[REFUSED_WHY] != why or refused[REFUSED_DURATION] != one[4] or refused[REFUSED_SOURCE] != one[7]:
        refused[REFUSED_REACH], refused[REFUSED_FIRST] = 0, one[3]
    refused[REFUSED_WHY] = why
    refused[REFUSED_REACH] = max(refused[REFUSED_REACH], one[3] + one[5])
    refused[REFUSED_FIRST] = min(refused[REFUSED_FIRST], one[3])
    refused[REFUSED_DURATION], refused[REFUSED_SOURCE] = one[4], one[7]
