"""Confirmation by likelihood ratio: target or false plots?"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.contracts.lifecycle import Evidence
from pipeline.kernels.compiled import allocating
from pipeline.lifecycle.fading import NEVER_LOOKED, TENTATIVE, Fading, hits_within
from pipeline.tables.arrays import Array, Floats

HISTORY_LOOKS = 32
"""Looks that a history holds."""


@dataclass(frozen=True, kw_only=True)
class Score(Fading):
    """A tentative track is confirmed when a target explains its plots better than false plots do, by e^confirm.

    The score is the logarithm of the ratio, kept by the tracker for each sensor: a plot adds more the closer it came to
    where it was expected, the fewer false plots there are at its place, and the larger it is; a look without a plot
    costs. The score of a track is the sum of those that are positive; when none is, the greatest of the sensors that
    have seen the target. drop: score at which a tentative track ends. keep: score at which one that was confirmed ends
    unless a report has named it. least_hits: measurements that it needs besides. longest: looks of each radar that has
    seen it, after which a track that is still tentative ends. The other settings are those of `Fading`.
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

    def judge(self, evidence: Evidence) -> tuple[Array, Array]:
        """The new TrackPhase (n,) and the mask of tracks that end. See `LifecyclePart`."""
        n = len(evidence.phase)
        confirmed, unlikely = np.empty(n, np.bool_), np.empty(n, np.bool_)
        _weigh(
            evidence.phase, evidence.history, evidence.looks, evidence.score, evidence.radars, evidence.identified,
            self.confirm, self.drop, self.keep, self.least_hits, self.longest, confirmed, unlikely,
        )  # fmt: skip
        phase, ended = self.fade(evidence, confirmed)
        return phase, ended | unlikely


PART = Score


@allocating
def _weigh(
    phase: Array, history: Array, looks: Array, score: Floats, radars: int, identified: Array, confirm: float,
    drop: float, keep: float, least_hits: int, longest: int, confirmed: Array, unlikely: Array,
) -> None:  # fmt: skip
    for k in range(len(phase)):
        total, greatest, hits, fewest = 0.0, -np.inf, 0, NEVER_LOOKED
        for s in range(history.shape[1]):
            if history[k, s] == 0:
                continue
            hits += hits_within(history[k, s], HISTORY_LOOKS)
            total += max(score[k, s], 0.0)
            greatest = max(greatest, score[k, s])
            if s < radars:
                fewest = min(fewest, looks[k, s])
        if total == 0.0:
            total = greatest
        confirmed[k] = phase[k] != TENTATIVE or (total >= confirm and hits >= least_hits)
        if confirmed[k]:
            unlikely[k] = total <= keep and not identified[k]
        else:
            unlikely[k] = total <= drop or (fewest != NEVER_LOOKED and fewest > longest)
