"""Polygons drawn into arrays: a cell belongs to a polygon when its centre does (even-odd rule, scan lines)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry


@dataclass(frozen=True)
class Grid:
    """Square cells of `step` metres. shape: (rows, columns), row 0 is the southernmost, column 0 the westernmost.

    east_min, north_min: the south-west corner of cell (0, 0).
    """

    east_min: float
    north_min: float
    step: float
    shape: tuple[int, int]

    @classmethod
    def around(cls, bounds: tuple[float, float, float, float], step: float, margin: float) -> Grid:
        """The grid that covers (west, south, east, north) with a margin."""
        west, south, east, north = bounds
        columns = int(np.ceil((east - west + 2 * margin) / step))
        rows = int(np.ceil((north - south + 2 * margin) / step))
        return cls(west - margin, south - margin, step, (max(rows, 1), max(columns, 1)))

    def cells(self, east: Any, north: Any) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
        """(row, column, inside) of places; outside (and for nan) row and column are 0."""
        column = np.floor((np.asarray(east, float) - self.east_min) / self.step)
        row = np.floor((np.asarray(north, float) - self.north_min) / self.step)
        inside = (row >= 0) & (row < self.shape[0]) & (column >= 0) & (column < self.shape[1])
        return np.where(inside, row, 0).astype(np.int64), np.where(inside, column, 0).astype(np.int64), inside

    def fill(self, array: NDArray[Any], geometry: BaseGeometry, value: int) -> None:
        """Write `value` into the cells of `array` (of this grid's shape) whose centre lies in the geometry."""
        for polygon in shapely.get_parts(geometry):
            if isinstance(polygon, Polygon) and not polygon.is_empty:
                self._fill_polygon(array, polygon, value)

    def _fill_polygon(self, array: NDArray[Any], polygon: Polygon, value: int) -> None:
        west, south, east, north = polygon.bounds
        first_row = max(int(np.ceil((south - self.north_min) / self.step - 0.5)), 0)
        last_row = min(int(np.floor((north - self.north_min) / self.step - 0.5)), self.shape[0] - 1)
        first_column = max(int(np.ceil((west - self.east_min) / self.step - 0.5)), 0)
        last_column = min(int(np.floor((east - self.east_min) / self.step - 0.5)), self.shape[1] - 1)
        if last_row < first_row or last_column < first_column:
            return
        rows, columns = last_row - first_row + 1, last_column - first_column + 1
        toggles = np.zeros((rows, columns + 1), np.uint8)
        for ring in (polygon.exterior, *polygon.interiors):
            row, place = self._crossings(np.asarray(ring.coords)[:, :2], first_row, last_row)
            column = np.clip(np.ceil(place - 0.5), first_column, last_column + 1).astype(np.int64) - first_column
            np.bitwise_xor.at(toggles, (row - first_row, column), 1)
        inside = np.bitwise_xor.accumulate(toggles[:, :-1], axis=1).astype(np.bool_)
        array[first_row : last_row + 1, first_column : last_column + 1][inside] = value

    def _crossings(
        self, ring: NDArray[np.float64], first_row: int, last_row: int
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Where the ring crosses the centre lines of the rows: (row, place in columns)."""
        x = (ring[:, 0] - self.east_min) / self.step
        y = (ring[:, 1] - self.north_min) / self.step - 0.5
        x0, y0, x1, y1 = x[:-1], y[:-1], x[1:], y[1:]
        low = np.clip(np.ceil(np.minimum(y0, y1)), first_row, last_row + 1).astype(np.int64)
        high = np.clip(np.ceil(np.maximum(y0, y1)), first_row, last_row + 1).astype(np.int64)
        count = high - low
        edge = np.repeat(np.arange(len(count)), count)
        row = low[edge] + np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
        return row, x0[edge] + (row - y0[edge]) * (x1[edge] - x0[edge]) / (y1[edge] - y0[edge])


def areas_of(geometry: BaseGeometry, width: float) -> BaseGeometry:
    """The geometry as an area: lines get `width` metres."""
    if isinstance(geometry, Polygon | MultiPolygon):
        return geometry
    return geometry.buffer(width / 2, cap_style="flat")
