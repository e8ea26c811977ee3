"""Clutter map CFAR: each cell's own recursive mean over the scans, plus a constant; optionally with anti-masking.

E. N. Khoury, J. S. Hoyle, "Clutter maps: design and performance", 1984; as compared by Galati et al., "Airport
surveillance processing chain for high resolution radar", section 3, with the anti-masking of their reference 12: the
input of the mean is limited, and the mean is frozen where something is detected.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from pipeline.detect.calibration import (
    censored_bias_db,
    false_alarm_probability,
    recursive_mean_offsets_db,
)
from pipeline.detect.checks import check_block, check_pfa, check_positive, check_start, check_whole
from pipeline.detect.limits import limits_used
from pipeline.kernels.bits import borrowed
from pipeline.kernels.compiled import allocating
from pipeline.kernels.run_cap import CapSettings, detect_row
from pipeline.state import ArrayState, StateError, read_only, remembered
from pipeline.tables import Detections, Sweeps, VideoFormat

AntiMasking = Literal["none", "limit", "freeze", "both"]

ONE = 256
"""Units of a level in one step of the log amplitude."""

GAIN_BITS = 14
"""Binary places of the gain of the recursive mean."""

SETTLED = 16
"""Scans before the input is limited: a mean of fewer is not sure enough to be limited about."""

MOST_MEMORY = 4096


@dataclass(eq=False, kw_only=True)
class ClutterMapState(ArrayState):
    """level: (azimuths, ranges) recursive mean in 1/256 step. heard: (azimuths) sweeps behind it. threshold, growth:
    limits of the row last swept, growth empty when no growth is asked for. above, growth_above: what the limits lie
    above the level, by sweeps heard, in 1/256 step; gain: of the mean, likewise."""

    azimuths: int
    above: NDArray[np.int32]
    growth_above: NDArray[np.int32]
    gain: NDArray[np.int32]
    limit_units: int
    tail: NDArray[np.uint8]
    threshold: NDArray[np.uint8]
    growth: NDArray[np.uint8]
    level: NDArray[np.uint16] = remembered()
    heard: NDArray[np.int64] = remembered()
    budget: NDArray[np.float64] = remembered()
    degraded_sweeps: NDArray[np.int64] = remembered()

    def refuse_untrue(self, saved: Mapping[str, NDArray[Any]]) -> None:
        """Raise StateError for sweeps heard less than never, or more than any radar lives to turn."""
        if not ((saved["heard"] >= 0) & (saved["heard"] < 2**48)).all():
            raise StateError("heard: numbers of sweeps that cannot be true")

    @property
    def counters(self) -> dict[str, int]:
        """degraded_sweeps: sweeps whose threshold was raised to stay under the cap on runs."""
        return {"degraded_sweeps": int(self.degraded_sweeps[0])}


@dataclass(frozen=True)
class ClutterMap:
    """A cell is detected when its log amplitude exceeds its own remembered log mean by a constant.

    pfa: false alarm probability in Rayleigh clutter, held including the 8-bit rounding and the error of the mean
    itself, at every age of the map: the constant is 59.8 dB in scan 2 (1e-6), 37.3, 29.5 and 25.6 dB in scans 3 to 5,
    17.1 dB in scan 15 and 14.1 dB in the end. Scan 1 only learns. memory: scans of the recursive mean (weight
    1/memory of the newest); until then it is the plain mean of the scans seen.

    anti_masking: "limit" takes no more than limit_db above the mean into it (from scan 17 on), "freeze" leaves
    the mean alone where the cell is detected, "both" does both. A frozen mean stays as long as the cell is detected:
    clutter that rises at once beyond the threshold (heavy rain) then stays detected, up to the cap on runs.

    learn_scans: scans of a sweep before its cells detect anything, up to 6 * memory. max_runs: as in `hybrid`.
    """

    pfa: float = 1e-6
    memory: int = 64
    anti_masking: AntiMasking = "none"
    limit_db: float = 9.0
    learn_scans: int = 1
    max_runs: int = 40_000

    def __post_init__(self) -> None:
        check_pfa(self.pfa)
        check_positive(limit_db=self.limit_db)
        check_whole(1, MOST_MEMORY, memory=self.memory)
        check_whole(1, 6 * self.memory, learn_scans=self.learn_scans)
        check_whole(max_runs=self.max_runs)
        if self.anti_masking not in get_args(AntiMasking):
            raise ValueError(f"anti_masking must be one of {', '.join(get_args(AntiMasking))}")

    def start(
        self, video: VideoFormat, surface: NDArray[np.uint8] | None = None, growth_db: float | None = None
    ) -> ClutterMapState:
        """The state before the first sweep. surface is not used."""
        check_start(video, surface, growth_db)
        above = self._above(self.pfa, video.db_per_step)
        grow = above
        if growth_db is not None:
            grow = self._above(false_alarm_probability(growth_db, video.db_per_step), video.db_per_step)
        gain = np.maximum(1 / np.arange(1, len(above) + 1), 1 / self.memory)
        limited = self.anti_masking in ("limit", "both")
        return ClutterMapState(
            azimuths=video.azimuths,
            above=above,
            growth_above=np.minimum(grow, above),
            gain=np.rint(gain * (1 << GAIN_BITS)).astype(np.int32),
            limit_units=round(min(self.limit_db / video.db_per_step, 256) * ONE) if limited else 256 * ONE,
            tail=np.zeros(64, np.uint8),
            level=np.zeros((video.azimuths, video.ranges), np.uint16),
            heard=np.zeros(video.azimuths, np.int64),
            threshold=np.full(64 * video.words, 255, np.uint8),
            growth=np.full(0 if growth_db is None else 64 * video.words, 255, np.uint8),
            budget=np.array([CapSettings.of(self.max_runs, video.azimuths).depth]),
            degraded_sweeps=np.zeros(1, np.int64),
        )

    def __call__(self, sweeps: Sweeps, state: ClutterMapState) -> Detections:
        """The detections of the block. Raises TableError when it is not on the grid of the state."""
        check_block(sweeps, state.azimuths, state.level.shape[1])
        mask = np.empty((len(sweeps), state.threshold.size // 64), np.uint64)
        growth = np.empty((len(sweeps), state.growth.size // 64), np.uint64)
        before = int(state.degraded_sweeps[0])
        cap = CapSettings.of(self.max_runs, state.azimuths)
        _detect(
            read_only(sweeps.amplitude),
            read_only(sweeps.row, np.int64),
            (mask, growth),
            (state.above, state.growth_above, state.gain),
            (state.limit_units, self.anti_masking in ("freeze", "both")),
            (state.level, state.heard, state.threshold, state.growth),
            (cap.refill, cap.depth, state.budget, state.degraded_sweeps, state.tail),
        )
        degraded = int(state.degraded_sweeps[0]) > before
        return Detections(mask, degraded, growth if state.growth.size else None)

    def thresholds(self, sweeps: Sweeps, state: ClutterMapState) -> NDArray[np.uint8]:
        """(n, ranges) the limits that the call would compare the block with."""
        return limits_used(self, sweeps, deepcopy(state))

    def _above(self, pfa: float, db_per_step: float) -> NDArray[np.int32]:
        """By sweeps heard, the last for all that follow: what the limit lies above the level, in 1/256 step."""
        decibels = recursive_mean_offsets_db(pfa, db_per_step, self.memory).copy()
        late = slice(min(SETTLED, len(decibels) - 1), None)
        limit = self.limit_db if self.anti_masking in ("limit", "both") else np.inf
        freeze = self.anti_masking in ("freeze", "both")
        own = float(recursive_mean_offsets_db(self.pfa, db_per_step, self.memory)[-1])
        decibels[late] += censored_bias_db(limit, own if freeze else np.inf)
        steps = np.where(np.arange(len(decibels)) < self.learn_scans, 512.0, decibels / db_per_step)
        return np.asarray(np.rint(np.minimum(steps, 512.0) * ONE), np.int32)


PART = ClutterMap


@allocating
def _detect(amplitude: Any, rows: Any, masks: Any, tables: Any, rule: Any, memory: Any, cap: Any) -> None:
    amplitude, rows = borrowed(amplitude), borrowed(rows)
    mask, grown = borrowed(masks[0]), borrowed(masks[1])
    above, growth_above, gain = tables
    most, freeze = np.int32(rule[0]), np.int32(rule[1])
    level, heard, threshold, growth = borrowed(memory[0]), borrowed(memory[1]), borrowed(memory[2]), borrowed(memory[3])
    refill, depth, budget, degraded, tail = cap
    budget, degraded, tail = borrowed(budget), borrowed(degraded), borrowed(tail)
    half, half_gain = np.int32(ONE // 2), np.int32(1 << (GAIN_BITS - 1))
    top = np.int32(255)
    for i in range(amplitude.shape[0]):
        row = np.uintp(rows[i])
        age = min(heard[row], above.size - 1)
        heard[row] += 1
        cells, mean = amplitude[i], level[row]
        offset, step = above[age] + half, gain[age]
        bound = most if age >= SETTLED else np.int32(256 * ONE)
        if growth.size:
            lower = growth_above[age] + half
            for j in range(cells.size):
                growth[j] = min(max((np.int32(mean[j]) + lower) >> np.int32(8), np.int32(0)), top)
        # without a branch and in 32 bits, so that the compiler makes it one loop of vectors
        for j in range(cells.size):
            x, old = np.int32(cells[j]), np.int32(mean[j])
            limit = min(max((old + offset) >> np.int32(8), np.int32(0)), top)
            threshold[j] = limit
            error = min((x << np.int32(8)) - old, bound)
            change = (error * step + half_gain) >> np.int32(GAIN_BITS)
            mean[j] = old + change * (np.int32(1) - freeze * np.int32(x > limit))
        detect_row(cells, threshold, growth, mask[i], grown[i], (refill, depth), budget, degraded, tail)
