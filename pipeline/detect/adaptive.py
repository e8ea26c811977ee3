"""Adaptive CFAR: a short-memory level of each patch of ground, a long-memory offset of each cell, a spread.

Ours. It starts from the observation that the Hybrid CFAR (`pipeline.detect.hybrid`) holds its false alarm rate only
where a macro-cell is homogeneous and its clutter Rayleigh. The threshold of a cell is

    level(patch) + offset(cell) + mu * spread(patch) / spread(Rayleigh)

* A patch is a macro-cell cut by the surface kinds of the map. Its level is the mean of (log amplitude - offset) without
  what stands out, remembered for little more than a scan, so that rain is followed.
* The offset is the cell's own texture, remembered for a minute and more, not learned from what stands out, and bounded
  on the pavement, so that a target that stands still is never learned away.
* The spread is the standard deviation of what is left. Weibull clutter is a location-scale family in the log domain, so
  the false alarm rate holds for every Weibull shape.
* Cells beside a border of surface kinds, and buildings, are patches of their own with wide bounds: a clutter map, whose
  level follows only the changes of the ground about it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.detect.calibration import estimation_loss_db, threshold_offset_db, truncated_rayleigh_db
from pipeline.detect.patches import BUILDING, EDGE, GRASS, Patches
from pipeline.kernels.bits import bits_above, count_runs
from pipeline.kernels.run_cap import CapSettings, fit_row
from pipeline.state import ArrayState, read_only, remembered
from pipeline.tables import Detections, Sweeps, VideoFormat

ONE = 128
"""Units of an offset in one step of the log amplitude."""

LEARN_EVERY = 6
"""Once the start is over, a row learns in every sixth scan: its offsets then remember for minutes."""

STILL = 1.2
"""Steps that a patch's threshold must be off before it is moved: most rows then need no new limits."""

FEW = 0.45
"""Where less than this part of a patch is ordinary, it is the patch that has changed, not what stands on it."""

START_SCANS = 30
"""For so long grass, borders and buildings learn from everything, also from what stands out."""


@dataclass(eq=False, kw_only=True)
class AdaptiveState(ArrayState):
    """offset: of each cell, in 1/128 step. level, spread, bias: of each patch, in steps. heard: scans in which each
    patch was swept. scan: the newest, how many are over, and `heard` of the patch
    swept last for the first time. moved: of each patch, the scan after which its base moved.
    stale: of each row, the scan up to which its limits are true; -1 not at all. limits: uint8, 64 cells a word."""

    azimuths: int
    rule: tuple[float, ...]
    run_at: NDArray[np.int64]
    runs: NDArray[np.int32]
    macro: NDArray[np.int64]
    bounds: NDArray[np.int32]
    wide: NDArray[np.bool_]
    soft: NDArray[np.bool_]
    tail: NDArray[np.uint8]
    offset: NDArray[np.int16] = remembered()
    level: NDArray[np.float64] = remembered()
    spread: NDArray[np.float64] = remembered()
    bias: NDArray[np.float64] = remembered()
    base: NDArray[np.int32] = remembered()
    sums: NDArray[np.float64] = remembered()
    heard: NDArray[np.int64] = remembered()
    scan: NDArray[np.int64] = remembered()
    moved: NDArray[np.int64] = remembered()
    stale: NDArray[np.int64] = remembered()
    limits: NDArray[np.uint8] = remembered()
    budget: NDArray[np.float64] = remembered()
    degraded_sweeps: NDArray[np.int64] = remembered()

    @property
    def counters(self) -> dict[str, int]:
        """degraded_sweeps: sweeps whose threshold was raised to stay under the cap on runs."""
        return {"degraded_sweeps": int(self.degraded_sweeps[0])}


