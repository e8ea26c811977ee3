"""Kalman filter with near-constant velocity, batched over columns of tracks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pipeline.contracts.filter import Column, Ground, Innovations, Moments, Prior, Store
from pipeline.contracts.measured import Hypotheses, Measured
from pipeline.kernels.compiled import allocating
from pipeline.tables.arrays import Array, Floats

_COLUMNS: Mapping[str, Column] = {
    "state": Column("f8", (4,)),
    "covariance": Column("f8", (4, 4)),
    "one_point": Column("?", (), True),
}


Noise = tuple[float, float, float, float, float]
"""The settings of the acceleration: still_sd, along_sd, across_sd, turn_rate, full_speed."""


class Predicted(NamedTuple):
    """rows: (n,) of the store. time: (n,) UTC s. mean: (n, 4). covariance: (n, 4, 4)."""

    rows: Array
    time: Floats
    mean: Floats
    covariance: Floats


@dataclass(frozen=True)
class Kalman:
    """Near-constant velocity with white acceleration that is known along and across the course.

    The state is (east, north, v_east, v_north). The spectral density of the acceleration is (sd squared times one
    second): `still_sd` m/s^2 for what stands, rising along the course by `along_sd` (braking, take-off) until
    `full_speed` m/s, and across the course by `turn_rate` rad/s times the speed, at most `across_sd`. The first two
    positions give the first velocity when nothing else does, if they are at least `two_point_after` s apart: closer
    ones would give little but noise.

    Source: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, 6.2.2 (continuous
    white noise acceleration), 5.2, and 5.5.3 (two-point differencing). A measurement older than the state: Bar-Shalom,
    Update with out-of-sequence measurements in tracking (IEEE T-AES 38, 2002), without the correlation of the process
    noise.
    """

    still_sd: float = 0.4
    along_sd: float = 1.8
    across_sd: float = 1.5
    turn_rate: float = 0.15
    full_speed: float = 8.0
    two_point_after: float = 0.3

    def __post_init__(self) -> None:
        for name in ("still_sd", "along_sd", "across_sd", "turn_rate", "full_speed", "two_point_after"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise ValueError(f"{name} must be positive")

    @property
    def columns(self) -> Mapping[str, Column]:
        """State, covariance, and whether only one position was taken so far."""
        return _COLUMNS

    @property
    def _noise(self) -> Noise:
        return self.still_sd, self.along_sd, self.across_sd, self.turn_rate, self.full_speed

    def start(self, store: Store, rows: Array, measured: Measured, prior: Prior) -> None:
        """Begin rows with a position each and the velocity held before. See `FilterPart`."""
        _start(
            store.filter, store.time, rows, measured.time, measured.position, measured.noise, prior.velocity,
            prior.covariance, prior.known,
        )  # fmt: skip

    def predict(self, store: Store, rows: Array, time: Floats, ground: Ground | None = None) -> Predicted:
        """State (n, 4) and covariance (n, 4, 4) at times (n,); looking back also loses. See `FilterPart`."""
        made = Predicted(rows, time, np.empty((len(rows), 4)), np.empty((len(rows), 4, 4)))
        _predict(store.filter, store.time, rows, time, self._noise, made.mean, made.covariance)
        return made

    def moments(self, predicted: Predicted) -> Moments:
        """They are the state itself."""
        return Moments(predicted.mean, predicted.covariance)

    def log_likelihood(self, predicted: Predicted, measured: Measured, tracks: Array, plots: Array) -> Floats:
        """(k,) of the positions `plots`, were they of `tracks` moved to their times. See `FilterPart`."""
        made = np.empty(len(tracks))
        _log_likelihood(
            predicted.mean, predicted.covariance, predicted.time, measured.time, measured.position, measured.noise,
            tracks, plots, self._noise, made,
        )  # fmt: skip
        return made

    def update(self, store: Store, predicted: Predicted, measured: Measured, hypotheses: Hypotheses) -> Innovations:
        """Take positions; several hypotheses of a row become their mixture. See `FilterPart`.

        A measurement older than the row is compared with the state looked back, and the row keeps its time.
        """
        squared = np.full(len(predicted.rows), np.nan)
        moments = Moments(np.empty_like(predicted.mean), np.empty_like(predicted.covariance))
        _update(
            store.filter, store.time, predicted.rows, measured.time, measured.position, measured.noise, *hypotheses,
            self._noise, self.two_point_after, squared, *moments,
        )  # fmt: skip
        return Innovations(squared, moments)

    def branch(self, store: Store, rows: Array, into: Array) -> None:
        """Copy rows into others."""
        store.filter[into] = store.filter[rows]
        store.time[into] = store.time[rows]

    def merge(self, store: Store, into: Array, rows: Array, weight: Floats) -> None:
        """The mixture of pairs of rows, at the later of their times. See `FilterPart`."""
        for target, other, share in zip(into, rows, weight, strict=True):
            if share >= 1.0:
                self.branch(store, np.array([other]), np.array([target]))
                continue
            pair = np.array([target, other])
            at = np.full(2, store.time[pair].max())
            both = self.predict(store, pair, at)
            mean, covariance = mixture(both.mean, both.covariance, np.array([1.0 - share, share]))
            store.filter["state"][target], store.filter["covariance"][target] = mean, covariance
            store.filter["one_point"][target] &= store.filter["one_point"][other]
            store.time[target] = at[0]


def mixture(mean: Floats, covariance: Floats, weight: Floats) -> tuple[Floats, Floats]:
    """Mean (d,) and covariance (d, d) of a mixture of normal laws (k, d), (k, d, d) with weights (k,) of sum 1."""
    centre = weight @ mean
    off = mean - centre
    return centre, np.einsum("k,kij->ij", weight, covariance + off[:, :, None] * off[:, None, :])


PART = Kalman

LEAST_SPEED = 1e-9
"""m/s, below which a velocity has no direction."""


@allocating
def _density(velocity_east: float, velocity_north: float, noise: Noise) -> tuple[float, float, float]:
    """Spectral density of the acceleration: its east-east, east-north and north-north elements."""
    still, along_sd, across_sd, turn_rate, full_speed = noise[0], noise[1], noise[2], noise[3], noise[4]
    speed = math.sqrt(velocity_east * velocity_east + velocity_north * velocity_north)
    along = still + along_sd * min(speed / full_speed, 1.0)
    across = still + min(turn_rate * speed, across_sd)
    a, c = along * along, across * across
    if speed < LEAST_SPEED:
        return a, 0.0, c
    e, n = velocity_east / speed, velocity_north / speed
    return a * e * e + c * n * n, (a - c) * e * n, a * n * n + c * e * e


@allocating
def _move(x: Floats, p: Floats, dt: float, noise: Noise, out_x: Floats, out_p: Floats) -> None:
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
def _start(
    own: Array, own_time: Floats, rows: Array, time: Floats, position: Floats, noise: Floats, velocity: Floats,
    velocity_covariance: Floats, known: Array,
) -> None:  # fmt: skip
    for k in range(len(rows)):
        row = own[rows[k]]
        x, p = row["state"], row["covariance"]
        for i in range(2):
            x[i], x[2 + i] = position[k, i], velocity[k, i]
            for j in range(2):
                p[i, j], p[2 + i, 2 + j] = noise[k, i, j], velocity_covariance[k, i, j]
                p[i, 2 + j] = p[2 + i, j] = 0.0
        row["one_point"] = not known[k]
        own_time[rows[k]] = time[k]


@allocating
def _predict(
    own: Array, own_time: Floats, rows: Array, time: Floats, noise: Noise, out_mean: Floats, out_cov: Floats
) -> None:
    for k in range(len(rows)):
        row = own[rows[k]]
        _move(row["state"], row["covariance"], time[k] - own_time[rows[k]], noise, out_mean[k], out_cov[k])


@allocating
def _log_likelihood(
    mean: Floats, cov: Floats, time: Floats, m_time: Floats, position: Floats, r: Floats, tracks: Array, plots: Array,
    noise: Noise, out: Floats,
) -> None:  # fmt: skip
    x, p = np.empty(4), np.empty((4, 4))
    for k in range(len(tracks)):
        i, j = tracks[k], plots[k]
        _move(mean[i], cov[i], m_time[j] - time[i], noise, x, p)
        s00, s01, s11 = p[0, 0] + r[j, 0, 0], p[0, 1] + r[j, 0, 1], p[1, 1] + r[j, 1, 1]
        v0, v1 = position[j, 0] - x[0], position[j, 1] - x[1]
        det = s00 * s11 - s01 * s01
        squared = (v0 * v0 * s11 - 2.0 * v0 * v1 * s01 + v1 * v1 * s00) / det
        out[k] = -0.5 * squared - math.log(2.0 * math.pi) - 0.5 * math.log(det)


@allocating
def _take(
    x: Floats, p: Floats, dt: float, z: Floats, r: Floats, noise: Noise, moved_x: Floats, moved_p: Floats,
    gain_p: Floats, gain: Floats,
) -> float:  # fmt: skip
    """Correct x (4,), p (4, 4) in place by a position dt s later, or earlier; its normalised innovation squared."""
    _move(x, p, dt, noise, moved_x, moved_p)
    s00, s01, s11 = moved_p[0, 0] + r[0, 0], moved_p[0, 1] + r[0, 1], moved_p[1, 1] + r[1, 1]
    v0, v1 = z[0] - moved_x[0], z[1] - moved_x[1]
    if dt >= 0.0:
        x[:], p[:] = moved_x, moved_p
    # covariance of (state kept, position measured): with a state looked back this is P F(dt)' H'
    back = min(dt, 0.0)
    for i in range(4):
        gain_p[i, 0] = p[i, 0] + back * p[i, 2]
        gain_p[i, 1] = p[i, 1] + back * p[i, 3]
    det = s00 * s11 - s01 * s01
    for i in range(4):
        gain[i, 0] = (gain_p[i, 0] * s11 - gain_p[i, 1] * s01) / det
        gain[i, 1] = (gain_p[i, 1] * s00 - gain_p[i, 0] * s01) / det
    for i in range(4):
        x[i] += gain[i, 0] * v0 + gain[i, 1] * v1
        for j in range(i, 4):
            p[i, j] -= gain[i, 0] * gain_p[j, 0] + gain[i, 1] * gain_p[j, 1]
            p[j, i] = p[i, j]
    return float((v0 * v0 * s11 - 2.0 * v0 * v1 * s01 + v1 * v1 * s00) / det)


@allocating
def _two_points(x: Floats, p: Floats, dt: float, z: Floats, r: Floats) -> None:
    """Two-point differencing in place: the second position comes dt > 0 s after the first."""
    for i in range(2):
        x[2 + i] = (z[i] - x[i]) / dt
        for j in range(2):
            p[2 + i, 2 + j] = (r[i, j] + p[i, j]) / (dt * dt)
            p[i, j] = r[i, j]
            p[i, 2 + j] = p[2 + i, j] = r[i, j] / dt
    x[0], x[1] = z[0], z[1]


@allocating
def _update(
    own: Array, own_time: Floats, rows: Array, time: Floats, position: Floats, r: Floats, track_first: Array,
    plot_first: Array, plot: Array, log_weight: Floats, noise: Noise, two_point_after: float, squared: Floats,
    out_mean: Floats, out_cov: Floats,
) -> None:  # fmt: skip
    x, p, moved_x, moved_p = np.empty(4), np.empty((4, 4)), np.empty(4), np.empty((4, 4))
    mean, cov = np.empty(4), np.empty((4, 4))
    gain_p, gain = np.empty((4, 2)), np.empty((4, 2))
    for k in range(len(rows)):
        first, last = track_first[k], track_first[k + 1]
        if plot_first[first] == plot_first[last]:
            continue
        row, before = own[rows[k]], own_time[rows[k]]
        newest, likeliest, one_point = before, -np.inf, row["one_point"]
        for h in range(first, last):
            for o in range(plot_first[h], plot_first[h + 1]):
                newest = max(newest, time[plot[o]])
        mean[:], cov[:] = 0.0, 0.0
        for h in range(first, last):
            x[:], p[:] = row["state"], row["covariance"]
            at, unknown, nis = before, one_point, np.nan
            for o in range(plot_first[h], plot_first[h + 1]):
                j = plot[o]
                if unknown and time[j] - at >= two_point_after:
                    _two_points(x, p, time[j] - at, position[j], r[j])
                    unknown = False
                else:
                    nis = _take(x, p, time[j] - at, position[j], r[j], noise, moved_x, moved_p, gain_p, gain)
                at = max(at, time[j])
            if log_weight[h] > likeliest:
                likeliest, squared[k], row["one_point"] = log_weight[h], nis, unknown
            if last - first > 1 and at < newest:
                _move(x, p, newest - at, noise, moved_x, moved_p)
                x[:], p[:] = moved_x, moved_p
            if last - first > 1:
                _add_to_mixture(mean, cov, x, p, math.exp(log_weight[h]))
        if last - first > 1:
            for i in range(4):
                for j in range(4):
                    cov[i, j] -= mean[i] * mean[j]
        else:
            mean[:], cov[:] = x, p
        row["state"][:], row["covariance"][:] = mean, cov
        out_mean[k], out_cov[k] = mean, cov
        own_time[rows[k]] = newest


@allocating
def _add_to_mixture(mean: Floats, cov: Floats, x: Floats, p: Floats, weight: float) -> None:
    """Sums of the first and second moments (about zero), of which the mixture is made."""
    for i in range(4):
        mean[i] += weight * x[i]
        for j in range(4):
            cov[i, j] += weight * (p[i, j] + x[i] * x[j])
