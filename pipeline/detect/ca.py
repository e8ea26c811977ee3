"""Cell-averaging CFAR: the mean of the cells about the cell under test, plus a constant.

H. Rohling, "Radar CFAR thresholding in clutter and multiple target situations", 1983; compared by Galati et al.,
"Airport surveillance processing chain for high resolution radar", section 3. In log video the mean is that of the log
amplitudes (V. G. Hansen, H. R. Ward, "Detection performance of the cell averaging LOG/CFAR receiver", 1972).
"""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from pipeline.detect.calibration import mean_offsets_db, power_mean_offsets_db
from pipeline.detect.limits import limits_used
from pipeline.detect.window import BEYOND, WindowState, check_settings, detect_block, window_fields, window_of
from pipeline.kernels.bits import borrowed
from pipeline.kernels.compiled import allocating
from pipeline.kernels.recent_rows import take_row
from pipeline.kernels.run_cap import detect_row
from pipeline.tables import Detections, Sweeps, VideoFormat

Domain = Literal["log", "power"]

FULL_POWER = 1 << 40
"""Units of power of full scale: whole numbers, so that sums are exact in any order; 120 dB below it is nothing."""


@dataclass(eq=False, kw_only=True)
class CellAveragingState(WindowState):
    """values: (256) what each amplitude adds to a sum. sums: scratch. scale: steps of a tenfold mean; 0 in the log
    domain."""

    values: NDArray[np.int64]
    sums: NDArray[np.int64]
    scale: float


@dataclass(frozen=True)
class CellAveraging:
    """A cell is detected when its log amplitude exceeds the mean of the cells about it by a constant.

    pfa: false alarm probability in Rayleigh clutter, held including the 8-bit rounding and the error of the mean, for
    as many cells as the window has in each place: 15.2 dB above the log mean of 32 cells at 1e-6. domain: "log"
    averages log amplitudes, "power" their powers. side: cells on either side of the guard cells. guard: cells on either
    side left out. sweeps: how many sweeps the window reaches back, 0 for a window in range only; guard_sweeps: of so
    many of them the guard cells are left out, too. max_runs: as in `hybrid`.

    It learns nothing: the first sweep is judged like all others, but for those earlier sweeps that are not there.
    """

    pfa: float = 1e-6
    domain: Domain = "log"
    side: int = 16
    guard: int = 2
    sweeps: int = 0
    guard_sweeps: int = 2
    max_runs: int = 40_000

    def __post_init__(self) -> None:
        check_settings(self)
        if self.domain not in get_args(Domain):
            raise ValueError(f"domain must be one of {', '.join(get_args(Domain))}")

    def start(
        self, video: VideoFormat, surface: NDArray[np.uint8] | None = None, growth_db: float | None = None
    ) -> CellAveragingState:
        """The state before the first sweep. surface is not used."""
        step = video.db_per_step
        independent = np.floor(window_of(self).independent(video) + 1e-9).astype(int)
        power = self.domain == "power"
        offsets = power_mean_offsets_db if power else mean_offsets_db

        def above(pfa: float) -> NDArray[np.float64]:
            steps = offsets(pfa, step, max(int(independent.max()), 1))[independent] / step
            return np.asarray(np.minimum(steps, BEYOND))

        amplitude = np.arange(256)
        return CellAveragingState(
            **window_fields(self, video, surface, growth_db, above),
            values=np.rint(FULL_POWER * 10 ** ((amplitude - 255) * step / 10)).astype(int) if power else amplitude,
            sums=np.zeros((3, video.ranges + 2 * (self.side + self.guard) + 1), np.int64),
            scale=10 / step if power else 0.0,
        )

    def __call__(self, sweeps: Sweeps, state: CellAveragingState) -> Detections:
        """The detections of the block. Raises TableError when it is not on the grid of the state."""
        return detect_block(_detect, self, sweeps, state, (state.scale, state.values, state.sums))

    def thresholds(self, sweeps: Sweeps, state: CellAveragingState) -> NDArray[np.uint8]:
        """(n, ranges) the limits that the call would compare the block with."""
        return limits_used(self, sweeps, deepcopy(state))


PART = CellAveraging


@allocating
def _detect(amplitude: Any, rows: Any, masks: Any, window: Any, tables: Any, memory: Any, cap: Any, own: Any) -> None:
    """See `detect_block`. own: scale, values, sums of the state."""
    amplitude, rows = borrowed(amplitude), borrowed(rows)
    mask, grown = borrowed(masks[0]), borrowed(masks[1])
    guard, reach, near = window
    count, above, growth_above = borrowed(tables[0]), borrowed(tables[1]), borrowed(tables[2])
    ring, ring_row, stack = borrowed(memory[0]), borrowed(memory[1]), borrowed(memory[2])
    threshold, growth = borrowed(memory[3]), borrowed(memory[4])
    scale, values, sums = own[0], borrowed(own[1]), borrowed(own[2])
    refill, depth, budget, degraded, tail = cap
    budget, degraded, tail = borrowed(budget), borrowed(degraded), borrowed(tail)
    ranges = amplitude.shape[1]
    # sums before each cell, of the sweeps whose guard cells do not count and of all; with a margin of the reach, so
    # that a difference of two is the sum of a window cut off at the ends
    beside, whole, level = sums[0], sums[1], sums[2]
    for i in range(amplitude.shape[0]):
        cells = amplitude[i]
        close, far = take_row(cells, rows[i], ring, ring_row, near, stack)
        _add_up(stack, 1 + close, values, scale, reach, beside)
        _add_up(stack, 1 + close + far, values, scale, reach, whole)
        for j in range(ranges):
            inside = beside[j + reach + guard + 1] - beside[j + reach - guard]
            level[j] = whole[j + 2 * reach + 1] - whole[j] - inside
        number, offset = count[close, far], above[close, far]
        _limits(level, number, offset, scale, threshold, ranges)
        if growth.size:
            _limits(level, number, growth_above[close, far], scale, growth, ranges)
        detect_row(cells, threshold, growth, mask[i], grown[i], (refill, depth), budget, degraded, tail)


@allocating
def _add_up(stack: Any, end: int, values: Any, scale: float, margin: int, sums: Any) -> None:
    ranges = stack.shape[1]
    column = sums[margin + 1 : margin + 1 + ranges]
    column[:] = 0
    for r in range(end):
        cells = stack[r]
        if scale > 0:
            for j in range(ranges):
                column[j] += values[cells[j]]
        else:
            for j in range(ranges):
                column[j] += cells[j]
    total = np.int64(0)
    for j in range(ranges):
        total += column[j]
        column[j] = total
    sums[margin + 1 + ranges :] = total


@allocating
def _limits(level: Any, number: Any, above: Any, scale: float, limits: Any, ranges: int) -> None:
    for j in range(ranges):
        mean = level[j] / max(number[j], 1)
        if scale > 0:
            mean = max(255.0 + scale * np.log10(max(mean, 1.0) / FULL_POWER), 0.0)
        limits[j] = np.uint8(min(max(np.floor(mean + above[j] + 0.5), 0.0), 255.0))
