"""The attributes of a plot from the runs of its cells."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.kernels.runs import END, FIRST, GRID, LAST, NEXT, PEAK, ROW, START, SUM
from pipeline.sites import RadarSite
from pipeline.tables import Plots

COLUMNS = 22
"""Width of a plot's row in the output of the kernels; `plots_from` names the columns."""

SCATTERERS = 16.0
"""The cells of one target fluctuate together with its few strong scatterers: no more parts than these are
independent."""

GLINT = 0.3
"""m^2: how far the centre of the echo strays from that of a small target, on each axis."""

BEARING_FLOOR = 0.06
"""rad: what the long axis of a real target's cells strays from its heading even with very many cells."""

BEARING_LIMIT = 0.35
"""rad: an axis less certain than this is not given."""

BEARING_CELLS = 8.0
"""Independent cells below which there is no axis."""


@dataclass(frozen=True, eq=False)
class Geometry:
    """What turns cells into metres. sums: (2, ranges + 1) of ground range and its square over the cells before each."""

    constants: tuple[float, float, float, float, float, float, float]
    sums: NDArray[np.float64]

    @classmethod
    def of(cls, site: RadarSite) -> Geometry:
        """For the radar's grid; slant range becomes ground range with the antenna's height."""
        video = site.video
        slant = video.first_range_m + video.range_step_m * np.arange(video.ranges)
        ground = np.sqrt(np.maximum(slant**2 - site.height**2, 0.0))
        sums = np.zeros((2, video.ranges + 1))
        np.cumsum(ground, out=sums[0, 1:])
        np.cumsum(ground**2, out=sums[1, 1:])
        constants = (
            float(site.east),
            float(site.north),
            float(site.height),
            float(video.range_step_m),
            float(video.azimuth_step_rad),
            float(max(video.beamwidth_rad, video.azimuth_step_rad)),
            float(video.azimuths),
        )
        return cls(constants, sums)


def plots_from(radar: int, rows: NDArray[np.float64]) -> Plots:
    """The table made of the kernel's output rows."""
    return Plots.build(
        len(rows),
        time=rows[:, 0],
        radar=radar,
        scan=rows[:, 1],
        east=rows[:, 2],
        north=rows[:, 3],
        covariance=rows[:, [4, 5, 5, 6]].reshape(-1, 2, 2),
        range=rows[:, 7],
        azimuth=rows[:, 8],
        range_extent=rows[:, 9],
        azimuth_extent=rows[:, 10],
        length=rows[:, 11],
        width=rows[:, 12],
        cells=rows[:, 13],
        mean_amplitude=rows[:, 14],
        peak_amplitude=rows[:, 15],
        bearing=rows[:, 16],
        bearing_sd=rows[:, 17],
        window=rows[:, 18:22],
    )


