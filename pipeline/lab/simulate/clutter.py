"""Clutter: how strongly each cell of the ground answers, how its echo fluctuates, and what stands in the shadow."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter
from scipy.special import gammaln
from shapely import STRtree, points

from pipeline.airport.model import Airport, SurfaceKind
from pipeline.kernels.compiled import allocating
from pipeline.sites import RadarSite

Floats = NDArray[np.float64]

FINE = 16
"""Levels are kept in sixteenths of a step of the log amplifier, so that only the output is rounded to 8 bits."""

SHAPES = (2.0, 1.7, 1.4, 4.0)
"""Weibull shape of the amplitude in each family; 2 is Rayleigh."""

SLOPE_SCALE = 16384.0
"""Units a tangent of the shadow map."""


@dataclass(frozen=True, slots=True)
class Ground:
    """How one kind of ground answers. sigma0: dB (m^2 per m^2). texture: dB, standard deviation from cell to cell.

    family: index into SHAPES.
    """

    sigma0: float
    texture: float
    family: int


GROUNDS: dict[str, Ground] = {
    "asphalt": Ground(-43.0, 0.5, 0),
    "concrete": Ground(-39.0, 0.7, 0),
    "road": Ground(-38.0, 1.0, 0),
    "water": Ground(-48.0, 0.5, 0),
    "weak grass": Ground(-33.0, 0.8, 0),
    "strong grass": Ground(-27.5, 1.2, 1),
    "country": Ground(-23.0, 3.5, 2),
    "building": Ground(-3.0, 5.0, 3),
}
"""Grazing-incidence values chosen to look like X-band pictures; settings, not measurements."""

NAMES = tuple(GROUNDS)
_OF_KIND = {
    SurfaceKind.RUNWAY: "asphalt",
    SurfaceKind.TAXIWAY: "asphalt",
    SurfaceKind.APRON: "concrete",
    SurfaceKind.ROAD: "road",
    SurfaceKind.WATER: "water",
    SurfaceKind.GRASS: "weak grass",
    SurfaceKind.BUILDING: "building",
}


@dataclass(frozen=True, slots=True)
class PowerLaw:
    """The radar equation in one line: dB over thermal noise of 1 m^2 at range R is reference - 10 exponent log10(R/km).

    exponent: between 4 (free space) and 0 (ideal inverse cosecant squared beam). nearest: m, stronger no more below.
    """

    reference: float = 33.0
    exponent: float = 2.8
    nearest: float = 60.0

    def decibels(self, range_m: Floats) -> Floats:
        """dB over noise of one square metre at these slant ranges."""
        return np.asarray(self.reference - 10 * self.exponent * np.log10(np.maximum(range_m, self.nearest) / 1e3))


@dataclass(frozen=True, slots=True, eq=False)
class ClutterMap:
    """What does not change from scan to scan.

    code: (azimuths, ranges) uint16: the mean power of clutter and noise in 1/16 step (12 bits), family above.
    slope: (azimuths, ranges) int16: tangent of the elevation, seen from the antenna, of the highest building top nearer
    than the cell, times SLOPE_SCALE; what lies lower is in its shadow.
    ground: (azimuths, ranges) uint8 index into NAMES.
    """

    code: NDArray[np.uint16]
    slope: NDArray[np.int16]
    ground: NDArray[np.uint8]


def build_clutter(
    airport: Airport,
    site: RadarSite,
    surface: NDArray[np.uint8],
    seed: int,
    law: PowerLaw,
    noise_step: float,
    shadow_loss: float,
) -> ClutterMap:
    """The map of a radar's clutter. surface: (azimuths, ranges) SurfaceKind.

    noise_step: mean thermal noise in steps. shadow_loss: dB by which an echo behind a building is weaker.
    Raises ValueError when the surface does not have the shape of the radar's video.
    """
    video = site.video
    if surface.shape != (video.azimuths, video.ranges):
        raise ValueError(f"surface of shape {surface.shape} for video of {video.azimuths} x {video.ranges}")
    rng = np.random.default_rng([seed, 3])
    ground = _grounds(surface, site, rng)
    slant = np.asarray(video.first_range_m + np.arange(video.ranges) * video.range_step_m, np.float64)
    slope = _shadows(airport, site, surface, slant)
    table = GROUNDS.values()
    sigma0 = np.array([one.sigma0 for one in table], np.float32)
    texture = np.array([one.texture for one in table], np.float32)
    family = np.array([one.family for one in table], np.uint16)
    area = np.maximum(slant, video.range_step_m) * video.beamwidth_rad * video.range_step_m
    per_range = (law.decibels(slant) + 10 * np.log10(area)).astype(np.float32)
    lit = np.tan(np.arctan2(-site.height, np.maximum(slant, 1.0))) * SLOPE_SCALE
    code = np.empty(surface.shape, np.uint16)
    for first in range(0, video.azimuths, 256):
        rows = slice(first, first + 256)
        kind = ground[rows]
        level = sigma0[kind] + per_range
        level += texture[kind] * rng.standard_normal(kind.shape, np.float32)
        built = kind == NAMES.index("building")
        # a wall shows its top above what stands before it; open ground only where nothing does
        hidden = (slope[rows] > lit) & ~built
        level[hidden] -= shadow_loss
        total = 10 * np.log10(1.0 + 10 ** (level / 10))
        fine = np.clip((noise_step + total / video.db_per_step) * FINE, 0, 255 * FINE)
        code[rows] = np.round(fine).astype(np.uint16) | (family[kind] << np.uint16(12))
    return ClutterMap(code, slope, ground)


def _grounds(surface: NDArray[np.uint8], site: RadarSite, rng: np.random.Generator) -> NDArray[np.uint8]:
    """The index into NAMES of every cell: the mapped kinds, and grass split into weak, strong and open country."""
    of_kind = np.full(256, NAMES.index("weak grass"), np.uint8)
    for kind, name in _OF_KIND.items():
        of_kind[kind] = NAMES.index(name)
    ground = of_kind[surface]
    video = site.video
    step = 25.0
    reach = video.first_range_m + video.ranges * video.range_step_m
    half = math.ceil(reach / step) + 2
    axis = (np.arange(2 * half + 1) - half) * step
    x, y = np.meshgrid(axis, axis)
    row = (np.mod(np.arctan2(x, y), 2 * np.pi) / video.azimuth_step_rad).astype(int) % video.azimuths
    cell = np.clip(((np.hypot(x, y) - video.first_range_m) / video.range_step_m).astype(int), 0, video.ranges - 1)
    paved = np.isin(surface[row, cell], (SurfaceKind.RUNWAY, SurfaceKind.TAXIWAY, SurfaceKind.APRON))
    away = distance_transform_edt(~paved) * step if paved.any() else np.full(paved.shape, 0.0)
    patches = gaussian_filter(rng.standard_normal(paved.shape), 3.0)
    patches /= max(float(patches.std()), 1e-9)
    grass = np.full(paved.shape, NAMES.index("weak grass"), np.uint8)
    grass[patches > 0.6] = NAMES.index("strong grass")
    grass[away > 260.0 + 60.0 * patches] = NAMES.index("country")
    azimuth = (np.arange(video.azimuths) + 0.5) * video.azimuth_step_rad
    slant = video.first_range_m + np.arange(video.ranges) * video.range_step_m
    for first in range(0, video.azimuths, 256):
        rows = slice(first, first + 256)
        # shaken by half a patch cell, so that the patches have no straight edges
        shaken = rng.random((2, *ground[rows].shape), np.float32) - 0.5
        i = np.round(np.outer(np.cos(azimuth[rows]), slant) / step + shaken[0]).astype(np.int32) + half
        j = np.round(np.outer(np.sin(azimuth[rows]), slant) / step + shaken[1]).astype(np.int32) + half
        open_ground = surface[rows] == SurfaceKind.GRASS
        ground[rows][open_ground] = grass[i[open_ground], j[open_ground]]
    return ground


def _shadows(
    airport: Airport, site: RadarSite, surface: NDArray[np.uint8], slant: Floats, default: float = 12.0
) -> NDArray[np.int16]:
    built = surface == SurfaceKind.BUILDING
    slope = np.full(surface.shape, -32767, np.int16)
    starts = built.copy()
    starts[:, 1:] &= ~built[:, :-1]
    row, cell = np.nonzero(starts)
    if not len(row):
        return slope
    azimuth = (row + 0.5) * site.video.azimuth_step_rad
    # a look 1.5 cells inside the wall finds the building that it belongs to
    reach = slant[cell] + 1.5 * site.video.range_step_m
    buildings = [one for one in airport.features if one.kind == "Building"]
    heights = np.array([_height(one.properties, default) for one in buildings] + [default])
    place = points(site.east + reach * np.sin(azimuth), site.north + reach * np.cos(azimuth))
    found = np.full(len(row), len(buildings))
    if buildings:
        which, building = STRtree([one.geometry for one in buildings]).query(place, predicate="dwithin", distance=8.0)
        found[which] = building
    _spread_shadows(row, cell, heights[found], site.height, slant, built, slope)
    return slope


def _height(properties: dict[str, object], default: float) -> float:
    try:
        height = float(str(properties.get("height") or properties.get("height_m") or default).rstrip(" m"))
    except ValueError:
        return default
    return height if 1.0 <= height <= 150.0 else default


@allocating
def _spread_shadows(row, cell, height, antenna, slant, built, slope):  # type: ignore[no-untyped-def]
    n = len(row)
    ranges = len(slant)
    for k in range(n):
        near = max(slant[cell[k]], 30.0)
        top = (height[k] - antenna) / near * 16384.0
        out = slope[row[k]]
        inside = built[row[k]]
        value = np.int16(min(max(top, -32767.0), 32767.0))
        j = cell[k]
        # the roof itself is as far in shadow as its far edge says: follow the building to its end
        while j < ranges and inside[j]:
            j += 1
        if antenna > height[k] and j < ranges:
            far = (height[k] - antenna) / max(slant[j], 30.0) * 16384.0
            value = np.int16(min(max(far, -32767.0), 32767.0))
        for m in range(j, ranges):
            out[m] = max(out[m], value)


def quantiles() -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Fluctuation about the mean power, dB * 1e6 as int32: (families, 4096) and, for the top 1/4096, (families, 65536).

    Entry u of the first is the quantile (u + 0.5) / 4096; of the second (4095 + (v + 0.5) / 65536) / 4096, so that the
    tail is drawn down to 2**-28.
    """
    main = (np.arange(4096) + 0.5) / 4096
    tail = (4095 + (np.arange(65536) + 0.5) / 65536) / 4096
    made = []
    for u in (main, tail):
        power = np.log(-np.log1p(-u)) * (10 / math.log(10))
        made.append(np.stack([(2 / c) * power - 10 / math.log(10) * float(gammaln(1 + 2 / c)) for c in SHAPES]) * 1e6)
    return made[0].astype(np.int32), made[1].astype(np.int32)
