"""Reading OpenStreetMap elements (Overpass JSON with the geometry inline) into shapes in the local frame.

Source: https://wiki.openstreetmap.org/wiki/Overpass_API/Overpass_QL#Output_Format_(out:json), "out geom".
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import shapely
from shapely.geometry import LineString, MultiPolygon, Point, Polygon
from shapely.ops import polygonize

from pipeline.airport.frame import LocalFrame

Position = tuple[float, float]

FEET = 0.3048
LIFECYCLE = ("disused", "abandoned", "razed", "demolished", "removed", "destroyed", "was", "historic")
PLANNED = ("construction", "proposed", "planned")


class ImportFault(ValueError):
    """The extract cannot be made into an airport; the message says what is missing or wrong."""


@dataclass(frozen=True)
class Element:
    """One element of the extract. parts: one list of (longitude, latitude) a way, with its role, or one point.

    id: "way/123". status: "" in use, "closed" for disused ones, "planned" for those not built yet.
    """

    id: str
    type: str
    tags: dict[str, str]
    parts: tuple[tuple[str, tuple[Position, ...]], ...]
    status: str = ""

    @property
    def aeroway(self) -> str:
        """The value of the aeroway key, looked for behind the prefixes of things out of use as well."""
        return aeroway_of(self.tags)

    @property
    def name(self) -> str:
        """What it is called: the reference before the name."""
        return (self.tags.get("ref") or self.tags.get("name") or "").strip()


@dataclass
class Extract:
    """All readable elements and how many were left out, by reason."""

    elements: list[Element] = field(default_factory=list)
    dropped: Counter[str] = field(default_factory=Counter)


def aeroway_of(tags: dict[str, str]) -> str:
    """The aeroway value of these tags, whatever prefix it stands behind; "" when there is none."""
    plain = tags.get("aeroway", "")
    if plain in PLANNED or plain in LIFECYCLE:
        return tags.get(plain, "") or plain
    if plain:
        return plain
    for prefix in (*LIFECYCLE, *PLANNED):
        if found := tags.get(f"{prefix}:aeroway", ""):
            return found
    return tags.get("area:aeroway", "")


def status_of(tags: dict[str, str]) -> str:
    """The value of Element.status that these tags mean."""
    plain = tags.get("aeroway", "")
    if plain in PLANNED or (not plain and any(f"{one}:aeroway" in tags for one in PLANNED)):
        return "planned"
    if plain in LIFECYCLE or (not plain and any(f"{one}:aeroway" in tags for one in LIFECYCLE)):
        return "closed"
    if any(tags.get(one) == "yes" for one in LIFECYCLE) or tags.get("runway") == "closed":
        return "closed"
    return "planned" if any(tags.get(one) == "yes" for one in PLANNED) else ""


def read_extract(extract: Any) -> Extract:
    """Every element with usable geometry. Raises ImportFault when this is not an Overpass document."""
    if not isinstance(extract, dict):
        raise ImportFault("not an OpenStreetMap extract: the document is not a JSON object")
    elements = extract.get("elements")
    if not isinstance(elements, list):
        raise ImportFault(
            'not an Overpass extract: it has no list "elements" (ask Overpass for [out:json] and "out geom")'
        )
    made = Extract()
    seen: set[str] = set()
    for raw in elements:
        reason = _read_element(raw, made, seen)
        if reason:
            made.dropped[reason] += 1
    return made


def _read_element(raw: Any, made: Extract, seen: set[str]) -> str:
    if not isinstance(raw, dict) or raw.get("type") not in ("node", "way", "relation"):
        return "not an element"
    tags = raw.get("tags")
    if not isinstance(tags, dict) or not tags:
        return "no tags"
    tags = {str(key): str(value).strip() for key, value in tags.items() if isinstance(value, str | int | float)}
    id = f"{raw['type']}/{raw.get('id', 0)}"
    if id in seen:
        return "element repeated"
    parts = tuple(_parts(raw))
    if not parts:
        return "no geometry"
    seen.add(id)
    made.elements.append(Element(id, raw["type"], tags, parts, status_of(tags)))
    return ""


def _parts(raw: dict[str, Any]) -> Iterator[tuple[str, tuple[Position, ...]]]:
    if raw["type"] == "node":
        position = _position(raw)
        if position is not None:
            yield "", (position,)
    elif raw["type"] == "way":
        positions = _positions(raw.get("geometry"))
        if len(positions) >= 2:
            yield "", positions
    else:
        members = raw.get("members")
        for member in members if isinstance(members, list) else []:
            if not isinstance(member, dict) or member.get("type") != "way":
                continue
            positions = _positions(member.get("geometry"))
            if len(positions) >= 2:
                yield str(member.get("role") or "outer"), positions


def _positions(geometry: Any) -> tuple[Position, ...]:
    made: list[Position] = []
    for raw in geometry if isinstance(geometry, list) else []:
        position = _position(raw)  # Overpass writes null for the nodes that a bounding box cut off
        if position is not None and (not made or made[-1] != position):
            made.append(position)
    return tuple(made)


def _position(raw: Any) -> Position | None:
    if not isinstance(raw, dict):
        return None
    latitude, longitude = raw.get("lat"), raw.get("lon")
    if not isinstance(latitude, int | float) or not isinstance(longitude, int | float):
        return None
    if not (-90 <= latitude <= 90 and -180 <= longitude <= 180):
        return None
    return float(longitude), float(latitude)


def point_of(element: Element, frame: LocalFrame) -> Point:
    """The node, or a point on whatever else it is."""
    positions = [one for _, part in element.parts for one in part]
    east, north = frame.to_local([one[1] for one in positions], [one[0] for one in positions])
    return Point(float(east.mean()), float(north.mean()))


def line_of(positions: Sequence[Position], frame: LocalFrame) -> LineString | None:
    """The way as a line in metres; None when it has no length or lies beyond the horizon."""
    east, north = frame.to_local([one[1] for one in positions], [one[0] for one in positions])
    points = [(float(x), float(y)) for x, y in zip(east, north, strict=True) if math.isfinite(x) and math.isfinite(y)]
    points = [one for place, one in enumerate(points) if place == 0 or one != points[place - 1]]
    if len(points) < 2:
        return None
    line = LineString(points)
    return line if line.length > 0.5 else None


def lines_of(element: Element, frame: LocalFrame) -> list[LineString]:
    """All ways of the element as lines."""
    found = (line_of(part, frame) for _, part in element.parts)
    return [line for line in found if line is not None]


def is_area(element: Element) -> bool:
    """A closed way or a multipolygon: its tags do not say that it is a line."""
    if element.type == "relation":
        return True
    if element.type != "way" or element.tags.get("area") == "no":
        return False
    positions = element.parts[0][1]
    return len(positions) >= 4 and positions[0] == positions[-1]


def area_of(element: Element, frame: LocalFrame) -> Polygon | MultiPolygon | None:
    """The area of a closed way or of a multipolygon relation, its outer ways stitched; None when it does not close."""
    outer: list[LineString] = []
    inner: list[LineString] = []
    roles = {role for role, _ in element.parts}
    wanted = {"outline"} if "outline" in roles else {"outer", "outline", ""}
    for role, positions in element.parts:
        line = line_of(positions, frame)
        if line is None:
            continue
        if role == "inner":
            inner.append(line)
        elif role in wanted:
            outer.append(line)
    outside = _stitched(outer)
    if outside is None:
        return None
    inside = _stitched(inner)
    area = outside if inside is None else outside.difference(inside)
    return _clean(area)


def _stitched(lines: list[LineString]) -> Any:
    if not lines:
        return None
    rings = [line for line in lines if line.is_ring or (line.coords[0] == line.coords[-1] and len(line.coords) > 3)]
    open_ends = [line for line in lines if line not in rings]
    polygons = [shapely.make_valid(Polygon(ring.coords)) for ring in rings]
    if open_ends:
        polygons.extend(polygonize(shapely.node(shapely.MultiLineString(open_ends))))
    if not polygons:
        return None
    return shapely.unary_union(polygons)


def _clean(area: Any) -> Polygon | MultiPolygon | None:
    pieces = [one for one in shapely.get_parts(shapely.make_valid(area)) if isinstance(one, Polygon) and one.area > 1.0]
    if not pieces:
        return None
    return pieces[0] if len(pieces) == 1 else MultiPolygon(pieces)


_NUMBER = re.compile(r"^\s*([0-9]+(?:[.,][0-9]+)?)\s*(m|metres?|meters?|ft|feet|foot|')?\s*(?:$|[;/x])", re.IGNORECASE)


def metres(text: str | None, least: float, most: float) -> float | None:
    """A length as OpenStreetMap writes it ("45", "45 m", "150 ft", "148'"); None when it is none or not likely."""
    found = _NUMBER.match(text or "")
    if not found:
        return None
    value = float(found[1].replace(",", "."))
    if (found[2] or "m").lower() in ("ft", "feet", "foot", "'"):
        value *= FEET
    return value if least <= value <= most else None
