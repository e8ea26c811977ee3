"""One target whose echo falls into several plots in one turn: their common centre and extent."""

from __future__ import annotations

import math

from pipeline.kernels.compiled import allocating
from pipeline.tables.arrays import Array, Floats


@allocating
def join_split_plots(
    members: Array, position: Floats, cells: Array, extent: Floats, direction: float, centre: Floats, whole: Floats
) -> None:
    """Write the centre (2,) and the extent (3,) of one target that `members` (p,), rows of the plots, belong to.

    position: (m, 2) m. cells: (m,) number of cells, by which the centre is weighed. extent: (m, 3) length m, width m
    and direction rad of each plot, nan where unknown. direction: rad of the target, along and across which its extent
    is measured from end to end.
    """
    s, c = math.sin(direction), math.cos(direction)
    total = east = north = 0.0
    ahead, behind, right, left = -math.inf, math.inf, -math.inf, math.inf
    for j in members:
        weight = float(max(cells[j], 1))
        total += weight
        east += weight * position[j, 0]
        north += weight * position[j, 1]
        along = position[j, 0] * s + position[j, 1] * c
        across = position[j, 0] * c - position[j, 1] * s
        turn = (extent[j, 2] if math.isfinite(extent[j, 2]) else 0.0) - direction
        lean, cross = abs(math.cos(turn)), abs(math.sin(turn))
        half_along = 0.5 * max(extent[j, 0] * lean, extent[j, 1] * cross)
        half_across = 0.5 * max(extent[j, 0] * cross, extent[j, 1] * lean)
        ahead, behind = max(ahead, along + half_along), min(behind, along - half_along)
        right, left = max(right, across + half_across), min(left, across - half_across)
    centre[0], centre[1] = east / total, north / total
    whole[0], whole[1], whole[2] = ahead - behind, right - left, direction % math.pi
