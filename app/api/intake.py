"""The other ways in: sweeps as octets, node events and target reports as JSON."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from typing import Annotated, Any, Literal, TypeVar

from fastapi import APIRouter, Path
from starlette.requests import Request
from starlette.responses import Response

from app.api import models
from app.api.context import Context, answer, problems
from app.api.openapi import json_rows
from app.api.problems import ApiProblem
from app.contract import RefusedRow, RefusedTime, Submitted
from app.ingest import octets
from app.ingest.node_events import NodeEventRow, parse_node_events
from app.ingest.target_reports import TargetReportRow, parse_target_reports
from app.ingest.wire_json import BadMessage, Parsed
from app.wire import Row
from pipeline.tables import NodeEvents, TargetReports

OCTETS = "application/octet-stream"
JSON = "application/json"

Rows = TypeVar("Rows", NodeEvents, TargetReports)


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
        openapi_extra={
            "requestBody": {"required": True, "content": {OCTETS: {"schema": {"type": "string", "format": "binary"}}}}
        },
    )
    async def sweeps(id: Annotated[str, Path(max_length=32)], request: Request) -> Response:
        body = await _body(request, OCTETS)
        counted = await context.take_in(lambda: context.ask(lambda: service.submit_sweeps(id, body), 422))
        return answer(counted)

    @router.post(
        "/nodes/events",
        response_model=models.RowsTaken,
        responses=failures,
        openapi_extra=json_rows(NodeEventRow, limits.node_events_per_request),
    )
    async def node_events(request: Request) -> Response:
        """Events of the nodes in the pavement, one object or an array.

        The good ones are taken, and each that is not is told in `errors` by its index and the reason: what is wrong
        with it, or that its time is too far from that of its arrival. Unknown members are ignored and named in
        `ignored`. 422 when nothing can be taken.
        """
        body = await _body(request, JSON)
        read = partial(parse_node_events, body, service.nodes, limits.node_events_per_request)
        return answer(await context.take_in(lambda: _take(context, "nodes", read, service.submit_node_events)))

    @router.post(
        "/targets/reports",
        response_model=models.RowsTaken,
        responses=failures,
        openapi_extra=json_rows(TargetReportRow, limits.node_events_per_request),
    )
    async def target_reports(request: Request) -> Response:
        """Positions that cooperative sensors give (ADS-B, multilateration, vehicle beacons), one object or an array.

        `address`: six hexadecimal digits, with `~` before one that is not of ICAO; `000000` and `ffffff` are none.
        `on_ground`: left out when unknown; then the altitude decides, and without one it is held to be on the ground.
        `source` names the sensor or feed that a report came through: at most 16 ASCII letters, digits, `_`, `-`, `.`.

        The good ones are taken, and each that is not is told in `errors` by its index and the reason: what is wrong
        with it, or that its time is too far from that of its arrival. Unknown members are ignored and named in
        `ignored`. 422 when nothing can be taken.
        """
        body = await _body(request, JSON)
        read = partial(parse_target_reports, body, service.airport.frame, limits.node_events_per_request)
        return answer(await context.take_in(lambda: _take(context, "reports", read, service.submit_target_reports)))

    return router


async def json_body(request: Request) -> bytes:
    """The body of a request with JSON in it. Raises ApiProblem (415) for another content type."""
    return await _body(request, JSON)


async def _body(request: Request, media_type: str) -> bytes:
    given = request.headers.get("content-type", "").split(";")[0].strip().lower()
    if given != media_type:
        raise ApiProblem(415, f"content type {media_type} wanted", headers={"Accept": media_type})
    return await request.body()


def _take(
    context: Context,
    feed: Literal["nodes", "reports"],
    read: Callable[[], Parsed[Rows]],
    submit: Callable[[Rows], Submitted],
) -> Row:
    """Read and submit the rows of a message; what was taken, and each row that was not.

    Raises ApiProblem: 422 when nothing is taken, with the reason of each row; 503 for want of room.
    """
    try:
        parsed = read()
    except BadMessage as error:
        context.service.note_bad_rows(feed, Counter(one.reason for one in error.rows))
        raise ApiProblem(422, str(error), errors=_errors(error.rows)) from error
    context.service.note_bad_rows(feed, Counter(one.reason for one in parsed.bad))
    try:
        submitted: Submitted = context.ask(lambda: submit(parsed.rows), 503)
    except ApiProblem as error:
        if isinstance(error.__cause__, RefusedTime):
            rows = _placed(error.__cause__.rows, parsed)
            raise ApiProblem(422, str(error.__cause__), errors=_errors(rows)) from error
        raise
    rows = _placed(submitted.refused, parsed)
    counts = Counter(f"refused_{one.reason}" for one in rows)
    made: Row = {"taken": submitted.taken, **counts}
    if rows:
        made["errors"] = _errors(rows)
    if parsed.ignored:
        made["ignored"] = parsed.ignored
    return made


def _placed(refused: Sequence[RefusedRow], parsed: Parsed[Any]) -> list[RefusedRow]:
    """All rows that were not taken, by their place in the message."""
    return sorted([*parsed.bad, *(one._replace(row=parsed.places[one.row]) for one in refused)])


def _errors(rows: Sequence[RefusedRow]) -> list[Row]:
    return [{"index": one.row, "reason": one.reason, "message": one.message} for one in rows]
