"""Taxiways, aprons, stands, buildings, roads and water from OpenStreetMap, as features in local metres."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import shapely
from scipy.spatial import cKDTree
from shapely.geometry import LineString, Point, Polygon

from pipeline.airport.frame import LocalFrame
from pipeline.airport.model import Feature
from pipeline.airport.osm.elements import Element, Findings, area_of, is_area, lines_of, metres, point_of

TAXIWAY_WIDTH = {4: 23.0, 3: 15.0, 2: 10.5, 1: 7.5}
"""Default width by the airport's greatest runway code number (ICAO Annex 14, 3.9.5)."""
LEVEL_HEIGHT = 3.6
BUILDING_HEIGHT = {
    "terminal": 18.0, "hangar": 16.0, "tower": 40.0, "control_tower": 40.0, "warehouse": 10.0, "industrial": 10.0,
    "hotel": 25.0, "office": 16.0, "roof": 5.0, "shed": 3.0, "garage": 3.0,
}  # fmt: skip
OTHER_HEIGHT = 8.0
ROAD_WIDTH = {
    "motorway": 15.0, "trunk": 12.0, "primary": 9.0, "secondary": 8.0, "tertiary": 7.0, "service": 6.0,
    "residential": 6.0, "unclassified": 6.0, "track": 4.0, "road": 6.0, "living_street": 5.0,
}  # fmt: skip
STAND_LENGTH = 45.0
BUILDING_AEROWAYS = ("terminal", "hangar", "tower", "control_tower", "control_center", "shelter")


def make_surfaces(elements: list[Element], frame: LocalFrame, code: int, findings: Findings) -> list[Feature]:
    """Features of everything but runways and holding positions, in drawing order. code: greatest runway code."""
    made: dict[str, list[Feature]] = {"apron": [], "taxiway": [], "stand": [], "building": [], "road": [], "water": []}
    for element in elements:
        group = _group(element)
        if not group:
            continue
        if element.status == "planned" or (element.status and group != "taxiway"):
            findings.left_out["not in use"] += 1
            continue
        features = list(_features(group, element, frame, code))
        if not features:
            findings.left_out["no usable shape"] += 1
        made[group].extend(features)
    made["building"] = _without_repeats(made["building"], findings)
    made["stand"].extend(_stand_ends(made["stand"], made["taxiway"]))
    made["stand"].extend(_stand_areas(made["stand"]))
    return [one for group in ("water", "apron", "road", "building", "stand", "taxiway") for one in made[group]]


def _group(element: Element) -> str:
    tags, aeroway = element.tags, element.aeroway
    if aeroway in ("taxiway", "taxilane"):
        return "taxiway"
    if aeroway == "apron":
        return "apron"
    if aeroway in ("parking_position", "gate") and (aeroway == "parking_position" or element.type == "way"):
        return "stand"
    if aeroway in BUILDING_AEROWAYS or tags.get("man_made") == "tower":
        return "building"
    if tags.get("building", "no") not in ("no", "construction", "proposed") or tags.get("building:part", "no") != "no":
        underground = tags.get("location") == "underground" or tags.get("layer", "").startswith("-")
        return "" if underground or element.type == "node" else "building"
    if tags.get("highway") in ROAD_WIDTH and element.type == "way":
        return "road"
    if tags.get("natural") == "water" or tags.get("waterway") == "riverbank":
        return "water"
    return ""


def _features(group: str, element: Element, frame: LocalFrame, code: int) -> Iterator[Feature]:
    if group == "taxiway":
        yield from _taxiway(element, frame, code)
    elif group == "stand":
        yield from _stand(element, frame)
    elif group == "building":
        yield from _building(element, frame)
    elif group == "road":
        yield from _road(element, frame)
    elif is_area(element):
        area = area_of(element, frame)
        if area is not None:
            kind = "ApronElement" if group == "apron" else "Water"
            yield Feature(element.id, kind, element.tags.get("name") or element.name, area, _surface(element))


def _surface(element: Element) -> dict[str, object]:
    made: dict[str, object] = {"source": element.id}
    if element.tags.get("surface"):
        made["surface"] = element.tags["surface"]
    return made


def _taxiway(element: Element, frame: LocalFrame, code: int) -> Iterator[Feature]:
    properties = _surface(element)
    if element.status:
        properties["status"] = element.status
    if element.tags.get("area") == "yes" or (element.type == "relation" and is_area(element)):
        area = area_of(element, frame)
        if area is not None:
            yield Feature(element.id, "TaxiwayElement", element.name, area, properties)
        return
    width = metres(element.tags.get("width"), 3.0, 100.0)
    lane = element.aeroway == "taxilane"
    for number, line in enumerate(lines_of(element, frame)):
        id = element.id if number == 0 else f"{element.id}/{number}"
        area = (
            Polygon() if width is None and lane else line.buffer((width or TAXIWAY_WIDTH[code]) / 2, cap_style="flat")
        )
        measures = {"width_m": width or TAXIWAY_WIDTH[code], "width_derived": width is None}
        if isinstance(area, Polygon) and not area.is_empty:
            yield Feature(f"{id}/area", "TaxiwayElement", element.name, area, properties | measures)
        if not element.status:
            extra: dict[str, object] = {"lane": True} if lane else {}
            if element.tags.get("oneway") in ("yes", "-1"):
                extra["oneway"] = element.tags["oneway"]
            yield Feature(id, "TaxiwayGuidanceLine", element.name, line, properties | measures | extra)


