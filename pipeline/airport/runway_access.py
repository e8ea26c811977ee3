"""The taxiways between the runways and their holding positions: walked outward from the pavement of a runway."""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from shapely.geometry import LineString, Polygon

from pipeline.airport.model import Feature, TaxiGraph

STEP = 4.0
PARALLEL = math.radians(5.0)
"""Between a runway and a lane alongside: one that draws away faster is a way out, such as a rapid exit."""
ROOM = 100.0
"""Metres beyond the distance that a walk goes on to get clear of another runway."""


@dataclass(frozen=True)
class Lanes:
    """The taxiway lines as points no more than STEP apart. owner: feature index of the line a point is on."""

    points: NDArray[np.float64]
    owner: NDArray[np.int32]
    neighbours: list[list[tuple[int, float]]]
    tree: cKDTree | None

    def nearest(self, position: tuple[float, float], within: float) -> int | None:
        """The point nearest to a place, None when it is further off than `within`."""
        if self.tree is None:
            return None
        distance, index = self.tree.query(position)
        return int(index) if distance <= within else None

    def crossing(self, line: LineString) -> set[int]:
        """The points at which lanes cross a line: what a bar across a taxiway stops."""
        if self.tree is None:
            return set()
        middle = line.interpolate(0.5, normalized=True)
        near = self.tree.query_ball_point((middle.x, middle.y), line.length / 2 + STEP)
        within = shapely.dwithin(shapely.points(self.points[near]), line, STEP / 2 + 0.1)
        return {int(one) for one, is_at in zip(near, np.atleast_1d(within), strict=True) if is_at}

    def direction(self, point: int) -> tuple[float, float] | None:
        """A unit vector along the lane at a point."""
        around = [self.points[one] for one, _ in self.neighbours[point]]
        if not around:
            return None
        step = around[0] - (around[1] if len(around) > 1 else self.points[point])
        length = float(np.hypot(*step))
        return (float(step[0] / length), float(step[1] / length)) if length > 0 else None


@dataclass
class Access:
    """What was walked from one runway. inside: (points,) within the holding positions or the distance.

    before: the point nearer to the runway on the way there. crossings: where the walk ended, as (point, reason):
    "distance", "alongside", and with `keep_clear` "no room" and "another runway". held: blocked points met.
    """

    inside: NDArray[np.bool_]
    before: dict[int, int] = field(default_factory=dict)
    length: dict[int, float] = field(default_factory=dict)
    crossings: list[tuple[int, str]] = field(default_factory=list)
    held: set[int] = field(default_factory=set)

    def trace(self, point: int, back: float) -> list[int]:
        """Points from `point` towards the runway, for `back` metres of way."""
        trail = [point]
        while trail[-1] in self.before and self.length[point] - self.length[trail[-1]] < back:
            trail.append(self.before[trail[-1]])
        return trail


def taxi_lanes(features: Sequence[Feature], graph: TaxiGraph) -> Lanes:
    """Sample the taxiway edges of the graph (neither stand lines nor runway centrelines)."""
    points = [np.asarray(graph.nodes, float).reshape(-1, 2)]
    count = len(graph.nodes)
    owner = [-1] * count
    neighbours: list[list[tuple[int, float]]] = [[] for _ in graph.nodes]
    for start, end, length, feature, line in graph.edges:
        if features[feature].kind != "TaxiwayGuidanceLine":
            continue
        pieces = max(1, math.ceil(length / STEP))
        inner = shapely.get_coordinates(shapely.line_interpolate_point(line, np.arange(1, pieces) * (length / pieces)))
        points.append(inner)
        chain = [start, *range(count, count + len(inner)), end]
        count += len(inner)
        neighbours.extend([] for _ in inner)
        owner.extend([feature] * len(inner))
        owner[start] = owner[end] = feature
        for one, other in pairwise(chain):
            neighbours[one].append((other, length / pieces))
            neighbours[other].append((one, length / pieces))
    every = np.vstack(points)
    return Lanes(every, np.array(owner, np.int32), neighbours, cKDTree(every) if len(every) else None)


