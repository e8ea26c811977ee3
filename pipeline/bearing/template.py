"""Bearing and type of the template that correlates best with the echo, out of all of them.

G. Galati, M. Leonardi, A. Cavallin, G. Pavan, "Airport surveillance processing chain for high resolution radar",
section 4B (3): types in steps of 1.2 degrees at distances of 100, 300, 500 and 1,000 m, all displacements. Costly: some
thousand templates, each at 49 places.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.bearing.sense import pointed
from pipeline.bearing.type_bank import AIRCRAFT, ANGLES, TypeBank, check
from pipeline.contracts.bearing import NO_BEARING, Bearing, Expected, TargetView
from pipeline.kernels.correlate import belief
from pipeline.kernels.echo import measured
from pipeline.kernels.scan_convert import grid_of
from pipeline.sites import RadarSite

TURN = 2 * math.pi


@dataclass(frozen=True)
class Template:
    """types: of which there are templates. distances_m: from the radar for which there are. cell_db: over the median of
    the ground, from which on a cell belongs to the echo. least_cells: echoes of fewer get no bearing. sharpness:
    likelihood of a resolution cell in proportion to one of independent normal errors. floor_deg: standard deviation
    that remains with very many cells. limit_deg: bearings less sure are not given. outliers: part of the expected
    headings that are wrong altogether.
    """

    types: tuple[str, ...] = AIRCRAFT
    distances_m: tuple[float, ...] = (100.0, 300.0, 500.0, 1000.0)
    cell_db: float = 10.0
    least_cells: int = 12
    sharpness: float = 1.0
    floor_deg: float = 1.0
    limit_deg: float = 20.0
    outliers: float = 0.01

    def __post_init__(self) -> None:
        object.__setattr__(self, "types", tuple(self.types))
        object.__setattr__(self, "distances_m", tuple(float(one) for one in self.distances_m))
        check(self.types, self.distances_m)
        if min(self.cell_db, self.sharpness, self.floor_deg, self.limit_deg) <= 0 or self.least_cells < 1:
            raise ValueError("cell_db, sharpness, floor_deg, limit_deg and least_cells must be above 0")
        if not 0 <= self.outliers < 1:
            raise ValueError("outliers must lie from 0 to below 1")

    def start(self, site: RadarSite) -> TypeBank:
        """The templates for the radar's resolution."""
        return TypeBank.of(site, self.types, self.distances_m)

    def __call__(self, view: TargetView, expected: Expected | None, state: TypeBank) -> Bearing:
        """The bearing and type of one target."""
        grid, video = grid_of(state.site, view.azimuth, view.range_m), state.site.video
        echo = measured(view.amplitude, view.plot, grid, video.beamwidth_rad, self.cell_db, video.db_per_step)
        if echo is None or echo.cells < self.least_cells:
            return NO_BEARING
        fit = state.correlations(view, echo, np.arange(ANGLES))
        likely = -0.5 * self.sharpness * echo.resolution_cells * np.log(1 - fit)
        heading = echo.azimuth + np.arange(ANGLES) * (TURN / ANGLES)
        if expected is not None:
            prior = (expected.heading, max(expected.sd, 1e-3), self.outliers)
            likely = likely + np.array([belief(one, prior) for one in heading])
        kind, best = np.unravel_index(int(np.argmax(likely)), likely.shape)
        away = (heading - heading[best] + math.pi / 2) % math.pi - math.pi / 2
        weight = np.exp(likely - likely.max()).sum(axis=0)
        weight /= weight.sum()
        # the mean near the best: finer than the templates
        near = np.abs(away) < math.radians(6)
        off = float(weight[near] @ away[near]) / float(weight[near].sum())
        sd = math.sqrt(float(weight @ (away - off) ** 2) + math.radians(self.floor_deg) ** 2)
        return pointed(float(heading[best]) + off, sd, expected, math.radians(self.limit_deg), self.types[int(kind)])


PART = Template
