"""OpenStreetMap elements: what their tags mean, and their shapes in the local frame."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import shapely
from shapely.geometry import LineString, MultiPolygon, Point, Polygon
from shapely.ops import polygonize

from pipeline.airport.frame import LocalFrame

Position = tuple[float, float]

FEET = 0.3048
LOWEST, HIGHEST = -450.0, 6000.0
"""Metres above mean sea level between which all aerodromes lie: the Dead Sea shore at -430, Daocheng at 4411."""
LIFECYCLE = ("disused", "abandoned", "razed", "demolished", "removed", "destroyed", "was", "historic")
PLANNED = ("construction", "proposed", "planned")
DECIDING = (
    "runway", "stopway", "taxiway", "taxilane", "apron", "holding_position", "parking_position", "threshold",
    "displaced_threshold", "terminal", "hangar", "control_tower", "tower", "aerodrome",
)  # fmt: skip
"""Of several aeroway values of one element the first of these decides what it is."""


class ImportFault(ValueError):
    """The extract cannot be made into an airport; the message says what is missing or wrong."""


@dataclass(frozen=True)
class Element:
    """One element of the extract. parts: one list of (longitude, latitude) a way, with its role, or one point.

    id: "way/123". status: "" in use, "closed" for disused ones, "planned" for those not built yet. gaps: how many of
    its points the extract does not hold.
    """

    id: str
    type: str
    tags: dict[str, str]
    parts: tuple[tuple[str, tuple[Position, ...]], ...]
    status: str = ""
    gaps: int = 0

    @property
    def aeroway(self) -> str:
        """The value of the aeroway key that decides, looked for behind the prefixes of things out of use as well."""
        return next(iter(aeroways_of(self.tags)), "")

    @property
    def name(self) -> str:
        """What it is called: the reference before the name."""
        return (self.tags.get("ref") or self.tags.get("name") or "").strip()


@dataclass
class Findings:
    """What an import has to tell beside the map.

    left_out: how many elements the map should have had, by reason. not_used: how many it has no use for, by value.
    to_check: sentences for whoever knows the airport.
    """

    left_out: Counter[str] = field(default_factory=Counter)
    not_used: Counter[str] = field(default_factory=Counter)
    to_check: list[str] = field(default_factory=list)


def values_of(text: str) -> list[str]:
    """The values of a tag, which mappers join with semicolons: "runway;taxiway"."""
    return [one for one in (part.strip() for part in text.split(";")) if one]


def aeroways_of(tags: dict[str, str]) -> list[str]:
    """The aeroway values of these tags, whatever prefix they stand behind, the one that decides first."""
    plain = values_of(tags.get("aeroway", ""))
    hidden = next((one for one in plain if one in PLANNED or one in LIFECYCLE), None)
    if hidden:
        return _ranked(values_of(tags.get(hidden, ""))) or [hidden]
    if plain:
        return _ranked(plain)
    for prefix in (*LIFECYCLE, *PLANNED):
        if found := values_of(tags.get(f"{prefix}:aeroway", "")):
            return _ranked(found)
    return _ranked(values_of(tags.get("area:aeroway", "")))


def _ranked(values: list[str]) -> list[str]:
    return sorted(values, key=lambda one: DECIDING.index(one) if one in DECIDING else len(DECIDING))


def status_of(tags: dict[str, str]) -> str:
    """The value of Element.status that these tags mean."""
    plain = values_of(tags.get("aeroway", ""))
    if any(one in PLANNED for one in plain) or (not plain and any(f"{one}:aeroway" in tags for one in PLANNED)):
        return "planned"
    if any(one in LIFECYCLE for one in plain) or (not plain and any(f"{one}:aeroway" in tags for one in LIFECYCLE)):
        return "closed"
    if any(tags.get(one) == "yes" for one in ("closed", *LIFECYCLE)) or tags.get("runway") == "closed":
        return "closed"
    return "planned" if any(tags.get(one) == "yes" for one in PLANNED) else ""


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


_ELEVATION = re.compile(r"^\s*([+-]?[0-9]+(?:[.,][0-9]+)?)\s*(m|metres?|meters?|ft|feet|foot|')?\s*$", re.IGNORECASE)


def elevation_of(text: str | None) -> float | None:
    """Metres above mean sea level from an "ele" tag ("432", "-3.7", "1416 ft"); None when it is none or not likely."""
    found = _ELEVATION.match(text or "")
    if not found:
        return None
    value = float(found[1].replace(",", "."))
    if (found[2] or "m").lower() in ("ft", "feet", "foot", "'"):
        value *= FEET
    return value if LOWEST <= value <= HIGHEST else None
