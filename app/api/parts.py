"""GET and PUT /api/v1/radars/{id}/parts: which methods work on a radar's video, and the choice of others."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Any

from fastapi import APIRouter, Path
from starlette.responses import Response

from app.api import part_models
from app.api.context import Context, answer, problems
from app.api.problems import ApiProblem
from app.contract import FrontEnd, WrongParts
from pipeline import catalogue

RadarId = Annotated[str, Path(max_length=32)]


def parts_router(context: Context) -> APIRouter:
    """The parts of each radar's front end."""
    router = APIRouter(prefix="/api/v1", tags=["parts"])
    service, mode = context.service, context.settings.mode

    def told(state: FrontEnd) -> Response:
        available = {verb: [asdict(one) for one in catalogue.methods(verb)] for verb in state.running}
        return answer({"mode": mode, **asdict(state), "available": available})

    @router.get("/radars/{id}/parts", response_model=part_models.RadarParts, responses=problems(404, 422, 503))
    def parts(id: RadarId) -> Response:
        """The parts that work on a radar's video with all their settings, their cost, and what else there is."""
        return told(context.ask(lambda: service.front_end(id)))

    @router.put(
        "/radars/{id}/parts",
        response_model=part_models.RadarParts,
        responses=problems(400, 403, 404, 409, 413, 422, 503),
    )
    def choose(id: RadarId, order: part_models.PartsOrder) -> Response:
        """Have other parts work on a radar's video, without a break in the picture.

        The new parts are built and compiled beside the old ones, which may take a while the first time. A detector that
        must learn before it detects learns beside the one that runs, and takes over after `scans_left` turns; another
        takes over at once. Tracks and counters go on. After a restart the settings file holds again.
        """
        wanted = {verb: _choice(one) for verb, one in order.root.items()}
        if not wanted:
            raise ApiProblem(422, "no part is named")
        try:
            return told(context.ask(lambda: service.choose_parts(id, wanted)))
        except WrongParts as error:
            raise ApiProblem(422, str(error)) from error

    return router


def _choice(one: part_models.PartChoice | str) -> dict[str, Any]:
    return {"name": one} if isinstance(one, str) else {"name": one.name, **(one.model_extra or {})}
