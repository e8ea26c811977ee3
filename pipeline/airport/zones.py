"""On what does a target stand? Look-ups over rasters that are drawn once from the map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from pipeline.airport.model import Airport
from pipeline.airport.raster import Grid, areas_of
from pipeline.airport.surfaces import DRAWN, surface_raster

ZONES = (
    "Water",
    "ApronElement",
    "ServiceRoad",
    "Building",
    "ParkingStandArea",
    "TaxiwayElement",
    "Stopway",
    "RunwayElement",
)
"""The kinds of features that are zones; where two overlap, the later is the answer."""


@dataclass(frozen=True, eq=False)
class ZoneMap:
    """Rasters of one airport and the look-ups over them; every look-up is one array read a target.

    zones: int32 index in `airport.features`, -1 for none. runways: int16 index in `airport.runways`, -1 for none.
    kinds: uint8 SurfaceKind. All of `grid.shape`.
    """

    grid: Grid
    zones: NDArray[np.int32]
    runways: NDArray[np.int16]
    kinds: NDArray[np.uint8]

    @classmethod
    def build(
        cls, airport: Airport, step: float = 2.0, *, margin: float = 5.0, most_cells: int = 24_000_000
    ) -> ZoneMap:
        """Draw the rasters. step: metres a cell; made coarser when the airport would need more than `most_cells`.

        margin: metres by which the paved polygon of a runway is widened. Where two runways cross, the later of
        `airport.runways` is the answer.
        """
        areas = [one.geometry for one in airport.features if one.kind in DRAWN] + [one.strip for one in airport.runways]
        bounds = tuple(float(one) for one in shapely.total_bounds(areas)) if areas else (0.0, 0.0, 0.0, 0.0)
        extent = (bounds[2] - bounds[0] + 100.0) * (bounds[3] - bounds[1] + 100.0)
        step = max(step, float(np.sqrt(extent / most_cells)))
        grid = Grid.around((bounds[0], bounds[1], bounds[2], bounds[3]), step, 50.0)
        zones = np.full(grid.shape, -1, np.int32)
        for kind in ZONES:
            for index, feature in enumerate(airport.features):
                if feature.kind == kind and feature.properties.get("status", "open") == "open":
                    width = float(feature.properties.get("width_m", 6.0))
                    grid.fill(zones, areas_of(feature.geometry, width), index)
        runways = np.full(grid.shape, -1, np.int16)
        for index, runway in enumerate(airport.runways):
            grid.fill(runways, runway.strip.buffer(margin, join_style="mitre"), index)
        kinds = surface_raster(airport, grid.east_min, grid.north_min, step, grid.shape)
        return cls(grid, zones, runways, kinds)

    def zone(self, east: Any, north: Any) -> NDArray[np.int32]:
        """Index in `airport.features` of what is at each place (metres), -1 for open ground and for nan."""
        return self._read(self.zones, east, north, -1)

    def runway(self, east: Any, north: Any) -> NDArray[np.int16]:
        """Index of the runway whose strip each place is in, -1 for none and for nan."""
        return self._read(self.runways, east, north, -1)

    def kind(self, east: Any, north: Any) -> NDArray[np.uint8]:
        """SurfaceKind at each place; grass outside the map."""
        return self._read(self.kinds, east, north, 0)

    def _read(self, raster: NDArray[Any], east: Any, north: Any, outside: int) -> NDArray[Any]:
        row, column, inside = self.grid.cells(east, north)
        return np.where(inside, raster[row, column], raster.dtype.type(outside))
