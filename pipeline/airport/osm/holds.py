"""Holding positions: each given to its runway and turned towards it; the missing ones derived.

Distances: ICAO Annex 14 Volume I, table 3-2 (by runway code number, see runways.HOLD_DISTANCE).
"""

from __future__ import annotations

import heapq
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, Point

from pipeline.airport.frame import LocalFrame
from pipeline.airport.model import Feature
from pipeline.airport.osm.designators import numbers_and_sides, read_designators, runway_id, sorted_ends
from pipeline.airport.osm.elements import Element, Findings, point_of, values_of
from pipeline.airport.osm.runways import HOLD_DISTANCE, LOW_VISIBILITY_DISTANCE, RunwayDraft
from pipeline.airport.runway_access import STEP, Access, Lanes, walk_outward

REACH = 700.0
"""Metres of taxiway within which a position that is said to guard a runway must reach it."""
UNTYPED_REACH = 260.0
FURTHER_OUT = REACH
"""Metres of taxiway within which a mapped position further out spares a derived one."""
SNAP = 40.0
"""Metres from the line of a taxiway within which a position is on it: some are drawn at its edge or on its shoulder."""
CROSSING_TO_RUNWAY = 12.0
"""Metres of taxiway over which the direction towards the runway is taken."""
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
    guessed: bool = False
    """Is it taken for a low-visibility position only because it is far out?"""


def make_holds(
    elements: list[Element],
    runways: Sequence[RunwayDraft],
    lanes: Lanes,
    features: Sequence[Feature],
    frame: LocalFrame,
    findings: Findings,
) -> list[Feature]:
    """TaxiwayHoldingPosition features, mapped ones first, then the derived ones; and the intermediate positions.

    Where a derived one had to be nearer to its runway than it should, or found no room, `findings` says so.
    """
    found = [_read(one, runways, lanes, features, frame) for one in elements if one.aeroway == "holding_position"]
    guarded = {one.lane for one in found if one.kind == "CAT_I" and one.lane is not None}
    free = [_walk(one, runways, lanes, set()) for one in runways]
    held = [_walk(one, runways, lanes, guarded) for one in runways]
    for hold in found:
        _assign(hold, runways, lanes, free, held)
    for hold in found:
        if hold.guessed and not _behind_another(hold, found, free):
            hold.kind = "CAT_I"
    kept = _without_repeats(found)
    if len(kept) < len(found):
        findings.left_out["holding position drawn twice"] += len(found) - len(kept)
    derived = [
        one for number in range(len(runways)) for one in _derive(number, runways, kept, lanes, features, findings)
    ]
    derived = _without_repeats(derived)
    for hold in derived:
        _say_too_near(findings, runways[hold.runway], hold)
    kept += derived
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
    hold.lane = lanes.nearest((point.x, point.y), SNAP)
    if hold.lane is not None:
        _take_taxiway(hold, lanes, features)
        on_lane = Point(lanes.points[hold.lane])
        if point.distance(on_lane) > hold.width / 2 + STEP:  # its bar would cross no traffic
            hold.point = on_lane
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
        hold.guessed = runway.centreline.distance(hold.point) >= max(far, 120.0)
        hold.kind = "CAT_II_III" if hold.guessed else "CAT_I"
    _turn_along(hold, lanes, runway, ways[hold.runway][1])


def _behind_another(hold: _Hold, found: Sequence[_Hold], free: Sequence[Access]) -> bool:
    """Does the way in pass a nearer position of the same runway?"""
    if hold.lane is None:
        return True
    nearer = {one.lane for one in found if one.runway == hold.runway and one.kind == "CAT_I"}
    return bool(nearer & set(free[hold.runway].trace(hold.lane, math.inf)[1:]))


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
    number: int,
    runways: Sequence[RunwayDraft],
    known: list[_Hold],
    lanes: Lanes,
    features: Sequence[Feature],
    findings: Findings,
) -> Iterator[_Hold]:
    """Positions on the ways to a runway that pass no mapped one: at its distance, and clear of the other runways."""
    runway = runways[number]
    mine = [one for one in known if one.runway == number and one.kind == "CAT_I"]
    blocked = {one for hold in mine for one in lanes.crossing(_bar(hold))}
    blocked |= {hold.lane for hold in mine if hold.lane is not None}
    facing = {hold.lane: hold.heading for hold in known if hold.runway not in (-1, number) and hold.kind == "CAT_I"}
    others = [one for one in runways if one is not runway]
    distance = HOLD_DISTANCE[runway.code]
    near = _near(others, lanes)
    walk = walk_outward(
        lanes, runway.strip(), runway.centreline, [one.strip() for one in others], distance, blocked, runway.width, near
    )
    ends = {point for point, reason in walk.crossings if reason in ("distance", "alongside")}
    for point, reason in walk.crossings:
        name = _taxiway_name(point, lanes, features)
        if near[point] or reason not in ("distance", "alongside"):
            _say_no_room(findings, runway, name)
            continue
        trail = walk.trace(point, CROSSING_TO_RUNWAY)
        inward = lanes.points[trail[-1]] - lanes.points[point]
        east, north = (float(one) for one in lanes.points[point])
        length = float(np.hypot(*inward))
        if length == 0 or any(_guards(one, east, north, inward / length) for one in mine):
            continue
        if ends & set(walk.trace(point, math.inf)[1:]):  # who passes here meets the other one further in
            continue
        if _held_further_out(lanes, point, trail[-1], blocked, facing, runway, others):
            continue
        id = f"hold/{runway.id.replace('/', '-')}/{round(east)}/{round(north)}"
        owner = int(lanes.owner[point])
        source = str(features[owner].properties.get("source", "")) if owner >= 0 else ""
        hold = _Hold(id, name, Point(east, north), "CAT_I", runway.id, source, point, number, derived=True)
        _take_taxiway(hold, lanes, features)
        _turn_along(hold, lanes, runway, walk)
        yield hold


