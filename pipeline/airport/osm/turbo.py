"""GeoJSON of OpenStreetMap elements in the form of Overpass JSON.

As overpass-turbo exports it (https://github.com/tyrasd/osmtogeojson: tags as properties beside "@id", or in "tags"),
and with the ids of osmium and QuickOSM.
"""

from __future__ import annotations

import re
from typing import Any

from pipeline.airport.osm.elements import ImportFault

_LETTERS = {"n": "node", "w": "way", "r": "relation"}
_ABOUT = ("@", "full_id", "osm_id", "osm_type")
"""How the names of properties begin that are no tags."""


def document_of_geojson(document: dict[str, Any]) -> dict[str, Any]:
    """{"elements": [...]} of a FeatureCollection. Raises ImportFault when it is the map of an airport already."""
    features = document.get("features")
    if not isinstance(features, list):
        raise ImportFault('not an OpenStreetMap extract: the FeatureCollection has no list "features"')
    if isinstance(document.get("reference"), dict) and "icao" in document:
        raise ImportFault(
            "this is a map that `airside airport import` made: use it as it is, or import its Overpass extract again"
        )
    made: dict[str, Any] = {"elements": [_element(one, place) for place, one in enumerate(features)]}
    return made | ({"remark": document["remark"]} if "remark" in document else {})


def _element(feature: Any, place: int) -> Any:
    if not isinstance(feature, dict) or not isinstance(feature.get("properties"), dict):
        return None
    properties = feature["properties"]
    nested = properties.get("tags")
    tags = nested if isinstance(nested, dict) else _tags(properties)
    geometry = feature.get("geometry")
    geometry = geometry if isinstance(geometry, dict) else {}
    shape = geometry.get("type")
    type, id = _type_and_id(feature, properties) or ("node" if shape == "Point" else "way", f"feature-{place + 1}")
    made: dict[str, Any] = {"type": type, "id": id, "tags": tags}
    if "@geometry" in properties:  # a centre or a box in place of the shape
        return made
    coordinates = geometry.get("coordinates")
    if shape == "Point" and type == "node":
        return made | (_position(coordinates) or {})
    if shape == "LineString":
        return _with_parts(made, [("", coordinates)])
    if shape == "MultiLineString" and isinstance(coordinates, list):
        return _with_parts(made, [("", one) for one in coordinates])
    if shape == "Polygon":
        return _with_parts(made, _rings([coordinates]))
    if shape == "MultiPolygon" and isinstance(coordinates, list):
        return _with_parts(made, _rings(coordinates))
    return made


def _tags(properties: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in properties.items() if not key.startswith(_ABOUT)}


def _type_and_id(feature: dict[str, Any], properties: dict[str, Any]) -> tuple[str, str] | None:
    for told in (properties.get("@id"), feature.get("id"), properties.get("full_id")):
        found = re.fullmatch(r"(node|way|relation|[nwr])/?(-?\d+)", str(told))
        if found:
            return _LETTERS[found[1][0]], found[2]
    type = str(properties.get("@type") or properties.get("osm_type") or properties.get("type") or "")
    id = next((properties[key] for key in ("@id", "osm_id", "id") if properties.get(key) is not None), None)
    return (type, str(id)) if type in _LETTERS.values() and id is not None else None


def _rings(polygons: list[Any]) -> list[tuple[str, Any]]:
    made: list[tuple[str, Any]] = []
    for rings in polygons:
        for number, ring in enumerate(rings if isinstance(rings, list) else []):
            made.append(("outer" if number == 0 else "inner", ring))
    return made


def _with_parts(made: dict[str, Any], parts: list[tuple[str, Any]]) -> dict[str, Any]:
    """A way keeps one line or ring; what has more, such as an area with holes, is a relation."""
    lines = [(role, [_position(one) for one in line] if isinstance(line, list) else []) for role, line in parts]
    if len(lines) == 1 and made["type"] != "relation":
        return made | {"type": "way", "geometry": lines[0][1]}
    members = [{"type": "way", "role": role, "geometry": line} for role, line in lines]
    return made | {"type": "relation", "members": members}


def _position(coordinates: Any) -> dict[str, Any] | None:
    if not isinstance(coordinates, list) or len(coordinates) < 2:
        return None
    return {"lat": coordinates[1], "lon": coordinates[0]}
