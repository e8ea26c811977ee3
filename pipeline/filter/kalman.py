"""Kalman filter with near-constant velocity, batched over columns of tracks."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.kernels.compiled import allocating

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Kalman:
    """Near-constant velocity with white acceleration that is known along and across the course.

    The state is (east, north, v_east, v_north). The spectral density of the acceleration is (sd squared times one
    second): `still_sd` m/s^2 for what stands, rising along the course by `along_sd` (braking, take-off) until
    `full_speed` m/s, and across the course by `turn_rate` rad/s times the speed, at most `across_sd`.

    Source: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, 6.2.2 (continuous
    white noise acceleration) and 5.2. A measurement older than the state: Bar-Shalom, Update with out-of-sequence
    measurements in tracking (IEEE T-AES 38, 2002), without the correlation of the process noise.
    """

    still_sd: float = 0.4
    along_sd: float = 1.8
    across_sd: float = 1.5
    turn_rate: float = 0.15
    full_speed: float = 8.0

    def __post_init__(self) -> None:
        for name in ("still_sd", "along_sd", "across_sd", "turn_rate", "full_speed"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise ValueError(f"{name} must be positive")

    @property
    def _noise(self) -> Floats:
        return np.array([self.still_sd, self.along_sd, self.across_sd, self.turn_rate, self.full_speed])

    def predict(self, state: Floats, covariance: Floats, dt: Floats) -> tuple[Floats, Floats]:
        """State (n, 4) and covariance (n, 4, 4) moved by dt (n,) seconds; a negative dt looks back and also loses."""
        out_state, out_covariance = np.empty_like(state), np.empty_like(covariance)
        _predict(state, covariance, dt, self._noise, out_state, out_covariance)
        return out_state, out_covariance

    def update(
        self, state: Floats, covariance: Floats, dt: Floats, position: Floats, noise: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Predict by dt (n,) s and take a position (n, 2) m with covariance noise (n, 2, 2) m^2.

        Returns state, covariance and normalised innovation squared (n,). With a negative dt the measurement is older
        than the state: it is compared with the state looked back, and the result keeps the time of the state.
        """
        out_state, out_covariance, nis = np.empty_like(state), np.empty_like(covariance), np.empty(len(state))
        _update(state, covariance, dt, position, noise, self._noise, out_state, out_covariance, nis)
        return out_state, out_covariance, nis


PART = Kalman


@allocating
def _density(velocity_east: float, velocity_north: float, noise: Floats) -> tuple[float, float, float]:
    """Spectral density of the acceleration: its east-east, east-north and north-north elements."""
    still, along_sd, across_sd, turn_rate, full_speed = noise[0], noise[1], noise[2], noise[3], noise[4]
    speed = math.sqrt(velocity_east * velocity_east + velocity_north * velocity_north)
    along = still + along_sd * min(speed / full_speed, 1.0)
    across = still + min(turn_rate * speed, across_sd)
    a, c = along * along, across * across
    if speed < 1e-9:
        return a, 0.0, c
    e, n = velocity_east / speed, velocity_north / speed
    return a * e * e + c * n * n, (a - c) * e * n, a * n * n + c * e * e


@allocating
def _move(x: Floats, p: Floats, dt: float, noise: Floats, out_x: Floats, out_p: Floats) -> None:
    """One row of predict: x (4,), p (4, 4)."""
    mee, men, mnn = _density(x[2], x[3], noise)
    out_x[0], out_x[1] = x[0] + dt * x[2], x[1] + dt * x[3]
    out_x[2], out_x[3] = x[2], x[3]
    t = abs(dt)
    q3, q2, q1 = t * t * t / 3.0, dt * t / 2.0, t
    for i in range(2):
        for j in range(2):
            m = men
            if i == j:
                m = mee if i == 0 else mnn
            pv = p[i, 2 + j] + dt * p[2 + i, 2 + j]
            out_p[i, j] = p[i, j] + dt * (p[2 + i, j] + pv) + q3 * m
            out_p[i, 2 + j] = pv + q2 * m
            out_p[2 + j, i] = out_p[i, 2 + j]
            out_p[2 + i, 2 + j] = p[2 + i, 2 + j] + q1 * m


@allocating
def _predict(state: Floats, cov: Floats, dt: Floats, noise: Floats, out_state: Floats, out_cov: Floats) -> None:
    for k in range(len(state)):
        _move(state[k], cov[k], dt[k], noise, out_state[k], out_cov[k])


@allocating
def _update(
    state: Floats, cov: Floats, dt: Floats, position: Floats, r: Floats, noise: Floats,
    out_state: Floats, out_cov: Floats, nis: Floats,
) -> None:  # fmt: skip
    gain_p = np.empty((4, 2))
    gain = np.empty((4, 2))
    for k in range(len(state)):
        x, p = out_state[k], out_cov[k]
        _move(state[k], cov[k], dt[k], noise, x, p)
        s00, s01, s11 = p[0, 0] + r[k, 0, 0], p[0, 1] + r[k, 0, 1], p[1, 1] + r[k, 1, 1]
        v0, v1 = position[k, 0] - x[0], position[k, 1] - x[1]
        if dt[k] < 0.0:
            x[:], p[:] = state[k], cov[k]
        # covariance of (state kept, position measured): with a state looked back this is P F(dt)' H'
        back = min(dt[k], 0.0)
        for i in range(4):
            gain_p[i, 0] = p[i, 0] + back * p[i, 2]
            gain_p[i, 1] = p[i, 1] + back * p[i, 3]
        det = s00 * s11 - s01 * s01
        for i in range(4):
            gain[i, 0] = (gain_p[i, 0] * s11 - gain_p[i, 1] * s01) / det
            gain[i, 1] = (gain_p[i, 1] * s00 - gain_p[i, 0] * s01) / det
        nis[k] = (v0 * v0 * s11 - 2.0 * v0 * v1 * s01 + v1 * v1 * s00) / det
        for i in range(4):
            x[i] += gain[i, 0] * v0 + gain[i, 1] * v1
            for j in range(i, 4):
                p[i, j] -= gain[i, 0] * gain_p[j, 0] + gain[i, 1] * gain_p[j, 1]
                p[j, i] = p[i, j]