def _near(runways: Sequence[RunwayDraft], lanes: Lanes) -> NDArray[np.bool_]:
    """(points,) where who waits is in the way of one of these runways."""
    points = shapely.points(lanes.points)
    made = np.zeros(len(lanes.points), np.bool_)
    for one in runways:
        made |= np.asarray(shapely.distance(points, one.centreline)) <= HOLD_DISTANCE[one.code]
    return made


def _taxiway_name(point: int, lanes: Lanes, features: Sequence[Feature]) -> str:
    owner = int(lanes.owner[point])
    return features[owner].name if owner >= 0 else ""


def _say_no_room(findings: Findings, runway: RunwayDraft, taxiway: str) -> None:
    told = (
        f"no holding position of runway {runway.id} is derived on taxiway {taxiway or '(unnamed)'}: there is no room "
        "between it and another runway"
    )
    if told not in findings.to_check:
        findings.to_check.append(told)


def _say_too_near(findings: Findings, runway: RunwayDraft, hold: _Hold) -> None:
    away, distance = float(runway.centreline.distance(hold.point)), HOLD_DISTANCE[runway.code]
    if away < distance:
        findings.to_check.append(
            f"the holding position derived on taxiway {hold.name or '(unnamed)'} is {away:.0f} m from the centreline "
            f"of runway {runway.id}, nearer than the {distance:.0f} m of its code number: a taxiway runs alongside"
        )


def _guards(hold: _Hold, east: float, north: float, inward: np.ndarray) -> bool:
    """Is a mapped position a little further out on the same way?"""
    outward = np.array([hold.point.x - east, hold.point.y - north])
    length = float(np.hypot(*outward))
    return length < 12.0 or (length < 70.0 and float(-outward @ inward) > 0.8 * length)


def _held_further_out(
    lanes: Lanes,
    point: int,
    inner: int,
    holds: set[int],
    facing: Mapping[int | None, float],
    runway: RunwayDraft,
    others: Sequence[RunwayDraft],
) -> bool:
    """Does every way further out meet a mapped position (as on rapid exits, and where two taxiways join)?

    holds: points of the positions of this runway. facing: the headings of those of others, which count where who
    comes this way passes them towards their runway (as where one guards two runways that meet). A way that leads back
    to the runway itself is no way in; one from another runway is.
    """
    strip, elsewhere = runway.strip(), shapely.unary_union([one.strip() for one in others])
    shapely.prepare([strip, elsewhere])
    away = lanes.points[point] - lanes.points[inner]
    seen = {inner}
    queue = [(0.0, point, inner)]
    while queue:
        walked, here, before = heapq.heappop(queue)
        if here in holds or here in seen:
            continue
        seen.add(here)
        east, north = lanes.points[before] - lanes.points[here]
        if here in facing and east * math.sin(facing[here]) + north * math.cos(facing[here]) > 0.0:
            continue
        ahead = lanes.neighbours[here]
        if here == point:  # the points passed on the way here lie behind
            ahead = [one for one in ahead if float((lanes.points[one[0]] - lanes.points[point]) @ away) > 0]
        elif shapely.contains_xy(strip, *lanes.points[here]):
            continue
        dead_end = len(ahead) < (1 if here == point else 2)
        if dead_end or walked > FURTHER_OUT or shapely.contains_xy(elsewhere, *lanes.points[here]):
            return False
        for one, step in ahead:
            heapq.heappush(queue, (walked + step, one, here))
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
