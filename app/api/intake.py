"""The other ways in: sweeps as octets, node events and target reports as JSON."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

import msgspec
from fastapi import APIRouter, Path
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response

from app.api import models
from app.api.context import Context, answer, problems
from app.api.problems import ApiProblem
from app.contract import RefusedTime
from app.ingest import octets
from app.ingest.node_events import NodeEventRow, parse_node_events
from app.ingest.target_reports import TargetReportRow, parse_target_reports

OCTETS = "application/octet-stream"
JSON = "application/json"


def intake_router(context: Context) -> APIRouter:
    """POST /api/v1/radars/{id}/sweeps, /nodes/events, /targets/reports."""
    router = APIRouter(prefix="/api/v1", tags=["ways in"])
    service, limits = context.service, context.settings.limits
    failures = problems(403, 404, 409, 413, 415, 422, 503)

    @router.post(
        "/radars/{id}/sweeps",
        response_model=models.Counted,
        responses=failures,
        description=octets.__doc__,
        openapi_extra={"requestBody": {"required": True, "content": {OCTETS: {"schema": {"type": "string"}}}}},
    )
    async def sweeps(id: Annotated[str, Path(max_length=32)], request: Request) -> Response:
        body = await _body(request, OCTETS)
        counted = await run_in_threadpool(context.ask, lambda: service.submit_sweeps(id, body), 422)
        return answer(counted)

    @router.post(
        "/nodes/events",
        response_model=models.Counted,
        responses=failures,
        openapi_extra=_json_body(NodeEventRow, limits.node_events_per_request),
    )
    async def node_events(request: Request) -> Response:
        """Events of the nodes in the pavement, one object or an array; nothing is taken when one is wrong.

        Events whose time is too far from that of their arrival are refused and counted by reason, the others taken.
        """
        body = await _body(request, JSON)
        events = _parsed(lambda: parse_node_events(body, service.nodes, limits.node_events_per_request))
        return answer(await run_in_threadpool(_submitted, context, lambda: service.submit_node_events(events)))

    @router.post(
        "/targets/reports",
        response_model=models.Counted,
        responses=failures,
        openapi_extra=_json_body(TargetReportRow, limits.node_events_per_request),
    )
    async def target_reports(request: Request) -> Response:
        """Positions that cooperative sensors give (ADS-B, multilateration, vehicle beacons).

        `source` names the sensor or feed that a report came through: at most 16 ASCII letters, digits, `_`, `-`, `.`.
        Reports whose time is too far from that of their arrival are refused and counted by reason, the others taken.
        """
        body = await _body(request, JSON)
        frame, limit = service.airport.frame, limits.node_events_per_request
        reports = _parsed(lambda: parse_target_reports(body, frame, limit))
        return answer(await run_in_threadpool(_submitted, context, lambda: service.submit_target_reports(reports)))

    return router


async def json_body(request: Request) -> bytes:
    """The body of a request with JSON in it. Raises ApiProblem (415) for another content type."""
    return await _body(request, JSON)


async def _body(request: Request, media_type: str) -> bytes:
    given = request.headers.get("content-type", "").split(";")[0].strip().lower()
    if given != media_type:
        raise ApiProblem(415, f"content type {media_type} wanted", headers={"Accept": media_type})
    return await request.body()


def _submitted(context: Context, work: Callable[[], dict[str, int]]) -> dict[str, int]:
    """What was taken and refused. Raises ApiProblem: 422 when all is refused for its time, 503 for want of room."""
    try:
        counted: dict[str, int] = context.ask(work, 503)
    except ApiProblem as error:
        if isinstance(error.__cause__, RefusedTime):
            raise ApiProblem(422, str(error.__cause__)) from error
        raise
    return counted


def _parsed(work: Callable[[], Any]) -> Any:
    try:
        return work()
    except ValueError as error:
        raise ApiProblem(422, str(error)) from error


def _json_body(row: type[msgspec.Struct], limit: int) -> dict[str, Any]:
    """The request body for OpenAPI, from the struct that decodes it."""
    schemas, components = msgspec.json.schema_components([row], ref_template="#/components/schemas/{name}")
    one = components[row.__name__] if row.__name__ in components else schemas[0]
    many = {"type": "array", "items": one, "maxItems": limit}
    return {"requestBody": {"required": True, "content": {JSON: {"schema": {"anyOf": [one, many]}}}}}
