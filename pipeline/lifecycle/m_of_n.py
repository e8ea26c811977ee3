"""M-of-N confirmation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.lifecycle.fading import Fading
from pipeline.tables import TrackPhase
from pipeline.tables.arrays import Array, Floats


@dataclass(frozen=True, kw_only=True)
class MOfN(Fading):
    """A tentative track is confirmed by m hits within n looks and ends when that is out of reach.

    The other settings are those of `Fading`. Source: Blackman and Popoli, 6.2 (M of N).
    """

    m: int = 4
    n: int = 6

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 1 <= self.m <= self.n <= 32:
            raise ValueError("m and n must satisfy 1 <= m <= n <= 32")

    def judge(
        self, phase: Array, history: Array, looks: Array, misses: Array, silence: Floats, identified: Array,
        position_sd: Floats, score: Floats,
    ) -> tuple[Array, Array]:  # fmt: skip
        """The new TrackPhase (n,) and the mask of tracks that end; `score` is not asked. See `LifecyclePart`."""
        recent = np.minimum(looks, self.n)
        hits = np.bitwise_count(history & np.uint32((1 << self.n) - 1))
        confirmed = (phase != TrackPhase.TENTATIVE) | (hits >= self.m)
        made, ended = self.fade(phase, confirmed, misses, silence, identified, position_sd)
        return made, ended | (~confirmed & (recent - hits > self.n - self.m))


PART = MOfN
