"""Intervals for what trials measured."""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, t


def wilson(hits: float, tries: float, level: float = 0.95) -> tuple[float, float]:
    """The interval of a probability from `hits` of `tries`: E. B. Wilson, J. Am. Stat. Assoc. 22 (1927).

    Raises ValueError without a try or for hits outside 0 .. tries.
    """
    if tries <= 0 or not 0 <= hits <= tries:
        raise ValueError(f"{hits} hits of {tries} tries")
    z = float(norm.ppf(0.5 + level / 2))
    share = hits / tries
    middle = share + z * z / (2 * tries)
    half = z * sqrt(share * (1 - share) / tries + z * z / (4 * tries * tries))
    whole = 1 + z * z / tries
    low, high = (middle - half) / whole, (middle + half) / whole
    return low if hits > 0 else 0.0, high if hits < tries else 1.0  # exact, where rounding would leave a trace


def mean_interval(values: NDArray[Any], level: float = 0.95) -> tuple[float, float]:
    """The interval of a mean of independent values, by Student's t; of a single value, the value itself.

    Raises ValueError without a value.
    """
    if not len(values):
        raise ValueError("no values")
    middle = float(np.mean(values))
    if len(values) == 1:
        return middle, middle
    half = float(t.ppf(0.5 + level / 2, len(values) - 1) * np.std(values, ddof=1) / sqrt(len(values)))
    return middle - half, middle + half


def rms_interval(errors: NDArray[Any], level: float = 0.95, draws: int = 1000, seed: int = 0) -> tuple[float, float]:
    """The interval of the root mean square of independent errors, by the bootstrap (percentiles of `draws`).

    The same errors always give the same interval. Raises ValueError without an error.
    """
    squares = np.square(np.asarray(errors, np.float64))
    if not len(squares):
        raise ValueError("no errors")
    chance = np.random.default_rng(seed)
    means = [float(squares[chance.integers(0, len(squares), len(squares))].mean()) for _ in range(draws)]
    low, high = np.sqrt(np.quantile(means, (0.5 - level / 2, 0.5 + level / 2)))
    return float(low), float(high)
