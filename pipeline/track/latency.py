"""By how much the positions of each source of reports are older than their time stamps say, estimated from motion."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from pipeline.kernels.compiled import allocating
from pipeline.tables import TargetReports
from pipeline.tables.arrays import Floats

FIRST_SD_S = 0.5
"""Standard deviation of the latency of a source that nothing is known of: sensors and networks take up to a second."""

WANDER = 0.02
"""s per root of a second, by which a latency may change: networks and queues change in minutes."""

MOST_S = 2.0
"""A latency beyond this is not believed, in either sense; what is later is refused."""

LEAST_SPEED = 8.0
"""m/s, below which a motion says nothing of the latency: at 8 m/s a second is as long as a report is inexact."""

SPEED_SHARE = 0.3
"""Standard deviation of a speed, as a fraction of it, up to which it is known well enough."""

CORROBORATED_S = 3.0
"""A radar that contributed to a track within this time, or within so many of its turns, tells where it is."""

MOST_SOURCES = 10_000
"""Sources that are remembered; the one heard longest ago is forgotten for another."""


@dataclass(slots=True)
class Latencies:
    """Of each source: latency s, its variance s^2, and UTC s of the report from which it was last learnt.

    A source is what the report names as such; where it names none, each address is a source of its own.
    """

    known: dict[str, tuple[float, float, float]] = field(default_factory=dict)

    def of(self, keys: Iterable[str], time: Floats) -> tuple[Floats, Floats]:
        """Latency and its standard deviation (k,) s of sources at times (k,) UTC s."""
        made = np.array([self._at(key, at) for key, at in zip(keys, time.tolist(), strict=True)]).reshape(-1, 2)
        return made[:, 0], np.sqrt(made[:, 1])

    def learn(self, key: str, time: float, late: float, variance: float) -> None:
        """A report was late by `late` s beyond what is known, with a variance of s^2."""
        if not key or not math.isfinite(late):
            return
        mean, before = self._at(key, time)
        gain = before / (before + variance)
        mean = min(max(mean + gain * late, -MOST_S), MOST_S)
        self.known.pop(key, None)
        self.known[key] = (mean, (1.0 - gain) * before, time)
        if len(self.known) > MOST_SOURCES:
            self.known.pop(next(iter(self.known)))

    def shift(self, seconds: float) -> None:
        """All times become later by `seconds`."""
        self.known = {key: (mean, variance, time + seconds) for key, (mean, variance, time) in self.known.items()}

    def _at(self, key: str, time: float) -> tuple[float, float]:
        mean, variance, before = self.known.get(key, (0.0, FIRST_SD_S**2, time))
        return mean, min(variance + WANDER**2 * max(time - before, 0.0), FIRST_SD_S**2)


def source_keys(reports: TargetReports) -> list[str]:
    """The source of each report, or its address where it names none."""
    named = np.where(reports.source != "", reports.source, reports.address)
    return [str(one) for one in named]


def lateness(mean: Floats, covariance: Floats, position: Floats, noise: Floats) -> tuple[Floats, Floats]:
    """By how many s positions (k, 2) lie behind moving targets (k, 4), and the variance of that; nan for slow ones.

    covariance: (k, 4, 4) of the targets. noise: (k, 2, 2) of the positions.
    """
    velocity = mean[:, 2:]
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    with np.errstate(invalid="ignore", divide="ignore"):
        along = velocity / speed[:, None]
        behind = -np.einsum("ki,ki->k", position - mean[:, :2], along) / speed
        variance = np.einsum("ki,kij,kj->k", along, covariance[:, :2, :2] + noise, along) / speed**2
        speed_variance = np.einsum("ki,kij,kj->k", along, covariance[:, 2:, 2:], along)
    slow = ~(speed >= LEAST_SPEED) | ~(speed_variance <= (SPEED_SHARE * speed) ** 2)
    return np.where(slow, np.nan, behind), np.where(slow, np.nan, variance)


def with_latency(mean: Floats, covariance: Floats, sd: Floats) -> Floats:
    """Covariances (k, 4, 4) of targets (k, 4) with that of a latency of standard deviation sd (k,) s."""
    if not (sd > 0.0).any():
        return covariance
    made = covariance.copy()
    _add(mean, covariance, sd, made)
    return made


def latency_noise(mean: Floats, covariance: Floats, sd: Floats) -> Floats:
    """(k, 2, 2) m^2, covariance of the way that targets (k, 4), (k, 4, 4) move in a time of standard deviation sd."""
    made = np.zeros((len(mean), 2, 2))
    _add(mean, covariance, sd, made)
    return made


@allocating
def _add(mean: Floats, covariance: Floats, sd: Floats, made: Floats) -> None:
    for k in range(len(mean)):
        for i in range(2):
            for j in range(2):
                made[k, i, j] += sd[k] * sd[k] * (mean[k, 2 + i] * mean[k, 2 + j] + covariance[k, 2 + i, 2 + j])
