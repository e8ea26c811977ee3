"""OpenStreetMap extract in, airport map as GeoJSON out.

Feature kinds follow the names of AMDB (EUROCAE ED-99, RTCA DO-272) where it has one; `Building` stands for its vertical
polygonal structure. What the map does not tell is derived at the values of ICAO Annex 14 and marked as derived.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import shapely
from shapely.geometry import LineString, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from pipeline.airport.frame import LocalFrame
from pipeline.airport.model import Feature
from pipeline.airport.osm.elements import (
    HIGHEST,
    LOWEST,
    Element,
    Findings,
    ImportFault,
    Position,
    aeroways_of,
    area_of,
    elevation_of,
    is_area,
    lines_of,
    metres,
)
from pipeline.airport.osm.holds import make_holds
from pipeline.airport.osm.reading import read_extract
from pipeline.airport.osm.runway_parts import OVERRUNS
from pipeline.airport.osm.runways import (
    DEFAULT_WIDTH,
    HOLD_DISTANCE,
    LOW_VISIBILITY_DISTANCE,
    RunwayDraft,
    make_runways,
)
from pipeline.airport.osm.surfaces import BUILDING_AEROWAYS, make_surfaces
from pipeline.airport.runway_access import taxi_lanes
from pipeline.airport.taxi_graph import build_taxi_graph

ATTRIBUTION = "© OpenStreetMap contributors, ODbL 1.0"
LICENCE = "https://opendatacommons.org/licenses/odbl/1-0/"
FURTHEST = 25_000.0
"""Metres from the reference point beyond which nothing belongs to an airport."""
BEYOND = 1_500.0
"""Metres from runways, taxiways and aprons beyond which buildings and roads are left out."""
PAVED = ("runway", "taxiway", "taxilane", "apron")
USED = (*PAVED, *OVERRUNS, *BUILDING_AEROWAYS, "parking_position", "gate", "holding_position", "threshold",
        "displaced_threshold", "aerodrome")  # fmt: skip
"""Values of aeroway that become part of the map."""


def airport_geojson(
    extract: Any, icao: str, name: str | None = None, *, elevation: float | None = None
) -> dict[str, Any]:
    """One FeatureCollection (longitude, latitude) of the airport `icao` in an extract of OpenStreetMap.

    extract: Overpass JSON with the geometry inline or with the nodes beside, GeoJSON of
    overpass-turbo, or OpenStreetMap XML. name: of the airport, when the extract has no aerodrome element that tells
    it. elevation: metres above mean sea level; by default that of the aerodrome element, or of the highest runway that
    has one. Top-level members besides the features: icao, name, reference, elevation_m (when it is known), attribution,
    licence and `import` (features by kind, what was derived, what was left out or not used and why, what to check).
    Raises ImportFault when the document is no such extract, or an incomplete one, or has no runway in use.
    """
    code = icao.strip().upper()
    if not (len(code) in (3, 4) and code.isalnum()):
        raise ImportFault(f"{icao!r} is not an ICAO code: four letters or digits, such as LFPO")
    if elevation is not None and not LOWEST <= elevation <= HIGHEST:
        raise ImportFault(f"an elevation of {elevation} m is not between {LOWEST:.0f} and {HIGHEST:.0f} m")
    findings = Findings()
    read = _in_one_piece(read_extract(extract, findings))
    aerodrome = _aerodrome(read, code)
    frame = _frame(read)
    elements = _belonging(read, aerodrome, frame, findings)
    features = _features(elements, frame, findings)
    height = elevation if elevation is not None else _elevation(aerodrome, elements, findings)
    _tell(elements, features, height, findings)
    made: dict[str, Any] = {
        "type": "FeatureCollection",
        "icao": code,
        "name": name or _name(aerodrome) or code,
        "reference": {"latitude": frame.latitude, "longitude": frame.longitude},
        "elevation_m": None if height is None else round(height, 1),
        "attribution": ATTRIBUTION,
        "licence": LICENCE,
        "import": _summary(features, findings),
        "features": [_geojson(one, frame) for one in features],
    }
    return {key: value for key, value in made.items() if value is not None}


def _in_one_piece(elements: list[Element]) -> list[Element]:
    """Longitudes without the step at the antimeridian: those of an airport on it go on beyond 180 degrees."""
    told = [one for one in elements if one.aeroway in PAVED]
    every = np.array([position[0] for one in told for _, part in one.parts for position in part])
    if not len(every) or np.ptp(every) <= 180.0:
        return elements
    turned = np.radians(every)
    middle = math.degrees(math.atan2(np.sin(turned).mean(), np.cos(turned).mean()))

    def moved(part: tuple[Position, ...]) -> tuple[Position, ...]:
        return tuple((middle + (longitude - middle + 180.0) % 360.0 - 180.0, latitude) for longitude, latitude in part)

    return [replace(one, parts=tuple((role, moved(part)) for role, part in one.parts)) for one in elements]


def _elevation(aerodrome: Element | None, elements: list[Element], findings: Findings) -> float | None:
    """Of the aerodrome, or the highest of its runways: it is the elevation of the highest point of the landing area."""
    told = elevation_of(aerodrome.tags.get("ele")) if aerodrome is not None else None
    if told is not None:
        return told
    heights = [elevation_of(one.tags.get("ele")) for one in elements if one.aeroway == "runway" and not one.status]
    highest = max((one for one in heights if one is not None), default=None)
    if highest is not None:
        findings.to_check.append(
            f"the elevation {highest:g} m is that of the highest runway: the extract does not tell the aerodrome's"
        )
    return highest


def _aerodrome(elements: list[Element], code: str) -> Element | None:
    found = [one for one in elements if one.aeroway == "aerodrome"]
    return next(
        (one for one in found if code in (one.tags.get("icao"), one.tags.get("iata"), one.tags.get("ref"))), None
    )


def _name(aerodrome: Element | None) -> str:
    if aerodrome is None:
        return ""
    return aerodrome.tags.get("name:en") or aerodrome.tags.get("name") or ""


def _frame(elements: list[Element]) -> LocalFrame:
    """About the middle of the runways, or of all pavement where there is no runway."""
    for wanted in (("runway",), PAVED):
        positions = [
            position
            for one in elements
            if one.aeroway in wanted and not one.status and one.type != "node"
            for _, part in one.parts
            for position in part
        ]
        if positions:
            longitude, latitude = np.median(positions, axis=0)
            near = [p for p in positions if _apart(p, (longitude, latitude)) < FURTHEST]
            west_south, east_north = np.min(near or positions, axis=0), np.max(near or positions, axis=0)
            middle = (west_south + east_north) / 2
            longitude = (float(middle[0]) + 180.0) % 360.0 - 180.0
            return LocalFrame(round(float(middle[1]), 7), round(longitude, 7))
    raise ImportFault("the extract holds no runway, taxiway or apron with geometry: is it an extract of an airport?")


def _apart(one: Any, other: Any) -> float:
    east = ((one[0] - other[0] + 180.0) % 360.0 - 180.0) * math.cos(math.radians(other[1]))
    return 111_320.0 * math.hypot(east, one[1] - other[1])


def _belonging(
    elements: list[Element], aerodrome: Element | None, frame: LocalFrame, findings: Findings
) -> list[Element]:
    """Without what lies far away, and without what belongs to a neighbouring aerodrome."""
    reference = (frame.longitude, frame.latitude)
    near = [one for one in elements if all(_apart(p, reference) < FURTHEST for _, part in one.parts for p in part)]
    findings.left_out.update({"far away": len(elements) - len(near)} if len(near) < len(elements) else {})
    own = area_of(aerodrome, frame) if aerodrome is not None and is_area(aerodrome) else None
    foreign = [
        area_of(one, frame) for one in near if one.aeroway == "aerodrome" and one is not aerodrome and is_area(one)
    ]
    elsewhere = shapely.unary_union([one for one in foreign if one is not None]).difference(own or Polygon())
    if own is not None and not elsewhere.is_empty:
        outside = [one for one in near if elsewhere.covers(_outline(one, frame))]
        findings.left_out.update({"belongs to another aerodrome": len(outside)} if outside else {})
        near = [one for one in near if one not in outside]
    paved = [_outline(one, frame) for one in near if one.aeroway in PAVED and not one.status and one.type != "node"]
    ground = shapely.unary_union(paved).convex_hull.buffer(BEYOND)
    shapely.prepare(ground)
    kept = [one for one in near if ground.intersects(_outline(one, frame))]
    findings.left_out.update({"not near the pavement": len(near) - len(kept)} if len(kept) < len(near) else {})
    return kept


def _outline(element: Element, frame: LocalFrame) -> BaseGeometry:
    positions = [one for _, part in element.parts for one in part]
    east, north = frame.to_local([one[1] for one in positions], [one[0] for one in positions])
    return shapely.MultiPoint(np.column_stack([east, north]))


def _features(elements: list[Element], frame: LocalFrame, findings: Findings) -> list[Feature]:
    runways = make_runways(elements, frame, findings)
    if not runways:
        raise ImportFault(_why_no_runway(elements, findings))
    code = max((one.code for one in runways), default=2)
    features = make_surfaces(elements, frame, code, findings)
    features += list(_closed_runways(elements, frame))
    features += [one for runway in runways for one in _runway_features(runway)]
    graph = build_taxi_graph(features)
    features += make_holds(elements, runways, taxi_lanes(features, graph), features, frame, findings)
    return _with_unique_ids(features)


def _why_no_runway(elements: list[Element], findings: Findings) -> str:
    closed = sum(one.aeroway == "runway" and bool(one.status) for one in elements)
    lost = findings.left_out + Counter({"runway not in use": closed})
    reasons = ", ".join(f"{count} x {reason}" for reason, count in sorted(lost.items()))
    named = "".join(f"\n  {one}" for one in findings.to_check)
    return (
        f"no runway in the result; left out: {reasons or 'nothing'}. Is the extract complete (every way with its "
        f'geometry: "out geom"), and is it of this airport?{named}'
    )


def _tell(elements: list[Element], features: list[Feature], elevation: float | None, findings: Findings) -> None:
    """What a look at the whole shows: values of no use, ways with gaps, and what every airport has."""
    for one in elements:
        first, *others = aeroways_of(one.tags) or [""]
        if first and (first not in USED or (first == "gate" and one.type == "node")):
            findings.not_used[f"aeroway={first}"] += 1
        for value in others:
            findings.not_used[f"aeroway={value}, beside {first}"] += 1
    cut = [one.id for one in elements if one.gaps and one.aeroway in PAVED]
    if cut:
        findings.to_check.append(
            f"the extract lacks points of {len(cut)} runways, taxiways or aprons (cut off at the edge of its box?): "
            + ", ".join(cut[:10])
            + (" and others" if len(cut) > 10 else "")
        )
    kinds = {one.kind for one in features}
    if "TaxiwayGuidanceLine" not in kinds:
        findings.to_check.append(
            "there is no taxiway: tracks cannot be expected along them, no position can be derived"
        )
    if "TaxiwayHoldingPosition" not in kinds:
        findings.to_check.append("there is no holding position, neither mapped nor derived")
    if elevation is None:
        findings.to_check.append(
            "the elevation of the airport is not known: without --elevation METRES no altitude of anything in the air "
            "is given to others"
        )


def _runway_features(runway: RunwayDraft) -> Iterator[Feature]:
    base = f"runway/{runway.id.replace('/', '-')}"
    common: dict[str, Any] = {"runway": runway.id, "source": ", ".join(runway.source)}
    measures = {
        "designators": list(runway.designators),
        "designators_derived": "designators" in runway.derived,
        "width_m": round(runway.width, 2),
        "width_derived": "width" in runway.derived,
        "length_m": round(runway.length, 1),
        "code": runway.code,
        "surface": runway.surface or None,
        "status": "open",
        "hold_distance_m": HOLD_DISTANCE[runway.code],
        "low_visibility_distance_m": LOW_VISIBILITY_DISTANCE[runway.code],
    }
    yield Feature(base, "RunwayElement", runway.id, runway.strip(), common | measures | {"title": runway.name or None})
    for number, (source, area) in enumerate(runway.stopways):
        properties = {"runway": runway.id, "source": source}
        yield Feature(f"{base}/stopway/{number}", "Stopway", runway.id, area, properties)
    first, second = runway.displaced
    for displaced, low, high, end in ((first, 0.0, first, 0), (second, runway.length - second, runway.length, 1)):
        if displaced > 1.0:
            area = LineString([runway.at(low), runway.at(high)]).buffer(runway.width / 2, cap_style="flat")
            id = f"{base}/displaced/{runway.designators[end]}"
            yield Feature(id, "RunwayDisplacedArea", runway.designators[end], area, common)
    yield Feature(
        f"{base}/centreline", "PaintedCenterline", runway.id, runway.centreline, common | {"width_m": runway.width}
    )
    for end, along in ((0, first), (1, runway.length - second)):
        heading = round(math.degrees(runway.heading + math.pi * end) % 360, 2) % 360
        threshold: dict[str, Any] = {"designator": runway.designators[end], "heading_deg": heading}
        threshold |= {"displaced_m": round(runway.displaced[end], 1)}
        id = f"{base}/threshold/{runway.designators[end]}"
        yield Feature(id, "RunwayThreshold", runway.designators[end], runway.at(along), common | threshold)


def _closed_runways(elements: list[Element], frame: LocalFrame) -> Iterator[Feature]:
    for element in elements:
        if element.aeroway != "runway" or not element.status or element.type == "node":
            continue
        kind = "RunwayElement" if element.status == "closed" else "ConstructionArea"
        properties = {"source": element.id, "status": "closed" if element.status == "closed" else "construction"}
        if is_area(element):
            area = area_of(element, frame)
            if area is not None:
                yield Feature(element.id, kind, element.name, area, properties)
            continue
        for number, line in enumerate(lines_of(element, frame)):
            width = metres(element.tags.get("width"), 5.0, 150.0) or DEFAULT_WIDTH[3]
            id = element.id if number == 0 else f"{element.id}/{number}"
            yield Feature(id, kind, element.name, line.buffer(width / 2, cap_style="flat"), properties)


def _with_unique_ids(features: list[Feature]) -> list[Feature]:
    taken: Counter[str] = Counter()
    made: list[Feature] = []
    for one in features:
        taken[one.id] += 1
        id = one.id if taken[one.id] == 1 else f"{one.id}~{taken[one.id]}"
        made.append(Feature(id, one.kind, one.name, one.geometry, one.properties))
    return made


def _summary(features: list[Feature], findings: Findings) -> dict[str, Any]:
    derived: Counter[str] = Counter()
    for one in features:
        if one.properties.get("derived"):
            derived[one.kind] += 1
        for key, value in one.properties.items():
            if key.endswith("_derived") and value:
                derived[f"{one.kind} {key.removesuffix('_derived')}"] += 1
    counts = Counter(one.kind for one in features)
    return {
        "counts": dict(sorted(counts.items())),
        "derived": dict(sorted(derived.items())),
        "left_out": dict(sorted(findings.left_out.items())),
        "not_used": dict(sorted(findings.not_used.items())),
        "to_check": findings.to_check,
    }


def _geojson(feature: Feature, frame: LocalFrame) -> dict[str, Any]:
    properties: dict[str, Any] = {"id": feature.id, "kind": feature.kind, "name": feature.name}
    properties |= {key: value for key, value in feature.properties.items() if value is not None}
    if "position" in properties:
        latitude, longitude = frame.to_geodetic(*properties["position"])
        properties["position"] = [round(float(longitude), 7), round(float(latitude), 7)]
    geometry = feature.geometry
    if isinstance(geometry, Polygon):
        geometry = orient(geometry)
    elif isinstance(geometry, MultiPolygon):
        geometry = shapely.MultiPolygon([orient(one) for one in geometry.geoms])
    return {"type": "Feature", "id": feature.id, "properties": properties, "geometry": _degrees(geometry, frame)}


def _degrees(geometry: BaseGeometry, frame: LocalFrame) -> dict[str, Any]:
    def convert(points: np.ndarray) -> np.ndarray:
        latitude, longitude = frame.to_geodetic(points[:, 0], points[:, 1])
        return np.round(np.column_stack([longitude, latitude]), 7)

    shape: dict[str, Any] = shapely.geometry.mapping(shapely.transform(geometry, convert))
    return {"type": shape["type"], "coordinates": _lists(shape["coordinates"])}


def _lists(value: Any) -> Any:
    return [_lists(one) for one in value] if isinstance(value, tuple | list) else value
