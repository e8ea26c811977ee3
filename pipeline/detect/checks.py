"""Checks of settings that detectors have in common."""

from __future__ import annotations

from math import isfinite

import numpy as np
from numpy.typing import NDArray

from pipeline.tables import Sweeps, TableError, VideoFormat

LEAST_PFA = 1e-15
"""A year of a radar has fewer cells than false alarms of this probability need."""


def check_pfa(pfa: float) -> None:
    """Raises ValueError for a false alarm probability below LEAST_PFA or not below 0.5."""
    if not LEAST_PFA <= pfa < 0.5:
        raise ValueError(f"pfa must lie between 0 ({LEAST_PFA:g} at least) and 0.5")


def check_positive(**settings: float) -> None:
    """Raises ValueError, with its name, for a setting that is not a finite number above 0."""
    for name, value in settings.items():
        if not (value > 0 and isfinite(value)):
            raise ValueError(f"{name} must be greater than 0")


MOST_WHOLE = 2**53
"""The greatest whole number that a floating point number holds."""


def check_whole(least: int = 1, most: int = MOST_WHOLE, **settings: int) -> None:
    """Raises ValueError, with its name, for a setting that is no whole number, less than `least` or above `most`."""
    for name, value in settings.items():
        if not (least <= value <= most and value == int(value)):
            bounds = f"{least} or more" if most == MOST_WHOLE else f"{least} to {most}"
            raise ValueError(f"{name} must be a whole number, {bounds}")


def check_start(video: VideoFormat, surface: NDArray[np.uint8] | None, growth_db: float | None) -> None:
    """Raises ValueError for a surface of another shape than the video, or a growth_db that is negative or no number."""
    if surface is not None and surface.shape != (video.azimuths, video.ranges):
        raise ValueError(f"surface must be ({video.azimuths}, {video.ranges}), not {surface.shape}")
    if growth_db is not None and not (growth_db >= 0 and isfinite(growth_db)):
        raise ValueError("growth_db must be 0 or more")


def check_block(sweeps: Sweeps, azimuths: int, ranges: int) -> None:
    """Raises TableError for a block that is not on the grid: kernels read and write at addresses made of it."""
    if sweeps.amplitude.shape[1] != ranges:
        raise TableError(f"{ranges} range cells wanted, not {sweeps.amplitude.shape[1]}")
    if len(sweeps) and not 0 <= sweeps.row[0] <= sweeps.row[-1] < azimuths:
        raise TableError(f"rows outside 0 .. {azimuths - 1}")
