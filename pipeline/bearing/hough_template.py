"""Bearing by correlation with templates near the axes that the Hough transform finds (H/C).

G. Galati, M. Leonardi, A. Cavallin, G. Pavan, "Airport surveillance processing chain for high resolution radar",
section 4B (4): the fullest lines give the directions, each with a few offsets and both senses 10 to 20 correlations.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from pipeline.bearing.hough import Hough
from pipeline.bearing.sense import pointed
from pipeline.bearing.type_bank import ANGLES, TypeBank, check, nearest_template
from pipeline.contracts.bearing import NO_BEARING, Bearing, Expected, TargetView
from pipeline.kernels.echo import measured
from pipeline.kernels.scan_convert import grid_of
from pipeline.sites import RadarSite


@dataclass(frozen=True)
class HoughTemplate:
    """types, distances_m: of which and for which there are templates. peaks: lines of the Hough transform that are
    looked at. offsets_deg: about each of them. cell_db, least_cells: as in `hough`. sd_deg: standard deviation of the
    errors, short of those by which a wing is taken for the fuselage.
    """

    types: tuple[str, ...] = ("B738",)
    distances_m: tuple[float, ...] = (100.0, 300.0, 500.0, 1000.0)
    peaks: int = 2
    offsets_deg: tuple[float, ...] = (-9.6, -4.8, 0.0, 4.8, 9.6)
    cell_db: float = 12.0
    least_cells: int = 12
    sd_deg: float = 3.5
    lines: Hough = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "types", tuple(self.types))
        object.__setattr__(self, "distances_m", tuple(float(one) for one in self.distances_m))
        object.__setattr__(self, "offsets_deg", tuple(float(one) for one in self.offsets_deg))
        check(self.types, self.distances_m)
        if self.peaks < 1 or not self.offsets_deg or self.sd_deg <= 0:
            raise ValueError("peaks must be 1 or more, offsets_deg not empty, sd_deg above 0")
        object.__setattr__(self, "lines", Hough(cell_db=self.cell_db, least_cells=self.least_cells))

    def start(self, site: RadarSite) -> TypeBank:
        """The templates for the radar's resolution."""
        return TypeBank.of(site, self.types, self.distances_m)

    def __call__(self, view: TargetView, expected: Expected | None, state: TypeBank) -> Bearing:
        """The bearing of one target, and its type when there is a choice."""
        grid, video = grid_of(state.site, view.azimuth, view.range_m), state.site.video
        axes = self.lines.axes(view, state.site, self.peaks)
        echo = measured(view.amplitude, view.plot, grid, video.beamwidth_rad, self.cell_db, video.db_per_step)
        if echo is None or not axes:
            return NO_BEARING
        headings = [
            axis + math.radians(offset) + sense
            for axis in axes for offset in self.offsets_deg for sense in (0.0, math.pi)
        ]  # fmt: skip
        chosen = np.array([nearest_template(one, echo) for one in headings])
        fit = state.correlations(view, echo, chosen)
        kind, best = np.unravel_index(int(np.argmax(fit)), fit.shape)
        bearing = echo.azimuth + int(chosen[best]) * 2 * math.pi / ANGLES
        type = self.types[int(kind)] if len(self.types) > 1 else ""
        return pointed(bearing, math.radians(self.sd_deg), expected, math.pi / 4, type)


PART = HoughTemplate
