"""Confirmation by likelihood ratio: target or false plots?"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.lifecycle.fading import Fading
from pipeline.tables import TrackPhase
from pipeline.tables.arrays import Array, Floats


@dataclass(frozen=True, kw_only=True)
class Score(Fading):
    """A tentative track is confirmed when a target explains its plots better than false plots do, by e^confirm.

    The score is the logarithm of the ratio, kept by the tracker: a plot is worth more the closer it came to where it
    was expected, the fewer false plots there are at its place, and the larger it is; a look without a plot costs.
    drop: score at which a tentative track ends. keep: score at which one that was confirmed ends unless a report has
    named it. least_hits: measurements that it needs besides. longest: looks after
    which a track that is still tentative ends. The other settings are those of `Fading`.
    Source: Wald's sequential test as track score, Blackman and Popoli, Design and Analysis of Modern Tracking
    Systems, 6.2.2 to 6.2.5.
    """

    confirm: float = 12.0
    drop: float = -5.0
    keep: float = 4.0
    least_hits: int = 3
    longest: int = 14

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (math.isfinite(self.confirm) and math.isfinite(self.drop) and self.drop < 0 < self.confirm):
            raise ValueError("drop must be below and confirm above 0")
        if not self.keep < self.confirm:
            raise ValueError("keep must be below confirm")
        if not 1 <= self.least_hits <= self.longest <= 32:
            raise ValueError("least_hits and longest must satisfy 1 <= least_hits <= longest <= 32")

    def judge(
        self, phase: Array, history: Array, looks: Array, misses: Array, silence: Floats, identified: Array,
        position_sd: Floats, score: Floats,
    ) -> tuple[Array, Array]:  # fmt: skip
        """The new TrackPhase (n,) and the mask of tracks that end. See `LifecyclePart`."""
        hits = np.bitwise_count(history)
        confirmed = (phase != TrackPhase.TENTATIVE) | ((score >= self.confirm) & (hits >= self.least_hits))
        made, ended = self.fade(phase, confirmed, misses, silence, identified, position_sd)
        unlikely = np.where(
            confirmed, (score <= self.keep) & ~identified, (score <= self.drop) | (looks > self.longest)
        )
        return made, ended | unlikely


PART = Score
