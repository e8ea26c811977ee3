"""The elements of an extract with their geometry, wherever the document keeps it.

Overpass JSON with the geometry inline ("out geom") or with the nodes as elements of their own ("out body; >; out skel")
(https://wiki.openstreetmap.org/wiki/Overpass_API/Overpass_QL#Output_Format_(out:json)), and what `turbo` and
`app.ingest.osm_xml` make of the other formats.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pipeline.airport.osm.elements import Element, Findings, ImportFault, Position, status_of
from pipeline.airport.osm.turbo import document_of_geojson

Raw = dict[str, Any]
_GEOMETRY = ("lat", "lon", "geometry", "nodes", "members")


def read_extract(extract: Any, findings: Findings) -> list[Element]:
    """Every tagged element with usable geometry. Raises ImportFault when this is no extract, or a cut-off one."""
    if not isinstance(extract, dict):
        raise ImportFault("not an OpenStreetMap extract: the document is not a JSON object")
    if extract.get("type") == "FeatureCollection":
        extract = document_of_geojson(extract)
    _refuse_cut_off(extract)
    elements = extract.get("elements")
    if not isinstance(elements, list):
        raise ImportFault(
            'not an Overpass extract: it has no list "elements" (ask Overpass for [out:json] and "out geom")'
        )
    known = _by_id(elements, findings)
    referenced = {id for raw in known.values() for id in _references(raw)}
    made: list[Element] = []
    for id, raw in known.items():
        tags = raw.get("tags")
        if not isinstance(tags, dict) or not tags:
            if id not in referenced:
                findings.left_out["no tags"] += 1
            continue
        tags = {str(key): str(value).strip() for key, value in tags.items() if isinstance(value, str | int | float)}
        parts = list(_parts(raw, known))
        usable = tuple(
            (role, points) for role, points, _ in parts if len(points) >= (1 if raw["type"] == "node" else 2)
        )
        if usable:
            gaps = sum(one for _, _, one in parts)
            made.append(Element(id, raw["type"], tags, usable, status_of(tags), gaps))
        else:
            findings.left_out["no geometry"] += 1
    return made


def _refuse_cut_off(extract: Raw) -> None:
    remark = extract.get("remark")
    if remark:
        raise ImportFault(
            f"the extract is not complete: the server remarks {str(remark).strip()!r}; ask again, for a smaller box "
            "or with a longer [timeout:...]"
        )


def _by_id(elements: list[Any], findings: Findings) -> dict[str, Raw]:
    """One entry an id: an element given with its tags and again with its geometry is one."""
    known: dict[str, Raw] = {}
    for raw in elements:
        if not isinstance(raw, dict) or raw.get("type") not in ("node", "way", "relation"):
            findings.left_out["not an element"] += 1
        elif not raw.get("deleted"):
            id = f"{raw['type']}/{raw.get('id', 0)}"
            before = known.get(id)
            if before is None:
                known[id] = dict(raw)
                continue
            if raw.get("tags") and before.get("tags"):
                findings.left_out["element repeated"] += 1
            for key in ("tags", *_GEOMETRY):
                if not before.get(key) and key in raw:
                    before[key] = raw[key]
    return known


def _references(raw: Raw) -> Iterator[str]:
    if raw["type"] == "way":
        yield from (f"node/{one}" for one in _list(raw.get("nodes")))
    elif raw["type"] == "relation":
        members = (one for one in _list(raw.get("members")) if isinstance(one, dict))
        yield from (f"{one.get('type')}/{one.get('ref')}" for one in members)


def _parts(raw: Raw, known: dict[str, Raw]) -> Iterator[tuple[str, tuple[Position, ...], int]]:
    """(role, positions, points that are missing) of each way of the element, or of the node."""
    if raw["type"] == "node":
        position = _position(raw)
        if position is not None:
            yield "", (position,), 0
    elif raw["type"] == "way":
        yield "", *_line(raw, known)
    else:
        for member in _list(raw.get("members")):
            if not isinstance(member, dict) or member.get("type") != "way":
                continue
            way = known.get(f"way/{member.get('ref')}", {})
            inline = isinstance(member.get("geometry"), list)
            yield str(member.get("role") or "outer"), *_line(member if inline else way, known)


def _line(raw: Raw, known: dict[str, Raw]) -> tuple[tuple[Position, ...], int]:
    """The positions of a way, and how many are missing: Overpass writes null for those that a box cut off."""
    if isinstance(raw.get("geometry"), list) or "nodes" not in raw:
        found = [_position(one) for one in _list(raw.get("geometry"))]
    else:
        found = [_position(known.get(f"node/{one}")) for one in _list(raw.get("nodes"))]
    made: list[Position] = []
    for position in found:
        if position is not None and (not made or made[-1] != position):
            made.append(position)
    return tuple(made), found.count(None) if found else 1


def _list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []


def _position(raw: Any) -> Position | None:
    if not isinstance(raw, dict):
        return None
    latitude, longitude = raw.get("lat"), raw.get("lon")
    if not isinstance(latitude, int | float) or not isinstance(longitude, int | float):
        return None
    if not (-90 <= latitude <= 90 and -180 <= longitude <= 180):
        return None
    return float(longitude), float(latitude)
