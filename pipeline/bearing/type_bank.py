"""Templates of known types at the paper's distances, for the parts that correlate with them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.contracts.bearing import TargetView
from pipeline.kernels.correlate import explained
from pipeline.kernels.echo import Echo
from pipeline.kernels.planform import Planform, Templates, templates
from pipeline.kernels.scan_convert import grid_of
from pipeline.reference.types import TYPES
from pipeline.sites import RadarSite
from pipeline.state import read_only
from pipeline.tables import TargetClass, VideoFormat

Floats = NDArray[np.float64]

AIRCRAFT = tuple(name for name, one in TYPES.items() if one.category == TargetClass.AIRCRAFT)
"""The types there can be templates of."""

PIXELS, STEP, SHIFT = 42, 2.0, 3
"""Pixels of a template, a side; metres a pixel; pixels by which a template is moved each way."""

ANGLES = 300
"""Headings of the templates: 1.2 degrees apart."""

CONTRAST_DB, LIMIT_DB = 18.0, 22.0
"""Of the templates over their ground; what is brighter in an echo counts as this."""


@dataclass(frozen=True, eq=False)
class TypeBank:
    """The templates of one radar. bank: (distances, types, angles, pixels, pixels)."""

    site: RadarSite
    distances: Floats
    types: tuple[str, ...]
    bank: Templates

    @classmethod
    def of(cls, site: RadarSite, types: tuple[str, ...], distances: tuple[float, ...]) -> TypeBank:
        """Made of the types' dimensions for the radar's resolution."""
        return cls(site, np.array(distances), types, _bank(types, distances, site.video))

    def correlations(self, view: TargetView, echo: Echo, headings: NDArray[np.int64]) -> Floats:
        """(types, headings) the greatest correlation coefficient over all displacements, squared; headings: indices of
        templates, clockwise from the line of sight."""
        site = self.site
        ring = int(np.argmin(np.abs(self.distances - echo.range_m)))
        out = np.empty((len(self.types), len(headings)))
        picture = np.empty((PIXELS + 2 * SHIFT,) * 2, np.float32)
        place = (echo.east, echo.north, echo.azimuth, echo.background)
        grid: Any = grid_of(site, view.azimuth, view.range_m)
        scale = (STEP, site.video.db_per_step, LIMIT_DB)
        whole = explained(read_only(view.amplitude), grid, place, scale, self.bank[ring], headings, picture, out)
        return np.minimum(out / max(whole, 1e-9), 1.0 - 1e-6)


def check(types: tuple[str, ...], distances: tuple[float, ...]) -> None:
    """Raises ValueError for types without a template, or distances that are no distances."""
    unknown = [one for one in types if one not in AIRCRAFT]
    if not types or unknown:
        raise ValueError(f"there are templates of {', '.join(AIRCRAFT)}; not of {', '.join(unknown) or 'none'}")
    if not distances or min(distances) <= 0:
        raise ValueError("distances must be one or more, above 0")


@lru_cache(maxsize=4)
def _bank(types: tuple[str, ...], distances: tuple[float, ...], video: VideoFormat) -> Templates:
    widths = tuple(one * video.beamwidth_rad for one in distances)
    shapes = [Planform(one.length, one.width, one.fuselage, one.sweep) for one in (TYPES[name] for name in types)]
    made = [templates(one, ANGLES, PIXELS, STEP, video.range_step_m, widths, CONTRAST_DB) for one in shapes]
    return read_only(np.stack(made, axis=1))


def nearest_template(heading: float, echo: Echo) -> int:
    """Index of the template of a heading (rad from true north)."""
    return round((heading - echo.azimuth) / (2 * math.pi) * ANGLES) % ANGLES
