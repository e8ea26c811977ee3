"""Holding positions: each given to its runway and turned towards it; the missing ones derived.

Distances: ICAO Annex 14 Volume I, table 3-2 (by runway code number, see runways.HOLD_DISTANCE).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry import LineString, Point

from pipeline.airport.frame import LocalFrame
from pipeline.airport.model import Feature
from pipeline.airport.osm.designators import numbers_and_sides, read_designators, runway_id, sorted_ends
from pipeline.airport.osm.elements import Element, point_of, values_of
from pipeline.airport.osm.runways import HOLD_DISTANCE, LOW_VISIBILITY_DISTANCE, RunwayDraft
from pipeline.airport.runway_access import Access, Lanes, walk_outward

REACH = 700.0
"""Metres of taxiway within which a position that is said to guard a runway must reach it."""
UNTYPED_REACH = 260.0
FURTHER_OUT = 300.0
PASSED = 300.0
LOW_VISIBILITY = ("ils", "cat", "critical")


@dataclass
class _Hold:
    id: str
    name: str
    point: Point
    kind: str
    wanted: str
    source: str
    lane: int | None = None
    runway: int = -1
    heading: float = 0.0
    width: float = 23.0
    derived: bool = False


def make_holds(
    elements: list[Element],
    runways: Sequence[RunwayDraft],
    lanes: Lanes,
    features: Sequence[Feature],
    frame: LocalFrame,
) -> list[Feature]:
    """TaxiwayHoldingPosition features, mapped ones first, then the derived ones; and the intermediate positions."""
    found = [_read(one, runways, lanes, features, frame) for one in elements if one.aeroway == "holding_position"]
    guarded = {one.lane for one in found if one.kind == "CAT_I" and one.lane is not None}
    free = [_walk(one, runways, lanes, set()) for one in runways]
    held = [_walk(one, runways, lanes, guarded) for one in runways]
    for hold in found:
        _assign(hold, runways, lanes, free, held)
    kept = _without_repeats(found)
    derived = [one for number in range(len(runways)) for one in _derive(number, runways, kept, lanes, features)]
    kept += _without_repeats(derived)
    return [_feature(one, runways) for one in kept]


def _read(
    element: Element, runways: Sequence[RunwayDraft], lanes: Lanes, features: Sequence[Feature], frame: LocalFrame
) -> _Hold:
    point = point_of(element, frame)
    told = (element.tags.get("holding_position:type") or element.tags.get("holding_position") or "").lower()
    kind = "untyped"
    if {"runway", "hold_short"} & set(values_of(told)):
        kind = "CAT_I"
    elif any(one in told for one in LOW_VISIBILITY):
        kind = "CAT_II_III"
    elif told:
        kind = "land_and_hold_short" if told == "lahso" else "intermediate"
    wanted, name = _runway_in(element.tags.get("ref", ""), runways)
    hold = _Hold(element.id, name, point, kind, wanted, element.id)
    hold.lane = lanes.nearest((point.x, point.y), 20.0)
    if hold.lane is not None:
        _take_taxiway(hold, lanes, features)
    return hold


def _runway_in(ref: str, runways: Sequence[RunwayDraft]) -> tuple[str, str]:
    """(runway id or "", name) from what mappers write: "W37@07/25", "24-06", "A1", "NO ENTRY"."""
    name, _, place = ref.partition("@")
    designators = read_designators(place or name)
    wanted = ""
    if designators:
        exact = [one.id for one in runways if runway_id(one.designators) == runway_id(designators)]
        near = [one.id for one in runways if numbers_and_sides(one.designators) == sorted_ends(designators)]
        wanted = next(iter(exact or near), "")
    a_runway = designators and (wanted or numbers_and_sides(designators) == sorted_ends(designators))
    if not place and (a_runway or "ENTRY" in name.upper()):
        name = ""
    return wanted, re.sub(r"\s+", " ", name).strip()


def _take_taxiway(hold: _Hold, lanes: Lanes, features: Sequence[Feature]) -> None:
    owner = int(lanes.owner[hold.lane or 0])
    if owner < 0:
        return
    hold.width = float(features[owner].properties.get("width_m", 23.0))
    hold.name = hold.name or features[owner].name


def _walk(runway: RunwayDraft, runways: Sequence[RunwayDraft], lanes: Lanes, blocked: set[int]) -> Access:
    others = [one.strip() for one in runways if one is not runway]
    return walk_outward(lanes, runway.strip(), runway.centreline, others, 400.0, blocked, runway.width)


def _assign(
    hold: _Hold, runways: Sequence[RunwayDraft], lanes: Lanes, free: Sequence[Access], held: Sequence[Access]
) -> None:
    """Find the runway. free, held: the ways to each runway, and those that pass no other position."""
    if hold.kind == "land_and_hold_short" or not runways:
        _turn_along(hold, lanes, None)
        return
    reach = {"untyped": UNTYPED_REACH, "intermediate": 0.0}.get(hold.kind, REACH)
    ways = [_way(one, hold, *walks) for one, walks in zip(runways, zip(free, held, strict=True), strict=True)]
    for number, runway in enumerate(runways):
        if hold.wanted == runway.id and hold.kind != "intermediate" and runway.centreline.distance(hold.point) < 400.0:
            hold.runway = number
    if hold.runway < 0 and min(length for length, _ in ways) <= reach:
        hold.runway = min(range(len(ways)), key=lambda number: ways[number][0])
    if hold.runway < 0:
        hold.kind = "intermediate"
        _turn_along(hold, lanes, None)
        return
    runway = runways[hold.runway]
    if hold.kind == "untyped":
        far = 1.25 * HOLD_DISTANCE[runway.code]
        hold.kind = "CAT_I" if runway.centreline.distance(hold.point) < max(far, 120.0) else "CAT_II_III"
    _turn_along(hold, lanes, runway, ways[hold.runway][1])


def _way(runway: RunwayDraft, hold: _Hold, free: Access, held: Access) -> tuple[float, Access]:
    """Metres of taxiway to the runway, and the walk they come from.

    Where the map has no taxiway, metres over the ground, held for a longer way. A way past another position counts for
    longer: it is the other one that guards the runway there.
    """
    straight = float(runway.centreline.distance(hold.point)) - runway.width / 2
    if straight < 8.0:
        return math.inf, free
    if hold.lane is None:
        return (2.0 * straight if straight < 150.0 else math.inf), free
    if hold.kind == "CAT_II_III":
        return free.length.get(hold.lane, math.inf), free
    if hold.lane in held.length:
        return held.length[hold.lane], held
    return free.length.get(hold.lane, math.inf) + PASSED, free


def _turn_along(hold: _Hold, lanes: Lanes, runway: RunwayDraft | None, walk: Access | None = None) -> None:
    lane = lanes.direction(hold.lane) if hold.lane is not None else None
    if runway is None:
        hold.heading = math.atan2(*lane) if lane else 0.0
        return
    nearest = runway.centreline.interpolate(runway.centreline.project(hold.point))
    towards = np.array([nearest.x - hold.point.x, nearest.y - hold.point.y])
    towards = towards / max(float(np.hypot(*towards)), 1e-9)
    if walk is not None and hold.lane in walk.before:
        trail = walk.trace(hold.lane or 0, 8.0)  # the taxiway itself, round bends and at junctions
        step = lanes.points[trail[-1]] - lanes.points[trail[0]]
        hold.heading = math.atan2(step[0], step[1])
        return
    ahead = np.array(lane) if lane else towards
    turn = float(ahead @ towards)
    ahead = ahead if turn >= 0 else -ahead
    hold.heading = math.atan2(ahead[0], ahead[1])


def _without_repeats(holds: list[_Hold]) -> list[_Hold]:
    kept: list[_Hold] = []
    for hold in holds:
        near = 8.0 if hold.derived else 2.0
        if not any(
            one.runway == hold.runway and one.point.distance(hold.point) < near and one.kind == hold.kind
            for one in kept
        ):
            kept.append(hold)
    return kept


def _derive(
    number: int, runways: Sequence[RunwayDraft], known: list[_Hold], lanes: Lanes, features: Sequence[Feature]
) -> Iterator[_Hold]:
    runway = runways[number]
    mine = [one for one in known if one.runway == number and one.kind == "CAT_I"]
    blocked = {one for hold in mine for one in lanes.crossing(_bar(hold))}
    blocked |= {hold.lane for hold in mine if hold.lane is not None}
    others = [one.strip() for one in runways if one is not runway]
    distance = HOLD_DISTANCE[runway.code]
    walk = walk_outward(lanes, runway.strip(), runway.centreline, others, distance, blocked, runway.width)
    for point, _ in walk.crossings:
        east, north = (float(one) for one in lanes.points[point])
        trail = walk.trace(point, 12.0)
        inward = lanes.points[trail[-1]] - lanes.points[point]
        length = float(np.hypot(*inward))
        if length == 0 or any(_guards(one, east, north, inward / length) for one in mine):
            continue
        if _held_further_out(lanes, point, trail[-1], blocked):
            continue
        owner = int(lanes.owner[point])
        name = features[owner].name if owner >= 0 else ""
        source = str(features[owner].properties.get("source", "")) if owner >= 0 else ""
        id = f"hold/{runway.id.replace('/', '-')}/{round(east)}/{round(north)}"
        hold = _Hold(id, name, Point(east, north), "CAT_I", runway.id, source, point, number, derived=True)
        _take_taxiway(hold, lanes, features)
        _turn_along(hold, lanes, runway, walk)
        yield hold


def _guards(hold: _Hold, east: float, north: float, inward: np.ndarray) -> bool:
    """Is a mapped position a little further out on the same way?"""
    outward = np.array([hold.point.x - east, hold.point.y - north])
    length = float(np.hypot(*outward))
    return length < 12.0 or (length < 70.0 and float(-outward @ inward) > 0.8 * length)


def _held_further_out(lanes: Lanes, point: int, inner: int, holds: set[int]) -> bool:
    """Does every way further out meet a mapped position (as on rapid exits, and where two taxiways join)?"""
    away = lanes.points[point] - lanes.points[inner]
    seen = {inner, point}
    ends = [(point, 0.0)]
    while ends:
        here, walked = ends.pop()
        if here in holds:
            continue
        ahead = [(one, step) for one, step in lanes.neighbours[here] if one not in seen]
        if here == point:  # the points passed on the way here lie behind
            ahead = [one for one in ahead if float((lanes.points[one[0]] - lanes.points[point]) @ away) > 0]
        if not ahead or walked > FURTHER_OUT:
            return False
        seen.update(one for one, _ in ahead)
        ends.extend((one, walked + step) for one, step in ahead)
    return True


def _bar(hold: _Hold) -> LineString:
    across = np.array([math.cos(hold.heading), -math.sin(hold.heading)]) * (hold.width / 2)
    centre = np.array([hold.point.x, hold.point.y])
    return LineString([centre - across, centre + across])


def _feature(hold: _Hold, runways: Sequence[RunwayDraft]) -> Feature:
    line = _bar(hold)
    heading = round(math.degrees(hold.heading) % 360, 1)
    properties: dict[str, object] = {"heading_deg": heading % 360, "source": hold.source}
    if hold.runway < 0:
        kind = (
            "LandAndHoldShortOperationLocation" if hold.kind == "land_and_hold_short" else "TaxiwayIntersectionMarking"
        )
        return Feature(hold.id, kind, hold.name, line, properties)
    runway = runways[hold.runway]
    properties |= {
        "position": (hold.point.x, hold.point.y),
        "runway": runway.id,
        "category": hold.kind,
        "derived": hold.derived,
        "distance_m": round(float(shapely.distance(hold.point, runway.centreline)), 1),
        "low_visibility_distance_m": LOW_VISIBILITY_DISTANCE[runway.code],
    }
    return Feature(hold.id, "TaxiwayHoldingPosition", hold.name, line, properties)