@njit(nogil=True, cache=True)
def measure_plot(root: int, runs: Any, turn: Any, constants: Any, sums: Any, out: Any) -> None:
    """Fill one output row from a component.

    root: its first run; the others follow in the NEXT column. turn: (3, azimuths) sine, cosine and time of each row's
    sweep. Position: unweighted centroid of the cells on the ground. Covariance: the cells' own spread divided by the
    number of independent parts, one resolution cell divided by the number of resolution cells, the quantisation of the
    grid and GLINT. Axis: second moments of the cells (binary), resolution taken out; length and width: extent of the
    cells along and across that axis, resolution taken out.
    """
    east, north, height, step, azimuth_step, beam, azimuths = constants
    sine, cosine, times = turn[0], turn[1], turn[2]
    total, amplitude, peak = 0, 0, 0
    first_cell, last_cell = runs[root, START], runs[root, END]
    t0 = times[runs[root, GRID]]
    st = sx = sy = sxx = sxy = syy = sr = 0.0
    run = root
    while run >= 0:
        a, b = runs[run, START], runs[run, END]
        row = runs[run, GRID]
        n = b - a
        total += n
        amplitude += runs[run, SUM]
        peak = max(peak, runs[run, PEAK])
        first_cell = min(first_cell, a)
        last_cell = max(last_cell, b)
        g1, g2 = sums[0, b] - sums[0, a], sums[1, b] - sums[1, a]
        s, c = sine[row], cosine[row]
        st += n * (times[row] - t0)
        sr += n * (runs[run, ROW] - runs[root, FIRST])
        sx += s * g1
        sy += c * g1
        sxx += s * s * g2
        sxy += s * c * g2
        syy += c * c * g2
        run = runs[run, NEXT]
    mx, my = sx / total, sy / total
    ground = np.sqrt(mx * mx + my * my)
    first_row = runs[root, GRID]
    ux, uy = (mx / ground, my / ground) if ground > 0 else (sine[first_row], cosine[first_row])
    cross = max(ground, step) * azimuth_step
    resolution = max(ground, step) * beam
    cxx, cxy, cyy = sxx / total - mx * mx, sxy / total - mx * my, syy / total - my * my
    # a resolution cell and a grid cell as boxes along (u) and across (v) the line of sight
    box_u, box_v = step * step / 12, resolution * resolution / 12
    independent = max(1.0, total * cross / resolution)
    grid_v = cross * cross / 12
    var_u, var_v = box_u / independent + box_u / 12 + GLINT, box_v / independent + grid_v / 12 + GLINT
    parts = min(independent, SCATTERERS)
    out[4] = cxx / parts + var_u * ux * ux + var_v * uy * uy
    out[5] = cxy / parts + (var_u - var_v) * ux * uy
    out[6] = cyy / parts + var_u * uy * uy + var_v * ux * ux
    # the beam widens the cells' cloud across the line of sight
    excess = box_v - grid_v
    dxx, dxy, dyy = cxx - excess * uy * uy, cxy + excess * ux * uy, cyy - excess * ux * ux
    axis = 0.5 * np.arctan2(2 * dxy, dyy - dxx)
    half = np.sqrt((dyy - dxx) ** 2 + 4 * dxy * dxy) / 2
    middle = (dxx + dyy) / 2
    major, minor = middle + half, max(middle - half, box_u)
    ax, ay = np.sin(axis), np.cos(axis)
    low_a, high_a, low_b, high_b = np.inf, -np.inf, np.inf, -np.inf
    run = root
    while run >= 0:
        row = runs[run, GRID]
        for edge in range(2):
            j = runs[run, START] if edge == 0 else runs[run, END] - 1
            g = sums[0, j + 1] - sums[0, j]
            x, y = sine[row] * g - mx, cosine[row] * g - my
            along, across = x * ax + y * ay, x * ay - y * ax
            low_a = along if along < low_a else low_a
            high_a = along if along > high_a else high_a
            low_b = across if across < low_b else low_b
            high_b = across if across > high_b else high_b
        run = runs[run, NEXT]
    radial, tangential = abs(ax * ux + ay * uy), abs(ax * uy - ay * ux)
    # extent of the cells = extent of the target + resolution - grid, in the direction concerned
    length = max(0.0, high_a - low_a - tangential * (resolution - cross))
    width = max(0.0, high_b - low_b - radial * (resolution - cross))
    bearing, deviation = np.nan, np.nan
    if independent >= BEARING_CELLS and major > minor:
        spread = major * minor / (independent * (major - minor) ** 2)
        deviation = np.sqrt(spread + BEARING_FLOOR**2)
        bearing = axis % np.pi
        if deviation > BEARING_LIMIT:
            bearing, deviation = np.nan, np.nan
    azimuth = np.arctan2(ux, uy) % (2 * np.pi)
    centre_row = runs[root, FIRST] + sr / total + 0.5
    out[0] = t0 + st / total
    out[1] = np.rint((centre_row - azimuth / azimuth_step) / azimuths)
    out[2] = east + mx
    out[3] = north + my
    out[7] = np.sqrt(ground * ground + height * height)
    out[8] = azimuth
    out[9] = (last_cell - first_cell) * step
    out[10] = (runs[root, LAST] - runs[root, FIRST] + 1) * azimuth_step
    out[11] = max(length, width) if np.isnan(bearing) else length
    out[12] = min(length, width) if np.isnan(bearing) else width
    out[13] = total
    out[14] = amplitude / total
    out[15] = peak
    out[16] = bearing
    out[17] = deviation
    out[18] = runs[root, FIRST] % np.int64(azimuths)
    out[19] = runs[root, LAST] - runs[root, FIRST] + 1
    out[20] = first_cell
    out[21] = last_cell - first_cell
