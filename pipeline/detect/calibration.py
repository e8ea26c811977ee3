"""Threshold offsets in the logarithmic domain for a stated false alarm probability in Rayleigh clutter."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from math import log
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq, newton
from scipy.special import betaln, gammaln, loggamma

DB = 10 / log(10)
"""Decibels of a natural unit of power ratio."""

LOG_RAYLEIGH_SD_DB = DB * np.pi / np.sqrt(6)
"""Standard deviation of the log amplitude of Rayleigh clutter: 5.57 dB, whatever its power."""

LOG_MEAN_DB = -DB * float(np.euler_gamma)
"""Mean log power of Rayleigh clutter relative to the log of its mean power: -2.51 dB."""


def false_alarm_probability(offset_db: float, db_per_step: float) -> float:
    """Pfa of a cell that must exceed round(log mean + offset), both in steps of the quantised log amplitude.

    The video is rounded to whole steps and so is the threshold, so the edge that the unrounded amplitude has to pass
    lies between 0 and 1 step above mean + offset, anywhere alike when the mean drifts: the average over that is given.
    """
    fractions = (np.arange(64) + 0.5) / 64
    power = 10 ** ((offset_db + fractions * db_per_step + LOG_MEAN_DB) / 10)
    return float(np.exp(-power).mean())


def threshold_offset_db(pfa: float, db_per_step: float) -> float:
    """Decibels to add to a well-known log mean: 13.76 dB for 1e-6 at 0.3125 dB a step.

    Galati et al. section 3 (the additive threshold in the log domain). Raises ValueError for a pfa outside (0, 0.5).
    """
    if not 0 < pfa < 0.5:
        raise ValueError("pfa must lie between 0 and 0.5")
    return float(
        brentq(lambda mu: log(max(false_alarm_probability(mu, db_per_step), 1e-300)) - log(pfa), -60.0, 40.0, xtol=1e-9)
    )


def estimation_loss_db(pfa: float, db_per_step: float) -> float:
    """Further decibels, times 1/n, when the log mean is itself estimated from n independent cells.

    To second order of the error, for many cells: an error of variance v in the level adds v / 2 times the second
    derivative to Pfa. `log_mean_offset_db` is exact, for few cells too.
    """
    mu = threshold_offset_db(pfa, db_per_step)
    less, middle, more = (false_alarm_probability(mu + shift, db_per_step) for shift in (0.02, 0.0, -0.02))
    curvature, slope = (less - 2 * middle + more) / 0.02**2, (more - less) / 0.04
    return float(curvature / slope * LOG_RAYLEIGH_SD_DB**2 / 2)


@lru_cache(maxsize=16)
def residual_moments_db(most_db: float, least_db: float) -> tuple[float, float, float]:
    """Of log Rayleigh clutter about its mean, as far as it is no more than most_db: the mean, the mean
    magnitude and the standard deviation when what lies below least_db is raised to it."""
    power = -np.log1p(-(np.arange(200_000) + 0.5) / 200_000)
    decibels = 10 * np.log10(power) - LOG_MEAN_DB
    left = decibels[decibels <= most_db]
    raised = np.maximum(left, least_db)
    return float(raised.mean()), float(np.abs(raised).mean()), float(raised.std())


def log_mean_offset_db(
    pfa: float, db_per_step: float, weights: NDArray[np.float64], many: NDArray[np.float64]
) -> float:
    """Decibels to add to a weighted mean of log amplitudes of Rayleigh clutter that is itself such clutter.

    weights: (n) weights of the mean, many: (n) how many independent amplitudes have each; sum(weights * many) is 1.
    With E and E_i exponential, Pfa is the mean of exp(-a * prod(E_i ** w_i)), a the offset as a ratio. Its Mellin
    transform in a is Gamma(s) * prod(Gamma(1 - s w_i)), times that of the rounding of the amplitudes and of the limit
    to whole steps; it is turned back by a sum along the line through the saddle point, without any approximation but
    that the rounding is met at all its fractions alike. Raises ValueError for a pfa outside (0, 1).
    """
    if not 0 < pfa < 1:
        raise ValueError("pfa must lie between 0 and 1")
    step = db_per_step / DB
    end = 1 / float(weights.max())

    def exponent(s: NDArray[Any]) -> NDArray[Any]:
        scaled = s[:, None] * weights
        half = scaled * step / 2
        clutter = (loggamma(1 - scaled) + np.log(np.sinh(half) / half)) @ many
        return np.asarray(loggamma(s) + clutter + np.log(-np.expm1(-s * step) / (s * step)))

    def real(c: float) -> float:
        return float(exponent(np.array([c + 0j]))[0].real)

    def slope(c: float) -> float:
        near = 1e-4 * min(c, end - c)
        return (real(c + near) - real(c - near)) / (2 * near)

    c = float(brentq(lambda one: real(one) - one * slope(one) - log(pfa), 1e-6 * end, (1 - 1e-6) * end, xtol=1e-6))
    spacing = min(c, end - c, 4.0) / 4
    line = c + 1j * spacing * np.arange(int(80 / spacing))
    height = exponent(line)
    level = height[0].real
    terms = np.exp(height - level) * np.where(line.imag == 0, 0.5, 1.0) * spacing / np.pi

    def excess(ratio: float) -> float:
        total = float((terms * np.exp((c - line) * ratio)).sum().real)
        return log(max(total, 1e-30)) + float(level) - c * ratio - log(pfa)

    return float(newton(excess, slope(c), tol=1e-9)) * DB


@lru_cache(maxsize=64)
def mean_offsets_db(pfa: float, db_per_step: float, most: int) -> NDArray[np.float64]:
    """(most + 1) `log_mean_offset_db` of the plain mean of as many amplitudes; of none, infinite."""
    return _by_count(lambda n: log_mean_offset_db(pfa, db_per_step, np.array([1 / n]), np.array([n])), most)


@lru_cache(maxsize=64)
def power_mean_offsets_db(pfa: float, db_per_step: float, most: int) -> NDArray[np.float64]:
    """(most + 1) decibels to add to the mean power of as many cells of Rayleigh clutter; of none, infinite.

    Pfa = (1 + a / n) ** -n for offset a as a ratio (Rohling 1983), here with the rounding of the amplitudes and of the
    limit.
    """
    rounding = 10 ** ((np.arange(32) + 0.5) / 32 * db_per_step / 10)
    centred = rounding / 10 ** (db_per_step / 20)

    def excess(log_ratio: float, n: float) -> float:
        one = (1 / (1 + np.exp(log_ratio) / n * rounding[:, None] * centred)).mean(axis=1)
        return log(max(float((one**n).mean()), 1e-300)) - log(pfa)

    return _by_count(lambda n: DB * float(brentq(excess, -12.0, 60.0, args=(n,), xtol=1e-9)), most)


@lru_cache(maxsize=4096)
def order_offset_steps(pfa: float, db_per_step: float, cells: float, rank: float) -> float:
    """Steps to add to the rank-th smallest of so many log amplitudes of Rayleigh clutter.

    Pfa = prod((n - i) / (n - i + T), i < k) for offset T as a ratio (Rohling 1983, equation 35), by gamma functions, so
    that n and k need not be whole. Level and limit are both whole, so whole offsets alone would miss the probability;
    the part after the point says what share of the cells is to have one step more.
    """
    edges = (np.arange(64) + 0.5) / 64

    def chance(steps: int) -> float:
        ratio = 10 ** ((steps + edges) * db_per_step / 10)
        constant = gammaln(cells + 1) - gammaln(cells - rank + 1) - gammaln(rank)
        return float(np.exp(constant + betaln(cells - rank + 1 + ratio, rank)).mean())

    low, high = -1024, 1024
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if chance(middle) >= pfa else (low, middle)
    more, less = chance(low), chance(high)
    return low + (more - pfa) / (more - less) if more > less else float(low)


@lru_cache(maxsize=64)
def recursive_mean_offsets_db(pfa: float, db_per_step: float, memory: int) -> NDArray[np.float64]:
    """(6 * memory + 1) `log_mean_offset_db` by scans heard, of a mean with gain 1/scans, at least 1/memory.

    From 6 * memory scans on it changes no more.
    """
    every = np.full(6 * memory + 1, np.inf)
    every[: memory + 1] = mean_offsets_db(pfa, db_per_step, memory)
    late = memory + np.unique(
        np.rint(memory * np.array([0.0, 0.2, 0.4, 0.7, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0])).astype(int)
    )
    solved = [log_mean_offset_db(pfa, db_per_step, *_recursive_weights(int(n), memory)) for n in late]
    every[memory:] = np.interp(np.arange(memory, 6 * memory + 1), late, solved)
    every.flags.writeable = False
    return every


def _recursive_weights(heard: int, memory: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Weights of a recursive mean and how many scans have each; old scans in groups of nearly equal weight."""
    later = heard - memory
    edges = np.unique(np.linspace(0, later, min(later, 128) + 1).astype(int))
    kept = (1 - 1 / memory) ** edges
    many = np.append(np.diff(edges).astype(float), memory)
    weights = np.append(-np.diff(kept), kept[-1]) / many
    return weights[weights > 0], many[weights > 0]


def censored_bias_db(limit_db: float, freeze_db: float) -> float:
    """How far the recursive log mean of Rayleigh clutter settles too low when no more than limit_db above it is taken
    into it, and nothing that is freeze_db above the true mean."""
    power = -np.log1p(-(np.arange(200_000) + 0.5) / 200_000)
    decibels = DB * np.log(power) - LOG_MEAN_DB
    decibels = decibels[decibels <= freeze_db] - decibels.mean()
    return float(brentq(lambda low: float(np.minimum(decibels + low, limit_db).mean()), -1e-9, 60.0, xtol=1e-9))


def _by_count(solve: Callable[[float], float], most: int) -> NDArray[np.float64]:
    """(most + 1) a smooth function of a count: solved where it bends, in between by a spline in 1 / count."""
    counts = np.unique([*range(1, min(most, 8) + 1), *np.rint(np.geomspace(min(most, 8), most, 24)).astype(int)])
    solved = np.array([solve(float(n)) for n in counts])
    every = np.full(most + 1, np.inf)
    if len(counts) < 4:
        every[counts] = solved
    else:
        every[1:] = CubicSpline(1 / counts[::-1], solved[::-1])(1 / np.arange(1, most + 1))
    every.flags.writeable = False
    return every
