"""The attributes of a plot from the runs of its cells."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.kernels.compiled import inlined
from pipeline.kernels.runs import FREE
from pipeline.sites import RadarSite
from pipeline.tables import Plots

PLACED = 0.012
"""Part of the cells' own spread by which the middle of a target strays from that of its echo, however strong: the echo
does not weigh nose and tail alike, nor the near side and the far one. Rather more than dense scatterers want (0.0075):
with a few strong ones (`pipeline.lab.simulate.scatter`) it strays farther."""

LOST = 0.7
"""Part of the cells' own spread that a target loses with the parts of it that are not detected."""

EDGE = 0.3
"""Part of a resolution cell that does not average out with the number of cells."""

GLINT = 0.02
"""m^2: the least variance on each axis."""

BEARING_FLOOR = 0.06
"""rad: what the long axis of a real target's cells strays from its heading even with very many cells."""

BEARING_LIMIT = 0.35
"""rad: an axis less certain than this is not given."""

BEARING_CELLS = 8.0
"""Independent cells below which there is no axis."""

SINE, COSINE, TIME, AZIMUTH, SCAN, GIVEN, BEFORE, TURN_FIELDS = 0, 1, 2, 3, 4, 5, 6, 8
"""What is known of a row of the grid that had runs: of its azimuth (0 .. 2 pi), s, rad, turn it belongs to, the azimuth
as it was given, and what is added to an absolute row to know the turn."""

WIDE = ("time", "east", "north", "range", "azimuth", "weighted_east", "weighted_north", "scan")
NARROW = (
    "range_extent", "azimuth_extent", "length", "width", "mean_amplitude", "peak_amplitude", "bearing", "bearing_sd",
    "cells",
)  # fmt: skip
"""Columns of 8 and of 4 octets, in the order of their rows in PlotColumns; the last of each are integers."""

TYPE = np.dtype("U4")


@dataclass(frozen=True, eq=False)
class Geometry:
    """What turns cells into metres. ground: (ranges) ground range of each cell. sums: (2, ranges + 1) of ground range
    and its square over the cells before each. loudness: (256) linear amplitude of each log amplitude.
    """

    constants: tuple[float, float, float, float, float, float, float, float]
    ground: NDArray[np.float64]
    sums: NDArray[np.float64]
    loudness: NDArray[np.float64]

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
            float(np.log(10) / 10 * video.db_per_step),
        )
        return cls(constants, ground, sums, 10.0 ** (np.arange(256) * video.db_per_step / 20))


@dataclass(frozen=True, eq=False)
class PlotColumns:
    """Room for the columns of a table of plots, written by the kernels, handed on without a copy."""

    wide: NDArray[np.float64]
    narrow: NDArray[np.float32]
    covariance: NDArray[np.float64]
    window: NDArray[np.int32]

    @classmethod
    def room_for(cls, plots: int) -> PlotColumns:
        """Columns that hold up to so many plots."""
        return cls(
            np.empty((len(WIDE), plots)),
            np.empty((len(NARROW), plots), np.float32),
            np.empty((plots, 2, 2)),
            np.empty((plots, 4), np.int32),
        )

    @property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """What the kernels take."""
        return (
            self.wide,
            self.wide.view(np.int64),
            self.narrow,
            self.narrow.view(np.int32),
            self.covariance,
            self.window,
        )

    def table(self, radar: int, plots: int) -> Plots:
        """The first so many rows as a table."""
        made = dict(zip(WIDE + NARROW, (*self.wide[:, :plots], *self.narrow[:, :plots]), strict=True))
        made["scan"] = made["scan"].view(np.int64)
        made["cells"] = made["cells"].view(np.int32)
        made["covariance"], made["window"] = self.covariance[:plots], self.window[:plots]
        made["radar"] = np.full(plots, radar, np.int16)
        made["nose_known"], made["type"] = np.zeros(plots, np.bool_), np.zeros(plots, TYPE)
        return Plots._of_good(made)


@inlined
def position_variance(
    total: int, excess: float, radial: float, ground: float, constants: Any
) -> tuple[float, float, float, float]:
    """How sure the centroid of `total` cells is at a ground range, from (share, along, across, independent).

    excess: steps by which the mean log amplitude exceeds the least. radial: the cells' spread along the line of sight,
    m^2. The covariance is share times the cells' own spread, plus the variances along and across the line of sight.
    share: PLACED, and what is lost with parts that were not detected: all the more, the less the cells exceed what is
    detected, and the fewer independent ones there are. The variances: of a resolution cell, divided by how many there
    are, and what polar cells, denser on the near side, pull the centroid towards the radar. The form is ours; its
    constants were fitted to targets of many kinds at 100 to 2,500 m and 16 to 30 dB (`pipeline.lab.simulate.closeup`).
    independent: resolution cells in the plot.
    """
    step, azimuth_step, beam = constants[3], constants[4], constants[5]
    distance = max(ground, step)
    if total == 1:  # as below, where most of it does not matter
        return 0.0, step * step / 12 + GLINT, (distance * beam) ** 2 / 12 + GLINT, 1.0
    independent = max(1.0, total * azimuth_step / beam)
    root = np.sqrt(independent)
    share = PLACED + LOST * np.exp(-excess * constants[7]) / np.sqrt(root)
    part = (EDGE / root + (1 - EDGE) / total) / 12
    pull = radial / distance
    return share, step * step * part + pull * pull + GLINT, (distance * beam) ** 2 * part + GLINT, independent


