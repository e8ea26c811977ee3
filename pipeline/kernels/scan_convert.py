"""Scan conversion: the polar video about a place as a square image on the ground.

Each pixel is the mean log amplitude of the polar area that it covers: a box as wide as the pixel, but never narrower
than one cell, in range and in azimuth. Far away that is bilinear interpolation between the cells, near the radar the
mean of the many sweeps that cross the pixel.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.kernels.compiled import allocating
from pipeline.sites import RadarSite
from pipeline.state import read_only
from pipeline.tables import Plots

Grid = tuple[float, float, float, float, float]
"""Azimuth of the first row's centre and the step of rows (rad), slant range of the first cell's centre and the step of
cells (m), height of the antenna (m)."""


def grid_of(site: RadarSite, azimuth: float | None = None, range_m: float | None = None) -> Grid:
    """The polar grid of a radar's turn, or of a part of it that begins at `azimuth` and `range_m`."""
    video = site.video
    first = 0.5 * video.azimuth_step_rad if azimuth is None else azimuth
    near = video.first_range_m if range_m is None else range_m
    return (float(first), video.azimuth_step_rad, float(near), float(video.range_step_m), float(site.height))


def scan_converted(
    amplitude: NDArray[np.uint8],
    grid: Grid,
    place: tuple[float, float],
    *,
    step: float,
    size: int,
    up: float = 0.0,
    outside: float = 0.0,
) -> NDArray[np.float32]:
    """(size, size) mean log amplitude about a place; the first row is the farthest in the direction `up`.

    amplitude: (rows, cells) uint8; rows that make a whole turn of the grid close upon themselves. place: east and north
    of the image's centre from the radar in metres on the ground. step: m, side of a pixel. up: rad from true north; 0
    is north up, east to the right. outside: value of pixels that the video does not reach.
    Raises ValueError for an image without pixels or a step that is not above 0.
    """
    if size < 1 or not step > 0:
        raise ValueError(f"an image of {size} pixels a side, {step} m each, cannot be made")
    out = np.empty((size, size), np.float32)
    if amplitude.size == 0:
        out[:] = outside
        return out
    convert(read_only(amplitude), grid, (float(place[0]), float(place[1]), float(step), float(up), float(outside)), out)
    return out


def plot_images(
    plots: Plots, newest: NDArray[np.uint8], site: RadarSite, *, step: float, size: int
) -> NDArray[np.uint8]:
    """(n, size, size) the ground about each plot's centroid, north up, on the turn of video in which the plots are."""
    out = np.zeros((len(plots), size, size), np.uint8)
    for k in range(len(plots)):
        place = (float(plots.east[k]) - site.east, float(plots.north[k]) - site.north)
        out[k] = np.rint(scan_converted(newest, grid_of(site), place, step=step, size=size))
    return out


@allocating
def convert(amplitude: Any, grid: Any, image: Any, out: Any) -> None:
    """As scan_converted. image: east, north of the centre, step, up, outside. out: (n, m) float32."""
    first_azimuth, azimuth_step, first_range, range_step, height = grid
    east, north, step, up, outside = image
    rows, cells = amplitude.shape
    turn = 2.0 * np.pi / azimuth_step
    closed = abs(rows - turn) < 0.5
    sine, cosine = np.sin(up), np.cos(up)
    middle = 0.5 * rows
    for i in range(out.shape[0]):
        ahead = (0.5 * (out.shape[0] - 1) - i) * step
        line = out[i]
        for j in range(out.shape[1]):
            right = (j - 0.5 * (out.shape[1] - 1)) * step
            x = east + ahead * sine + right * cosine
            y = north + ahead * cosine - right * sine
            ground = np.sqrt(x * x + y * y)
            slant = np.sqrt(ground * ground + height * height)
            # edges of the covered box in cells and rows; cell k reaches from k to k + 1
            deep = max(step * ground / (slant * range_step) if slant > 0.0 else 1.0, 1.0)
            wide = min(max(step / (max(ground, step) * azimuth_step), 1.0), 0.25 * turn)
            cell = (slant - first_range) / range_step + 0.5
            row = (np.arctan2(x, y) - first_azimuth) / azimuth_step + 0.5
            row -= turn * np.floor((row - middle) / turn + 0.5)
            low_cell, high_cell = cell - 0.5 * deep, cell + 0.5 * deep
            low_row, high_row = row - 0.5 * wide, row + 0.5 * wide
            total = weight = 0.0
            r = int(np.floor(low_row))
            while r < high_row:
                share = min(r + 1.0, high_row) - max(float(r), low_row)
                at = r
                if closed:
                    at = r % rows
                if share > 0.0 and at >= 0 and at < rows:
                    sweep = amplitude[at]
                    begin, end = max(int(np.floor(low_cell)), 0), min(int(np.ceil(high_cell)), cells)
                    for c in range(begin, end):
                        part = share * (min(c + 1.0, high_cell) - max(float(c), low_cell))
                        total += part * sweep[c]
                        weight += part
                r += 1
            line[j] = total / weight if weight > 1e-9 else outside
