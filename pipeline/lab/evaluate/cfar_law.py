"""How clutter and targets fluctuate, and how probably they exceed a limit: exactly, so that 1e-6 can be measured."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import gamma, gammaln, kve

DB = 10 / np.log(10)
"""Decibels of a natural unit of power ratio."""

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Law:
    """The law of the power of clutter about its mean.

    family: rayleigh (of the amplitude); weibull, whose `shape` is that of the amplitude, 2 being Rayleigh; or k, whose
    `shape` is the order nu of the gamma-distributed texture (no two cells and no two scans share it).
    """

    family: Literal["rayleigh", "weibull", "k"] = "rayleigh"
    shape: float = 2.0

    def __post_init__(self) -> None:
        if self.family not in ("rayleigh", "weibull", "k"):
            raise ValueError(f"no family is called {self.family!r}")
        if not self.shape > 0:
            raise ValueError("shape must be greater than 0")

    def survival(self, decibels: NDArray[Any]) -> Floats:
        """Probability that the power is more than this many decibels above its mean."""
        power = 10.0 ** (np.clip(decibels, -200.0, 200.0) / 10)
        if self.family == "rayleigh":
            return np.asarray(np.exp(-power))
        if self.family == "weibull":
            return np.asarray(np.exp(-((power * gamma(1 + 2 / self.shape)) ** (self.shape / 2))))
        root = np.sqrt(self.shape * power)
        with np.errstate(over="ignore", invalid="ignore"):
            log = np.log(2.0) - gammaln(self.shape) + self.shape * np.log(root) + np.log(kve(self.shape, 2 * root))
        # for small arguments the Bessel function overflows, where nothing is lost by saying 1
        return np.asarray(np.minimum(np.exp(np.nan_to_num(log - 2 * root, nan=-np.inf, posinf=0.0)), 1.0))

    def decibels(self, survival: NDArray[Any]) -> Floats:
        """The inverse of `survival`, by interpolation: good to 0.001 dB between 1 - 1e-6 and 1e-12."""
        grid, log_log = self._inverse
        return np.asarray(np.interp(np.log(-np.log(survival)), log_log, grid))

    @cached_property
    def log_mean_db(self) -> float:
        """Mean of the log power, in decibels over the mean power: -2.51 for Rayleigh."""
        return float(self.decibels((np.arange(200_000) + 0.5) / 200_000).mean())

    @cached_property
    def _inverse(self) -> tuple[Floats, Floats]:
        grid = np.arange(-70.0, 40.0, 0.01)
        survival = self.survival(grid)
        good = (survival < 1 - 1e-9) & (survival > 1e-300)
        return grid[good], np.log(-np.log(survival[good]))

    @cached_property
    def quantiles(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Decibels about the mean at 65,536 equally probable places, and at as many of the last of them, ascending."""
        survival = 1 - (np.arange(65536) + 0.5) / 65536
        return self.decibels(survival).astype(np.float32), self.decibels(survival / 65536).astype(np.float32)


def swerling3_survival(limit_db: NDArray[Any], clutter_db: NDArray[Any], target_db: NDArray[Any]) -> Floats:
    """Probability that a Swerling 3 target and the Rayleigh clutter in its cell, added in phase and amplitude, exceed
    limit_db; clutter_db, target_db: their mean powers on the same scale.

    The Laplace transform of the power, over the clutter's mean, is (1 + s) / (1 + a s)^2 with a = 1 + SNR / 2.
    """
    limit = 10.0 ** (np.clip(np.subtract(limit_db, clutter_db), -200.0, 200.0) / 10)
    wide = 1.0 + 10.0 ** (np.subtract(target_db, clutter_db) / 10) / 2
    scaled = limit / wide
    return np.asarray(np.exp(-scaled) * (1.0 + (1.0 - 1.0 / wide) * scaled))


def swerling3_draw(chance: np.random.Generator, clutter_db: NDArray[Any], target_db: NDArray[Any]) -> Floats:
    """Decibels of such cells, drawn."""
    shape = np.broadcast_shapes(np.shape(clutter_db), np.shape(target_db))
    echo = np.sqrt(chance.standard_gamma(2.0, shape) / 2 * 10.0 ** (np.asarray(target_db) / 10))
    half = np.sqrt(10.0 ** (np.asarray(clutter_db) / 10) / 2)
    real, imaginary = chance.standard_normal((2, *shape))
    return np.asarray(10 * np.log10(np.square(echo + half * real) + np.square(half * imaginary)))