@inlined
def measure_run(one: Any, turn: Any, geometry: Any, out: Any, at: int) -> None:
    """Fill row `at` of the output from a plot of a single run, too small for an axis (see measure_plot)."""
    constants, ground, sums = geometry
    east, north, height, _, azimuth_step, _, _, _ = constants
    wide, wide_int, narrow, narrow_int, covariance, window = out
    start, end = np.int64(one.start), np.int64(one.end)
    total = end - start
    row = turn[one.row]
    s, c = row[SINE], row[COSINE]
    g, spread, mean, loud = ground[start], 0.0, np.float64(one.total), ground[start]
    if total > 1:
        part = 1.0 / total
        g = (sums[0, end] - sums[0, start]) * part
        spread = max((sums[1, end] - sums[1, start]) * part - g * g, 0.0)
        mean *= part
        loud = one.moment / one.weight
    share, along, across, _ = position_variance(total, mean - one.low, spread, g, constants)
    along += spread * share
    wide[0, at] = row[TIME]
    wide[1, at] = east + s * g
    wide[2, at] = north + c * g
    wide[3, at] = np.sqrt(g * g + height * height)
    wide[4, at] = row[AZIMUTH]
    wide[5, at] = east + s * loud
    wide[6, at] = north + c * loud
    wide_int[7, at] = np.int64(row[SCAN])
    covariance[at, 0, 0] = along * s * s + across * c * c
    covariance[at, 0, 1] = covariance[at, 1, 0] = (along - across) * s * c
    covariance[at, 1, 1] = along * c * c + across * s * s
    narrow[0, at] = total * constants[3]
    narrow[1, at] = azimuth_step
    narrow[2, at] = ground[end - 1] - ground[start]
    narrow[3, at] = 0.0
    narrow[4, at] = mean
    narrow[5, at] = one.peak
    narrow[6, at] = np.nan
    narrow[7, at] = np.nan
    narrow_int[8, at] = one.seeds
    window[at, 0] = one.row
    window[at, 1] = 1
    window[at, 2] = start
    window[at, 3] = total


