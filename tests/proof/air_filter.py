"""A filter with height for the proof that the tracker carries one: a state of six elements."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pipeline.contracts.filter import Column, Ground, Innovations, Moments, Prior, Store
from pipeline.contracts.measured import Hypotheses, Measured
from pipeline.filter.kalman import mixture
from pipeline.tables.arrays import Array, Floats


class Predicted(NamedTuple):
    """rows: (n,) of the store. time: (n,) UTC s. mean: (n, 6). covariance: (n, 6, 6)."""

    rows: Array
    time: Floats
    mean: Floats
    covariance: Floats


@dataclass(frozen=True)
class AirFilter:
    """Near-constant velocity east, north and up (m, then m/s); altitudes are taken where they are measured.

    level_sd, climb_sd: m/s^2 (times 1 s) of the white acceleration. altitude_sd: m of a measured altitude.
    unknown_altitude_sd: m of one that nobody has told. start_climb_sd: m/s of a new track.
    """

    level_sd: float = 2.0
    climb_sd: float = 1.0
    altitude_sd: float = 15.0
    unknown_altitude_sd: float = 2000.0
    start_climb_sd: float = 10.0

    @property
    def columns(self) -> Mapping[str, Column]:
        return {"state": Column("f8", (6,)), "covariance": Column("f8", (6, 6))}

    def start(self, store: Store, rows: Array, measured: Measured, prior: Prior) -> None:
        for k, row in enumerate(rows):
            told = np.isfinite(measured.altitude[k])
            covariance = np.zeros((6, 6))
            covariance[:2, :2], covariance[3:5, 3:5] = measured.noise[k], prior.covariance[k]
            covariance[2, 2] = (self.altitude_sd if told else self.unknown_altitude_sd) ** 2
            covariance[5, 5] = self.start_climb_sd**2
            altitude = measured.altitude[k] if told else 0.0
            store.filter["state"][row] = np.r_[measured.position[k], altitude, prior.velocity[k], 0.0]
            store.filter["covariance"][row], store.time[row] = covariance, measured.time[k]

    def predict(self, store: Store, rows: Array, time: Floats, ground: Ground | None = None) -> Predicted:
        made = Predicted(rows, time, np.empty((len(rows), 6)), np.empty((len(rows), 6, 6)))
        for k, row in enumerate(rows):
            made.mean[k], made.covariance[k] = self._move(*_read(store, row), time[k] - store.time[row])
        return made

    def moments(self, predicted: Predicted) -> Moments:
        return Moments(predicted.mean, predicted.covariance)

    def log_likelihood(self, predicted: Predicted, measured: Measured, tracks: Array, plots: Array) -> Floats:
        made = np.empty(len(tracks))
        for k, (i, j) in enumerate(zip(tracks, plots, strict=True)):
            dt = measured.time[j] - predicted.time[i]
            x, p = self._move(predicted.mean[i], predicted.covariance[i], dt)
            s, off = p[:2, :2] + measured.noise[j], measured.position[j] - x[:2]
            made[k] = -0.5 * (off @ np.linalg.solve(s, off) + np.log(np.linalg.det(s))) - math.log(2.0 * math.pi)
        return made

    def update(self, store: Store, predicted: Predicted, measured: Measured, hypotheses: Hypotheses) -> Innovations:
        squared = np.full(len(predicted.rows), np.nan)
        for k, row in enumerate(predicted.rows):
            sets, before, made = hypotheses.of_track(k), store.time[row], []
            taken = [j for plots, _ in sets for j in plots]
            if not taken:
                continue
            newest, likeliest = max(before, measured.time[taken].max()), max(weight for _, weight in sets)
            for plots, weight in sets:
                (x, p), at = _read(store, row), before
                for j in plots:
                    x, p, distance = self._take(x, p, measured.time[j] - at, measured, j)
                    at = max(at, measured.time[j])
                    squared[k] = distance if weight == likeliest else squared[k]
                made.append(self._move(x, p, newest - at))
            _write(store, row, made, np.exp([weight for _, weight in sets]), newest)
        return Innovations(squared, self.moments(self.predict(store, predicted.rows, store.time[predicted.rows])))

    def branch(self, store: Store, rows: Array, into: Array) -> None:
        store.filter[into], store.time[into] = store.filter[rows], store.time[rows]

    def merge(self, store: Store, into: Array, rows: Array, weight: Floats) -> None:
        for a, b, share in zip(into, rows, weight, strict=True):
            at = store.time[b] if share >= 1.0 else max(store.time[a], store.time[b])
            both = [self._move(*_read(store, row), at - store.time[row]) for row in (a, b)]
            _write(store, a, both, np.array([1.0 - share, share]), at)

    def _move(self, x: Floats, p: Floats, dt: float) -> tuple[Floats, Floats]:
        step, t = np.kron([[1.0, dt], [0.0, 1.0]], np.eye(3)), abs(dt)
        density = np.diag([self.level_sd, self.level_sd, self.climb_sd]) ** 2
        moved = step @ p @ step.T + np.kron([[t**3 / 3, dt * t / 2], [dt * t / 2, t]], density)
        return step @ x, (moved + moved.T) / 2

    def _take(
        self, x: Floats, p: Floats, dt: float, measured: Measured, j: int
    ) -> tuple[Floats, Floats, float]:  # fmt: skip
        """State and covariance after a measurement dt s later, or earlier, and its squared distance on the ground."""
        there, spread = self._move(x, p, dt)
        if dt >= 0.0:
            x, p = there, spread
        d = 3 if np.isfinite(measured.altitude[j]) else 2
        off = np.r_[measured.position[j], measured.altitude[j]][:d] - there[:d]
        s = spread[:d, :d].copy()
        s[:2, :2] += measured.noise[j]
        s[2:, 2:] += self.altitude_sd**2
        cross = p[:, :d] + min(dt, 0.0) * p[:, 3 : 3 + d]
        gain = np.linalg.solve(s, cross.T).T
        corrected = p - gain @ cross.T
        level = off[:2] @ np.linalg.solve(s[:2, :2], off[:2])
        return x + gain @ off, (corrected + corrected.T) / 2, float(level)


def _read(store: Store, row: int) -> tuple[Floats, Floats]:
    return store.filter["state"][row].copy(), store.filter["covariance"][row].copy()


def _write(store: Store, row: int, held: list[tuple[Floats, Floats]], share: Floats, time: float) -> None:
    """The mixture of what is held into a row."""
    mean, covariance = mixture(np.array([x for x, _ in held]), np.array([p for _, p in held]), share)
    store.filter["state"][row], store.filter["covariance"][row], store.time[row] = mean, covariance, time
