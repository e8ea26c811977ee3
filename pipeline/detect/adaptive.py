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

from copy import deepcopy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.detect.calibration import estimation_loss_db, threshold_offset_db, truncated_rayleigh_db
from pipeline.detect.checks import check_start
from pipeline.detect.patches import BUILDING, EDGE, GRASS, Patches
from pipeline.kernels.adaptive import ONE, detect
from pipeline.kernels.run_cap import CapSettings
from pipeline.state import ArrayState, read_only, remembered
from pipeline.tables import Detections, Sweeps, VideoFormat


@dataclass(eq=False, kw_only=True)
class AdaptiveState(ArrayState):
    """offset: of each cell, in 1/128 step. level, spread, bias: of each patch, in steps. heard: scans in which each
    patch was swept. scan: the newest, how many are over, and `heard` of the patch
    swept last for the first time. moved: of each patch, the scan after which its base moved.
    stale: of each row, the scan up to which its limits are true; -1 not at all. limits: uint8, 64 cells a word.
    growth_steps: threshold less growth threshold in Rayleigh clutter; nan without growth. lower: the same of each cell
    of the row being swept."""

    azimuths: int
    rule: tuple[float, ...]
    run_at: NDArray[np.int64]
    runs: NDArray[np.int32]
    macro: NDArray[np.int64]
    bounds: NDArray[np.int32]
    wide: NDArray[np.bool_]
    soft: NDArray[np.bool_]
    tail: NDArray[np.uint8]
    growth_steps: float
    lower: NDArray[np.uint8]
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

    def start(
        self, video: VideoFormat, surface: NDArray[np.uint8] | None = None, growth_db: float | None = None
    ) -> AdaptiveState:
        """The state before the first sweep. Without a map all is one surface kind."""
        check_start(video, surface, growth_db)
        shape = (video.azimuths, video.ranges)
        if surface is None:
            surface = np.full(shape, 2, np.uint8)
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
            growth_steps=np.nan if growth_db is None else max((mu + missing_db - growth_db) / step, 0.0),
            lower=np.zeros(0 if growth_db is None else 64 * video.words, np.uint8),
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
        return self._run(sweeps, state, np.empty((0, 0), np.uint8))

    def thresholds(self, sweeps: Sweeps, state: AdaptiveState) -> NDArray[np.uint8]:
        """(n, ranges) the limits of the block before any cap on runs; `state` is left alone."""
        used = np.empty(sweeps.amplitude.shape, np.uint8)
        self._run(sweeps, deepcopy(state), used)
        return used

    def _run(self, sweeps: Sweeps, state: AdaptiveState, used: NDArray[np.uint8]) -> Detections:
        words = (sweeps.amplitude.shape[1] + 63) // 64
        mask = np.zeros((len(sweeps), words), np.uint64)
        growth = np.zeros((len(sweeps) if len(state.lower) else 0, words), np.uint64)
        before = int(state.degraded_sweeps[0])
        cap = CapSettings.of(self.max_runs, state.azimuths)
        detect(
            read_only(sweeps.amplitude),
            read_only(sweeps.row, np.int64),
            sweeps.scan,
            (mask, growth, used),
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
            (state.growth_steps, state.lower),
        )
        degraded = int(state.degraded_sweeps[0]) > before
        return Detections(mask, degraded, growth if len(state.lower) else None)

    def _bounds(self, kind: NDArray[np.int64], step: float) -> NDArray[np.int32]:
        """(patches, 2) least and greatest offset in 1/128 step."""
        most = np.full(len(kind), self.most_offset_db)
        most[kind == GRASS] = self.grass_offset_db
        most[kind >= EDGE] = 22.0
        most[kind == BUILDING] = 30.0
        least = np.where(kind >= EDGE, -22.0, -20.0)
        return np.rint(np.stack([least, most], axis=1) * ONE / step).astype(np.int32)


PART = Adaptive
