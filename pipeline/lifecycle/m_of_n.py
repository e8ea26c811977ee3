"""M-of-N confirmation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.contracts.lifecycle import Evidence
from pipeline.kernels.compiled import allocating
from pipeline.lifecycle.fading import TENTATIVE, Fading, hits_within
from pipeline.tables.arrays import Array


@dataclass(frozen=True, kw_only=True)
class MOfN(Fading):
    """A tentative track is confirmed by m hits within n looks and ends when that is out of reach.

    The hits are those of the radar that has most of them, with what other kinds of sensor contributed: false plots of
    several radars at one place must not add up. It is out of reach when it is for every radar that has seen the target.
    The other settings are those of `Fading`. Source: Blackman and Popoli, 6.2 (M of N).
    """

    m: int = 4
    n: int = 6

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 1 <= self.m <= self.n <= 32:
            raise ValueError("m and n must satisfy 1 <= m <= n <= 32")

    def judge(self, evidence: Evidence) -> tuple[Array, Array]:
        """The new TrackPhase (n,) and the mask of tracks that end; the score is not asked. See `LifecyclePart`."""
        n = len(evidence.phase)
        confirmed, unlikely = np.empty(n, np.bool_), np.empty(n, np.bool_)
        _count(evidence.phase, evidence.history, evidence.looks, evidence.radars, self.m, self.n, confirmed, unlikely)
        phase, ended = self.fade(evidence, confirmed)
        return phase, ended | unlikely


PART = MOfN


@allocating
def _count(
    phase: Array, history: Array, looks: Array, radars: int, m: int, n: int, confirmed: Array, unlikely: Array
) -> None:
    for k in range(len(phase)):
        most, hopeful, seen = 0, False, False
        for s in range(radars):
            hits = hits_within(history[k, s], n)
            most = max(most, hits)
            if history[k, s] != 0:
                seen = True
                hopeful = hopeful or min(looks[k, s], n) - hits <= n - m
        for s in range(radars, history.shape[1]):
            most += hits_within(history[k, s], n)
        confirmed[k] = phase[k] != TENTATIVE or most >= m
        unlikely[k] = not confirmed[k] and seen and not hopeful
