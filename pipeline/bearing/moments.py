"""Bearing of the axis of least inertia of the echo's cells, on the ground.

G. Galati, M. Leonardi, A. Cavallin, G. Pavan, "Airport surveillance processing chain for high resolution radar",
section 4B (2). Counting each cell once (which the paper does not mention) is markedly better than weighing them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from pipeline.bearing.sense import pointed
from pipeline.contracts.bearing import NO_BEARING, Bearing, Expected, TargetView
from pipeline.kernels.echo import measured
from pipeline.kernels.scan_convert import grid_of
from pipeline.sites import RadarSite


@dataclass(frozen=True)
class Moments:
    """weighted: cells weigh by their decibels over the ground, instead of alike. cell_db: over the median of the
    ground, from which on a cell counts. least_resolution_cells: echoes of fewer resolution cells get no bearing.
    floor_deg: standard deviation that remains with very many cells. limit_deg: bearings less sure are not given.
    """

    weighted: bool = False
    cell_db: float = 12.0
    least_resolution_cells: float = 8.0
    floor_deg: float = 3.5
    limit_deg: float = 20.0

    def __post_init__(self) -> None:
        if min(self.cell_db, self.least_resolution_cells, self.floor_deg, self.limit_deg) <= 0:
            raise ValueError("cell_db, least_resolution_cells, floor_deg and limit_deg must be above 0")

    def start(self, site: RadarSite) -> RadarSite:
        """Nothing but the radar itself is needed."""
        return site

    def __call__(self, view: TargetView, expected: Expected | None, state: RadarSite) -> Bearing:
        """The bearing of one target."""
        grid, video = grid_of(state, view.azimuth, view.range_m), state.video
        echo = measured(
            view.amplitude,
            view.plot,
            grid,
            video.beamwidth_rad,
            self.cell_db,
            video.db_per_step,
            weighted=self.weighted,
        )
        if echo is None or echo.resolution_cells < self.least_resolution_cells:
            return NO_BEARING
        axis, major, minor = echo.axis
        minor = max(minor, video.range_step_m**2 / 12)
        if major <= minor:
            return NO_BEARING
        spread = major * minor / (echo.resolution_cells * (major - minor) ** 2)
        sd = math.sqrt(spread + math.radians(self.floor_deg) ** 2)
        return pointed(axis, sd, expected, math.radians(self.limit_deg))


PART = Moments
