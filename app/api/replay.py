"""GET and PUT /api/v1/replay: where the replay of a journal stands, and how it is steered."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from fastapi import APIRouter
from fastapi.exceptions import RequestValidationError
from pydantic import ValidationError
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response

from app.api import replay_models
from app.api.context import Context, answer, instant, problems
from app.api.intake import JSON, json_body
from app.api.openapi import reference
from app.api.problems import ApiProblem
from app.contract import Refused, ReplayControl, ReplayState


def replay_router(context: Context) -> APIRouter:
    """The replay, where the service is one."""
    router = APIRouter(prefix="/api/v1", tags=["replay"])
    service, mode = context.service, context.settings.mode

    def control() -> ReplayControl:
        if service.replay is None:
            raise ApiProblem(404, "this service shows what happens now; there is no recording to play or to seek in")
        return service.replay

    def told(state: ReplayState) -> Response:
        return answer({"mode": mode, **asdict(state)})

    @router.get("/replay", response_model=replay_models.Replay, responses=problems(404))
    def replay() -> Response:
        """Which recording is shown, where it stands, and how fast it goes. 404 when nothing is replayed."""
        return told(control().state())

    body = {"content": {JSON: {"schema": reference("ReplayOrder")}}, "required": True}

    @router.put(
        "/replay",
        response_model=replay_models.Replay,
        responses=problems(403, 404, 413, 415, 422),
        openapi_extra={"requestBody": body},
    )
    async def steer(request: Request) -> Response:
        """Play or pause, at another pace, from another time of the recording; what is left out stays.

        A new time begins a new `epoch` of the live feed: every client is sent the picture anew.
        """
        wanted = _wanted(await json_body(request))
        try:
            return told(await run_in_threadpool(lambda: control().steer(**wanted)))
        except Refused as error:
            raise ApiProblem(422, str(error)) from error

    return router


def _wanted(body: bytes) -> dict[str, Any]:
    """What the order asks for. Raises RequestValidationError or ApiProblem."""
    try:
        order = replay_models.ReplayOrder.model_validate_json(body)
    except ValidationError as error:
        faults = [{**one, "loc": ("body", *one["loc"])} for one in error.errors()]
        raise RequestValidationError(faults) from error
    wanted = {name: value for name, value in order if value is not None}
    if not wanted:
        raise ApiProblem(422, "body: none of playing, speed and time is given")
    if "time" in wanted:
        try:
            wanted["time"] = instant(wanted["time"])
        except (ValueError, OverflowError) as error:
            raise ApiProblem(422, f"body.time: neither Unix seconds nor an ISO 8601 time ({error})") from error
    return wanted
