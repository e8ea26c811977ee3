"""The echo of one target in a piece of polar video: its ground, its cells, where they lie and how they spread."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.kernels.compiled import allocating
from pipeline.kernels.scan_convert import Grid
from pipeline.state import read_only

RAYLEIGH_QUARTILE_DB = 3.01
"""Upper quartile of Rayleigh ground over its median; where it lies higher, a part of the ground is brighter."""

MOST_MIXED_DB = 12.0
"""What is brighter than this over the median is no ground: buildings, other targets."""


@dataclass(frozen=True, slots=True)
class Echo:
    """What was measured.

    background: median amplitude of the ground about the plot, of its brighter part when it is mixed. cells: those of
    the plot that stand out of it. resolution_cells: so many they fill. east, north: m from the radar, their middle.
    cxx, cxy, cyy: m^2, their covariance (xx: east), the beam's width taken out.
    """

    background: float
    cells: int
    resolution_cells: float
    east: float
    north: float
    cxx: float
    cxy: float
    cyy: float

    @property
    def range_m(self) -> float:
        """Distance on the ground, m."""
        return float(np.hypot(self.east, self.north))

    @property
    def azimuth(self) -> float:
        """Direction from the radar, rad from true north."""
        return float(np.arctan2(self.east, self.north))

    @property
    def axis(self) -> tuple[float, float, float]:
        """Direction of the long axis (rad modulo pi) and the variances along and across it, m^2."""
        half = float(np.hypot(0.5 * (self.cyy - self.cxx), self.cxy))
        middle = 0.5 * (self.cxx + self.cyy)
        direction = 0.5 * float(np.arctan2(2 * self.cxy, self.cyy - self.cxx))
        return direction % float(np.pi), middle + half, max(middle - half, 0.0)


def measured(
    amplitude: NDArray[np.uint8],
    plot: tuple[int, int, int, int],
    grid: Grid,
    beamwidth_rad: float,
    contrast_db: float,
    db_per_step: float,
    *,
    weighted: bool = False,
) -> Echo | None:
    """The echo in the plot's window (first row, rows, first cell, cells); None when nothing stands out, or
    no ground is shown about it to stand out of.

    contrast_db: over the median of the ground, from which on a cell belongs to the echo. weighted: by the steps above
    the ground. Rows without any amplitude were not received and tell nothing of the ground.
    """
    out = np.empty(8)
    rows, cells = amplitude.shape
    first, count, near, deep = plot
    first, near = max(first, 0), max(near, 0)
    window = (first, min(first + count, rows), near, min(near + deep, cells))
    if window[0] >= window[1] or window[2] >= window[3]:
        return None
    step_db = float(db_per_step)
    contrast = contrast_db / step_db
    if not _measure(read_only(amplitude), window, grid, float(beamwidth_rad), contrast, weighted, step_db, out):
        return None
    return Echo(float(out[0]), int(out[1]), *(float(one) for one in out[2:]))


@allocating
def _quantile(histogram: Any, wanted: float) -> Any:
    reached = 0
    for level in range(256):
        reached += histogram[level]
        if reached >= wanted:
            # inside the step, so that coarse video has no steps of its own
            return level + 0.5 - (reached - wanted) / histogram[level]
    return 255.0


@allocating
def _ground(amplitude: Any, window: Any, quartile: float, most: float) -> Any:
    top, bottom, near, far = window
    histogram = np.zeros(256, np.int64)
    total = seen = 0
    for i in range(amplitude.shape[0]):
        row = amplitude[i]
        received = False
        for j in range(row.size):
            received = received or row[j] > 0
        inside = top <= i < bottom
        seen += row.size - (far - near if inside else 0)
        if not received:
            continue
        for j in range(row.size):
            if not (inside and near <= j < far):
                histogram[row[j]] += 1
                total += 1
    if total:
        middle, upper = _quantile(histogram, 0.5 * total), _quantile(histogram, 0.75 * total)
        return min(max(upper - quartile, middle), middle + most)
    return 0.0 if seen else np.nan


@allocating
def _measure(
    amplitude: Any, window: Any, grid: Any, beam: float, contrast: float, weighted: bool, step_db: float, out: Any
) -> bool:
    first_azimuth, azimuth_step, first_range, range_step, height = grid
    background = _ground(amplitude, window, RAYLEIGH_QUARTILE_DB / step_db, MOST_MIXED_DB / step_db)
    if np.isnan(background):
        return False
    limit = background + contrast
    count = 0
    total = sx = sy = sxx = sxy = syy = 0.0
    # about the first corner, so that small differences of large squares do not matter
    slant = first_range + window[2] * range_step
    ground = np.sqrt(max(slant * slant - height * height, 0.0))
    azimuth = first_azimuth + window[0] * azimuth_step
    x0, y0 = ground * np.sin(azimuth), ground * np.cos(azimuth)
    for i in range(window[0], window[1]):
        azimuth = first_azimuth + i * azimuth_step
        sine, cosine = np.sin(azimuth), np.cos(azimuth)
        row = amplitude[i]
        for j in range(window[2], window[3]):
            if row[j] <= limit:
                continue
            slant = first_range + j * range_step
            ground = np.sqrt(max(slant * slant - height * height, 0.0))
            x, y = ground * sine - x0, ground * cosine - y0
            w = row[j] - background if weighted else 1.0
            count += 1
            total += w
            sx += w * x
            sy += w * y
            sxx += w * x * x
            sxy += w * x * y
            syy += w * y * y
    if count == 0:
        return False
    mx, my = sx / total, sy / total
    east, north = x0 + mx, y0 + my
    ground = max(np.sqrt(east * east + north * north), range_step)
    ux, uy = east / ground, north / ground
    wide = max(beam, azimuth_step) * ground
    cross = azimuth_step * ground
    excess = (wide * wide - cross * cross) / 12.0
    out[0] = background
    out[1] = count
    out[2] = count * cross / wide
    out[3] = east
    out[4] = north
    out[5] = sxx / total - mx * mx - excess * uy * uy
    out[6] = sxy / total - mx * my + excess * ux * uy
    out[7] = syy / total - my * my - excess * ux * ux
    return True
