"""What the ground is made of, cell by cell: on a square grid, and on the polar grid of a radar."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.airport.model import Airport, SurfaceKind
from pipeline.airport.raster import Grid, areas_of
from pipeline.sites import RadarSite

DRAWN = {
    "Water": SurfaceKind.WATER,
    "ApronElement": SurfaceKind.APRON,
    "ParkingStandArea": SurfaceKind.APRON,
    "TaxiwayElement": SurfaceKind.TAXIWAY,
    "Stopway": SurfaceKind.RUNWAY,
    "RunwayElement": SurfaceKind.RUNWAY,
    "ServiceRoad": SurfaceKind.ROAD,
    "Building": SurfaceKind.BUILDING,
}
"""The kinds of features that make a surface, in drawing order: the later covers the earlier."""


def surface_raster(
    airport: Airport, east_min: float, north_min: float, step: float, shape: tuple[int, int]
) -> NDArray[np.uint8]:
    """SurfaceKind of each cell of `step` metres, (rows, columns), row 0 in the south, column 0 in the west.

    A cell is what its centre lies on; building before road, runway, taxiway, apron, water and grass.
    """
    grid = Grid(east_min, north_min, step, shape)
    made = np.full(shape, int(SurfaceKind.GRASS), np.uint8)
    for kind, surface in DRAWN.items():
        for feature in airport.features:
            if feature.kind == kind:
                width = float(feature.properties.get("width_m", 6.0))
                grid.fill(made, areas_of(feature.geometry, width), int(surface))
    return made


def surface_of_radar(airport: Airport, site: RadarSite) -> NDArray[np.uint8]:
    """SurfaceKind of each cell of a radar's video, (azimuths, ranges), at the centre of the cell.

    Rows count from true north (the assembler has added the radar's north offset): row 0 is centred half a step from it.
    """
    video = site.video
    ranges = video.first_range_m + np.arange(video.ranges) * video.range_step_m
    step = max(1.0, min(video.range_step_m, 4.0))
    reach = float(ranges[-1]) + 2 * step
    side = int(np.ceil(2 * reach / step))
    grid = Grid(site.east - reach, site.north - reach, step, (side, side))
    raster = surface_raster(airport, grid.east_min, grid.north_min, step, grid.shape)
    azimuth = (np.arange(video.azimuths) + 0.5) * video.azimuth_step_rad
    east = site.east + np.sin(azimuth)[:, None] * ranges
    north = site.north + np.cos(azimuth)[:, None] * ranges
    row, column, _ = grid.cells(east, north)
    return np.ascontiguousarray(raster[row, column])
