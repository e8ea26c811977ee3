"""A hand-made extract, and the same in the other formats in which OpenStreetMap gives it."""

from __future__ import annotations

from typing import Any
from xml.sax.saxutils import quoteattr

from tests.pipeline.airport.extracts import extract, node, relation, runway, taxiway, way

Document = dict[str, Any]

RING = [(100, 300), (200, 300), (200, 400), (100, 400), (100, 300)]
FIELD = extract(
    runway(name='Main "strip"'),
    taxiway([(0, 0), (0, 100), (0, 300)], ref="A1"),
    taxiway([(-1200, 300), (0, 300), (1200, 300)], ref="A"),
    node((0, 110), aeroway="holding_position", holding_position__type="runway", ref="A1"),
    node((0, 100), aeroway="navigationaid"),
    way([(-400, 320), (-100, 320), (-100, 500), (-400, 500), (-400, 320)], aeroway="apron", ref="1"),
    relation([("outer", [(50, 250), (450, 250), (450, 550), (50, 550), (50, 250)]), ("inner", RING)], aeroway="apron"),
)


def with_nodes_beside(document: Document) -> Document:
    """As of "out body; >; out skel;": ways name their nodes, which follow without tags."""
    numbers: dict[tuple[float, float], int] = {}
    for one in document["elements"]:
        if one["type"] == "node":
            numbers[one["lat"], one["lon"]] = one["id"]

    def refs(geometry: list[dict[str, float]]) -> list[int]:
        return [numbers.setdefault((p["lat"], p["lon"]), 10_000 + len(numbers)) for p in geometry]

    made, parts = [], []
    for one in document["elements"]:
        element = {key: value for key, value in one.items() if key not in ("geometry", "members")}
        if one["type"] == "way":
            element["nodes"] = refs(one["geometry"])
        elif one["type"] == "relation":
            element["members"] = [{"type": "way", "ref": m["ref"], "role": m["role"]} for m in one["members"]]
            parts += [{"type": "way", "id": m["ref"], "nodes": refs(m["geometry"])} for m in one["members"]]
        made.append(element)
    skeletons = [{"type": "node", "id": id, "lat": lat, "lon": lon} for (lat, lon), id in numbers.items()]
    return {**document, "elements": [*made, *parts, *skeletons]}


def as_xml(document: Document) -> bytes:
    """As a file of openstreetmap.org: nodes, ways that refer to them, relations."""
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', '<osm version="0.6" generator="test">']
    if "remark" in document:
        lines.append(f"<remark> {document['remark']} </remark>")
    for one in with_nodes_beside(document)["elements"]:
        place = f' lat="{one["lat"]!r}" lon="{one["lon"]!r}"' if one["type"] == "node" else ""
        if (
            one["type"] == "node"
            and "tags" not in one
            and any(
                other.get("id") == one["id"] and other["type"] == "node" and "tags" in other
                for other in document["elements"]
            )
        ):
            continue
        lines.append(f'<{one["type"]} id="{one["id"]}"{place}>')
        lines += [f'<nd ref="{ref}"/>' for ref in one.get("nodes", ())]
        lines += [f'<member type="way" ref="{m["ref"]}" role="{m["role"]}"/>' for m in one.get("members", ())]
        lines += [f"<tag k={quoteattr(k)} v={quoteattr(v)}/>" for k, v in one.get("tags", {}).items()]
        lines.append(f"</{one['type']}>")
    return "\n".join([*lines, "</osm>"]).encode()


def as_turbo(document: Document) -> Document:
    """As overpass-turbo exports it: closed ways of aeroways that are areas become polygons."""
    features = []
    for one in document["elements"]:
        id = f"{one['type']}/{one['id']}"
        if one["type"] == "node":
            geometry: dict[str, Any] = {"type": "Point", "coordinates": [one["lon"], one["lat"]]}
        elif one["type"] == "way":
            line = _line(one["geometry"])
            area = line[0] == line[-1] and one["tags"].get("aeroway") != "taxiway"
            geometry = {"type": "Polygon" if area else "LineString", "coordinates": [line] if area else line}
        else:
            rings = sorted(one["members"], key=lambda m: m["role"] != "outer")
            geometry = {"type": "Polygon", "coordinates": [_line(m["geometry"]) for m in rings]}
        features.append({"type": "Feature", "id": id, "properties": {"@id": id, **one["tags"]}, "geometry": geometry})
    return {"type": "FeatureCollection", "generator": "overpass-turbo", "features": features}


def _line(geometry: list[dict[str, float]]) -> list[list[float]]:
    return [[one["lon"], one["lat"]] for one in geometry]
