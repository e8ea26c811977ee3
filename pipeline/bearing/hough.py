"""Bearing of the fullest line through the scan-converted picture of the echo, by the Hough transform.

G. Galati, M. Leonardi, A. Cavallin, G. Pavan, "Airport surveillance processing chain for high resolution radar",
section 4B (1).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.bearing.sense import pointed
from pipeline.contracts.bearing import NO_BEARING, Bearing, Expected, TargetView
from pipeline.kernels.echo import measured
from pipeline.kernels.hough import hough, peaks
from pipeline.kernels.scan_convert import grid_of, scan_converted
from pipeline.sites import RadarSite

PIXELS = 64


@dataclass(frozen=True)
class Hough:
    """weighted: pixels vote by their decibels over the ground, instead of alike. step_m: side of a pixel. cell_db: over
    the median of the ground, from which on a pixel votes. angles: directions of lines over 180 degrees. line_m: width
    of a line. least_cells: echoes of fewer get no bearing. sd_deg: standard deviation of the errors, short of those by
    which a wing is taken for the fuselage.
    """

    weighted: bool = True
    step_m: float = 1.5
    cell_db: float = 12.0
    angles: int = 180
    line_m: float = 4.5
    least_cells: int = 12
    sd_deg: float = 6.0

    def __post_init__(self) -> None:
        if min(self.step_m, self.cell_db, self.line_m, self.sd_deg) <= 0:
            raise ValueError("step_m, cell_db, line_m and sd_deg must be above 0")
        if self.angles < 12 or self.least_cells < 1:
            raise ValueError("angles must be 12 or more, least_cells 1 or more")

    def start(self, site: RadarSite) -> RadarSite:
        """Nothing but the radar itself is needed."""
        return site

    def __call__(self, view: TargetView, expected: Expected | None, state: RadarSite) -> Bearing:
        """The bearing of one target."""
        found = self.axes(view, state, 1)
        if not found:
            return NO_BEARING
        return pointed(found[0], math.radians(self.sd_deg), expected, math.pi / 4)

    def axes(self, view: TargetView, site: RadarSite, many: int) -> list[float]:
        """The directions (rad from true north, modulo pi) of the `many` fullest lines, 20 degrees apart or more."""
        grid, video = grid_of(site, view.azimuth, view.range_m), site.video
        contrast = self.cell_db / video.db_per_step
        echo = measured(view.amplitude, view.plot, grid, video.beamwidth_rad, self.cell_db, video.db_per_step)
        if echo is None or echo.cells < self.least_cells:
            return []
        place = (echo.east, echo.north)
        image = scan_converted(view.amplitude, grid, place, step=self.step_m, size=PIXELS, outside=echo.background)
        above = image - np.float32(echo.background)
        votes = np.where(above > contrast, above if self.weighted else np.float32(1.0), np.float32(0.0))
        lines = hough(votes, self.angles, self.line_m / self.step_m, ((PIXELS - 1) / 2,) * 2)
        # columns run east and rows south: a normal at `angle` from east to south is a line at `angle` from north
        return [angle for angle, _ in peaks(lines, many, math.radians(20))]


PART = Hough
