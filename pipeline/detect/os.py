"""Ordered-statistic CFAR: the k-th smallest of the cells about the cell under test, plus a constant.

H. Rohling, "Radar CFAR thresholding in clutter and multiple target situations", IEEE Transactions on Aerospace and
Electronic Systems 19 (4), 1983; compared by Galati et al., "Airport surveillance processing chain for high resolution
radar", section 3.
"""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.detect.calibration import order_offset_steps
from pipeline.detect.limits import limits_used
from pipeline.detect.window import BEYOND, WindowState, check_settings, detect_block, window_fields, window_of
from pipeline.kernels.bits import borrowed
from pipeline.kernels.compiled import allocating
from pipeline.kernels.recent_rows import take_row
from pipeline.kernels.run_cap import detect_row
from pipeline.tables import Detections, Sweeps, VideoFormat

GOLDEN = (np.sqrt(5) - 1) / 2
"""Multiples of it, without their whole part, are spread as evenly as can be."""


@dataclass(eq=False, kw_only=True)
class OrderedStatisticState(WindowState):
    """rank: (near + 1, further + 1, ranges) which of the cells of the window, counted up from the smallest."""

    rank: NDArray[np.int64]


@dataclass(frozen=True)
class OrderedStatistic:
    """A cell is detected when its log amplitude exceeds the k-th smallest of the cells about it by a constant.

    pfa: false alarm probability in Rayleigh clutter, held including the 8-bit rounding and the error of the statistic,
    for as many cells as the window has in each place. The constant is in whole steps, since level and limit are; so
    that the probability is neither too high nor too low, an evenly spread share of the range cells has one step more.
    rank: k as a part of the cells of the window. side, guard, sweeps, guard_sweeps: the window, as in `ca`. max_runs:
    as in `hybrid`.

    It learns nothing: the first sweep is judged like all others, but for those earlier sweeps that are not there.
    """

    pfa: float = 1e-6
    rank: float = 0.75
    side: int = 16
    guard: int = 2
    sweeps: int = 0
    guard_sweeps: int = 2
    max_runs: int = 40_000

    def __post_init__(self) -> None:
        check_settings(self)
        if not 0 < self.rank <= 1:
            raise ValueError("rank must lie above 0 and not above 1")

    def start(
        self, video: VideoFormat, surface: NDArray[np.uint8] | None = None, growth_db: float | None = None
    ) -> OrderedStatisticState:
        """The state before the first sweep. surface is not used."""
        count = window_of(self).counts(video.ranges)
        independent = window_of(self).independent(video)
        rank = np.clip(np.rint(self.rank * count), 1, np.maximum(count, 1)).astype(np.int64)
        spread = np.arange(video.ranges) * GOLDEN % 1

        def above(pfa: float) -> NDArray[np.float64]:
            kinds, which = np.unique(np.stack([count, independent, rank]).reshape(3, -1), axis=1, return_inverse=True)
            steps = [
                order_offset_steps(pfa, video.db_per_step, one, k * one / n) if n else BEYOND for n, one, k in kinds.T
            ]
            return np.asarray(np.floor(np.array(steps)[which].reshape(count.shape) + spread))

        return OrderedStatisticState(**window_fields(self, video, surface, growth_db, above), rank=rank)

    def __call__(self, sweeps: Sweeps, state: OrderedStatisticState) -> Detections:
        """The detections of the block. Raises TableError when it is not on the grid of the state."""
        return detect_block(_detect, self, sweeps, state, (state.rank,))

    def thresholds(self, sweeps: Sweeps, state: OrderedStatisticState) -> NDArray[np.uint8]:
        """(n, ranges) the limits that the call would compare the block with."""
        return limits_used(self, sweeps, deepcopy(state))


PART = OrderedStatistic


@allocating
def _detect(amplitude: Any, rows: Any, masks: Any, window: Any, tables: Any, memory: Any, cap: Any, own: Any) -> None:
    """See `detect_block`. own: rank of the state."""
    amplitude, rows = borrowed(amplitude), borrowed(rows)
    mask, grown = borrowed(masks[0]), borrowed(masks[1])
    guard, reach, near = window
    count, above, growth_above = borrowed(tables[0]), borrowed(tables[1]), borrowed(tables[2])
    ring, ring_row, stack = borrowed(memory[0]), borrowed(memory[1]), borrowed(memory[2])
    threshold, growth = borrowed(memory[3]), borrowed(memory[4])
    rank = borrowed(own[0])
    refill, depth, budget, degraded, tail = cap
    budget, degraded, tail = borrowed(budget), borrowed(degraded), borrowed(tail)
    ranges = amplitude.shape[1]
    histogram = np.empty(256, np.int64)
    level = np.empty(ranges, np.int64)
    for i in range(amplitude.shape[0]):
        cells = amplitude[i]
        close, far = take_row(cells, rows[i], ring, ring_row, near, stack)
        _order(stack, 1 + close, 1 + close + far, guard, reach, count[close, far], rank[close, far], histogram, level)
        offset = above[close, far]
        for j in range(ranges):
            threshold[j] = np.uint8(min(max(level[j] + offset[j], 0.0), 255.0))
        if growth.size:
            offset = growth_above[close, far]
            for j in range(ranges):
                growth[j] = np.uint8(min(max(level[j] + offset[j], 0.0), 255.0))
        detect_row(cells, threshold, growth, mask[i], grown[i], (refill, depth), budget, degraded, tail)


@allocating
def _order(
    stack: Any, close: int, rows: int, guard: int, reach: int, count: Any, rank: Any, histogram: Any, level: Any
) -> None:
    """The statistic of each cell by a histogram that slides along the sweep; 0 where the window is empty.

    The first `close` rows leave out the guard cells.
    """
    ranges = stack.shape[1]
    histogram[:] = 0
    value, below = 0, 0
    for r in range(rows):
        cells = stack[r]
        for j in range(min(reach, ranges)):  # the window of a cell before the first
            histogram[cells[j]] += 1
            below += cells[j] < value
    for r in range(close):
        cells = stack[r]
        for j in range(min(guard, ranges)):
            histogram[cells[j]] -= 1
            below -= cells[j] < value
    for j in range(ranges):
        come, gone, close_come, close_gone = j + reach, j - reach - 1, j - guard - 1, j + guard
        for r in range(rows):
            cells = stack[r]
            if come < ranges:
                histogram[cells[come]] += 1
                below += cells[come] < value
            if gone >= 0:
                histogram[cells[gone]] -= 1
                below -= cells[gone] < value
            if r < close:
                if close_come >= 0:
                    histogram[cells[close_come]] += 1
                    below += cells[close_come] < value
                if close_gone < ranges:
                    histogram[cells[close_gone]] -= 1
                    below -= cells[close_gone] < value
        if count[j] == 0:
            level[j] = 0
            continue
        while below >= rank[j]:
            value -= 1
            below -= histogram[value]
        while below + histogram[value] < rank[j]:
            below += histogram[value]
            value += 1
        level[j] = value
