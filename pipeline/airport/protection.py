"""Runway protection areas: where nothing may be while the runway is used.

Laterally to the holding positions, longitudinally beyond both ends (EUROCONTROL-SPEC-171; ICAO Annex 14 table 3-2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely
from shapely.geometry import LineString, MultiLineString, Polygon
from shapely.geometry.base import BaseGeometry

from pipeline.airport.model import HoldingPosition, Runway
from pipeline.airport.runway_access import Access, Lanes, walk_outward

CLEARANCE = 16.0
"""Metres on both sides of a taxiway outside the holding positions that are not protected."""
FURTHER = 100.0
"""Metres that a holding position may lie beyond the distance and still bound the area: it then follows the taxiway."""


def protection_areas(
    runways: Sequence[Runway],
    holds: Sequence[HoldingPosition],
    lanes: Lanes,
    distances: dict[str, dict[str, float]],
    beyond_ends: float,
) -> dict[str, dict[str, Polygon]]:
    """By runway id and visibility: a rectangle about the runway, without the taxiways outside the holding positions.

    distances: metres from the centreline by runway id and visibility. In low visibility the Cat II/III positions bound
    the area, and the Cat I positions of the taxiways that have no other. An aircraft that waits where it shall is so
    never inside, wherever its position was painted.
    """
    made: dict[str, dict[str, Polygon]] = {}
    for runway in runways:
        others = [one.strip for one in runways if one.id != runway.id]
        mine = [one for one in holds if one.runway == runway.id]
        made[runway.id] = {}
        for visibility in ("normal", "low"):
            distance = distances[runway.id][visibility]
            bounding, blocked = _bounding(runway, mine, lanes, others, distance, visibility)
            walk = walk_outward(
                lanes, runway.strip, runway.centreline, others, distance + FURTHER, blocked, runway.width
            )
            made[runway.id][visibility] = _area(runway, bounding, lanes, walk, distance, beyond_ends)
    return made


def _bounding(
    runway: Runway,
    holds: Sequence[HoldingPosition],
    lanes: Lanes,
    others: Sequence[Polygon],
    distance: float,
    visibility: str,
) -> tuple[list[HoldingPosition], set[int]]:
    """The holding positions that bound the area, and their places on the lanes."""
    place = {one.id: _places(one, lanes) for one in holds}
    wanted = [one for one in holds if visibility == "low" or one.category == "CAT_I"]
    if visibility == "low":
        further = [one for one in holds if one.category == "CAT_II_III"]
        nearer = [one for one in holds if one.category == "CAT_I"]
        blocked = {point for one in further for point in place[one.id]}
        walk = walk_outward(lanes, runway.strip, runway.centreline, others, distance, blocked, runway.width)
        passed = {one for point, _ in walk.crossings for one in walk.trace(point, math.inf)}
        wanted = further + [one for one in nearer if not place[one.id] or place[one.id] & passed]
    return wanted, {point for one in wanted for point in place[one.id]}


def _places(hold: HoldingPosition, lanes: Lanes) -> set[int]:
    nearest = lanes.nearest((hold.position.x, hold.position.y), 20.0)
    return lanes.crossing(hold.line) | ({nearest} if nearest is not None else set())


def _area(
    runway: Runway, holds: Sequence[HoldingPosition], lanes: Lanes, walk: Access, distance: float, beyond: float
) -> Polygon:
    start, end = (np.asarray(one) for one in (runway.centreline.coords[0], runway.centreline.coords[-1]))
    along = (end - start) / np.hypot(*(end - start))
    axis = LineString([start - along * beyond, end + along * beyond])
    box = axis.buffer(distance, cap_style="flat")
    ways = [_box(one, -200.0, 0.0) for one in holds if runway.strip.distance(one.position) < distance]
    ways.append(_outside(lanes, walk, box).buffer(CLEARANCE, cap_style="flat"))
    in_front = shapely.unary_union([_way_in(lanes, walk, point) for point in walk.held])
    area = box.difference(shapely.unary_union(ways)).union(in_front).union(runway.strip)
    pieces = [one for one in shapely.get_parts(area) if isinstance(one, Polygon)]
    whole = max(pieces, key=lambda one: one.intersection(runway.strip).area)
    return Polygon(shapely.get_coordinates(Polygon(whole.exterior).simplify(0.5)))


def _way_in(lanes: Lanes, walk: Access, point: int) -> BaseGeometry:
    """The taxiway from a holding position to the runway."""
    trail = walk.trace(point, math.inf)
    return LineString(lanes.points[trail]).buffer(CLEARANCE, cap_style="flat") if len(trail) > 1 else Polygon()


def _box(hold: HoldingPosition, low: float, high: float) -> Polygon:
    """As wide as a taxiway with its clearance, from `low` to `high` metres ahead of the bar."""
    ahead = np.array([math.sin(hold.heading), math.cos(hold.heading)])
    position = np.array([hold.position.x, hold.position.y])
    return LineString([position + ahead * low, position + ahead * high]).buffer(CLEARANCE, cap_style="flat")


def _outside(lanes: Lanes, walk: Access, area: BaseGeometry) -> BaseGeometry:
    """The lanes near the area that were not walked: traffic there is not before this runway."""
    near = np.asarray(shapely.dwithin(shapely.points(lanes.points), area, CLEARANCE + 5.0))
    pieces = [
        (lanes.points[one], lanes.points[other])
        for one in np.flatnonzero(near)
        for other, _ in lanes.neighbours[one]
        if other > one and not (walk.inside[one] and walk.inside[other])
    ]
    return shapely.line_merge(MultiLineString(pieces))
