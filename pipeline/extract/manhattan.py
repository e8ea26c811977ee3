"""Plots as connected components under a Manhattan distance that falls with range.

G. Galati, M. Leonardi, A. Cavallin, G. Pavan, "Airport surveillance processing chain for high resolution radar",
section 4A, equation (1.2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.kernels.component_state import MOST_OPEN_RUNS, ComponentState
from pipeline.kernels.components import flush, take_block
from pipeline.kernels.links import LinkRule
from pipeline.sites import RadarSite
from pipeline.tables import Detections, Plots, Sweeps


@dataclass(frozen=True)
class Manhattan:
    """Two detected cells belong to one plot when |i - k| + |j - l| <= M in azimuth and range cells, or over others that
    do.

    ring_m, reach: M is reach[n] from slant range ring_m[n] on (metres, from 0, rising; M falling): one azimuth cell is
    0.15 m wide at 100 m and 2.3 m at 1.5 km. Between cells of two rings the smaller M holds. min_cells: plots of fewer
    cells are left out, counted. max_extent_turn: a plot is cut when it is as long as this part of a turn, counted.
    max_open_runs: bound on the runs of cells in open plots; more are left out, counted.
    """

    ring_m: tuple[float, ...] = (0.0, 150.0, 300.0, 800.0, 1500.0)
    reach: tuple[int, ...] = (6, 4, 3, 2, 1)
    min_cells: int = 1
    max_extent_turn: float = 0.05
    max_open_runs: int = 32_768

    def __post_init__(self) -> None:
        object.__setattr__(self, "ring_m", tuple(float(one) for one in self.ring_m))
        object.__setattr__(self, "reach", tuple(int(one) for one in self.reach))
        if not self.ring_m or len(self.ring_m) != len(self.reach):
            raise ValueError("ring_m and reach must be of one length")
        if self.ring_m[0] != 0 or any(not b > a for a, b in zip(self.ring_m, self.ring_m[1:], strict=False)):
            raise ValueError("ring_m must begin with 0 and rise")
        if (
            self.reach[-1] < 1
            or self.reach[0] > 64
            or any(b > a for a, b in zip(self.reach, self.reach[1:], strict=False))
        ):
            raise ValueError("reach must fall from at most 64 to at least 1")
        if self.min_cells < 1 or not 16 <= self.max_open_runs <= MOST_OPEN_RUNS:
            raise ValueError(f"min_cells must be 1 or more, max_open_runs 16 to {MOST_OPEN_RUNS}")
        if not 0 < self.max_extent_turn <= 0.5:
            raise ValueError("max_extent_turn must lie above 0 and not above 0.5")

    def start(self, site: RadarSite) -> ComponentState:
        """The state of one radar before its first sweep. On a very coarse grid M is kept below a third of a turn."""
        video = site.video
        slant = video.first_range_m + video.range_step_m * np.arange(video.ranges)
        ring = np.searchsorted(np.array(self.ring_m), slant, side="right") - 1
        reach = np.array(self.reach, np.int64)[np.maximum(ring, 0)]
        reach = np.minimum(reach, max(1, (video.azimuths - 2) // 3))
        rule = LinkRule.of(np.maximum(reach[:, None] - np.arange(reach.max() + 1), -1))
        return ComponentState.of(
            site,
            rule,
            min_cells=self.min_cells,
            max_extent_turn=self.max_extent_turn,
            max_open_runs=self.max_open_runs,
        )

    def __call__(self, sweeps: Sweeps, detections: Detections, state: ComponentState) -> Plots:
        """The plots that this block completed."""
        return take_block(sweeps, detections, state)

    def flush(self, state: ComponentState) -> Plots:
        """The plots that were still open."""
        return flush(state)


PART = Manhattan
