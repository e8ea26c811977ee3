"""Which cells make one plot: a table of how far apart they may lie in range at each distance in azimuth rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class LinkRule:
    """ring_of_cell: (ranges) ring of each range cell. ring_stop: (rings) cell after each ring's last. reach: (rings,
    rows + 1) greatest range distance, in cells, of two linked cells at each row distance; -1 where none links.
    depth: (rings) greatest row distance at which cells of the ring link. edges: room for the ends of a row's runs.
    """

    ring_of_cell: NDArray[np.int64]
    ring_stop: NDArray[np.int64]
    reach: NDArray[np.int64]
    depth: NDArray[np.int64]
    edges: NDArray[np.int64]

    @classmethod
    def of(cls, reach: NDArray[np.int64]) -> LinkRule:
        """The rule of a table (ranges, rows + 1) as `reach`, given for each range cell.

        Two cells of different reach are linked when the smaller allows it. Raises ValueError when it does not fall (or
        stay) with range and with row distance, or when neighbours in a sweep are not linked.
        """
        if reach.ndim != 2 or (np.diff(reach, axis=0) > 0).any() or (np.diff(reach, axis=1) > 0).any():
            raise ValueError("the reach must fall with range and with row distance")
        if reach[:, 0].min() < 1 or reach.min() < -1:
            raise ValueError("neighbours in a sweep must be linked; what is never linked has the reach -1")
        changes = np.flatnonzero((np.diff(reach, axis=0) != 0).any(axis=1)) + 1
        stop = np.append(changes, len(reach)).astype(np.int64)
        ring = np.searchsorted(stop, np.arange(len(reach)), side="right").astype(np.int64)
        rows = max(1, int((reach >= 0).any(axis=0).sum()) - 1)
        table = np.full((len(stop), rows + 1), -1, np.int64)
        kept = reach[stop - 1][:, : rows + 1]
        table[:, : kept.shape[1]] = kept
        depth = (table >= 0).sum(axis=1) - 1
        return cls(ring, stop, table, depth.astype(np.int64), np.zeros(len(reach) + 66, np.int64))

    @property
    def rows(self) -> int:
        """The greatest row distance at which cells link."""
        return int(self.reach.shape[1]) - 1

    @property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """What the kernels take; the last is room to write in."""
        return self.ring_of_cell, self.ring_stop, self.reach, self.depth, self.edges
