"""Files in every format give the same airport; what is no whole extract is refused with the reason."""

from __future__ import annotations

import gzip
import json
from typing import Any

import pytest

from app.ingest.osm_extract import parse_extract
from pipeline.airport.osm import ImportFault, airport_geojson
from tests.pipeline.airport.extracts import extract, runway
from tests.pipeline.airport.osm.other_formats import FIELD, as_turbo, as_xml, with_nodes_beside


def made(document: Any) -> dict[str, Any]:
    return airport_geojson(document, "TEST")


@pytest.mark.parametrize(
    "octets",
    [
        json.dumps(with_nodes_beside(FIELD)).encode(),
        json.dumps(with_nodes_beside(FIELD)).encode("utf-16"),
        b"\xef\xbb\xbf" + json.dumps(FIELD).encode(),
        as_xml(FIELD),
        as_xml(FIELD).decode().replace("UTF-8", "UTF-16").encode("utf-16"),
        json.dumps(as_turbo(FIELD)).encode(),
    ],
    ids=["nodes beside", "nodes beside, utf-16", "inline, with a byte order mark", "xml", "xml, utf-16", "turbo"],
)
def test_every_format_gives_the_same_airport(octets: bytes) -> None:
    given, wanted = made(parse_extract(octets)), made(FIELD)
    assert given["import"] == wanted["import"]
    assert given["features"] == wanted["features"]


def test_ways_of_overpass_xml_with_the_geometry_inline() -> None:
    text = as_xml(extract(runway())).decode()
    nodes = dict(part.split('" lat=', 1) for part in text.split('<node id="')[1:])
    for id, rest in nodes.items():
        text = text.replace(f'<nd ref="{id}"/>', f'<nd ref="{id}" lat={rest.split(">")[0]}/>')
    ways_only = text[: text.index("<node")] + "</osm>"
    assert made(parse_extract(ways_only.encode()))["import"]["counts"]["RunwayElement"] == 1


@pytest.mark.parametrize(
    "remark", ['runtime error: Query timed out in "query" at line 3', "runtime error: out of memory"]
)
def test_an_extract_that_the_server_cut_off_is_refused(remark: str) -> None:
    cut_off = {**FIELD, "remark": remark}
    turbo = {**as_turbo(FIELD), "remark": remark}
    for octets in (json.dumps(cut_off).encode(), as_xml(cut_off), json.dumps(turbo).encode()):
        with pytest.raises(ImportFault, match=f"not complete.*{remark[:14]}"):
            made(parse_extract(octets))
    assert made({**FIELD, "remark": ""})["features"]


def test_deleted_elements_of_an_editor_are_not_there() -> None:
    text = as_xml(extract(runway(), runway([(-900, 800), (900, 800)], ref="08/26"))).decode()
    second = text.index("<way", text.index("<way") + 1)
    text = text[:second] + text[second:].replace("<way", '<way action="delete"', 1)
    assert made(parse_extract(text.encode()))["import"]["counts"]["RunwayElement"] == 1


BOMB = b"""<?xml version="1.0"?><!DOCTYPE osm [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>
<osm version="0.6"><node id="1" lat="1" lon="2"><tag k="name" v="&b;"/></node></osm>"""
READS_A_FILE = b"""<?xml version="1.0"?><!DOCTYPE osm [<!ENTITY a SYSTEM "file:///etc/hostname">]>
<osm version="0.6"><node id="1" lat="1" lon="2"><tag k="name" v="x"/></node></osm>"""
ERROR_PAGE = b"""<?xml version="1.0" encoding="UTF-8"?>
<!DOCTYPE html PUBLIC "-//W3C//DTD XHTML 1.0 Strict//EN" "http://www.w3.org/TR/xhtml1/DTD/xhtml1-strict.dtd">
<html xmlns="http://www.w3.org/1999/xhtml"><head><title>OSM3S Response</title></head>
<body><p>Error: runtime error: Probably the server is too busy to handle your request.</p></body></html>"""


@pytest.mark.parametrize(
    ("octets", "message"),
    [
        (b"", "empty"),
        (b" \n", "empty"),
        (b"{", "neither JSON nor XML"),
        (json.dumps(FIELD).encode()[:300], "neither JSON nor XML"),
        (b"[" * 100_000, "neither JSON nor XML"),
        (as_xml(FIELD)[:300], "cannot be read as XML"),
        (gzip.compress(json.dumps(FIELD).encode()), "gzip"),
        (b"\x00\x00\x00\x0e\x0a\x09OSMHeader\x18\x7c", "PBF"),
        (BOMB, "document type or entities"),
        (READS_A_FILE, "document type or entities"),
        (ERROR_PAGE, "too busy"),
        (b"<html><body>504 Gateway Timeout<br></body></html>", "504 Gateway"),
        (b"<osmChange version='0.6'/>", "<osmChange>"),
    ],
)  # fmt: skip
def test_what_is_no_extract_is_refused_with_the_reason(octets: bytes, message: str) -> None:
    with pytest.raises(ImportFault, match=message):
        made(parse_extract(octets))
