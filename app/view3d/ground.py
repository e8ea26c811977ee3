"""The ground of the 3D scene: pavements, paint, buildings and lines of an airport as plain arrays.

Pavements are cut so that no two lie over each other: everything is in one plane and nothing flickers at a distance.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import MultiPolygon, Point, Polygon
from shapely.geometry.base import BaseGeometry

from app.view3d.paint import runway_paint
from pipeline.airport.model import Airport, Feature

Colour = tuple[int, int, int]
Floats = NDArray[np.float32]
Faces = NDArray[np.uint32]

GRASS: Colour = (30, 40, 37)
APRON: Colour = (52, 60, 70)
STAND: Colour = (60, 69, 80)
TAXIWAY: Colour = (68, 77, 88)
RUNWAY: Colour = (92, 100, 110)
STOPWAY: Colour = (66, 66, 62)
PAINT: Colour = (225, 229, 232)
WALL: Colour = (74, 86, 102)
ROOF: Colour = (90, 104, 122)
TOWER: Colour = (150, 166, 184)
TAXI_LINE: Colour = (158, 138, 66)
STAND_LINE: Colour = (108, 99, 70)
HOLD_BAR: Colour = (255, 96, 70)
INTERSECTION_BAR: Colour = (214, 186, 100)

FAR_M = 15_900.0
"""Half the side of the grass plane; its corners lie behind the sky."""

BELOW_M = -0.8
"""The grass lies this far under the pavements, which hides the seams."""

DEFAULT_HEIGHT_M = 10.0
EYE_OVER_CAB_M = 24.0
"""The camera hovers over the cab: from the true height the roofs around hide half of the field."""


@dataclass(frozen=True, eq=False)
class Surface:
    """A mesh of one colour. vertices: (V, 3) m; faces: (F, 3)."""

    name: str
    vertices: Floats
    faces: Faces
    colour: Colour
    flat: bool = False


@dataclass(frozen=True, eq=False)
class Lines:
    """Line segments of one colour. points: (N, 2, 3) m; width in screen pixels."""

    name: str
    points: Floats
    colour: Colour
    width: float


@dataclass(frozen=True)
class Ground:
    """All that does not move. notes: texts with the points they belong to. centre, span: m, of all runways.

    corners: of all runways, (n, 2) m. tower: the eye of the controller, None when the map has no tower; watched: what
    the eye is on, the nearest point of the nearest runway.
    """

    surfaces: tuple[Surface, ...]
    lines: tuple[Lines, ...]
    notes: tuple[tuple[str, tuple[float, float, float]], ...]
    centre: tuple[float, float]
    span: float
    tower: tuple[float, float, float] | None
    watched: tuple[float, float]
    corners: NDArray[np.float64]


def build_ground(airport: Airport) -> Ground:
    """The scene of an airport; features with empty or broken shapes are left out."""
    runway = _union(one.strip for one in airport.runways)
    taxiway = _union(_shapes(airport, "TaxiwayElement"))
    stand = _union(_shapes(airport, "ParkingStandArea"))
    apron = _union(_shapes(airport, "ApronElement"))
    stopway = _union(_shapes(airport, "Stopway"))
    paint = _union(shape for one in airport.runways for shape in runway_paint(one)).intersection(runway)
    layers = (
        ("runway-paint", paint, PAINT, runway.intersection(paint)),
        ("runway", runway, RUNWAY, runway.difference(paint)),
        ("stopway", stopway, STOPWAY, stopway.difference(runway)),
        ("taxiway", taxiway, TAXIWAY, taxiway.difference(runway)),
        ("stand", stand, STAND, stand.difference(_union((runway, taxiway)))),
        ("apron", apron, APRON, apron.difference(_union((runway, taxiway, stand)))),
    )
    surfaces = [_plane()]
    surfaces += [_flat(name, shape, colour, 0.0) for name, _, colour, shape in layers]
    surfaces += _buildings(airport)
    eye = _tower(airport)
    if eye is not None:
        surfaces.append(_tower_body(eye))
    west, south, east, north = runway.bounds if not runway.is_empty else (-500.0, -500.0, 500.0, 500.0)
    return Ground(
        surfaces=tuple(one for one in surfaces if len(one.faces)),
        lines=tuple(one for one in _lines(airport) if len(one.points)),
        notes=tuple(
            (end.designator, (end.threshold.x, end.threshold.y, 12.0)) for one in airport.runways for end in one.ends
        ),
        centre=((west + east) / 2, (south + north) / 2),
        span=max(east - west, north - south, 400.0),
        tower=None if eye is None else (eye[0], eye[1], eye[2] + EYE_OVER_CAB_M),
        watched=_watched(airport, eye) or ((west + east) / 2, (south + north) / 2),
        corners=shapely.get_coordinates([one.strip for one in airport.runways]).reshape(-1, 2),
    )


def triangles(shape: BaseGeometry) -> NDArray[np.float64]:
    """The triangles of all polygons in a shape, counter-clockwise: (n, 3, 2) m."""
    found = [_triangles_of(one) for one in _polygons(shape)]
    made = np.concatenate([np.zeros((0, 3, 2)), *found])
    a, b, c = made[:, 0], made[:, 1], made[:, 2]
    clockwise = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]) < 0
    made[clockwise] = made[clockwise][:, ::-1]
    return made


def _triangles_of(polygon: Polygon) -> NDArray[np.float64]:
    pieces = shapely.constrained_delaunay_triangles(polygon)
    return shapely.get_coordinates(pieces).reshape(-1, 4, 2)[:, :3]


def _polygons(shape: BaseGeometry) -> list[Polygon]:
    parts: Any = getattr(shape, "geoms", (shape,))
    found: list[Polygon] = []
    for one in parts:
        if isinstance(one, MultiPolygon):
            found += _polygons(one)
        elif isinstance(one, Polygon) and not one.is_empty and one.area > 0.01:
            found.append(one)
    return found


def _union(shapes: Iterable[BaseGeometry]) -> BaseGeometry:
    whole = [shapely.make_valid(one) for one in shapes if not one.is_empty]
    # a grid of a centimetre: without it slivers of the differences make needles in the triangulation
    return shapely.set_precision(shapely.union_all(whole), 0.01) if whole else Polygon()


def _shapes(airport: Airport, kind: str) -> list[BaseGeometry]:
    return [one.geometry for one in airport.features if one.kind == kind and one.geometry.area > 0]


def _flat(name: str, shape: BaseGeometry, colour: Colour, height: float) -> Surface:
    corners = triangles(shape).reshape(-1, 2)
    vertices = np.column_stack([corners, np.full(len(corners), height)]).astype(np.float32)
    vertices, inverse = np.unique(vertices, axis=0, return_inverse=True)
    return Surface(f"/ground/{name}", vertices, inverse.reshape(-1, 3).astype(np.uint32), colour)


def _plane() -> Surface:
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float32) * FAR_M
    vertices = np.column_stack([corners, np.full(4, BELOW_M)]).astype(np.float32)
    return Surface("/ground/grass", vertices, np.array([[0, 1, 2], [0, 2, 3]], np.uint32), GRASS)


def _height(feature: Feature) -> float:
    try:
        height = float(feature.properties.get("height_m", DEFAULT_HEIGHT_M))
    except (TypeError, ValueError):
        return DEFAULT_HEIGHT_M
    return min(max(height, 2.5), 120.0) if np.isfinite(height) else DEFAULT_HEIGHT_M


def _buildings(airport: Airport) -> list[Surface]:
    roofs: list[NDArray[np.float64]] = [np.zeros((0, 3, 3))]
    walls: list[NDArray[np.float64]] = [np.zeros((0, 3, 3))]
    for feature in airport.features:
        if feature.kind != "Building":
            continue
        height = _height(feature)
        for polygon in _polygons(shapely.make_valid(feature.geometry)):
            flat = triangles(polygon)
            roofs.append(np.concatenate([flat, np.full((*flat.shape[:2], 1), height)], axis=2))
            turned = shapely.orient_polygons(polygon)
            walls += [_wall(np.asarray(ring.coords)[:, :2], height) for ring in (turned.exterior, *turned.interiors)]
    return [
        _soup("/buildings/roofs", np.concatenate(roofs), ROOF),
        _soup("/buildings/walls", np.concatenate(walls), WALL),
    ]


def _wall(ring: NDArray[np.float64], height: float) -> NDArray[np.float64]:
    a, b = ring[:-1], ring[1:]
    low, high = np.full((len(a), 1), BELOW_M), np.full((len(a), 1), height)
    a0, b0, a1, b1 = np.hstack([a, low]), np.hstack([b, low]), np.hstack([a, high]), np.hstack([b, high])
    return np.concatenate([np.stack([a0, b0, b1], axis=1), np.stack([a0, b1, a1], axis=1)])


def _soup(name: str, corners: NDArray[np.float64], colour: Colour) -> Surface:
    vertices = corners.reshape(-1, 3).astype(np.float32)
    return Surface(name, vertices, np.arange(len(vertices), dtype=np.uint32).reshape(-1, 3), colour, flat=True)


def _tower(airport: Airport) -> tuple[float, float, float] | None:
    towers = [
        (one.geometry.centroid.x, one.geometry.centroid.y, _height(one))
        for one in airport.features
        if one.properties.get("use") == "tower" and not one.geometry.is_empty
    ]
    return max(towers, key=lambda one: one[2]) if towers else None


def _watched(airport: Airport, eye: tuple[float, float, float] | None) -> tuple[float, float] | None:
    if eye is None or not airport.runways:
        return None
    here = Point(eye[0], eye[1])
    line = min((one.centreline for one in airport.runways), key=here.distance)
    near = line.interpolate(line.project(here))
    return near.x, near.y


def _tower_body(eye: tuple[float, float, float]) -> Surface:
    """A shaft with a cab that widens upwards, of twelve sides."""
    around = np.linspace(0, 2 * np.pi, 13)[:-1]
    rings = [
        (4.5, BELOW_M),
        (3.6, eye[2] - 7.0),
        (7.0, eye[2] - 4.0),
        (8.5, eye[2]),
        (7.5, eye[2] + 0.8),
        (0.1, eye[2] + 1.6),
    ]
    points = [
        np.column_stack([eye[0] + r * np.cos(around), eye[1] + r * np.sin(around), np.full(12, z)]) for r, z in rings
    ]
    corners: list[NDArray[np.float64]] = []
    for low, high in pairwise(points):
        next_low, next_high = np.roll(low, -1, axis=0), np.roll(high, -1, axis=0)
        corners += [np.stack([low, next_low, next_high], axis=1), np.stack([low, next_high, high], axis=1)]
    return _soup("/buildings/tower", np.concatenate(corners), TOWER)


def _segments(shapes: Iterable[BaseGeometry], height: float) -> Floats:
    found: list[NDArray[np.float64]] = [np.zeros((0, 2, 3))]
    for shape in shapes:
        for line in getattr(shape, "geoms", (shape,)):
            if line.geom_type != "LineString" or line.is_empty:
                continue
            points = np.asarray(line.simplify(0.3).coords)[:, :2]
            points = np.column_stack([points, np.full(len(points), height)])
            found.append(np.stack([points[:-1], points[1:]], axis=1))
    return np.concatenate(found).astype(np.float32)


def _lines(airport: Airport) -> list[Lines]:
    def of(kind: str) -> list[BaseGeometry]:
        return [one.geometry for one in airport.features if one.kind == kind]

    return [
        Lines("/lines/taxiway", _segments(of("TaxiwayGuidanceLine"), 0.25), TAXI_LINE, 1.2),
        Lines("/lines/stand", _segments(of("StandGuidanceLine"), 0.25), STAND_LINE, 1.0),
        Lines("/lines/intersection", _segments(of("TaxiwayIntersectionMarking"), 0.35), INTERSECTION_BAR, 2.0),
        Lines("/lines/hold", _segments((one.line for one in airport.holding_positions), 0.4), HOLD_BAR, 3.0),
    ]
