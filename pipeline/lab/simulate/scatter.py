"""Hot-spot models: a target as a cloud of scattering centres whose strength depends on the side it is seen from.

Source: the idea of Golino and Farina, "Plot-to-track correlation in A-SMGCS using the target images from a Surface
Movement Radar" (48 centres of 0.1 m^2 on an aircraft, 22 of 0.02 m^2 on a car, summed coherently); where the centres
stand, their strengths and the specular side of the fuselage are ours.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from pipeline.reference.types import NAMES, TYPES, TargetType
from pipeline.tables import TargetClass

Floats = NDArray[np.float64]


def centres(kind: TargetType) -> Floats:
    """(n, 6) scattering centres of a type, in its own frame: forward, right, up (metres from its centre on the ground).

    The fourth column is the radar cross section in square metres; the strength from a direction that is `a` rad off the
    fifth column is section * (floor + (1 - floor) * max(cos a, 0) ** narrowness); narrowness 0 is the same everywhere.
    """
    made = _aircraft(kind) if kind.category == TargetClass.AIRCRAFT else _vehicle(kind)
    table = np.array(made, float)
    table[:, 3] *= kind.cross_section / table[:, 3].sum()
    return table


def _aircraft(kind: TargetType) -> list[tuple[float, float, float, float, float, float]]:
    half, body = kind.length / 2, kind.fuselage / 2
    axis_height = 0.32 * kind.height
    made: list[tuple[float, float, float, float, float, float]] = []
    count = round(kind.length / 2.6)
    for x in np.linspace(-0.72 * half, 0.92 * half, count):
        for side in (-1.0, 1.0):
            # the near side of the fuselage is specular: bright abeam, weaker towards the ends
            made.append((float(x), side * body, axis_height, 1.5, side * math.pi / 2, 4.0))
        made.append((float(x), 0.0, axis_height + body, 0.25, 0.0, 0.0))
    made += [(half, 0.0, axis_height, 3.0, 0.0, 2.0), (0.85 * half, 0.0, 0.8, 1.2, 0.0, 0.0)]
    span = kind.width / 2
    root = 0.12 * half
    points = max(6, round(span / 2.2))
    for s in np.linspace(0.12, 1.0, points):
        for side in (-1.0, 1.0):
            y = side * s * span
            x = root - s * span * math.tan(kind.sweep)
            made.append((x, y, axis_height - 0.5, 1.0, side * kind.sweep, 3.0))
            made.append((x - 0.14 * kind.length * (1.1 - s), y, axis_height - 0.5, 0.7, math.pi, 1.0))
    for engine in range(kind.engines):
        side = -1.0 if engine % 2 == 0 else 1.0
        y = side * 0.33 * span
        x = root - 0.33 * span * math.tan(kind.sweep) + 2.2
        made += [(x, y, 1.6, 4.0, 0.0, 1.0), (x - 3.0, y, 1.6, 2.0, math.pi, 1.0)]
    for s in np.linspace(0.15, 1.0, 4):
        for side in (-1.0, 1.0):
            made.append((-0.86 * half - s * 2.0, side * s * 0.36 * span, axis_height + 1.0, 0.6, 0.0, 0.0))
    for s in np.linspace(0.2, 1.0, 5):
        made.append((-0.8 * half - 0.16 * half * s, 0.0, axis_height + body + s * 0.55 * kind.height, 1.2, 0.0, 0.0))
    for x, y in ((0.78 * half, 0.0), (-0.02 * half, 0.09 * kind.width), (-0.02 * half, -0.09 * kind.width)):
        made.append((x, y, 0.6, 1.5, 0.0, 0.0))
    return made


def _vehicle(kind: TargetType) -> list[tuple[float, float, float, float, float, float]]:
    half, side, top = kind.length / 2, kind.width / 2, kind.height
    made = [
        (x, y, z, 1.0, math.atan2(y, x), 1.0)
        for x in (-half, half)
        for y in (-side, side)
        for z in (0.35 * top, 0.9 * top)
    ]
    made += [(0.0, y, 0.5 * top, 1.6, math.copysign(math.pi / 2, y), 6.0) for y in (-side, side)]
    made += [(x, 0.0, 0.5 * top, 1.6, 0.0 if x > 0 else math.pi, 6.0) for x in (-half, half)]
    steps = int(kind.length // 4)
    made += [(x, 0.0, 0.95 * top, 0.6, 0.0, 0.0) for x in np.linspace(-0.7 * half, 0.7 * half, 2 + steps)]
    return made


@cache
def catalogue() -> tuple[Floats, NDArray[np.int64]]:
    """(all centres of all types stacked, first row of each type and one past the last), in the order of NAMES."""
    models = [centres(TYPES[name]) for name in NAMES]
    first = np.concatenate([[0], np.cumsum([len(one) for one in models])]).astype(np.int64)
    return np.concatenate(models), first
