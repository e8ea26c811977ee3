"""The ways and areas of runways in an extract: what each is, what it is called, and which are none."""

from __future__ import annotations

from dataclasses import dataclass

from shapely.geometry import LineString, MultiPolygon, Point, Polygon

from pipeline.airport.frame import LocalFrame
from pipeline.airport.osm.designators import for_helicopters, named_designators, read_designators
from pipeline.airport.osm.elements import Element, Findings, area_of, is_area, lines_of, metres, values_of

OVERRUNS = ("stopway", "blast_pad", "blastpad", "overrun", "clearway")
NOT_FOR_AEROPLANES = ("fato", "tlof", "helipad", "helicopter", "heliport", "model", "models", "model_aerodrome", "rc")
NAMES = ("name", "name:en", "official_name", "alt_name", "short_name", "loc_name")


@dataclass
class RunwayPart:
    """One way of a runway. role: "runway", "displaced" (before a threshold) or "stopway". line: local metres."""

    line: LineString
    element: Element
    role: str
    designators: tuple[str, str] | None

    @property
    def width(self) -> float | None:
        """Metres, where the way tells them."""
        return metres(self.element.tags.get("width"), 5.0, 150.0)


def lose(findings: Findings, name: str, source: list[str], reason: str) -> None:
    """Count a runway or a part of one that the map will not have, and name it."""
    findings.left_out[reason] += 1
    findings.to_check.append(f"left out: {name or 'unnamed'} ({', '.join(source)}), {reason}")


def runway_parts(
    elements: list[Element], frame: LocalFrame, findings: Findings
) -> tuple[list[RunwayPart], list[tuple[Element, Polygon | MultiPolygon]]]:
    """The lines and the areas of the runways in use; the others are counted and named in `findings`."""
    pieces: list[RunwayPart] = []
    areas: list[tuple[Element, Polygon | MultiPolygon]] = []
    for element in elements:
        role = _role(element)
        if not role or element.status:
            continue
        reason = ""
        if element.type == "node":
            reason = "runway that is only a point"
        elif _for_helicopters_or_models(element):
            reason = "runway for helicopters or models"
        elif is_area(element) and role == "runway":
            area = area_of(element, frame)
            if area is None:
                reason = "area does not close"
            else:
                areas.append((element, area))
        elif role == "other":
            reason = "part of no runway"
        else:
            lines = lines_of(element, frame)
            straight = [one for one in lines if role != "runway" or _straight(one)]
            pieces.extend(RunwayPart(one, element, role, published_designators(element)) for one in straight)
            reason = "no usable shape" if not lines else "runway not straight" if len(straight) < len(lines) else ""
        if reason:
            lose(findings, element.name, [element.id], reason)
    return pieces, areas


def _straight(line: LineString) -> bool:
    return bool(line.length <= 1.08 * Point(line.coords[0]).distance(Point(line.coords[-1])))


def published_designators(element: Element) -> tuple[str, str] | None:
    """What the element says it is called: its reference, or else a pair of designators in a name."""
    told = read_designators(element.tags.get("ref", "")) or read_designators(element.tags.get("local_ref", ""))
    return told or next((found for key in NAMES if (found := named_designators(element.tags.get(key, "")))), None)


def _role(element: Element) -> str:
    if element.aeroway in OVERRUNS:
        return "stopway"
    if element.aeroway != "runway":
        return ""
    kind = element.tags.get("runway", "")
    if kind in OVERRUNS:
        return "stopway"
    return "displaced" if kind.startswith("displaced") else "other" if kind.startswith("turn") else "runway"


def _for_helicopters_or_models(element: Element) -> bool:
    """By the values of tags and the reference; descriptions and notes say too much to go by."""
    for key in ("runway", "sport", "usage"):
        values = [one.lower() for one in values_of(element.tags.get(key, ""))]
        if values and all(one in NOT_FOR_AEROPLANES for one in values):
            return True
    return for_helicopters(element.tags.get("ref", ""))