@dataclass(frozen=True)
class Adaptive:
    """See the module. The first `learn_scans` scans only learn; what stands on the pavement is not learned away.

    pfa: false alarm probability in Rayleigh and Weibull clutter. macro_cell_m: side of the macro-cells. level_scans:
    memory of the levels. offset_scans: memory of the offsets once the start is over; it begins with a sixth of it.
    spread_scans: memory of the spreads. most_offset_db: how far a pavement cell may be learned up; grass_offset_db: the
    same for grass. margin_db: what comes this near to the threshold is not learned. max_runs: as in `hybrid`.
    """

    pfa: float = 1e-6
    macro_cell_m: float = 100.0
    level_scans: float = 1.7
    offset_scans: int = 64
    spread_scans: float = 30.0
    most_offset_db: float = 8.0
    grass_offset_db: float = 16.0
    margin_db: float = 3.5
    learn_scans: int = 12
    max_runs: int = 40_000

    def __post_init__(self) -> None:
        if not 0 < self.pfa < 0.5:
            raise ValueError("pfa must lie between 0 and 0.5")
        if not self.macro_cell_m > 0:
            raise ValueError("macro_cell_m must be greater than 0")
        if (
            self.level_scans < 1
            or self.offset_scans < 12
            or self.spread_scans < 1
            or min(self.learn_scans, self.max_runs) < 1
        ):
            raise ValueError("scans and max_runs must be 1 or more, offset_scans 12 or more")

    def start(self, video: VideoFormat, surface: NDArray[np.uint8] | None = None) -> AdaptiveState:
        """The state before the first sweep. Without a map all is one surface kind."""
        shape = (video.azimuths, video.ranges)
        if surface is None:
            surface = np.full(shape, 2, np.uint8)
        if surface.shape != shape:
            raise ValueError(f"surface must be {shape}, not {surface.shape}")
        patches = Patches.build(video, surface, self.macro_cell_m)
        kind, many = patches.kind, len(patches.kind)
        step = video.db_per_step
        offset_db = threshold_offset_db(self.pfa, step)
        gain = 1.0 / self.offset_scans
        mu = offset_db + estimation_loss_db(self.pfa, step) * gain / (2 - gain)
        missing_db, spread_db = truncated_rayleigh_db(offset_db - self.margin_db)
        rayleigh = spread_db / step
        return AdaptiveState(
            azimuths=video.azimuths,
            rule=(
                (mu + missing_db) / step,
                rayleigh,
                self.margin_db / step,
                1.0 / self.level_scans,
                1.0 / self.spread_scans,
                float(self.offset_scans),
                12.0 / step,
                7.0 / step,
                float(self.learn_scans),
            ),
            run_at=patches.run_at,
            runs=patches.runs,
            macro=patches.macro,
            bounds=self._bounds(kind, step),
            wide=(kind >= EDGE) | (kind == BUILDING),
            soft=(kind >= EDGE) | (kind == BUILDING) | (kind == GRASS),
            tail=np.zeros(64, np.uint8),
            offset=np.zeros(shape, np.int16),
            level=np.zeros(many),
            spread=np.full(many, rayleigh),
            bias=np.zeros(many),
            base=np.full(many, 10_000, np.int32),
            sums=np.zeros((many, 5)),
            heard=np.zeros(many, np.int64),
            scan=np.array([-1, 0, 0], np.int64),
            moved=np.zeros(many, np.int64),
            stale=np.full(video.azimuths, -1, np.int64),
            limits=np.full((video.azimuths, 64 * video.words), 255, np.uint8),
            budget=np.array([CapSettings.of(self.max_runs, video.azimuths).depth]),
            degraded_sweeps=np.zeros(1, np.int64),
        )

    def __call__(self, sweeps: Sweeps, state: AdaptiveState) -> Detections:
        """The detections of the block."""
        mask = np.zeros((len(sweeps), (sweeps.amplitude.shape[1] + 63) // 64), np.uint64)
        before = int(state.degraded_sweeps[0])
        cap = CapSettings.of(self.max_runs, state.azimuths)
        _detect(
            read_only(sweeps.amplitude),
            read_only(sweeps.row, np.int64),
            sweeps.scan,
            mask,
            state.rule,
            (state.run_at, state.runs, state.macro, state.bounds, state.wide, state.soft),
            (
                state.offset,
                state.level,
                state.spread,
                state.bias,
                state.base,
                state.sums,
                state.heard,
                state.scan,
                state.moved,
                state.stale,
            ),
            (cap.refill, cap.depth, state.budget, state.degraded_sweeps),
            state.limits,
            state.tail,
        )
        return Detections(mask, degraded=int(state.degraded_sweeps[0]) > before)

    def _bounds(self, kind: NDArray[np.int64], step: float) -> NDArray[np.int32]:
        """(patches, 2) least and greatest offset in 1/128 step."""
        most = np.full(len(kind), self.most_offset_db)
        most[kind == GRASS] = self.grass_offset_db
        most[kind >= EDGE] = 22.0
        most[kind == BUILDING] = 30.0
        least = np.where(kind >= EDGE, -22.0, -20.0)
        return np.rint(np.stack([least, most], axis=1) * ONE / step).astype(np.int32)


PART = Adaptive


@njit(nogil=True, cache=True)
def _detect(
    amplitude: Any,
    rows: Any,
    scan: int,
    mask: Any,
    rule: Any,
    layout: Any,
    memory: Any,
    cap: Any,
    limits: Any,
    tail: Any,
) -> None:
    current = memory[7]
    refill, depth, budget, degraded = cap
    n, ranges = amplitude.shape
    words = mask.shape[1]
    whole = ranges // 64
    tail_at = tail.ctypes.data
    for i in range(n):
        if scan != current[0]:
            if current[0] >= 0:
                _finish_scan(rule, layout, memory)
            current[0] = scan
        row = rows[i]
        cells, limit, bits = amplitude[i], limits[row], mask[i]
        _refresh(row, limit, rule, layout, memory)
        row_at, limits_at = cells.ctypes.data, limit.ctypes.data
        anything = np.uint64(0)
        for w in range(whole):
            at = np.uintp(64 * w)
            word = bits_above(row_at + at, limits_at + at)
            bits[w] = word
            anything |= word
        if words > whole:
            for j in range(ranges - 64 * whole):
                tail[j] = cells[64 * whole + j]
            bits[whole] = bits_above(tail_at, limits_at + np.uintp(64 * whole))
            anything |= bits[whole]
        budget[0] = min(budget[0] + refill, depth)
        if anything:
            runs = count_runs(bits)
            if runs <= budget[0]:
                budget[0] -= runs
            else:
                degraded[0] += 1
                fit_row(cells, limits_at, bits, budget, tail)
        due = (scan + row) % LEARN_EVERY == 0
        if due or current[2] < rule[5]:
            _learn(cells, limit, row, due, rule, layout, memory)


@njit(nogil=True, cache=True)
def _refresh(row: int, limit: Any, rule: Any, layout: Any, memory: Any) -> None:
    """Bring the row's limits up to date where its patches or its offsets have moved since it was last swept."""
    run_at, runs = layout[0], layout[1]
    base, heard, moved, stale = memory[4], memory[6], memory[8], memory[9]
    own = memory[0][row]
    everything = stale[row] < 0
    for k in range(np.uintp(run_at[row]), np.uintp(run_at[row + 1])):
        p = np.uintp(runs[k, 2])
        if not everything and moved[p] <= stale[row]:
            continue
        level = np.int32(base[p]) if heard[p] >= rule[8] else np.int32(10_000)
        for j in range(np.uintp(runs[k, 0]), np.uintp(runs[k, 1])):
            value = level + ((np.int32(own[j]) + np.int32(ONE // 2)) >> np.int32(7))
            limit[j] = np.uint8(min(max(value, np.int32(0)), np.int32(255)))
    stale[row] = memory[7][1]


@njit(nogil=True, cache=True)
def _learn(cells: Any, limit: Any, row: int, due: bool, rule: Any, layout: Any, memory: Any) -> None:
    """Take one row into the sums of its patches, and let its offsets and limits follow. due: also the old patches."""
    _, rayleigh, margin, _, _, long, below, above, _ = rule
    run_at, runs, _, bounds, _, soft = layout
    offset, level, spread, bias, base, sums, heard, _, _, _ = memory
    own = offset[row]
    least_error, most_error = np.int32(-below * ONE), np.int32(above * ONE)
    for k in range(np.uintp(run_at[row]), np.uintp(run_at[row + 1])):
        p = np.uintp(runs[k, 2])
        age = np.float64(heard[p])
        if not due and age >= long:
            continue
        step = max(1.0 / long, 1.0 / (age + (2.0 if soft[p] else 12.0))) if age > 0 else 0.0
        gain = np.int32(8192 * step)
        middle, centre = np.int32(level[p] * ONE), np.int32(bias[p] * ONE)
        ordinary = np.int32((base[p] - margin * _scale(spread[p], rayleigh)) * ONE)
        learnable = np.int32(2**30) if soft[p] and age < START_SCANS else ordinary
        least, most = bounds[p, 0], bounds[p, 1]
        shown = np.int32(base[p]) if age >= rule[8] else np.int32(10_000)
        count, first, second, errors = np.int32(0), np.int32(0), np.int32(0), np.int32(0)
        # without a branch and in 32 bits, so that the compiler makes it one loop of vectors
        for j in range(np.uintp(runs[k, 0]), np.uintp(runs[k, 1])):
            rest = (np.int32(cells[j]) << np.int32(7)) - np.int32(own[j])
            apart = rest - middle
            kept = np.int32(rest <= ordinary)
            error = min(max(apart, least_error), most_error)
            coarse = (apart >> np.int32(5)) * kept
            count += kept
            first += (apart >> np.int32(2)) * kept
            second += coarse * coarse
            errors += (error >> np.int32(2)) * kept
            change = (((error - centre) * gain) >> np.int32(13)) * np.int32(rest <= learnable)
            new = min(max(np.int32(own[j]) + change, least), most)
            own[j] = np.int16(new)
            value = shown + ((new + np.int32(ONE // 2)) >> np.int32(7))
            limit[j] = np.uint8(min(max(value, np.int32(0)), np.int32(255)))
        sums[p, 0] += count
        sums[p, 1] += 4.0 * first
        sums[p, 2] += 1024.0 * second
        sums[p, 3] += 4.0 * errors
        sums[p, 4] += runs[k, 1] - runs[k, 0]


@njit(nogil=True, cache=True)
def _finish_scan(rule: Any, layout: Any, memory: Any) -> None:
    """Bring the patches that were swept up to date with the scan that is over."""
    mu, rayleigh, margin, level_gain, spread_gain = rule[0], rule[1], rule[2], rule[3], rule[4]
    macro, wide, soft = layout[2], layout[4], layout[5]
    _, level, spread, bias, base, sums, heard, current, moved_at, _ = memory
    current[1] += 1
    changes = np.zeros((macro.max() + 1, 2))
    fresh = np.zeros(level.size, np.bool_)
    for p in range(level.size):
        count, swept = sums[p, 0], sums[p, 4]
        if swept > 0 and count < FEW * swept:
            level[p] += margin  # most of it stands out: the ground itself has risen
            heard[p] += 1
        elif count > 0:
            moved = sums[p, 1] / count / ONE
            variance = max(sums[p, 2] / count / ONE**2 - moved**2, 0.0)
            faster = max(spread_gain, 1.0 / (heard[p] + 1.0))
            if heard[p] == 0:
                level[p] += moved
                fresh[p] = wide[p]
                if soft[p]:
                    spread[p] = np.sqrt(variance)
            else:
                spread[p] += faster * (np.sqrt(variance) - spread[p])
                bias[p] += faster * (sums[p, 3] / count / ONE - moved - bias[p])
                if not wide[p]:
                    level[p] += level_gain * moved
                    changes[macro[p], 0] += level_gain * moved * count
                    changes[macro[p], 1] += count
            heard[p] += 1
        sums[p] = 0.0
    for p in range(level.size):
        if wide[p] and not fresh[p] and changes[macro[p], 1] > 0:
            level[p] += changes[macro[p], 0] / changes[macro[p], 1]
        if heard[p] == 0:
            continue
        wanted = level[p] + mu * _scale(spread[p], rayleigh)
        if abs(wanted - base[p]) > STILL or heard[p] == np.int64(rule[8]):
            base[p] = np.int32(np.floor(wanted + 0.5))
            moved_at[p] = current[1]
    current[2] = current[1]
    for p in range(level.size):
        if heard[p] > 0:
            current[2] = min(current[2], heard[p])
    if fresh.any():
        _start_wide(layout, memory, fresh)


@njit(nogil=True, cache=True)
def _scale(spread: float, rayleigh: float) -> float:
    """How much wider than Rayleigh; the bounds are those of Weibull clutter worth following."""
    return min(max(spread / rayleigh, 0.93), 1.75)


@njit(nogil=True, cache=True)
def _start_wide(layout: Any, memory: Any, fresh: Any) -> None:
    """Cells beside a border begin at the greatest level of their macro-cell, and come down to their own."""
    run_at, runs, macro, bounds, _, _ = layout
    offset, level, heard, stale = memory[0], memory[1], memory[6], memory[9]
    stale[:] = -1
    highest = np.zeros(macro.max() + 1)
    for p in range(level.size):
        if heard[p] > 0:
            highest[macro[p]] = max(highest[macro[p]], level[p])
    for row in range(offset.shape[0]):
        own = offset[row]
        for k in range(run_at[row], run_at[row + 1]):
            p = runs[k, 2]
            if not fresh[p]:
                continue
            up = min(np.int64((highest[macro[p]] - level[p]) * ONE), np.int64(bounds[p, 1]))
            for j in range(runs[k, 0], runs[k, 1]):
                own[j] = up
