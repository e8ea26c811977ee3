"""Schemathesis runs the OpenAPI document against a real server; bounded, and the same every time."""

from __future__ import annotations

import importlib
import io
import json
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, given, settings
from openapi_spec_validator import OpenAPIV31SpecValidator
from schemathesis import GenerationMode
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    negative_data_rejection,
    response_schema_conformance,
    status_code_conformance,
    unsupported_method,
)

from app.ingest.octets import encode_sweeps
from tests.support.running import Server
from tests.support.sweeps import sweeps_of

CHECKS = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_schema_conformance,
    unsupported_method,
    negative_data_rejection,
]


@pytest.mark.parametrize("mode", [GenerationMode.POSITIVE, GenerationMode.NEGATIVE], ids=["right", "wrong"])
def test_the_service_keeps_to_its_document(server: Server, mode: GenerationMode) -> None:
    schema = schemathesis.openapi.from_url(f"{server.url}/openapi.json")
    operations: list[Any] = [one.ok() for one in schema.get_all_operations()]
    assert len(operations) >= 20
    tried: set[str] = set()
    for operation in operations:
        if mode is GenerationMode.NEGATIVE and not (operation.path_parameters or operation.query or operation.body):
            continue

        @settings(
            max_examples=6,
            derandomize=True,
            deadline=None,
            database=None,
            phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        )
        @given(case=operation.as_strategy(generation_mode=mode))
        def run(case: Any) -> None:
            tried.add(case.operation.label)
            case.call_and_validate(checks=CHECKS, timeout=20)

        run()
    assert "POST /api/v1/alerts/{id}/acknowledge" in tried
    assert "PUT /api/v1/runways/{id}/state" in tried


def test_the_octets_of_posted_sweeps_are_described_where_a_client_looks(server: Server) -> None:
    document = httpx.get(f"{server.url}/openapi.json", timeout=10).json()
    told = document["paths"]["/api/v1/radars/{id}/sweeps"]["post"]["description"]
    assert all(word in told for word in ("ASWP", "little-endian", "48 + n * (16 + cells)"))


def test_the_resume_place_is_described_as_the_feed_takes_it(server: Server) -> None:
    document = httpx.get(f"{server.url}/asyncapi.json", timeout=10).json()
    assert "`resume`" in document["info"]["description"]
    assert set(document["components"]["schemas"]["ResumePlace"]["properties"]) == {"epoch", "seq"}


@pytest.fixture(scope="module")
def document(server: Server) -> dict[str, Any]:
    made: dict[str, Any] = httpx.get(f"{server.url}/openapi.json", timeout=10).json()
    return made


def test_a_linter_finds_no_fault_in_the_document(document: dict[str, Any]) -> None:
    errors = [f"{'/'.join(map(str, one.absolute_path))}: {one.message}" for one in validator(document).iter_errors()]
    assert errors == []


def test_the_linter_sees_a_fault(document: dict[str, Any]) -> None:
    wrong = json.loads(json.dumps(document).replace('"operationId": "tracks"', '"operationId": "alerts"'))
    assert list(validator(wrong).iter_errors())
    assert list(validator({**document, "servers": ["/"]}).iter_errors())


def validator(document: dict[str, Any]) -> OpenAPIV31SpecValidator:
    return OpenAPIV31SpecValidator(document)


def test_what_is_said_in_many_places_has_a_name(document: dict[str, Any]) -> None:
    """Problems and the rows of the ways in are components; nothing with members is written out in an operation."""
    schemas = document["components"]["schemas"]
    assert {"Problem", "NodeEvent", "TargetReport", "RowsTaken", "GeoJson", "ReplayOrder"} <= set(schemas)
    assert set(schemas["TargetReport"]["required"]) == {"time", "lat", "lon"}
    assert '"properties"' not in json.dumps(document["paths"])
    problems = [
        body["schema"]
        for calls in document["paths"].values()
        for call in calls.values()
        for answer in call["responses"].values()
        for kind, body in answer.get("content", {}).items()
        if kind == "application/problem+json"
    ]
    assert len(problems) > 50
    assert all(one == {"$ref": "#/components/schemas/Problem"} for one in problems)


def test_every_operation_has_a_name_of_its_own_and_a_tag_that_is_described(document: dict[str, Any]) -> None:
    calls = [call for calls in document["paths"].values() for call in calls.values()]
    names = [call["operationId"] for call in calls]
    assert len(set(names)) == len(names)
    assert all(re.fullmatch("[a-z_]+", name) for name in names)
    described = {one["name"] for one in document["tags"]}
    assert {tag for call in calls for tag in call["tags"]} == described


def test_it_is_said_where_the_service_is_and_that_it_has_no_users(document: dict[str, Any]) -> None:
    assert [one["url"] for one in document["servers"]] == ["/"]
    assert {} in document["security"]
    named = {name for one in document["security"] for name in one}
    assert named == set(document["components"]["securitySchemes"])


GENERATOR_SETTINGS = {
    "post_hooks": [],
    "content_type_overrides": {"image/png": "application/octet-stream"},  # the generator knows no pictures
}


@pytest.fixture(scope="module")
def client_folder(document: dict[str, Any], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The folder of a client that openapi-python-client made of the document, without a warning."""
    folder = tmp_path_factory.mktemp("generated")
    (folder / "openapi.json").write_text(json.dumps(document))
    (folder / "settings.json").write_text(json.dumps(GENERATOR_SETTINGS))
    words = ["generate", "--meta", "none", "--fail-on-warning", "--path", "openapi.json", "--config", "settings.json"]
    made = subprocess.run(
        [sys.executable, "-m", "openapi_python_client", *words, "--output-path", "airside_client"],
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert made.returncode == 0, made.stdout + made.stderr
    sys.path.insert(0, str(folder))
    yield folder
    sys.path.remove(str(folder))


@pytest.mark.usefixtures("client_folder")
def test_a_generated_client_has_the_ways_in(server: Server) -> None:
    made = importlib.import_module("airside_client")
    models, ways = (importlib.import_module(f"airside_client.{one}") for one in ("models", "api.ways_in"))
    node_events, target_reports, sweeps = (
        importlib.import_module(f"{ways.__name__}.{one}") for one in ("node_events", "target_reports", "sweeps")
    )
    client = made.Client(base_url=server.url)
    now = time.time()
    good = models.TargetReport(time=now, lat=48.7233, lon=2.3794, address="~2a1b3c", altitude_m=900.0)
    bad = models.TargetReport(time=now, lat=95.0, lon=2.3794)
    answer = target_reports.sync(client=client, body=[good, bad])
    assert isinstance(answer, models.RowsTaken)
    assert (answer.taken, [one.index for one in answer.errors]) == (1, [1])
    assert server.service.target_reports[-1].address.tolist() == ["~2a1b3c"]
    assert isinstance(target_reports.sync(client=client, body=bad), models.Problem)
    event = models.NodeEvent(time=now, node="node-1", kind=models.NodeEventKind.LEFT)
    assert node_events.sync(client=client, body=event).taken == 1
    site = server.service.radars[0]
    body = encode_sweeps(sweeps_of(site, rows=8), site)
    types = importlib.import_module("airside_client.types")
    assert sweeps.sync("smr-1", client=client, body=types.File(payload=io.BytesIO(body))).taken == 8