def walk_outward(
    lanes: Lanes,
    strip: Polygon,
    centreline: LineString,
    others: Sequence[Polygon],
    distance: float,
    blocked: Sequence[int] | set[int],
    width: float = 45.0,
    keep_clear: NDArray[np.bool_] | None = None,
) -> Access:
    """Walk from the pavement of a runway until a blocked point, another runway, a lane alongside, or the distance.

    A lane that runs alongside the runway within the distance (at small aerodromes) is outside: traffic on it is not
    about to enter. keep_clear: (points,) where the walk does not end though it has left the distance, because nobody
    may wait there; after ROOM metres more it gives up. Dijkstra, so `before` leads back the shortest way.
    """
    east, north = lanes.points.T
    access = Access(np.zeros(len(lanes.points), np.bool_))
    if not len(east):
        return access
    away: NDArray[np.float64] = np.asarray(shapely.distance(shapely.points(lanes.points), centreline))
    at_runway = shapely.contains_xy(strip.buffer(1.0), east, north)  # a taxiway may meet the very end
    at_other = np.zeros(len(east), np.bool_)
    for other in others:
        at_other |= shapely.contains_xy(other, east, north)
    at_other &= ~at_runway
    along, abeam = _beside(lanes, centreline)
    kept_clear = np.zeros(len(east), np.bool_) if keep_clear is None else keep_clear
    stop = set(blocked)
    queue = [(0.0, int(point), -1) for point in np.flatnonzero(at_runway)]
    while queue:
        length, point, came = heapq.heappop(queue)
        if point in access.length:
            continue
        access.length[point] = length
        if came >= 0:
            access.before[point] = came
        if point in stop and not at_runway[point]:
            access.held.add(point)
            access.inside[point] = True
            continue
        if at_other[point]:
            if keep_clear is not None:
                access.crossings.append((point, "another runway"))
            continue
        if away[point] > distance and (not kept_clear[point] or away[point] > distance + ROOM):
            access.crossings.append((point, "no room" if kept_clear[point] else "distance"))
            continue
        if abeam[point] and width / 2 + 20.0 < away[point] <= distance and _alongside(lanes, access, point, along):
            access.crossings.append((point, "alongside"))
            continue
        access.inside[point] = True
        for other_point, step in lanes.neighbours[point]:
            if other_point not in access.length:
                heapq.heappush(queue, (0.0 if at_runway[other_point] else length + step, other_point, point))
    _leave_lanes_alongside(access, width, away)
    access.inside |= at_runway | at_other  # a lane on the pavement of a runway that crosses is not outside
    return access


def _beside(lanes: Lanes, centreline: LineString) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """The direction of a runway, and (points,) which lie beside it: a lane off its end leads to it."""
    start, end = np.asarray(centreline.coords[0]), np.asarray(centreline.coords[-1])
    along = (end - start) / np.hypot(*(end - start))
    forward = (lanes.points - start) @ along
    return along, (forward >= 0.0) & (forward <= centreline.length)


def _alongside(lanes: Lanes, access: Access, point: int, along: NDArray[np.float64]) -> bool:
    trail = access.trace(point, 40.0)
    chord = lanes.points[trail[0]] - lanes.points[trail[-1]]
    length = float(np.hypot(*chord))
    return length > 30.0 and abs(float(chord @ along)) > math.cos(PARALLEL) * length


def _leave_lanes_alongside(access: Access, width: float, away: NDArray[np.float64]) -> None:
    """The lane alongside was noticed late: give back what was walked of it, and the turn into it."""
    for place, (point, reason) in enumerate(access.crossings):
        if reason != "alongside":
            continue
        trail = access.trace(point, 65.0)
        for one in trail[:-1]:
            if away[one] < width / 2 + 15.0:
                break
            access.inside[one] = False
            access.crossings[place] = one, reason
