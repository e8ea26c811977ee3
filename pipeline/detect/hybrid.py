"""Hybrid CFAR: the mean log amplitude of a macro-cell, averaged over scans, plus a constant.

G. Galati, M. Leonardi, A. Cavallin, G. Pavan, "Airport surveillance processing chain for high resolution radar",
section 3, equation (1.1) and figure 3.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass
from math import inf
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from pipeline.detect.calibration import estimation_loss_db, threshold_offset_db
from pipeline.detect.checks import check_block, check_pfa, check_start, check_whole
from pipeline.detect.hybrid_map import HybridMapState, detect_in_map_cells, refuse_untrue_levels
from pipeline.detect.limits import limits_used
from pipeline.detect.macro_cells import STRIPE_ROWS, MacroCells, MapCells
from pipeline.kernels.bits import (
    add_pairs,
    bits_above,
    borrowed,
    compare_and_add_four,
    compare_twice_and_add_four,
    count_runs,
)
from pipeline.kernels.compiled import allocating
from pipeline.kernels.run_cap import CapSettings, fit_row
from pipeline.state import ArrayState, StateError, read_only, remembered
from pipeline.tables import Detections, Sweeps, VideoFormat

Cells = Literal["square", "map"]

PAIR_ROWS = 128
"""Rows whose sums of two bytes fit 16 bits."""

STRIPE, SWEPT, SCAN, LEFT, DRAINED = 0, 1, 2, 3, 4
"""The cursor: stripe being swept, sweeps of the scan taken up, scan, macro-cells of the turn left behind, sweeps until
the sums of pairs were last added up."""


@dataclass(eq=False, kw_only=True)
class HybridState(ArrayState):
    """level, weight: log mean in steps and scans behind it, of each macro-cell. threshold and growth: limits of each
    cell of the row. ring_since: sweeps of the scan before each ring's macro-cell; ring_sums, pair_sums: amplitudes of
    the sweeps since, of all cells and, newest, by pairs. cursor: see STRIPE."""

    cells: MacroCells
    azimuths: int
    ranges: int
    offset_steps: float
    loss_steps: float
    growth_steps: float
    grows: bool
    tail: NDArray[np.uint8]
    level: NDArray[np.float64] = remembered()
    weight: NDArray[np.float64] = remembered()
    threshold: NDArray[np.uint8] = remembered()
    growth: NDArray[np.uint8] = remembered()
    pair_sums: NDArray[np.uint16] = remembered()
    ring_sums: NDArray[np.int64] = remembered()
    ring_since: NDArray[np.int64] = remembered()
    cursor: NDArray[np.int64] = remembered()
    budget: NDArray[np.float64] = remembered()
    degraded_sweeps: NDArray[np.int64] = remembered()

    def refuse_untrue(self, saved: Mapping[str, NDArray[Any]]) -> None:
        """Raise StateError when the macro-cell that is left next does not exist, or for levels no video has."""
        if not 0 <= saved["cursor"][LEFT] < len(self.level):
            raise StateError("cursor: a macro-cell that does not exist")
        refuse_untrue_levels(saved)

    @property
    def counters(self) -> dict[str, int]:
        """degraded_sweeps: sweeps whose threshold was raised to stay under the cap on runs."""
        return {"degraded_sweeps": int(self.degraded_sweeps[0])}


@dataclass(frozen=True)
class Hybrid:
    """A cell is detected when its log amplitude exceeds its macro-cell's remembered log mean by a constant.

    pfa: false alarm probability in Rayleigh clutter, held including the 8-bit rounding and the error of the mean
    itself. macro_cell_m: side of the (nearly square) macro-cells. cells: "square", or "map" to cut the squares by the
    kinds of surface of the airport map, small pieces put together with others of their kind. memory: scans of the
    recursive mean (feedback 1 - 1/memory); until then it is the plain mean of the scans seen. learn_scans: scans before
    a macro-cell detects anything, up to memory: with 1, the first scan only learns and scan 2 detects with the full Pd.
    max_runs: cap on runs of detected cells a turn; above it the rows concerned get a higher threshold, just as high as
    needed (`Detections.degraded`, counted).

    A macro-cell within the offset of full scale detects nothing; without any echo (level 0) the offset alone is the
    threshold. growth_db counts from the same mean; a degraded row grows nothing, so that a flood stays bounded.
    """

    pfa: float = 1e-6
    macro_cell_m: float = 100.0
    cells: Cells = "square"
    memory: int = 64
    learn_scans: int = 1
    max_runs: int = 40_000

    def __post_init__(self) -> None:
        check_pfa(self.pfa)
        if not 1 <= self.macro_cell_m < inf:
            raise ValueError("macro_cell_m must be 1 or more")
        if self.cells not in get_args(Cells):
            raise ValueError(f"cells must be one of {', '.join(get_args(Cells))}")
        check_whole(memory=self.memory, max_runs=self.max_runs)
        check_whole(1, self.memory, learn_scans=self.learn_scans)

    def start(
        self, video: VideoFormat, surface: NDArray[np.uint8] | None = None, growth_db: float | None = None
    ) -> HybridState | HybridMapState:
        """The state before the first sweep. surface is used for cells = "map" only; without it, all is of one kind."""
        check_start(video, surface, growth_db)
        independent = min(1.0, video.azimuth_step_rad / video.beamwidth_rad)
        rule: dict[str, Any] = {
            "azimuths": video.azimuths,
            "ranges": video.ranges,
            "offset_steps": threshold_offset_db(self.pfa, video.db_per_step) / video.db_per_step,
            "loss_steps": estimation_loss_db(self.pfa, video.db_per_step) / video.db_per_step / independent,
            "growth_steps": (growth_db or 0.0) / video.db_per_step,
            "grows": growth_db is not None,
            "tail": np.zeros(64, np.uint8),
            "threshold": np.full(64 * video.words, 255, np.uint8),
            "growth": np.full(64 * video.words, 255, np.uint8),
            "budget": np.array([CapSettings.of(self.max_runs, video.azimuths).depth]),
            "degraded_sweeps": np.zeros(1, np.int64),
        }
        if self.cells == "map":
            ground = np.zeros((video.azimuths, video.ranges), np.uint8) if surface is None else surface
            return HybridMapState.begin(MapCells.build(video, ground, self.macro_cell_m), rule)
        cells = MacroCells.build(video, self.macro_cell_m)
        rings, many = len(cells.first), len(cells.rows)
        return HybridState(
            **rule,
            cells=cells,
            level=np.zeros(many),
            weight=np.zeros(many),
            pair_sums=np.zeros(32 * video.words, np.uint16),
            ring_sums=np.zeros(rings, np.int64),
            ring_since=np.zeros(rings, np.int64),
            cursor=np.array([-1, 0, -1, 0, 0], np.int64),
        )

    def __call__(self, sweeps: Sweeps, state: HybridState | HybridMapState) -> Detections:
        """The detections of the block. Raises TableError when it is not on the grid of the state."""
        check_block(sweeps, state.azimuths, state.ranges)
        mask = np.empty((len(sweeps), state.threshold.size // 64), np.uint64)
        growth = np.empty(mask.shape if state.grows else (0, 0), np.uint64)
        before = int(state.degraded_sweeps[0])
        cap = CapSettings.of(self.max_runs, state.azimuths)
        rule = (
            state.offset_steps,
            state.loss_steps,
            float(self.memory),
            self.learn_scans - 0.5,
            state.growth_steps,
            state.grows,
        )
        block = read_only(sweeps.amplitude), read_only(sweeps.row, np.int64), sweeps.scan, (mask, growth)
        if isinstance(state, HybridMapState):
            detect_in_map_cells(*block, rule, (cap.refill, cap.depth), *state.arrays())
        else:
            cells = state.cells
            _detect(
                *block,
                cells.stripe_rows,
                (cells.groups, cells.turn, cells.cells, cells.rows),
                rule,
                (cap.refill, cap.depth),
                (
                    state.level,
                    state.weight,
                    state.threshold.view(np.uint64),
                    state.pair_sums.view(np.uint64),
                    state.growth.view(np.uint64),
                ),
                (state.ring_sums, state.ring_since, state.cursor),
                (state.budget, state.degraded_sweeps),
                state.tail,
            )
        degraded = int(state.degraded_sweeps[0]) > before
        return Detections(mask, degraded, growth if state.grows else None)

    def thresholds(self, sweeps: Sweeps, state: HybridState | HybridMapState) -> NDArray[np.uint8]:
        """(n, ranges) the limits that the call would compare the block with."""
        return limits_used(self, sweeps, deepcopy(state))


PART = Hybrid


@allocating
def _detect(
    amplitude: Any,
    rows: Any,
    scan: int,
    masks: Any,
    stripe_rows: int,
    layout: Any,
    rule: Any,
    cap: Any,
    memory: Any,
    swept: Any,
    flood: Any,
    tail: Any,
) -> None:
    refill, depth = cap
    grows = rule[5]
    amplitude, rows, tail = borrowed(amplitude), borrowed(rows), borrowed(tail)
    mask, grown = borrowed(masks[0]), borrowed(masks[1])
    threshold, pair_sums, growth = borrowed(memory[2]), borrowed(memory[3]), borrowed(memory[4])
    cursor = borrowed(swept[2])
    budget, degraded = borrowed(flood[0]), borrowed(flood[1])
    memory = (borrowed(memory[0]), borrowed(memory[1]), threshold, pair_sums, growth)
    swept = (borrowed(swept[0]), borrowed(swept[1]), cursor)
    layout = (borrowed(layout[0]), borrowed(layout[1]), borrowed(layout[2]), borrowed(layout[3]))
    n, ranges = amplitude.shape
    whole = ranges // 64
    rest = ranges - 64 * whole
    cells_at, limits_at, sums_at, tail_at = (
        amplitude.ctypes.data,
        threshold.ctypes.data,
        pair_sums.ctypes.data,
        tail.ctypes.data,
    )
    mask_at, grown_at, lower_at = mask.ctypes.data, grown.ctypes.data, growth.ctypes.data
    step = np.uintp(8 * mask.shape[1])
    left = budget[0]
    i = 0
    while i < n:
        stripe = rows[i] // stripe_rows
        if stripe != cursor[STRIPE] or scan != cursor[SCAN]:
            _next_stripe(stripe, scan, layout, rule, memory, swept)
        end = i + 1
        while end < n and rows[end] < (stripe + 1) * stripe_rows:
            end += 1
        cursor[SWEPT] += end - i
        k = i
        while k + 4 <= end:
            row_at, first_word = cells_at + np.uintp(k) * np.uintp(ranges), np.uintp(k) * step
            for w in range(whole):
                at = np.uintp(64 * w)
                to = first_word + np.uintp(8 * w)
                if grows:
                    compare_twice_and_add_four(
                        row_at + at,
                        np.uintp(ranges),
                        sums_at + at,
                        step,
                        limits_at + at,
                        mask_at + to,
                        lower_at + at,
                        grown_at + to,
                    )
                else:
                    compare_and_add_four(
                        row_at + at, np.uintp(ranges), sums_at + at, step, limits_at + at, mask_at + to
                    )
            k += 4
        while k < end:
            row_at, bits = cells_at + np.uintp(k) * np.uintp(ranges), mask[k]
            for w in range(whole):
                at = np.uintp(64 * w)
                bits[w] = bits_above(row_at + at, limits_at + at)
                add_pairs(row_at + at, sums_at + at)
                if grows:
                    grown[k, w] = bits_above(row_at + at, lower_at + at)
            k += 1
        for k in range(i, end):
            cells, bits = amplitude[k], mask[k]
            if rest:
                for j in range(rest):
                    tail[j] = cells[64 * whole + j]
                at = np.uintp(64 * whole)
                bits[whole] = bits_above(tail_at, limits_at + at)
                add_pairs(tail_at, sums_at + at)
                if grows:
                    grown[k, whole] = bits_above(tail_at, lower_at + at)
            left = min(left + refill, depth)
            runs = count_runs(bits)
            raised = runs > left
            if raised:
                degraded[0] += 1
                budget[0] = left
                fit_row(cells, limits_at, bits, budget, tail)
                left = budget[0]
            else:
                left -= runs
            if grows and raised:
                grown[k, :] = bits
        i = end
    budget[0] = left


@allocating
def _next_stripe(stripe: int, scan: int, layout: Any, rule: Any, memory: Any, swept: Any) -> None:
    # One function with plain loops over eight bytes at a time: a call that hands on arrays, or a loop whose length the
    # compiler does not know, costs more here than the work itself.
    groups, turn, full_cells, full_rows = layout
    mu, loss, most, learn, grow, grows = rule
    level, weight, threshold, pair_sums, growth = memory
    sums, since, cursor = swept
    until, leaving, ring, after = turn[0], turn[1], turn[2], turn[3]
    new_scan = scan != cursor[SCAN]
    now = np.uint64(stripe)
    count = cursor[SWEPT]
    even, one = np.uint64(0x0000FFFF0000FFFF), np.uint64(1)
    event, many = np.uint64(cursor[LEFT]), np.uint64(leaving.size)
    while new_scan or until[event] <= now:
        old, new, k = leaving[event], after[event], ring[event]
        low, high = np.uint64(0), np.uint64(0)
        for g in range(groups[k], groups[k + one]):
            four = pair_sums[g]
            low += four & even
            high += (four >> np.uint64(16)) & even
            pair_sums[g] = 0
        low += high
        rows = count - since[k]
        if rows > 0:
            total = sums[k] + np.int64((low & np.uint64(0xFFFFFFFF)) + (low >> np.uint64(32)))
            share = rows / full_rows[old]
            weight[old] = min(weight[old] + share, most)
            level[old] += (total / (share * full_cells[old]) - level[old]) * share / weight[old]
        sums[k] = 0
        since[k] = count
        limit = 255.0
        if weight[new] >= learn:
            limit = min(np.floor(level[new] + mu + loss / (weight[new] * full_cells[new]) + 0.5), 255.0)
        eight = np.uint64(limit) * np.uint64(0x0101010101010101)
        for g in range(groups[k], groups[k + one]):
            threshold[g] = eight
        if grows:
            lower = min(np.floor(level[new] + grow + 0.5), limit) if weight[new] >= learn else limit
            eight = np.uint64(lower) * np.uint64(0x0101010101010101)
            for g in range(groups[k], groups[k + one]):
                growth[g] = eight
        event += one
        if event == many:
            new_scan = False
            event = np.uint64(0)
            count = np.int64(0)
            cursor[DRAINED] = 0
            since[:] = 0
    if count - cursor[DRAINED] > PAIR_ROWS - STRIPE_ROWS:
        for r in range(since.size):
            for g in range(groups[r], groups[r + 1]):
                four = pair_sums[g]
                pairs = (four & even) + ((four >> np.uint64(16)) & even)
                sums[r] += np.int64((pairs & np.uint64(0xFFFFFFFF)) + (pairs >> np.uint64(32)))
                pair_sums[g] = 0
        cursor[DRAINED] = count
    cursor[STRIPE] = stripe
    cursor[SWEPT] = count
    cursor[SCAN] = scan
    cursor[LEFT] = event
