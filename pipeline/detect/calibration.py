"""Threshold offsets in the logarithmic domain for a stated false alarm probability in Rayleigh clutter."""

from __future__ import annotations

from functools import lru_cache
from math import log

import numpy as np
from scipy.optimize import brentq

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

    First order: an error of variance v in the level multiplies Pfa by exp(s^2 v / 2), s being the slope of ln Pfa.
    """
    mu = threshold_offset_db(pfa, db_per_step)
    slope: float = 10 * (
        log(false_alarm_probability(mu - 0.05, db_per_step)) - log(false_alarm_probability(mu + 0.05, db_per_step))
    )
    return float(slope * LOG_RAYLEIGH_SD_DB**2 / 2)


@lru_cache(maxsize=16)
def truncated_rayleigh_db(limit_db: float) -> tuple[float, float]:
    """How much the mean of log Rayleigh clutter loses when nothing is more than limit_db above it, and what spread is
    left."""
    power = -np.log1p(-(np.arange(200_000) + 0.5) / 200_000)
    decibels = 10 * np.log10(power) - LOG_MEAN_DB
    left = decibels[decibels <= limit_db]
    return float(-left.mean()), float(left.std())
