"""A filter of two models for the proof that the tracker carries one: a quiet and an agile near-constant velocity."""

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

LEAST_WEIGHT = 1e-9  # of a model, so that it can come back


class Models(NamedTuple):
    """What is held of one track: states (2, 4), covariances (2, 4, 4), weights (2,) of sum 1."""

    states: Floats
    covariances: Floats
    weights: Floats


class Predicted(NamedTuple):
    """rows: (n,) of the store. time: (n,) UTC s. held: the models of each row."""

    rows: Array
    time: Floats
    held: list[Models]


@dataclass(frozen=True)
class TwoModels:
    """Interacting multiple models; each has white acceleration of its own standard deviation in m/s^2 (times 1 s).

    sojourn: s for which a target keeps to a model on average.
    Source: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, 11.6.6 (IMM).
    """

    quiet_sd: float = 0.5
    agile_sd: float = 3.0
    sojourn: float = 5.0

    @property
    def columns(self) -> Mapping[str, Column]:
        return {name: Column("f8", (2, 4, 4)[:dim]) for name, dim in zip(Models._fields, (2, 3, 1), strict=True)}

    def start(self, store: Store, rows: Array, measured: Measured, prior: Prior) -> None:
        for k, row in enumerate(rows):
            covariance = np.zeros((4, 4))
            covariance[:2, :2], covariance[2:, 2:] = measured.noise[k], prior.covariance[k]
            state = np.r_[measured.position[k], prior.velocity[k]]
            both = Models(np.stack([state] * 2), np.stack([covariance] * 2), np.full(2, 0.5))
            _write(store, row, [both], np.ones(1), measured.time[k])

    def predict(self, store: Store, rows: Array, time: Floats, ground: Ground | None = None) -> Predicted:
        ahead = time - store.time[rows]
        held = [Models(*one) for one in store.filter[rows]]
        return Predicted(rows, time, [self._expect(one, dt) for one, dt in zip(held, ahead, strict=True)])

    def moments(self, predicted: Predicted) -> Moments:
        mean, covariance = zip(*(mixture(*one) for one in predicted.held), strict=True) if predicted.held else ((), ())
        return Moments(np.reshape(mean, (-1, 4)), np.reshape(covariance, (-1, 4, 4)))

    def log_likelihood(self, predicted: Predicted, measured: Measured, tracks: Array, plots: Array) -> Floats:
        made = np.empty(len(tracks))
        for k, (i, j) in enumerate(zip(tracks, plots, strict=True)):
            one = self._move(predicted.held[i], measured.time[j] - predicted.time[i])
            made[k] = np.logaddexp.reduce(np.log(one.weights) + _innovations(one, measured, j)[2])
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
                held, at = Models(*store.filter[row].copy()), before
                for j in plots:
                    held, distance = self._take(held, measured.time[j] - at, measured, j)
                    at = max(at, measured.time[j])
                    squared[k] = distance if weight == likeliest else squared[k]
                made.append(self._expect(held, newest - at))
            _write(store, row, made, np.exp([weight for _, weight in sets]), newest)
        return Innovations(squared, self.moments(self.predict(store, predicted.rows, store.time[predicted.rows])))

    def branch(self, store: Store, rows: Array, into: Array) -> None:
        store.filter[into], store.time[into] = store.filter[rows], store.time[rows]

    def merge(self, store: Store, into: Array, rows: Array, weight: Floats) -> None:
        for a, b, share in zip(into, rows, weight, strict=True):
            at = store.time[b] if share >= 1.0 else max(store.time[a], store.time[b])
            both = [self._expect(Models(*store.filter[row].copy()), at - store.time[row]) for row in (a, b)]
            _write(store, a, both, np.array([1.0 - share, share]), at)

    def _expect(self, held: Models, dt: float) -> Models:
        """Models that interact over dt s; looking back they do not."""
        if dt <= 0.0:
            return self._move(held, dt)
        change = 0.5 * (1.0 - math.exp(-2.0 * dt / self.sojourn))
        share = held.weights[:, None] * np.array([[1.0 - change, change], [change, 1.0 - change]])
        states, covariances = (np.stack([column] * 2, axis=1) for column in held[:2])
        return self._move(_mixture(states, covariances, share), dt)

    def _move(self, held: Models, dt: float) -> Models:
        step, t = np.kron([[1.0, dt], [0.0, 1.0]], np.eye(2)), abs(dt)
        noise = np.kron([[t**3 / 3, dt * t / 2], [dt * t / 2, t]], np.eye(2))
        grown = np.stack([self.quiet_sd**2 * noise, self.agile_sd**2 * noise])
        return Models(held.states @ step.T, step @ held.covariances @ step.T + grown, held.weights)

    def _take(self, held: Models, dt: float, measured: Measured, j: int) -> tuple[Models, float]:
        """The models after a measurement dt s later, or earlier, and its normalised innovation squared."""
        there = self._expect(held, dt)
        base = there if dt >= 0.0 else held
        off, s, log_density, squared = _innovations(there, measured, j)
        cross = base.covariances[:, :2] + min(dt, 0.0) * base.covariances[:, 2:]  # of the position and the state kept
        gain = np.linalg.solve(s, cross).transpose(0, 2, 1)
        states, covariances = base.states + (gain @ off)[:, :, 0], base.covariances - gain @ cross
        log_weights = np.log(base.weights) + log_density
        weights = np.maximum(np.exp(log_weights - log_weights.max()), LEAST_WEIGHT)
        return Models(states, covariances, weights / weights.sum()), float(squared[np.argmax(weights)])


def _write(store: Store, row: int, held: list[Models], share: Floats, time: float) -> None:
    """The mixture of several beliefs about one track into its row, each model by itself."""
    states, covariances, weights = (np.array(column) for column in zip(*held, strict=True))
    store.filter[row], store.time[row] = tuple(_mixture(states, covariances, share[:, None] * weights)), time


def _innovations(held: Models, measured: Measured, j: int) -> tuple[Floats, Floats, Floats, Floats]:
    """Of a position under each model: what is new (2, 2, 1), its covariance, ln of its density, squared distance."""
    off = (measured.position[j] - held.states[:, :2])[:, :, None]
    s = held.covariances[:, :2, :2] + measured.noise[j]
    squared = (off * np.linalg.solve(s, off)).sum(axis=(1, 2))
    return off, s, -0.5 * (squared + np.log(np.linalg.det(s))) - math.log(2.0 * math.pi), squared


def _mixture(states: Floats, covariances: Floats, share: Floats) -> Models:
    """Each model the mixture of k beliefs (k, 2, 4), (k, 2, 4, 4), whose shares (k, 2) sum to 1 over all."""
    weights = share.sum(axis=0)
    made = [mixture(states[:, m], covariances[:, m], share[:, m] / weights[m]) for m in range(2)]
    return Models(np.array([x for x, _ in made]), np.array([p for _, p in made]), weights)