@inlined
def measure_plot(root: int, newest: int, runs: Any, turn: Any, geometry: Any, out: Any, at: int) -> None:
    """Fill row `at` of the output from a component.

    root: its first run; the others follow by `next`. newest: absolute row of its last run. turn: (azimuths,
    TURN_FIELDS), what is known of each row. Position: centroid of the cells on the ground, unweighted; the weighted one
    has the linear amplitude (10 to the power of dB / 20) as weight. Covariance: see position_variance. Axis: second
    moments of the cells (binary), resolution taken out; length and width: extent of the cells along and across that
    axis, resolution taken out. All over the plot's cells; their number that is given is that of the detected ones.
    """
    constants, ground_of, sums = geometry
    east, north, height, step, azimuth_step, beam, azimuths, _ = constants
    wide, wide_int, narrow, narrow_int, covariance, window = out
    grid_rows = np.int64(azimuths)
    total, amplitude, peak, low = np.int64(0), np.int64(0), np.int64(0), np.int64(255)
    first_cell, last_cell = np.int64(runs[root].start), np.int64(runs[root].end)
    first_row = np.int64(runs[root].row)
    rows = (np.int64(runs[root].last) - first_row) % grid_rows + 1
    t0 = turn[first_row, TIME]
    st = sx = sy = sxx = sxy = syy = sr = loud_x = loud_y = weight = 0.0
    run = np.int64(root)
    while True:
        one = runs[run]
        a, b = np.int64(one.start), np.int64(one.end)
        row = np.int64(one.row)
        n = b - a
        total += n
        amplitude += np.int64(one.total)
        peak = max(peak, np.int64(one.peak))
        low = min(low, np.int64(one.low))
        first_cell = min(first_cell, a)
        last_cell = max(last_cell, b)
        g1, g2 = sums[0, b] - sums[0, a], sums[1, b] - sums[1, a]
        here = turn[row]
        s, c = here[SINE], here[COSINE]
        away = row - first_row
        away += grid_rows if away < 0 else 0
        st += n * (here[TIME] - t0)
        sr += n * away
        sx += s * g1
        sy += c * g1
        sxx += s * s * g2
        sxy += s * c * g2
        syy += c * c * g2
        loud_x += s * one.moment
        loud_y += c * one.moment
        weight += one.weight
        one.parent = FREE
        run = np.int64(one.next)
        if run == root:
            break
    part = 1.0 / total
    mx, my = sx * part, sy * part
    ground = np.sqrt(mx * mx + my * my)
    s, c = turn[first_row, SINE], turn[first_row, COSINE]
    ux, uy = (mx / ground, my / ground) if ground > 0 else (s, c)
    cxx, cxy, cyy = sxx * part - mx * mx, sxy * part - mx * my, syy * part - my * my
    radial = cxx * ux * ux + 2 * cxy * ux * uy + cyy * uy * uy
    share, along, across, independent = position_variance(total, amplitude * part - low, radial, ground, constants)
    # the beam widens the cells' cloud across the line of sight
    cross, resolution = max(ground, step) * azimuth_step, max(ground, step) * beam
    excess = (resolution * resolution - cross * cross) / 12
    dxx, dxy, dyy = cxx - excess * uy * uy, cxy + excess * ux * uy, cyy - excess * ux * ux
    half = np.sqrt((dyy - dxx) ** 2 + 4 * dxy * dxy) / 2
    # the axis' angle is half that of (dyy - dxx, 2 dxy)
    double = (dyy - dxx) / (2 * half) if half > 0 else 1.0
    ay = np.sqrt(max(0.5 + 0.5 * double, 0.0))
    ax = np.copysign(np.sqrt(max(0.5 - 0.5 * double, 0.0)), dxy)
    low_a, high_a, low_b, high_b = np.inf, -np.inf, np.inf, -np.inf
    while True:
        one = runs[run]
        here = turn[one.row]
        on_a, on_b = here[SINE] * ax + here[COSINE] * ay, here[SINE] * ay - here[COSINE] * ax
        for edge in range(2):
            j = np.int64(one.start) if edge == 0 else np.int64(one.end) - 1
            along_axis, across_axis = ground_of[j] * on_a, ground_of[j] * on_b
            low_a = min(low_a, along_axis)
            high_a = max(high_a, along_axis)
            low_b = min(low_b, across_axis)
            high_b = max(high_b, across_axis)
        run = np.int64(one.next)
        if run == root:
            break
    lengthwise, crosswise = abs(ax * ux + ay * uy), abs(ax * uy - ay * ux)
    # extent of the cells = extent of the target + resolution - grid, in the direction concerned
    length = max(0.0, high_a - low_a - crosswise * (resolution - cross))
    width = max(0.0, high_b - low_b - lengthwise * (resolution - cross))
    bearing, deviation = _axis(ax, ay, (dxx + dyy) / 2, half, step * step / 12, independent)
    if np.isnan(bearing):
        length, width = max(length, width), min(length, width)
    azimuth = turn[first_row, AZIMUTH] + _small_angle(ux * c - uy * s, ux * s + uy * c)
    azimuth += 2 * np.pi if azimuth < 0 else (-2 * np.pi if azimuth >= 2 * np.pi else 0.0)
    centre_row = newest - rows + 1 + sr * part + 0.5
    wide[0, at] = t0 + st * part
    wide[1, at] = east + mx
    wide[2, at] = north + my
    wide[3, at] = np.sqrt(ground * ground + height * height)
    wide[4, at] = azimuth
    wide[5, at] = east + loud_x / weight
    wide[6, at] = north + loud_y / weight
    wide_int[7, at] = np.int64(np.rint((centre_row - azimuth / azimuth_step) / azimuths))
    covariance[at, 0, 0] = cxx * share + along * ux * ux + across * uy * uy
    covariance[at, 0, 1] = covariance[at, 1, 0] = cxy * share + (along - across) * ux * uy
    covariance[at, 1, 1] = cyy * share + along * uy * uy + across * ux * ux
    narrow[0, at] = (last_cell - first_cell) * step
    narrow[1, at] = rows * azimuth_step
    narrow[2, at] = length
    narrow[3, at] = width
    narrow[4, at] = amplitude * part
    narrow[5, at] = peak
    narrow[6, at] = bearing
    narrow[7, at] = deviation
    narrow_int[8, at] = runs[root].seeds
    window[at, 0] = first_row
    window[at, 1] = rows
    window[at, 2] = first_cell
    window[at, 3] = last_cell - first_cell


@inlined
def _axis(ax: float, ay: float, middle: float, half: float, least: float, independent: float) -> tuple[float, float]:
    """Direction (0 .. pi) and standard deviation of the long axis; nan where the cells do not tell."""
    major, minor = middle + half, max(middle - half, least)
    if independent < BEARING_CELLS or major <= minor:
        return np.nan, np.nan
    deviation = np.sqrt(major * minor / (independent * (major - minor) ** 2) + BEARING_FLOOR**2)
    if deviation > BEARING_LIMIT:
        return np.nan, np.nan
    return np.arctan2(ax, ay) % np.pi, deviation


@inlined
def _small_angle(sine: float, cosine: float) -> Any:
    """arctan2; by its series where that is exact to rounding, as it is for all plots but the very near."""
    if abs(sine) > 0.03 * cosine or cosine <= 0:
        return np.arctan2(sine, cosine)
    x = sine / cosine
    y = x * x
    return x * (1 - y * (1 / 3 - y * (1 / 5 - y * (1 / 7 - y / 9))))
