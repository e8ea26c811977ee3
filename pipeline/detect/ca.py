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

from pipeline.detect.calibration import false_alarm_probability, mean_offsets_db, power_mean_offsets_db
from pipeline.detect.checks import check_block, check_pfa, check_start, check_whole
from pipeline.detect.limits import limits_used
from pipeline.detect.window import BEYOND, Window, WindowState, window_fields
from pipeline.kernels.bits import borrowed
from pipeline.kernels.compiled import allocating
from pipeline.kernels.recent_rows import take_row
from pipeline.kernels.run_cap import CapSettings, detect_row
from pipeline.state import read_only
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
        check_pfa(self.pfa)
        if self.domain not in get_args(Domain):
            raise ValueError(f"domain must be one of {', '.join(get_args(Domain))}")
        check_whole(max_runs=self.max_runs)
        _ = self.window

    @property
    def window(self) -> Window:
        """The cells that are averaged."""
        return Window(self.side, self.guard, self.sweeps, self.guard_sweeps)

    def start(
        self, video: VideoFormat, surface: NDArray[np.uint8] | None = None, growth_db: float | None = None
    ) -> CellAveragingState:
        """The state before the first sweep. surface is not used."""
        check_start(video, surface, growth_db)
        step = video.db_per_step
        independent = np.floor(self.window.independent(video) + 1e-9).astype(int)
        offsets = power_mean_offsets_db if self.domain == "power" else mean_offsets_db

        def above(pfa: float) -> NDArray[np.float64]:
            steps = offsets(pfa, step, max(int(independent.max()), 1))[independent] / step
            return np.asarray(np.minimum(steps, BEYOND))

        power = self.domain == "power"
        amplitude = np.arange(256)
        return CellAveragingState(
            **window_fields(
                self.window,
                video,
                self.max_runs,
                growth_db,
                above,
                self.pfa,
                false_alarm_probability(growth_db or 0.0, step),
            ),
            values=np.rint(FULL_POWER * 10 ** ((amplitude - 255) * step / 10)).astype(int) if power else amplitude,
            sums=np.zeros((3, video.ranges + 2 * (self.side + self.guard) + 1), np.int64),
            scale=10 / step if power else 0.0,
        )

    def __call__(self, sweeps: Sweeps, state: CellAveragingState) -> Detections:
        """The detections of the block. Raises TableError when it is not on the grid of the state."""
        check_block(sweeps, state.azimuths, state.stack.shape[1])
        mask = np.empty((len(sweeps), state.threshold.size // 64), np.uint64)
        growth = np.empty((len(sweeps), state.growth.size // 64), np.uint64)
        before = int(state.degraded_sweeps[0])
        cap = CapSettings.of(self.max_runs, state.azimuths)
        _detect(
            read_only(sweeps.amplitude),
            read_only(sweeps.row, np.int64) + sweeps.scan * state.azimuths,
            (mask, growth),
            (self.guard, self.side + self.guard, self.window.near, state.scale),
            (state.count, state.above, state.growth_above, state.values),
            (state.ring, state.ring_row, state.stack, state.sums, state.threshold, state.growth),
            (cap.refill, cap.depth, state.budget, state.degraded_sweeps, state.tail),
        )
        degraded = int(state.degraded_sweeps[0]) > before
        return Detections(mask, degraded, growth if state.growth.size else None)

    def thresholds(self, sweeps: Sweeps, state: CellAveragingState) -> NDArray[np.uint8]:
        """(n, ranges) the limits that the call would compare the block with."""
        return limits_used(self, sweeps, deepcopy(state))


PART = CellAveraging


@allocating
def _detect(amplitude: Any, rows: Any, masks: Any, window: Any, tables: Any, memory: Any, cap: Any) -> None:
    amplitude, rows = borrowed(amplitude), borrowed(rows)
    mask, grown = borrowed(masks[0]), borrowed(masks[1])
    guard, reach, near, scale = window
    count, above, growth_above, values = (
        borrowed(tables[0]),
        borrowed(tables[1]),
        borrowed(tables[2]),
        borrowed(tables[3]),
    )
    ring, ring_row, stack = borrowed(memory[0]), borrowed(memory[1]), borrowed(memory[2])
    sums, threshold, growth = borrowed(memory[3]), borrowed(memory[4]), borrowed(memory[5])
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
