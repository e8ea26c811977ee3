"""Runways from OpenStreetMap: the ways of one runway joined, turned, measured and named.

Code numbers, default widths and distances: ICAO Annex 14 Volume I, tables 1-1, 3-1 and 3-2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry import LineString, MultiPolygon, Point, Polygon

from pipeline.airport.frame import LocalFrame
from pipeline.airport.osm.designators import (
    are_opposite,
    misfit,
    opposite_designator,
    read_designators,
    runway_id,
    sorted_ends,
)
from pipeline.airport.osm.elements import Element, Findings, point_of
from pipeline.airport.osm.runway_parts import RunwayPart, lose, published_designators, runway_parts

HOLD_DISTANCE = {4: 90.0, 3: 75.0, 2: 40.0, 1: 40.0}
"""Metres from the centreline to a holding position, by runway code number."""
LOW_VISIBILITY_DISTANCE = {4: 150.0, 3: 150.0, 2: 90.0, 1: 90.0}
"""Metres from the centreline that are protected in low visibility, by runway code number."""
DEFAULT_WIDTH = {4: 45.0, 3: 30.0, 2: 23.0, 1: 18.0}

SHORTEST = 250.0
JOIN_TOUCHING = 8.0
JOIN_SAME_NAME = 300.0
UNNAMED_SHORTEST = 600.0
"""Metres. A strip without designators that is shorter, and shorter than UNNAMED_SHARE of the longest runway that has
some, is a landing area for helicopters, models or parachutists: Annex 14 wants designators on every runway."""
UNNAMED_SHARE = 0.25
UNLIKELY = 25.0
"""Degrees between direction and designators beyond which somebody has to look: half of the 5 degrees of rounding more
than the magnetic variation where most airports are."""
IMPOSSIBLE = 80.0
"""Degrees beyond which it cannot be told which end a designator means."""


def runway_code(length: float) -> int:
    """The code number by length; it stands in for the reference field length, which maps do not tell."""
    return 4 if length >= 1800 else 3 if length >= 1200 else 2 if length >= 800 else 1


@dataclass
class RunwayDraft:
    """A runway being made. start, end: of the pavement, in the direction of designators[0].

    displaced: metres from either pavement end to its threshold. derived: what the map did not say. reference: the
    "ref" as it was written.
    """

    start: Point
    end: Point
    width: float
    designators: tuple[str, str]
    source: list[str]
    surface: str = ""
    area: Polygon | MultiPolygon | None = None
    displaced: tuple[float, float] = (0.0, 0.0)
    stopways: list[tuple[str, Polygon]] = field(default_factory=list)
    derived: set[str] = field(default_factory=set)
    id: str = ""
    name: str = ""
    reference: str = ""

    @property
    def length(self) -> float:
        """Metres of pavement between both ends."""
        return float(self.start.distance(self.end))

    @property
    def heading(self) -> float:
        """Rad, of designators[0]."""
        return math.atan2(self.end.x - self.start.x, self.end.y - self.start.y)

    @property
    def centreline(self) -> LineString:
        """From pavement end to pavement end."""
        return LineString([self.start, self.end])

    @property
    def code(self) -> int:
        """Code number by length."""
        return runway_code(self.length)

    def at(self, along: float) -> Point:
        """The point so many metres from the start along the centreline, or along its extension."""
        return Point(self.start.x + along * math.sin(self.heading), self.start.y + along * math.cos(self.heading))

    def strip(self) -> Polygon:
        """The paved polygon."""
        if isinstance(self.area, Polygon):
            return self.area
        return Polygon(self.centreline.buffer(self.width / 2, cap_style="flat"))


def make_runways(elements: list[Element], frame: LocalFrame, findings: Findings) -> list[RunwayDraft]:
    """All runways in use, the longest first."""
    pieces, areas = runway_parts(elements, frame, findings)
    drafts = [_draft(group) for group in _groups([one for one in pieces if one.role == "runway"])]
    drafts += _from_areas(areas, drafts, findings)
    named = [one.length for one in drafts if one.designators[0]]
    unnamed_shortest = min(UNNAMED_SHORTEST, UNNAMED_SHARE * max(named, default=0.0))
    kept: list[RunwayDraft] = []
    for draft in sorted(drafts, key=lambda one: -one.length):
        if draft.length < SHORTEST:
            lose(findings, draft.reference, draft.source, "runway too short")
        elif not draft.designators[0] and draft.length < unnamed_shortest:
            lose(findings, draft.reference, draft.source, "short strip without designators")
        elif any(_same_place(draft, other) for other in kept):
            lose(findings, draft.reference, draft.source, "runway drawn twice")
        else:
            kept.append(draft)
    made = _named(kept, frame, findings)
    for piece in pieces:
        if piece.role != "runway" and not _attach(piece, made):
            lose(findings, piece.element.name, [piece.element.id], "part of no runway")
    for element in elements:
        if element.type == "node" and element.aeroway in ("threshold", "displaced_threshold"):
            _move_threshold(point_of(element, frame), read_designators(element.name), made)
    return made


def _axis(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    centre = points.mean(axis=0)
    _, _, axes = np.linalg.svd(points - centre, full_matrices=False)
    return centre, axes[0]


def _collinear(one: LineString, other: LineString) -> bool:
    points = np.asarray(one.coords)
    long = points if one.length >= other.length else np.asarray(other.coords)
    short = other if one.length >= other.length else one
    centre, axis = _axis(long)
    offset = np.asarray(short.coords) - centre
    across = np.abs(offset[:, 0] * axis[1] - offset[:, 1] * axis[0])
    step = np.asarray(short.coords[-1]) - np.asarray(short.coords[0])
    turn = abs(step[0] * axis[1] - step[1] * axis[0]) / max(float(np.hypot(*step)), 1e-9)
    return bool(across.max() < 12.0) and (turn < 0.06 or short.length < 100.0)


def _groups(pieces: list[RunwayPart]) -> list[list[RunwayPart]]:
    groups: list[list[RunwayPart]] = [[one] for one in pieces]
    joined = True
    while joined:
        joined = False
        for first in range(len(groups)):
            for second in range(first + 1, len(groups)):
                if any(_belong(a, b) for a in groups[first] for b in groups[second]):
                    groups[first].extend(groups.pop(second))
                    joined = True
                    break
            if joined:
                break
    return groups


def _belong(one: RunwayPart, other: RunwayPart) -> bool:
    both = one.designators is not None and other.designators is not None
    if both and runway_id(one.designators or ("", "")) != runway_id(other.designators or ("", "")):
        return False
    gap = one.line.distance(other.line)
    return gap <= (JOIN_SAME_NAME if both else JOIN_TOUCHING) and _collinear(one.line, other.line)


def _draft(group: list[RunwayPart]) -> RunwayDraft:
    points = np.vstack([np.asarray(one.line.coords) for one in group])
    centre, axis = _axis(points)
    along = (points - centre) @ axis
    start, end = (Point(*(centre + axis * float(one))) for one in (along.min(), along.max()))
    longest = max(group, key=lambda one: one.line.length)
    known = next((one for one in sorted(group, key=lambda one: -one.line.length) if one.designators), None)
    widths = [one.width for one in group if one.width]
    draft = RunwayDraft(
        start,
        end,
        max(widths) if widths else DEFAULT_WIDTH[runway_code(start.distance(end))],
        (known.designators if known else None) or ("", ""),
        sorted({one.element.id for one in group}),
        surface=longest.element.tags.get("surface", ""),
        name=longest.element.tags.get("name", ""),
        reference=(known or longest).element.name,
    )
    if not widths:
        draft.derived.add("width")
    return draft


def _from_areas(
    areas: list[tuple[Element, Polygon | MultiPolygon]], drafts: list[RunwayDraft], findings: Findings
) -> list[RunwayDraft]:
    made: list[RunwayDraft] = []
    for element, area in areas:
        owner = next((one for one in drafts if one.centreline.intersection(area).length > 0.5 * one.length), None)
        if owner is not None:
            if isinstance(area, Polygon) and area.area < 4 * owner.length * owner.width:
                owner.area = area
            if not owner.designators[0]:
                owner.designators = published_designators(element) or owner.designators
            continue
        box = shapely.get_coordinates(area.minimum_rotated_rectangle)[:4]
        sides = [float(np.hypot(*(b - a))) for a, b in pairwise([*box, box[0]])]
        if max(sides) < 4 * min(sides):
            lose(findings, element.name, [element.id], "runway area without direction")
            continue
        turn = 0 if sides[0] < sides[1] else 1
        box = np.roll(box, -turn, axis=0)
        middles = (box[0] + box[1]) / 2, (box[2] + box[3]) / 2
        designators = published_designators(element) or ("", "")
        draft = RunwayDraft(Point(*middles[0]), Point(*middles[1]), min(sides), designators, [element.id])
        draft.surface = element.tags.get("surface", "")
        draft.area = area if isinstance(area, Polygon) else None
        draft.name, draft.reference = element.tags.get("name", ""), element.name
        made.append(draft)
    return made


def _same_place(one: RunwayDraft, other: RunwayDraft) -> bool:
    return bool(one.strip().intersection(other.strip()).area > 0.6 * one.strip().area)


def _named(drafts: list[RunwayDraft], frame: LocalFrame, findings: Findings) -> list[RunwayDraft]:
    made = [_turned(one, frame, findings) for one in drafts]
    by_name: dict[str, list[RunwayDraft]] = {}
    for draft in made:
        if "designators" in draft.derived:
            by_name.setdefault(runway_id(draft.designators), []).append(draft)
    for same in by_name.values():
        if len(same) in (2, 3):
            _set_sides(same)
    taken: set[str] = set()
    for draft in made:
        base = draft.id = runway_id(draft.designators)
        again = 2
        while draft.id in taken:
            draft.id = f"{base}-{again}"
            again += 1
        if draft.id != base:
            told = f"another runway is called {base} too: this one ({', '.join(draft.source)}) is {draft.id} here"
            findings.to_check.append(told)
        taken.add(draft.id)
    return made


def _turned(draft: RunwayDraft, frame: LocalFrame, findings: Findings) -> RunwayDraft:
    """Published designators stand, whatever the variation; the lower one's direction becomes the runway's."""

    def off(designator: str, turn: float = 0.0) -> float:
        return misfit(draft.heading + turn, designator, frame.latitude, frame.longitude)

    given, derived = draft.designators, set(draft.derived)
    where = f"{draft.reference or 'unnamed'} ({', '.join(draft.source)})"
    turned = min(off(given[0]), off(given[0], math.pi)) if given[0] else 0.0
    if not given[0] or not are_opposite(given) or turned > IMPOSSIBLE:
        number = f"{round(math.degrees(draft.heading) / 10 - 1) % 36 + 1:02d}"
        made = sorted_ends((number, opposite_designator(number)))
        why = "no published designators that can be read" if not given[0] else "designators that cannot be its own"
        findings.to_check.append(f"runway {where} has {why}: called {'/'.join(made)} by its direction")
        given = made
        derived.add("designators")
    elif turned > UNLIKELY:
        findings.to_check.append(
            f"runway {where} lies {turned:.0f} degrees off its designators (magnetic variation?): they are kept"
        )
    low, high = sorted_ends(given)
    start, end = draft.start, draft.end
    away = misfit(draft.heading, low, 0.0, 0.0) if "designators" in derived else off(low)
    if away > 90:
        start, end = end, start
    return replace(draft, designators=(low, high), start=start, end=end, derived=derived)


def _set_sides(same: list[RunwayDraft]) -> None:
    heading = same[0].heading
    across = [
        one.centreline.centroid.x * math.cos(heading) - one.centreline.centroid.y * math.sin(heading) for one in same
    ]
    letters = "LR" if len(same) == 2 else "LCR"
    for letter, (_, draft) in zip(letters, sorted(zip(across, same, strict=True), key=lambda one: one[0]), strict=True):
        low = draft.designators[0] + letter
        draft.designators = low, opposite_designator(low)


def _attach(piece: RunwayPart, runways: list[RunwayDraft]) -> bool:
    near = [one for one in runways if _collinear(piece.line, one.centreline)]
    near = [one for one in near if piece.line.distance(one.centreline) < 60.0]
    if not near:
        return False
    runway = min(near, key=lambda one: float(piece.line.distance(one.centreline)))
    heading = runway.heading
    points = np.asarray(piece.line.coords) - np.asarray(runway.start.coords[0])
    along = points @ np.array([math.sin(heading), math.cos(heading)])
    low, high = float(along.min()), float(along.max())
    at_start = (low + high) / 2 < runway.length / 2
    first, second = runway.displaced
    if piece.role == "stopway":
        box = LineString([runway.at(low), runway.at(high)])
        runway.stopways.append((piece.element.id, box.buffer((piece.width or runway.width) / 2, cap_style="flat")))
    elif at_start:
        runway.displaced = high - min(low, 0.0), second
        runway.start = runway.at(min(low, 0.0))
    else:
        runway.displaced = first, max(high, runway.length) - low
        runway.end = runway.at(max(high, runway.length))
    runway.source.append(piece.element.id)
    return True


def _move_threshold(point: Point, designators: tuple[str, str] | None, runways: list[RunwayDraft]) -> None:
    for runway in runways:
        if runway.centreline.distance(point) > 20.0:
            continue
        along = float(runway.centreline.project(point))
        side = 0 if along < runway.length / 2 else 1
        if designators and designators[0] in runway.designators and runway.designators.index(designators[0]) != side:
            continue
        inward = along if side == 0 else runway.length - along
        if runway.displaced[side] == 0.0 and 10.0 < inward < 0.4 * runway.length:
            both = list(runway.displaced)
            both[side] = inward
            runway.displaced = both[0], both[1]
