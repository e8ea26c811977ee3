"""Nodes beside the ways and GeoJSON give the same airport as geometry inline."""

from __future__ import annotations

import json
from typing import Any

import pytest

from pipeline.airport.osm import ImportFault, airport_geojson
from tests.pipeline.airport.osm.other_formats import FIELD, as_turbo, with_nodes_beside


def made(document: Any) -> dict[str, Any]:
    return airport_geojson(document, "TEST")


@pytest.mark.parametrize("form", [with_nodes_beside, as_turbo])
def test_every_form_gives_the_same_airport(form: Any) -> None:
    given, wanted = made(form(FIELD)), made(FIELD)
    assert given["import"] == wanted["import"]
    assert given["features"] == wanted["features"]


def test_tags_apart_from_the_other_properties() -> None:
    """The older form of osmtogeojson, and ids as osmium and QuickOSM write them."""
    document = as_turbo(FIELD)
    for feature in document["features"]:
        type, number = feature["id"].split("/")
        tags = {key: value for key, value in feature["properties"].items() if key != "@id"}
        feature["properties"] = {"type": type, "id": int(number), "tags": tags, "relations": [], "meta": {}}
        del feature["id"]
    assert made(document)["features"] == made(FIELD)["features"]
    for feature in document["features"]:
        about = feature["properties"]
        feature["properties"] = {"full_id": f"{about['type'][0]}{about['id']}", "osm_id": about["id"], **about["tags"]}
    assert made(document)["features"] == made(FIELD)["features"]


def test_a_centre_in_place_of_a_shape_is_no_shape() -> None:
    document = as_turbo(FIELD)
    document["features"][1]["properties"]["@geometry"] = "center"
    assert made(document)["import"]["left_out"] == {"no geometry": 1}


def test_a_way_whose_nodes_are_not_there_is_counted_and_a_gap_is_told() -> None:
    document = with_nodes_beside(FIELD)
    lost = document["elements"][2]["nodes"][0]
    document["elements"] = [one for one in document["elements"] if one["type"] != "node" or one["id"] != lost]
    told = made(document)["import"]
    assert told["left_out"] == {}
    assert any("lacks points of 1" in one and f"way/{FIELD['elements'][2]['id']}" in one for one in told["to_check"])
    document["elements"] = [one for one in document["elements"] if one["type"] != "node" or "tags" in one]
    with pytest.raises(ImportFault, match="extract of an airport"):
        made(document)


def test_a_finished_map_is_refused() -> None:
    with pytest.raises(ImportFault, match="Overpass extract"):
        made(json.loads(json.dumps(made(FIELD))))
