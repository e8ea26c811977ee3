"""OpenStreetMap XML (https://wiki.openstreetmap.org/wiki/OSM_XML) in the form of Overpass JSON."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any
from xml.etree.ElementTree import Element as Node
from xml.etree.ElementTree import ParseError

from pipeline.airport.osm import ImportFault


def document_of_xml(octets: bytes) -> dict[str, Any]:
    """{"elements": [...]} and, where the server wrote one, "remark". Raises ImportFault.

    Documents with a DTD or entities of their own are refused: OpenStreetMap has none, and they can be made to fill the
    memory or to read other files.
    """
    from defusedxml import DefusedXmlException
    from defusedxml.ElementTree import fromstring

    try:
        root = fromstring(octets, forbid_dtd=True)
    except DefusedXmlException as error:
        what = _error_page(octets) or "a document type or entities, which OpenStreetMap files do not have"
        raise ImportFault(f"the file is XML, but no OpenStreetMap extract: {what}") from error
    except (ParseError, ValueError, LookupError) as error:
        what = _error_page(octets) or str(error)
        raise ImportFault(f"the file cannot be read as XML ({what})") from error
    if root.tag != "osm":
        what = _error_page(octets) or f"its outermost element is <{root.tag}>, not <osm>"
        raise ImportFault(f"the file is XML, but no OpenStreetMap extract: {what}")
    made: dict[str, Any] = {"elements": [_element(one) for one in root if one.tag in ("node", "way", "relation")]}
    remarks = " ".join((one.text or "").strip() for one in root if one.tag == "remark").strip()
    return made | ({"remark": remarks} if remarks else {})


def _error_page(octets: bytes) -> str:
    """What a server says on the page that it sends in place of an extract; "" when this is no such page."""
    text = octets[:20_000].decode("utf-8", "replace")
    if "<html" not in text.lower():
        return ""
    body = re.sub(r"(?is)<(head|style|script)\b.*?</\1>", " ", text)
    words = re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", body)).strip()
    return f"it is a web page that says {words[:300]!r}"


def _element(node: Node) -> dict[str, Any]:
    if node.get("visible") == "false" or node.get("action") == "delete":  # editors keep what was deleted
        return {"type": node.tag, "id": node.get("id", ""), "deleted": True}
    made: dict[str, Any] = {"type": node.tag, "id": node.get("id", "")}
    tags = {one.get("k", ""): one.get("v", "") for one in node if one.tag == "tag"}
    if tags:
        made["tags"] = tags
    if node.tag == "node":
        made |= _position(node) or {}
    elif node.tag == "way":
        made |= _way(node)
    else:
        made["members"] = list(_members(node))
    return made


def _way(node: Node) -> dict[str, Any]:
    points = [one for one in node if one.tag == "nd"]
    made: dict[str, Any] = {"nodes": [one.get("ref", "") for one in points]}
    geometry = [_position(one) for one in points]
    return made | ({"geometry": geometry} if any(geometry) else {})


def _members(node: Node) -> Iterator[dict[str, Any]]:
    for one in node:
        if one.tag == "member":
            made: dict[str, Any] = {"type": one.get("type", ""), "ref": one.get("ref", ""), "role": one.get("role", "")}
            geometry = [_position(point) for point in one if point.tag == "nd"]
            yield made | ({"geometry": geometry} if any(geometry) else {})


def _position(node: Node) -> dict[str, float] | None:
    try:
        return {"lat": float(node.get("lat", "")), "lon": float(node.get("lon", ""))}
    except ValueError:
        return None
