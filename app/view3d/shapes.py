"""Low-poly shapes of movers and rings: unit size, nose to +x, left to +y, standing on z = 0; scaled per instance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Shape:
    """A mesh. vertices: (V, 3) float32; faces: (F, 3) uint32, counter-clockwise seen from outside."""

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]


def aircraft() -> Shape:
    """An airliner of length 1 and span 1; heights are in lengths. Fuselage, swept wings, tail, two engines."""
    parts = [_fuselage()]
    for side in (1.0, -1.0):
        parts += [
            _slab([(0.13, 0.0, 0.098), (-0.10, 0.0, 0.098), (-0.195, 0.5, 0.142), (-0.145, 0.5, 0.142)], 0.016, side),
            _slab([(-0.37, 0.0, 0.165), (-0.475, 0.0, 0.165), (-0.52, 0.19, 0.18), (-0.475, 0.19, 0.18)], 0.010, side),
            _tube([(0.085, 0.024), (0.02, 0.028), (-0.05, 0.017)], 0.17 * side, 0.078, 8),
        ]
    fin = [(-0.31, 0.0, 0.165), (-0.475, 0.0, 0.165), (-0.525, 0.0, 0.345), (-0.45, 0.0, 0.345)]
    parts.append(_blade(fin, 0.011))
    return _joined(parts)


def vehicle() -> Shape:
    """A box with a cab, wheels and a beacon: length 1, width 1, height 1."""
    cab = [
        (0.46, 0.42, 0.42), (0.46, -0.42, 0.42), (0.02, -0.42, 0.42), (0.02, 0.42, 0.42),
        (0.30, 0.38, 0.86), (0.30, -0.38, 0.86), (0.06, -0.38, 0.86), (0.06, 0.38, 0.86),
    ]  # fmt: skip
    parts = [
        _box(-0.5, 0.5, -0.5, 0.5, 0.14, 0.46),
        _hexahedron(np.array(cab)),
        _box(-0.46, -0.04, -0.46, 0.46, 0.46, 0.72),
    ]
    for x in (0.30, -0.30):
        for y in (-0.52, 0.36):
            parts.append(_box(x - 0.09, x + 0.09, y, y + 0.16, 0.0, 0.24))
    parts.append(_box(0.13, 0.23, -0.14, 0.14, 0.86, 1.0))
    return _joined(parts)


def unknown() -> Shape:
    """A diamond: length, width and height 1."""
    around = np.array([[0.5, 0, 0.5], [0, 0.5, 0.5], [-0.5, 0, 0.5], [0, -0.5, 0.5]])
    vertices = np.vstack([around, [[0, 0, 1.0], [0, 0, 0.0]]])
    faces = [(k, (k + 1) % 4, 4) for k in range(4)] + [((k + 1) % 4, k, 5) for k in range(4)]
    return _joined([(vertices, np.array(faces))])


def puck(sides: int = 16) -> Shape:
    """A low drum of diameter and height 1, for what is known but not which way it points."""
    angle = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(sides)])
    points = np.vstack([circle * 0.5, circle * 0.44 + np.array([0, 0, 0.7]), [[0, 0, 1.0]]])
    k = np.arange(sides)
    after = (k + 1) % sides
    walls = np.vstack([np.column_stack([k, after, after + sides]), np.column_stack([k, after + sides, k + sides])])
    top = np.column_stack([k + sides, after + sides, np.full(sides, 2 * sides)])
    return _joined([(points, np.vstack([walls, top]))])


def ring(inner: float = 0.86, sides: int = 40) -> Shape:
    """A flat ring of radius 1."""
    return _joined([_annulus(inner, 1.0, sides)])


def alarm_ring(sides: int = 48) -> Shape:
    """Two rings and four teeth: an alarm differs from information by shape, not only by colour."""
    parts = [_annulus(0.90, 1.0, sides), _annulus(0.70, 0.76, sides)]
    for angle in np.arange(4) * np.pi / 2 + np.pi / 4:
        c, s = np.cos(angle), np.sin(angle)
        corners = np.array([(1.0, -0.12), (1.30, 0.0), (1.0, 0.12)]) @ np.array([[c, s], [-s, c]])
        parts.append((np.column_stack([corners, np.zeros(3)]), np.array([[0, 1, 2]])))
    return _joined(parts)


def _joined(parts: list[tuple[Points, NDArray[np.int_]]]) -> Shape:
    vertices, faces, count = [], [], 0
    for points, triangles in parts:
        vertices.append(points)
        faces.append(np.asarray(triangles) + count)
        count += len(points)
    return Shape(np.vstack(vertices).astype(np.float32), np.vstack(faces).astype(np.uint32))


def _annulus(inner: float, outer: float, sides: int) -> tuple[Points, NDArray[np.int_]]:
    angle = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(sides)])
    k = np.arange(sides)
    after = (k + 1) % sides
    faces = np.vstack([np.column_stack([k, k + sides, after + sides]), np.column_stack([k, after + sides, after])])
    return np.vstack([circle * inner, circle * outer]), faces


def _fuselage() -> tuple[Points, NDArray[np.int_]]:
    stations = [(0.5, 0.004, 0.118), (0.475, 0.024, 0.120), (0.43, 0.042, 0.124), (0.36, 0.054, 0.130),
                (-0.20, 0.054, 0.130), (-0.36, 0.036, 0.146), (-0.5, 0.008, 0.172)]  # fmt: skip
    return _loft(stations, 0.0, 10)


def _tube(stations: list[tuple[float, float]], y: float, z: float, sides: int) -> tuple[Points, NDArray[np.int_]]:
    return _loft([(x, r, z) for x, r in stations], y, sides)


def _loft(stations: list[tuple[float, float, float]], y: float, sides: int) -> tuple[Points, NDArray[np.int_]]:
    angle = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    rows = [np.column_stack([np.full(sides, x), y + r * np.cos(angle), z + r * np.sin(angle)]) for x, r, z in stations]
    points = np.vstack([*rows, [[stations[0][0], y, stations[0][2]], [stations[-1][0], y, stations[-1][2]]]])
    faces: list[tuple[int, int, int]] = []
    for row in range(len(stations) - 1):
        for k in range(sides):
            a, b = row * sides + k, row * sides + (k + 1) % sides
            faces += [(a, b + sides, b), (a, a + sides, b + sides)]
    front, back, last = len(points) - 2, len(points) - 1, (len(stations) - 1) * sides
    for k in range(sides):
        after = (k + 1) % sides
        faces += [(front, k, after), (back, last + after, last + k)]
    return points, _outward(points, np.array(faces))


def _slab(corners: list[tuple[float, float, float]], thickness: float, side: float) -> tuple[Points, NDArray[np.int_]]:
    """A wing: four corners in plan (leading root, trailing root, trailing tip, leading tip), thinner at the tip."""
    top = np.array(corners) * [1, side, 1]
    bottom = top - np.array([[0, 0, thickness]] * 2 + [[0, 0, thickness * 0.4]] * 2)
    return _hexahedron(np.vstack([bottom, top]))


def _blade(corners: list[tuple[float, float, float]], thickness: float) -> tuple[Points, NDArray[np.int_]]:
    side = np.array([[0, thickness / 2, 0]] * 4)
    return _hexahedron(np.vstack([np.array(corners) - side, np.array(corners) + side]))


def _box(x0: float, x1: float, y0: float, y1: float, z0: float, z1: float) -> tuple[Points, NDArray[np.int_]]:
    return _hexahedron(np.array([(x, y, z) for z in (z0, z1) for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))]))


def _hexahedron(points: Points) -> tuple[Points, NDArray[np.int_]]:
    quads = [(0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    faces = np.array([face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))])
    return points, _outward(points, faces)


def _outward(points: Points, faces: NDArray[np.int_]) -> NDArray[np.int_]:
    """Turn faces of a convex part so that they look away from its middle."""
    corners = points[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.einsum("ij,ij->i", normal, corners.mean(axis=1) - points.mean(axis=0)) < 0
    faces[inward] = faces[inward][:, ::-1]
    return faces
