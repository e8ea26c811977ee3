"""The detectors that the CFAR experiments compare, and what a detector that knew the clutter would do."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.contracts.detect import Detector
from pipeline.lab.evaluate.cfar_law import Law
from pipeline.lab.evaluate.ground import Scene
from pipeline.parts import available, build
from pipeline.tables import Sweeps

CLAIRVOYANT = "clairvoyant"
"""Label of the detector that knows the true mean of every cell: the bound."""


@dataclass(frozen=True)
class Case:
    """A detector under its label: the part's name and its settings. learns: it is to see all scans, not only those that
    are measured."""

    label: str
    part: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    learns: bool = True

    def detector(self, pfa: float) -> Detector:
        """The part at this false alarm probability. Raises PartError."""
        made: Detector = build("detect", self.part, {"pfa": pfa, **self.settings})
        return made


CASES = (
    Case("ca", "ca", learns=False),
    Case("os", "os", learns=False),
    Case("clutter map", "clutter_map"),
    Case("clutter map + anti-masking", "clutter_map", {"anti_masking": "both"}),
    Case("hybrid", "hybrid"),
    Case("hybrid + map", "hybrid", {"cells": "map"}),
    Case("adaptive", "adaptive"),
)


def every_part() -> tuple[Case, ...]:
    """CASES, and the parts of the registry that are not among them, at their defaults."""
    named = {case.part for case in CASES}
    return CASES + tuple(Case(name, name) for name in available("detect") if name not in named)


class Watch:
    """Detectors at work over one scene, side by side."""

    def __init__(self, cases: Sequence[Case], scene: Scene, pfa: float) -> None:
        self._cases, self._scene = cases, scene
        self._parts = [case.detector(pfa) for case in cases]
        self._states = [part.start(scene.video, scene.surface) for part in self._parts]
        self._known = np.float32(scene.ground.law.decibels(np.array(pfa)))

    def learn(self, block: Sweeps) -> None:
        """Show them a scan."""
        for case, part, state in zip(self._cases, self._parts, self._states, strict=True):
            if case.learns:
                part(block, state)

    def measure(
        self, block: Sweeps, mean_db: NDArray[np.float32]
    ) -> Iterator[tuple[NDArray[np.float32], NDArray[np.bool_]]]:
        """Show them a scan: (limits, detected cells) of each, and at the end of the bound, which knows mean_db."""
        video = self._scene.video
        for part, state in zip(self._parts, self._states, strict=True):
            limit = limits_of(part.thresholds(block, state), video.db_per_step)
            yield limit, part(block, state).cells(video.ranges)
        limit = mean_db + self._known
        yield limit, block.amplitude * np.float32(video.db_per_step) > limit


FINE_DB = 0.05
LEAST_DB = -60.0
BINS = 2800


def margins(limit_db: NDArray[Any], mean_db: NDArray[Any], kind: NDArray[np.int64], kinds: int) -> NDArray[np.float64]:
    """(kinds, BINS + 1) how many cells of each kind have their limit so far above their true mean, in bins of FINE_DB
    from LEAST_DB on; the last is for cells that detect nothing (limit infinite). kind: of each cell; -1 leaves it out.
    """
    apart = np.nan_to_num((limit_db - mean_db).ravel(), posinf=1e9)
    at = np.clip(np.rint((apart - LEAST_DB) / FINE_DB), 0, BINS - 1).astype(np.int64)
    at[apart > 1e8] = BINS
    flat = kind.ravel()
    taken = flat >= 0
    counts = np.bincount(flat[taken] * (BINS + 1) + at[taken], minlength=kinds * (BINS + 1))
    return counts.reshape(kinds, BINS + 1).astype(np.float64)


def false_alarms(counts: NDArray[np.float64], law: Law, shift_db: float = 0.0) -> float:
    """Mean probability of false alarm of the cells in counts (.., BINS + 1), their limits raised by shift_db."""
    together = counts.reshape(-1, BINS + 1).sum(axis=0)
    edges = LEAST_DB + FINE_DB * np.arange(BINS)
    total = together.sum()
    return float(together[:BINS] @ law.survival(edges + shift_db) / total) if total else float("nan")


def shift_for(counts: NDArray[np.float64], law: Law, pfa: float) -> float:
    """Decibels by which all limits must be raised for the mean probability of false alarm to be pfa."""
    low, high = -30.0, 60.0
    for _ in range(50):
        middle = (low + high) / 2
        low, high = (middle, high) if false_alarms(counts, law, middle) > pfa else (low, middle)
    return (low + high) / 2


def limits_of(thresholds: NDArray[np.uint8], db_per_step: float) -> NDArray[np.float32]:
    """What an amplitude must pass before it is rounded, dB above amplitude 0; infinite where nothing is detected."""
    table = (np.arange(256, dtype=np.float32) + np.float32(0.5)) * np.float32(db_per_step)
    table[255] = np.inf
    return table[thresholds]


def labels(cases: Sequence[Case]) -> list[str]:
    """The labels of the detectors and, at the end, of the bound."""
    return [*(case.label for case in cases), CLAIRVOYANT]
