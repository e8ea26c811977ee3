"""The octets of an extract to one document in the form of Overpass JSON, whatever format they are in.

JSON of Overpass, GeoJSON as overpass-turbo exports it, and XML as Overpass and openstreetmap.org write it
(https://wiki.openstreetmap.org/wiki/OSM_XML).
"""

from __future__ import annotations

import json
from typing import Any

from app.ingest.osm_xml import document_of_xml
from pipeline.airport.osm import ImportFault

NO_TEXT = {b"\x1f\x8b": "gzip", b"BZh": "bzip2", b"PK\x03\x04": "zip"}
"""How compressed files begin."""
PBF_HEADER = b"OSMHeader"
"""Stands in the first block of every .osm.pbf file."""


def parse_extract(octets: bytes) -> Any:
    """The document in an extract: JSON as it is, XML in the form of Overpass JSON. Raises ImportFault."""
    start = octets.lstrip(b"\xef\xbb\xbf \t\r\n")[:64]
    if not start:
        raise ImportFault("the file is empty")
    packed = next((name for begin, name in NO_TEXT.items() if octets.startswith(begin)), None)
    if packed:
        raise ImportFault(f"the file is compressed ({packed}): unpack it first")
    if PBF_HEADER in start:
        raise ImportFault(
            "the file is OpenStreetMap PBF: convert it to XML first (osmium cat FILE.osm.pbf -o FILE.osm)"
        )
    if start.startswith((b"<", b"\xff\xfe<", b"\xfe\xff\x00<")):
        return document_of_xml(octets)
    try:
        return json.loads(octets)
    except (ValueError, RecursionError) as error:
        raise ImportFault(f"the file is neither JSON nor XML ({error})") from error