def _stand(element: Element, frame: LocalFrame) -> Iterator[Feature]:
    properties: dict[str, object] = {"source": element.id}
    if element.type == "node":
        yield Feature(element.id, "ParkingStandLocation", element.name, point_of(element, frame), properties)
    elif is_area(element):
        area = area_of(element, frame)
        if area is not None:
            yield Feature(element.id, "ParkingStandArea", element.name, area, properties)
    else:
        for number, line in enumerate(lines_of(element, frame)):
            id = element.id if number == 0 else f"{element.id}/{number}"
            yield Feature(id, "StandGuidanceLine", element.name, line, properties)


def _building(element: Element, frame: LocalFrame) -> Iterator[Feature]:
    use = element.aeroway if element.aeroway in BUILDING_AEROWAYS else element.tags.get("man_made", "")
    use = use or element.tags.get("building", "yes")
    height, derived = _height(element, use)
    properties = {"source": element.id, "use": use, "height_m": height, "height_derived": derived}
    if element.type == "node":
        if "tower" in use:
            yield Feature(element.id, "VerticalPointStructure", element.name, point_of(element, frame), properties)
    elif is_area(element):
        area = area_of(element, frame)
        if area is not None:
            yield Feature(element.id, "Building", element.tags.get("name") or element.name, area, properties)


def _height(element: Element, use: str) -> tuple[float, bool]:
    told = metres(element.tags.get("height") or element.tags.get("building:height"), 1.5, 200.0)
    if told is not None:
        return told, False
    levels = metres(element.tags.get("building:levels"), 1.0, 60.0)
    if levels is not None:
        return round(levels * LEVEL_HEIGHT * (1.6 if use in ("terminal", "hangar") else 1.0), 1), True
    return BUILDING_HEIGHT.get(use, OTHER_HEIGHT), True


def _road(element: Element, frame: LocalFrame) -> Iterator[Feature]:
    kind = element.tags.get("highway", "service")
    if element.tags.get("tunnel", "no") != "no" or element.tags.get("layer", "").startswith("-"):
        return
    width = metres(element.tags.get("width"), 2.0, 40.0)
    properties = _surface(element) | {"width_m": width or ROAD_WIDTH[kind], "width_derived": width is None}
    for number, line in enumerate(lines_of(element, frame)):
        id = element.id if number == 0 else f"{element.id}/{number}"
        yield Feature(id, "ServiceRoad", element.name, line, properties)


def _without_repeats(buildings: list[Feature], findings: Findings) -> list[Feature]:
    """Without the buildings that are drawn twice (a way and a relation of the same outline)."""
    areas = [one.geometry for one in buildings]
    tree = shapely.STRtree(areas) if areas else None
    gone: set[int] = set()
    for place, area in enumerate(areas):
        if place in gone or tree is None or area.geom_type == "Point":
            continue
        for other in tree.query(area, predicate="intersects"):
            if other > place and other not in gone and areas[other].geom_type != "Point":
                common = area.intersection(areas[other]).area
                if common > 0.9 * max(area.area, areas[other].area):
                    gone.add(int(other))
    findings.left_out.update({"building drawn twice": len(gone)} if gone else {})
    return [one for place, one in enumerate(buildings) if place not in gone]


def _stand_ends(stands: list[Feature], taxiways: list[Feature]) -> Iterator[Feature]:
    """The place where an aircraft stands: the end of its guidance line that is further from the taxiways."""
    lines = [one.geometry for one in taxiways if one.kind == "TaxiwayGuidanceLine"]
    tree = shapely.STRtree(lines) if lines else None
    named = {one.name for one in stands if one.kind == "ParkingStandLocation" and one.name}
    for stand in stands:
        if stand.kind != "StandGuidanceLine" or stand.name in named:
            continue
        line = LineString(stand.geometry.coords)
        first, last = Point(line.coords[0]), Point(line.coords[-1])
        if tree is not None:
            near = [lines[int(tree.nearest(one))].distance(one) for one in (first, last)]
            if near[0] > near[1]:
                first, last = last, first
                line = LineString(line.coords[::-1])
        heading = math.degrees(_final_heading(line)) % 360
        properties = {"source": stand.properties["source"], "heading_deg": round(heading, 1) % 360, "derived": True}
        yield Feature(f"{stand.id}/stop", "ParkingStandLocation", stand.name, last, properties)


def _final_heading(line: LineString) -> float:
    before, last = line.interpolate(max(0.0, line.length - 15.0)), line.coords[-1]
    return math.atan2(last[0] - before.x, last[1] - before.y)


def _stand_areas(stands: list[Feature]) -> Iterator[Feature]:
    """A box about each stop for which the map has no area: as wide as its neighbours leave room for."""
    stops = [one for one in stands if one.kind == "ParkingStandLocation" and "heading_deg" in one.properties]
    if not stops:
        return
    points = np.array([one.geometry.coords[0] for one in stops])
    room = np.full(len(stops), 60.0)
    if len(stops) > 1:
        pairs = np.array(sorted(cKDTree(points).query_pairs(60.0)), dtype=int).reshape(-1, 2)
        for one, other in pairs:
            gap = float(np.hypot(*(points[one] - points[other])))
            if gap > 8.0:
                room[[one, other]] = np.minimum(room[[one, other]], gap)
    for stop, (east, north), gap in zip(stops, points, room, strict=True):
        heading = math.radians(stop.properties["heading_deg"])
        ahead = np.array([math.sin(heading), math.cos(heading)])
        tail = np.array([east, north]) - ahead * min(STAND_LENGTH, 1.3 * gap)
        box = LineString([tail, np.array([east, north]) + ahead * 3.0]).buffer(0.47 * gap, cap_style="flat")
        properties = {"source": stop.properties["source"], "derived": True}
        yield Feature(stop.id.removesuffix("/stop") + "/area", "ParkingStandArea", stop.name, box, properties)
