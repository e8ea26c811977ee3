"""GET and PUT /api/v1/radars/{id}/parts, over the real switch of a radar that does not turn."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import httpx
import jsonschema_rs
import pytest

from pipeline import catalogue, parts
from tests.support.running import Server, running, until

FRONT_END = ("detect", "extract")
PATH = "/api/v1/radars/smr-1/parts"


@pytest.fixture
def own() -> Iterator[Server]:
    with running() as made:
        yield made


@pytest.fixture
def client(own: Server) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=own.url, timeout=60.0) as made:
        yield made


def put(client: httpx.Client, order: Any, status: int = 200, **how: Any) -> Any:
    answer = client.put(PATH, json=order, **how)
    assert answer.status_code == status, answer.text
    return answer.json()


def test_what_runs_and_what_there_is(client: httpx.Client) -> None:
    body = client.get(PATH).json()
    assert set(body["running"]) == set(body["available"]) >= set(FRONT_END)
    assert body["running"]["extract"]["name"] == "hysteresis"
    assert body["next"] is None
    assert body["plots_a_scan"] == 214
    assert body["ms_a_turn"]["detect"] == 18.4
    for verb, found in body["available"].items():
        assert {one["name"] for one in found} == set(parts.available(verb))
        assert all(one["about"] for one in found)
        for one in found:
            if one["name"] == body["running"][verb]["name"]:
                assert {"name", *(field["name"] for field in one["settings"])} == set(body["running"][verb])
    hybrid = next(one for one in body["available"]["detect"] if one["name"] == "hybrid")
    pfa = next(one for one in hybrid["settings"] if one["name"] == "pfa")
    assert (pfa["type"], pfa["default"]) == ("number", 1e-6)
    assert "false alarm" in pfa["about"]


def test_parts_are_chosen_and_named_in_the_sensor_state(own: Server, client: httpx.Client) -> None:
    order = {"detect": {"name": "hybrid", "pfa": 1e-5}, "extract": {"name": "manhattan", "min_cells": 2}}
    body = put(client, order)
    assert body["running"]["detect"] == {**body["running"]["detect"], "name": "hybrid", "pfa": 1e-5}
    assert body["running"]["extract"]["min_cells"] == 2
    assert client.get(PATH).json()["running"] == body["running"]
    body = put(client, {"detect": "adaptive"})
    assert body["running"]["detect"]["name"] == "adaptive"
    assert body["running"]["extract"]["min_cells"] == 2, "what is left out stays"
    assert put(client, body["running"])["running"] == body["running"], "what is told can be sent back"
    other = client.get("/api/v1/radars/smr-2/parts").json()
    assert other["running"]["extract"]["min_cells"] == 1
    own.service.step()
    until(lambda: own.hub.picture is not None, "the picture is numbered")
    names = {one["id"]: one["parts"] for one in client.get("/api/v1/picture").json()["sensors"]}
    assert names["smr-1"]["detect"] == "adaptive"
    assert names["nodes"] == {}


@pytest.mark.parametrize(
    ("order", "words"),
    [
        ({"detect": {"name": "hybird"}}, "did you mean 'hybrid'?"),
        ({"detect": "hybird"}, "did you mean 'hybrid'?"),
        ({"detect": {"name": "hybrid", "pfaa": 0.1}}, "did you mean 'pfa'?"),
        ({"detect": {"name": "hybrid", "pfa": 2.0}}, "pfa must"),
        ({"detect": {"name": "hybrid", "pfa": "low"}}, "pfa must be float, not 'low'"),
        ({"detect": {"name": "hybrid", "memory": 2.5}}, "memory must be int"),
        ({"detect": {"name": "hybrid", "memory": True}}, "memory must be int"),
        ({"detct": {"name": "hybrid"}}, "did you mean 'detect'?"),
        ({"filter": {"name": "kalman"}}, "no part of a radar is called 'filter'"),
        ({"detect": {"pfa": 1e-5}}, "name"),
        ({"extract": {"name": "manhattan", "ring_m": "wide"}}, "manhattan"),
        ({"detect": 5}, "detect"),
        ({}, "no part is named"),
        ([], "dict"),
    ],
)
def test_wrong_parts_are_refused_with_the_nearest_right_word(client: httpx.Client, order: Any, words: str) -> None:
    before = client.get(PATH).json()["running"]
    answer = client.put(PATH, json=order)
    assert answer.status_code == 422, answer.text
    assert words in answer.json()["detail"]
    assert client.get(PATH).json()["running"] == before


def test_who_may_not_and_what_is_not_there(own: Server, client: httpx.Client) -> None:
    put(client, {"detect": "hybrid"}, 403, headers={"Origin": "https://elsewhere.example"})
    assert client.put("/api/v1/radars/nobody/parts", json={"detect": "hybrid"}).status_code == 404
    assert client.get("/api/v1/radars/nobody/parts").status_code == 404


def test_the_examples_of_the_document_are_true(client: httpx.Client) -> None:
    document = client.get("/openapi.json").json()
    schemas = document["components"]["schemas"]
    for name, key in (("PartsOrder", None), ("RadarParts", "running"), ("Sensor", "parts")):
        schema = schemas[name] if key is None else schemas[name]["properties"][key]
        for example in schema["examples"]:
            jsonschema_rs.Draft202012Validator({**schema, "components": document["components"]}).validate(example)
    for example in schemas["PartsOrder"]["examples"]:
        put(client, example)


@pytest.mark.parametrize("verb", parts.VERBS)
def test_every_setting_that_can_be_changed_live_is_explained(verb: str) -> None:
    for method in catalogue.methods(verb):
        assert method.about, method.name
        for one in method.settings:
            assert one.type != "object", (verb, method.name, one.name)
            if verb in FRONT_END:
                assert one.about, f"{verb} {method.name}: the docstring of the part says nothing of {one.name}"
