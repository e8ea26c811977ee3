"""Aircraft that stand at their stands all the time."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from shapely import STRtree, distance
from shapely.geometry import Point

from pipeline.airport.model import Airport
from pipeline.lab.simulate.paths import Movement
from pipeline.reference.types import TYPES

_TYPES = ("A320", "B738", "E190", "A321")


def parked(
    airport: Airport,
    movements: Sequence[Movement],
    length: float,
    count: int,
    seed: int,
    clearance: float = 60.0,
    vehicles: Sequence[Movement] = (),
    wing_clearance: float = 32.0,
) -> list[Movement]:
    """Up to `count` simulated aircraft without transponder on stands that nothing in `movements` comes near.

    clearance: m from the middle of the aircraft to anything in `movements`; wing_clearance: to anything in `vehicles`.

    They stand nose in: on a stand's guidance line, with the nose at the end that is nearer to a building.
    """
    buildings = STRtree([one.geometry for one in airport.features if one.kind == "Building"])
    lines = [one.geometry for one in airport.features if one.kind == "StandGuidanceLine" and one.geometry.length > 20.0]
    if not len(buildings.geometries) or not lines:
        return []
    rng = np.random.default_rng([seed, 17])
    busy = [np.stack([one.east, one.north], axis=1)[::3] for one in movements]
    tracks = np.concatenate(busy) if busy else np.zeros((0, 2))
    driven = [np.stack([one.east, one.north], axis=1) for one in vehicles]
    ways = np.unique(np.round(np.concatenate(driven) / 4.0), axis=0) * 4.0 if driven else np.zeros((0, 2))
    made: list[Movement] = []
    taken = np.zeros((0, 2))
    whole = int(length)
    for index in rng.permutation(len(lines)):
        if len(made) == count:
            break
        coordinates = [(float(x), float(y)) for x, y, *_ in lines[index].coords]
        if _away(buildings, coordinates[0]) < _away(buildings, coordinates[-1]):
            coordinates.reverse()
        nose, behind = np.array(coordinates[-1]), np.array(coordinates[-2])
        heading = math.atan2(*(nose - behind))
        name = _TYPES[int(rng.integers(len(_TYPES)))]
        place = nose - TYPES[name].length / 2 * np.array([math.sin(heading), math.cos(heading)])
        near = np.hypot(*(np.concatenate([tracks, taken]) - place).T)
        if _away(buildings, (float(place[0]), float(place[1]))) < 22.0 or near.min(initial=math.inf) < clearance:
            continue
        if np.hypot(*(ways - place).T).min(initial=math.inf) < wing_clearance:
            continue
        taken = np.append(taken, [place], axis=0)
        n = whole + 1
        made.append(
            Movement(
                name, "", "", 0.0, np.full(n, place[0]), np.full(n, place[1]), np.zeros(n), np.full(n, heading),
                np.zeros(n), np.ones(n, bool), np.zeros(n, bool),
            )
        )  # fmt: skip
    return made


def _away(buildings: STRtree, place: tuple[float, float]) -> float:
    point = Point(place)
    nearest = buildings.geometries.take(buildings.nearest(point))
    return float(distance(nearest, point))
