"""Adaptive CFAR: a short-memory level of each patch of ground, a long-memory offset of each cell, a spread.

Ours. It starts from the observation that the Hybrid CFAR (`pipeline.detect.hybrid`) holds its false alarm rate only
where a macro-cell is homogeneous and its clutter Rayleigh. The threshold of a cell is

    level(patch) + offset(cell) + mu * spread(patch) / spread(Rayleigh)

* A patch is a macro-cell cut by the surface kinds of the map, in tiles of 8 cells by 16 rows. Its level is the mean of
  (log amplitude - offset) without what stands out, remembered for a few scans, and for less when it rises by more than
  chance.
* Rain adds power, it does not multiply: the darkest ground near by tells how much, all patches are raised by that, and
  no limit lies below what the rain alone asks for.
* The offset is the cell's own texture, remembered for a minute and more, not learned from what stands out, and bounded
  on the pavement, so that a target that stands still is never learned away.
* The spread is the mean magnitude of what is left. Weibull clutter is a location-scale family in the log domain, so
  the false alarm rate holds for every Weibull shape.
* Tiles of several surface kinds, and buildings, are patches of their own with wide bounds, nearly a clutter map; the
  pavement in them begins at the level of its like near by.

Start: the first `learn_scans` scans show nothing. The next rest on offsets of few scans: on the demonstration's airport
the false alarm rate over all cells is some hundred times the nominal one in scan 13, on its pavement some ten times,
and falls with every scan. For the first 64 scans every row learns, later every eighth.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.detect.calibration import estimation_loss_db, residual_moments_db, threshold_offset_db
from pipeline.detect.checks import check_block, check_pfa, check_positive, check_start, check_whole
from pipeline.detect.patches import BUILDING, GRASS, MIXED, Patches
from pipeline.kernels.adaptive import LEARN_EVERY, Rule, detect
from pipeline.kernels.rainfall import DRY
from pipeline.kernels.run_cap import CapSettings
from pipeline.kernels.tiles import STILL
from pipeline.state import ArrayState, StateError, read_only, remembered
from pipeline.tables import Detections, Sweeps, VideoFormat

PAVED, GROWN, BORDER, BUILT = range(4)
"""Classes of tiles, by what their offsets may do."""

FIRST = (30.0, 2.0, 1.0, 1.0)
"""Scans of nothing that the offsets of a class begin with: the variance of a sample over that of the texture."""

WIDE_DB = (22.0, 40.0)
"""Greatest offsets of tiles of several kinds, without and with buildings."""

FREE_SCANS = 30
"""For so long all but pavement learns from everything, also from what stands out."""

FADE_DB_PER_M = 0.04
"""A patch so much darker may be a metre farther away to tell of rain as well."""

LEAST_KEPT = 0.8
"""A residual counts down to this much of the greatest that counts: deep fades tell little of the level."""

UNKNOWN = np.array([127, 127, 0, -128, 126, 0, -128, STILL], np.int8).view(np.uint64)[0]
"""The rule of a patch before it was swept; see `pipeline.kernels.tiles`."""


@dataclass(eq=False, kw_only=True)
class AdaptiveState(ArrayState):
    """Of each cell: offset, whole steps, and fine, 1/256 steps. times: how often each row has learned. Of each patch:
    level and dry in steps above 128, short and long memory; spread relative to Rayleigh clutter; heard: scans; sums;
    rule, drop: what its tiles are compared with; mean, least: of that rule. lowest, rain: of each macro-cell. The rest
    is the stripe of tiles being swept, and the run cap."""

    azimuths: int
    ranges: int
    settings: Rule
    tile: NDArray[np.int32]
    macro: NDArray[np.int32]
    kind: NDArray[np.uint8]
    expected: NDArray[np.float32]
    telling: NDArray[np.bool_]
    near: NDArray[np.int32]
    apart: NDArray[np.float32]
    like: NDArray[np.int32]
    gain: NDArray[np.float32]
    own_rain: NDArray[np.float32]
    ahead: NDArray[np.float32]
    strict: NDArray[np.uint64]
    tail: NDArray[np.uint8]
    limits: NDArray[np.uint8]
    drops: NDArray[np.uint8]
    offset: NDArray[np.int8] = remembered()
    fine: NDArray[np.uint8] = remembered()
    times: NDArray[np.int32] = remembered()
    level: NDArray[np.float32] = remembered()
    dry: NDArray[np.float32] = remembered()
    spread: NDArray[np.float32] = remembered()
    heard: NDArray[np.int32] = remembered()
    sums: NDArray[np.uint64] = remembered()
    rule: NDArray[np.uint64] = remembered()
    drop: NDArray[np.uint8] = remembered()
    lowest: NDArray[np.int32] = remembered()
    source: NDArray[np.int32] = remembered()
    rain: NDArray[np.float32] = remembered()
    mean: NDArray[np.float32] = remembered()
    least: NDArray[np.float32] = remembered()
    rules: NDArray[np.uint64] = remembered()
    pending: NDArray[np.uint64] = remembered()
    cursor: NDArray[np.int64] = remembered()
    budget: NDArray[np.float64] = remembered()
    degraded_sweeps: NDArray[np.int64] = remembered()

    @property
    def counters(self) -> dict[str, int]:
        """degraded_sweeps: sweeps whose threshold was raised to stay under the cap on runs."""
        return {"degraded_sweeps": int(self.degraded_sweeps[0])}

    def refuse_untrue(self, saved: Mapping[str, NDArray[Any]]) -> None:
        """Raise StateError for an index out of bounds, or a negative count."""
        bounds = {"lowest": (-1, len(self.level)), "source": (0, len(self.rain)), "times": (0, 2**30)}
        for name, (least, end) in {**bounds, "heard": (0, 2**30)}.items():
            if ((saved[name] < least) | (saved[name] >= end)).any():
                raise StateError(f"{name}: numbers that cannot be true")
        if not -1 <= saved["cursor"][1] < len(self.tile):
            raise StateError("cursor: numbers that cannot be true")


@dataclass(frozen=True)
class Adaptive:
    """See the module. The first `learn_scans` scans only learn; what stands on the pavement is not learned away.

    pfa: false alarm probability in Rayleigh and Weibull clutter. macro_cell_m: side of the macro-cells. level_scans,
    calm_scans: memory of the levels that change and of those that do not. offset_scans: how often a cell learns before
    its memory grows no more; it then learns in every eighth scan. spread_scans: memory of the spreads. dry_scans: of
    the levels that rain is told by. most_offset_db: how far a pavement cell may be learned up; grass_offset_db: the
    same for grass. margin_db: what comes this near to the threshold is not learned. max_runs: as in `hybrid`.
    """

    pfa: float = 1e-6
    macro_cell_m: float = 100.0
    level_scans: float = 1.0
    calm_scans: float = 4.0
    offset_scans: int = 64
    spread_scans: float = 12.0
    dry_scans: float = 64.0
    most_offset_db: float = 8.0
    grass_offset_db: float = 16.0
    margin_db: float = 3.5
    learn_scans: int = 12
    max_runs: int = 40_000

    def __post_init__(self) -> None:
        check_pfa(self.pfa)
        check_positive(macro_cell_m=self.macro_cell_m, grass_offset_db=self.grass_offset_db)
        check_positive(most_offset_db=self.most_offset_db, margin_db=self.margin_db)
        check_whole(learn_scans=self.learn_scans, max_runs=self.max_runs)
        check_whole(12, offset_scans=self.offset_scans)
        if min(self.level_scans, self.calm_scans, self.spread_scans, self.dry_scans) < 1:
            raise ValueError("level_scans, calm_scans, spread_scans and dry_scans must be 1 or more")
        if self.learn_scans > 3600:
            raise ValueError("learn_scans must be 3600 or less: for so long nothing is shown")
        if threshold_offset_db(self.pfa, 1e-3) - self.margin_db < 1.0:
            raise ValueError("margin_db must be at least 1 dB less than the threshold's offset, which pfa sets")

    def start(
        self, video: VideoFormat, surface: NDArray[np.uint8] | None = None, growth_db: float | None = None
    ) -> AdaptiveState:
        """The state before the first sweep. Without a map all is one surface kind."""
        check_start(video, surface, growth_db)
        if surface is None:
            surface = np.full((video.azimuths, video.ranges), 2, np.uint8)
        patches = Patches.build(video, surface, self.macro_cell_m)
        many, cells, tiles = len(patches.kind), (video.azimuths, 64 * video.words), 8 * video.words
        macros = int(patches.macro.max()) + 1
        return AdaptiveState(
            azimuths=video.azimuths,
            ranges=video.ranges,
            settings=self._rule(video, growth_db or 0.0, float(np.square(patches.cells).sum() / patches.cells.sum())),
            tile=patches.tile,
            macro=patches.macro.astype(np.int32),
            kind=_classes(patches.kind),
            expected=patches.cells.astype(np.float32),
            telling=patches.telling,
            near=patches.near.astype(np.int32),
            apart=(patches.distance * FADE_DB_PER_M / video.db_per_step).astype(np.float32),
            like=patches.like.astype(np.int32),
            source=np.arange(macros, dtype=np.int32),
            gain=np.zeros(many, np.float32),
            own_rain=np.zeros(macros, np.float32),
            ahead=np.zeros(many, np.float32),
            strict=patches.paved,
            tail=np.zeros(64, np.uint8),
            limits=np.zeros(64 * video.words, np.uint8),
            offset=np.zeros(cells, np.int8),
            fine=np.full(cells, 128, np.uint8),
            times=np.zeros(video.azimuths, np.int32),
            level=np.zeros(many, np.float32),
            dry=np.zeros(many, np.float32),
            spread=np.ones(many, np.float32),
            heard=np.zeros(many, np.int32),
            sums=np.zeros(many, np.uint64),
            rule=np.full(many, UNKNOWN, np.uint64),
            drop=np.zeros(many, np.uint8),
            lowest=np.full(macros, -1, np.int32),
            rain=np.full(macros, DRY, np.float32),
            mean=np.zeros(many, np.float32),
            least=np.full(many, -128.0, np.float32),
            rules=np.zeros(tiles, np.uint64),
            drops=np.zeros(0 if growth_db is None else cells[1], np.uint8),
            pending=np.zeros(tiles, np.uint64),
            cursor=np.array([-1, -1, 0, 0, 0], np.int64),
            budget=np.array([CapSettings.of(self.max_runs, video.azimuths).depth]),
            degraded_sweeps=np.zeros(1, np.int64),
        )

    def __call__(self, sweeps: Sweeps, state: AdaptiveState) -> Detections:
        """The detections of the block."""
        return self._run(sweeps, state, np.empty((0, 0), np.uint8))

    def thresholds(self, sweeps: Sweeps, state: AdaptiveState) -> NDArray[np.uint8]:
        """(n, ranges) the limits of the block before any cap on runs; `state` is left alone."""
        used = np.empty(sweeps.amplitude.shape, np.uint8)
        self._run(sweeps, deepcopy(state), used)
        return used

    def _run(self, sweeps: Sweeps, state: AdaptiveState, used: NDArray[np.uint8]) -> Detections:
        check_block(sweeps, state.azimuths, state.ranges)
        mask = np.empty((len(sweeps), state.limits.size // 64), np.uint64)
        growth = np.empty((len(sweeps), state.drops.size // 64), np.uint64)
        before = int(state.degraded_sweeps[0])
        cap = CapSettings.of(self.max_runs, state.azimuths)
        detect(
            read_only(sweeps.amplitude),
            read_only(sweeps.row, np.int64),
            sweeps.scan,
            (mask, growth, used),
            state.settings,
            (state.tile, state.macro, state.kind, state.expected, state.telling, state.near, state.apart, state.like),
            (state.offset, state.fine, state.times, state.strict),
            (
                state.level,
                state.dry,
                state.spread,
                state.heard,
                state.sums,
                state.rule,
                state.drop,
                state.lowest,
                state.rain,
                state.mean,
                state.least,
                state.gain,
                state.own_rain,
                state.source,
                state.ahead,
            ),
            (state.rules, state.drops, state.pending, state.cursor),
            (cap.refill, cap.depth, state.budget, state.degraded_sweeps, state.limits),
            state.tail,
        )
        degraded = int(state.degraded_sweeps[0]) > before
        return Detections(mask, degraded, growth if state.drops.size else None)

    def _rule(self, video: VideoFormat, growth_db: float, patch_cells: float) -> Rule:
        step = video.db_per_step
        offset_db = threshold_offset_db(self.pfa, step)
        gain = 1.0 / (self.offset_scans + FIRST[PAVED])
        keep_db = offset_db - self.margin_db
        calm = 1.0 / self.calm_scans
        unsure = gain / (2 - gain) + calm / (2 - calm) * LEARN_EVERY / max(patch_cells, LEARN_EVERY)
        mu = offset_db + estimation_loss_db(self.pfa, step) * unsure
        missing, magnitude, deviation = residual_moments_db(keep_db, -LEAST_KEPT * keep_db)
        most = [self.most_offset_db, self.grass_offset_db, *WIDE_DB]
        return Rule(
            threshold=np.float32(mu / step),
            growth=np.float32(growth_db / step),
            keep=np.float32(keep_db / step),
            least=np.float32(LEAST_KEPT * keep_db / step),
            missing=np.float32(missing / step),
            magnitude=np.float32(magnitude / step),
            deviation=np.float32(deviation / step),
            calm=np.float32(calm),
            quick=np.float32(1 / self.level_scans),
            spread=np.float32(1 / self.spread_scans),
            dry=np.float32(1 / self.dry_scans),
            learn=np.float32(self.learn_scans),
            soft=np.float32(FREE_SCANS),
            dead=np.float32(0.7 / step),
            wet=np.float32(4.0 / step),
            below=np.float32(0.5 / step),
            step_db=np.float32(step),
            long=float(self.offset_scans),
            first=FIRST,
            most=_four([one / step for one in most]),
            azimuths=video.azimuths,
        )


PART = Adaptive


def _classes(kind: NDArray[np.int64]) -> NDArray[np.uint8]:
    built = (kind == BUILDING) | (kind == MIXED + BUILDING)
    made = np.select([built, kind >= MIXED, kind == GRASS], [BUILT, BORDER, GROWN], PAVED)
    return made.astype(np.uint8)


def _four(steps: list[float]) -> np.uint64:
    """Four signed bytes in one word, the first lowest."""
    return np.uint64(np.array([*np.clip(np.rint(steps), -127, 127), 0, 0, 0, 0], np.int8).view(np.uint64)[0])
