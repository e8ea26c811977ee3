"""The last few sweeps, for detectors that look back over them; sweeps that did not come are left out."""

from __future__ import annotations

from typing import Any

from pipeline.kernels.compiled import allocating


@allocating
def take_row(cells: Any, absolute: int, ring: Any, ring_row: Any, near: int, stack: Any) -> Any:
    """Lay out a sweep and those remembered before it, and remember it.

    cells: (ranges) uint8 of the row `absolute` = scan * azimuths + row. ring: (sweeps, ranges), ring_row: (sweeps) the
    same of each. stack: (1 + sweeps, ranges), to fill: this sweep, then the received ones of the `near` rows before
    it, then of the rows before those. Returns how many of either there are.
    """
    sweeps = ring.shape[0]
    stack[0, :] = cells
    close, far = 0, 0
    for back in range(1, sweeps + 1):
        slot = (absolute - back) % sweeps
        if ring_row[slot] == absolute - back:
            stack[1 + close + far, :] = ring[slot]
            if back <= near:
                close += 1
            else:
                far += 1
    if sweeps:
        ring[absolute % sweeps, :] = cells
        ring_row[absolute % sweeps] = absolute
    return close, far
