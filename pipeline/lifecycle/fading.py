"""What the lifecycle parts share: how a track begins with two points, coasts and ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.kernels.compiled import allocating
from pipeline.tables import TrackPhase
from pipeline.tables.arrays import Array, Floats


@dataclass(frozen=True, kw_only=True)
class Fading:
    """start_speed_sd: m/s of each velocity component after one measurement. coast_after: looks in a row without a hit,
    or coast_silence s without any measurement, after which a confirmed track is coasting. delete_misses looks in a
    row, or delete_silence s (identified_silence s when a report has named it), end it; so does a position
    standard deviation above max_position_sd m.
    Source: Bar-Shalom, Li, Kirubarajan, 5.5.3 (two-point differencing).
    """

    start_speed_sd: float = 25.0
    coast_after: int = 2
    coast_silence: float = 2.5
    delete_misses: int = 8
    delete_silence: float = 10.0
    identified_silence: float = 20.0
    max_position_sd: float = 120.0

    def __post_init__(self) -> None:
        if not 0 < self.coast_after <= self.delete_misses:
            raise ValueError("coast_after must be positive and not above delete_misses")
        if not 0 < self.coast_silence <= self.delete_silence <= self.identified_silence:
            raise ValueError("coast_silence, delete_silence and identified_silence must be positive and ascend")
        if not (self.start_speed_sd > 0 and self.max_position_sd > 0):
            raise ValueError("start_speed_sd and max_position_sd must be positive")

    def start(self, position: Floats, noise: Floats) -> tuple[Floats, Floats]:
        """State (n, 4) at rest and covariance (n, 4, 4) of tracks begun by a position (n, 2) with noise (n, 2, 2)."""
        state, covariance = np.zeros((len(position), 4)), np.zeros((len(position), 4, 4))
        state[:, :2] = position
        covariance[:, :2, :2] = noise
        covariance[:, 2, 2] = covariance[:, 3, 3] = self.start_speed_sd**2
        return state, covariance

    def second(
        self, state: Floats, covariance: Floats, dt: Floats, position: Floats, noise: Floats
    ) -> tuple[Floats, Floats]:
        """Two-point start: state and covariance at the second measurement, dt (n,) > 0 s after the first."""
        out_state, out_covariance = np.empty_like(state), np.empty_like(covariance)
        _two_points(state, covariance, dt, position, noise, out_state, out_covariance)
        return out_state, out_covariance

    def fade(
        self, phase: Array, confirmed: Array, misses: Array, silence: Floats, identified: Array, position_sd: Floats
    ) -> tuple[Array, Array]:
        """The TrackPhase (n,) of confirmed tracks (the others keep theirs), and the mask of tracks that end."""
        coasting = (misses >= self.coast_after) | (silence > self.coast_silence)
        made = np.where(confirmed, np.where(coasting, TrackPhase.COASTING, TrackPhase.CONFIRMED), phase)
        patience = np.where(identified, self.identified_silence, self.delete_silence)
        silent = silence > np.where(confirmed, patience, min(self.delete_silence, 2 * self.coast_silence))
        missed = confirmed & (misses >= self.delete_misses) & ~identified
        return made.astype(np.uint8), silent | missed | ~(position_sd <= self.max_position_sd)


@allocating
def _two_points(
    state: Floats, cov: Floats, dt: Floats, position: Floats, noise: Floats, out_state: Floats, out_cov: Floats
) -> None:
    for k in range(len(state)):
        t = dt[k]
        for i in range(2):
            out_state[k, i] = position[k, i]
            out_state[k, 2 + i] = (position[k, i] - state[k, i]) / t
            for j in range(2):
                out_cov[k, i, j] = noise[k, i, j]
                out_cov[k, i, 2 + j] = noise[k, i, j] / t
                out_cov[k, 2 + i, j] = noise[k, i, j] / t
                out_cov[k, 2 + i, 2 + j] = (noise[k, i, j] + cov[k, i, j]) / (t * t)
