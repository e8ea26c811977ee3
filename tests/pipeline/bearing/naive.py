"""Slow and obvious twins of the kernels."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.contracts.bearing import TargetView
from pipeline.sites import RadarSite


def cells_of(view: TargetView, site: RadarSite, contrast_db: float) -> tuple[Any, Any, Any]:
    """East, north and steps over the ground of the plot's cells."""
    amplitude = view.amplitude.astype(float)
    top, rows, near, deep = view.plot
    outside = np.ones(amplitude.shape, bool)
    outside[top : top + rows, near : near + deep] = False
    outside[(amplitude == 0).all(axis=1)] = False
    middle, upper = np.quantile(amplitude[outside], [0.5, 0.75])
    step = site.video.db_per_step
    ground = min(max(upper - 3.01 / step, middle), middle + 12 / step)
    i, j = np.nonzero(~outside & (amplitude > ground + contrast_db / step))
    azimuth = view.azimuth + i * site.video.azimuth_step_rad
    slant = view.range_m + j * site.video.range_step_m
    flat = np.sqrt(slant**2 - site.height**2)
    return flat * np.sin(azimuth), flat * np.cos(azimuth), amplitude[i, j] - ground


def hough(weights: Any, angles: int, width: float) -> Any:
    """As the kernel, pixel by pixel and angle by angle."""
    reach = int(np.ceil(np.hypot(*weights.shape) / width)) + 1
    out = np.zeros((angles, 2 * reach + 1))
    for i, j in zip(*np.nonzero(weights), strict=True):
        for k in range(angles):
            normal = j * np.cos(np.pi * k / angles) + i * np.sin(np.pi * k / angles)
            out[k, round(normal / width) + reach] += weights[i, j]
    return out


def pixel(amplitude: Any, grid: Any, east: float, north: float, step: float) -> float:
    """Mean amplitude over the polar box of a pixel, by many points."""
    first_azimuth, azimuth_step, first_range, range_step, height = grid
    ground = np.hypot(east, north)
    slant = np.hypot(ground, height)
    deep = max(step * ground / slant, range_step)
    wide = max(step / max(ground, step), azimuth_step)
    # many points a row and a cell: with few, how often each is met would be chance
    across, along = ((np.arange(parts) + 0.5) / parts - 0.5 for parts in (8000, 300))
    rows = np.rint((np.arctan2(east, north) + across * wide - first_azimuth) / azimuth_step).astype(int)
    cells = np.rint((slant + along * deep - first_range) / range_step).astype(int)
    cells = cells[(cells >= 0) & (cells < amplitude.shape[1])]
    return float(amplitude[np.ix_(rows % len(amplitude), cells)].mean())
