"""Schemathesis runs the OpenAPI document against a real server; bounded, and the same every time."""

from __future__ import annotations

from typing import Any

import httpx
import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, given, settings
from schemathesis import GenerationMode
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    negative_data_rejection,
    response_schema_conformance,
    status_code_conformance,
    unsupported_method,
)

from tests.support.running import Server

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
