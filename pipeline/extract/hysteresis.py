"""Plots grown out of detected cells over a lower threshold, linked within a window of metres.

Ours. Two thresholds, as in J. Canny, "A computational approach to edge detection", IEEE PAMI 8 (1986), section VIII,
but growth ends where it leaves the window of a detected cell instead of going on for as long as cells touch: some
percent of the clutter's cells lie over the lower threshold, and close to the radar, where the window has many azimuth
cells, it would wander off through them. The window is of one size in metres, as targets are, so that an aircraft is one
plot near the radar and far from it, and two cars are two.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np

from pipeline.kernels.component_state import MOST_OPEN_RUNS
from pipeline.kernels.growth import GrowthState, GrowthWindow, flush_grown, take_grown_block
from pipeline.kernels.links import LinkRule
from pipeline.sites import RadarSite
from pipeline.tables import Detections, Plots, Sweeps


@dataclass(frozen=True)
class Hysteresis:
    """Two cells belong to one plot when they lie in neighbouring range cells (or the same) and no more than window_m
    apart across them, or over others that do; at least the next azimuth cell is linked. The cells are the detected ones
    and those with a detected cell in their window that are more than growth_db above the mean log amplitude of their
    clutter.

    most_rows: greatest height of the window in azimuth cells (it holds at a few tens of metres). min_cells: plots of
    fewer cells are left out, counted. max_extent_turn: a plot is cut when it is as long as this part of a turn (an
    eighth is 78 m at 100 m), counted. max_open_runs: bound on the runs of cells in open plots; more are left out,
    counted. max_grown_runs: bound on the runs of a turn; a row over it keeps its detected cells only, counted.
    """

    growth_db: float = 7.0
    window_m: float = 3.0
    most_rows: int = 32
    min_cells: int = 1
    max_extent_turn: float = 0.125
    max_open_runs: int = 32_768
    max_grown_runs: int = 60_000

    def __post_init__(self) -> None:
        if not 0 < self.growth_db < 40:
            raise ValueError("growth_db must lie between 0 and 40")
        if not 0 < self.window_m < inf or not 1 <= self.most_rows <= 64:
            raise ValueError("window_m must be greater than 0, most_rows 1 to 64")
        if min(self.min_cells, self.max_grown_runs) < 1 or not 16 <= self.max_open_runs <= MOST_OPEN_RUNS:
            raise ValueError(f"min_cells and max_grown_runs must be 1 or more, max_open_runs 16 to {MOST_OPEN_RUNS}")
        if not 0 < self.max_extent_turn <= 0.5:
            raise ValueError("max_extent_turn must lie above 0 and not above 0.5")

    def start(self, site: RadarSite) -> GrowthState:
        """The state of one radar before its first sweep. On a very coarse grid the window is kept below a third of a
        turn."""
        video = site.video
        slant = np.maximum(video.first_range_m + video.range_step_m * np.arange(video.ranges), 1e-3)
        most = max(1, min(self.most_rows, (video.azimuths - 2) // 3))
        rows = np.clip(np.floor(self.window_m / (slant * video.azimuth_step_rad)), 1, most).astype(np.int64)
        rule = LinkRule.of(np.where(np.arange(most + 1) <= rows[:, None], 1, -1))
        return GrowthState.growing(
            site,
            rule,
            GrowthWindow.of(video, rule, self.max_grown_runs),
            min_cells=self.min_cells,
            max_extent_turn=self.max_extent_turn,
            max_open_runs=self.max_open_runs,
        )

    def __call__(self, sweeps: Sweeps, detections: Detections, state: GrowthState) -> Plots:
        """The plots that this block completed; without `Detections.growth` they are made of the detected cells."""
        return take_grown_block(sweeps, detections, state)

    def flush(self, state: GrowthState) -> Plots:
        """The plots that were still open."""
        return flush_grown(state)


PART = Hysteresis
