"""The picture and its parts: tracks, alerts, sensors, runways, map."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Path, Query
from sqlalchemy.exc import SQLAlchemyError
from starlette.responses import Response

from app.api import models
from app.api.context import Context, Span, answer, problems
from app.api.openapi import reference
from app.api.problems import ApiProblem
from app.store.read_pool import RETRY_LATE_S, NoAnswer
from app.wire import Row, encode

log = logging.getLogger(__name__)

TrackId = Annotated[int, Path(ge=1, le=models.LARGEST_ID, description="id of the track, as in the list of tracks")]
AlertId = Annotated[int, Path(ge=1, le=2**53)]
Limit = Annotated[int, Query(ge=1, le=10_000)]
GEOJSON = "application/geo+json"


def surveillance_router(context: Context) -> APIRouter:
    """GET /api/v1/picture, /tracks, /alerts, /sensors, /runways, /airport.geojson and the two orders."""
    router = APIRouter(prefix="/api/v1")
    _picture_routes(router, context)
    _track_routes(router, context)
    _history_routes(router, context)
    _alert_routes(router, context)
    _acknowledge_route(router, context)
    _runway_routes(router, context)
    return router


def _picture_routes(router: APIRouter, context: Context) -> None:
    service, hub, settings = context.service, context.hub, context.settings
    airport_document: list[bytes] = []

    @router.get("/picture", response_model=models.Picture, responses=problems(503), tags=["picture"])
    async def picture() -> Response:
        """Everything at one moment: tracks, alerts, runways, sensors."""
        document = hub.document()
        if document is None:
            raise ApiProblem(503, "there is no picture yet", headers={"Retry-After": "1"})
        return Response(document, media_type="application/json")

    @router.get("/sensors", response_model=models.SensorList, tags=["picture"])
    def sensors() -> Response:
        """The health of every sensor, with what was dropped by reason."""
        newest = service.picture()
        rows = [context.wire.sensor(one) for one in service.sensors()]
        return answer({"mode": settings.mode, "time": newest.time if newest else None, "sensors": rows})

    @router.get(
        "/airport.geojson",
        tags=["picture"],
        responses={200: {"content": {GEOJSON: {"schema": reference("GeoJson")}}}},
        response_class=Response,
    )
    def airport() -> Response:
        """The map; feature kinds follow AMDB names."""
        if not airport_document:
            airport_document.append(encode(service.airport_geojson))
        return Response(airport_document[0], media_type=GEOJSON, headers={"Cache-Control": "max-age=300"})


def _track_routes(router: APIRouter, context: Context) -> None:
    hub = context.hub

    @router.get("/tracks", response_model=models.TrackList, responses=problems(422, 503), tags=["tracks"])
    async def tracks(
        classes: Annotated[
            list[models.ClassName] | None, Query(alias="class", description="only these classes")
        ] = None,
    ) -> Response:
        """The live tracks."""
        stamp = context.stamp()
        rows = [row for row in hub.rows() if not classes or row["class"] in classes]
        return answer({**stamp, "tracks": rows})

    @router.get(
        "/tracks.geojson",
        tags=["tracks"],
        response_class=Response,
        responses={200: {"content": {GEOJSON: {"schema": reference("GeoJson")}}}, **problems(503)},
    )
    async def tracks_geojson() -> Response:
        """The live tracks as GeoJSON points."""
        stamp = context.stamp()
        features = [_feature(row) for row in hub.rows() if row["lat"] is not None]
        return Response(encode({"type": "FeatureCollection", **stamp, "features": features}), media_type=GEOJSON)

    @router.get("/tracks/{id}", response_model=models.TrackAnswer, responses=problems(404, 422, 503), tags=["tracks"])
    async def track(id: TrackId) -> Response:
        """One live track."""
        stamp = context.stamp()
        for row in hub.rows():
            if row["id"] == id:
                return answer({**stamp, "track": row})
        raise ApiProblem(404, f"no live track has the id {id}")


def _history_routes(router: APIRouter, context: Context) -> None:
    store, mode = context.store, context.settings.mode

    @router.get(
        "/tracks/{id}/history", response_model=models.History, responses=problems(404, 422, 503), tags=["tracks"]
    )
    async def history(id: TrackId, span: Span, limit: Limit = 3600) -> Response:
        """The stored points of the newest track with this id (or the newest within the given times)."""
        if store is None:
            raise ApiProblem(404, "nothing is stored")
        asked = store

        def found() -> Response:
            row = asked.track_history(id, *span, limit)
            if row is None:
                raise ApiProblem(404, f"no track with the id {id} is stored")
            return answer({"mode": mode, **row})

        return await context.reads.ask(found)

    @router.get("/history/tracks", response_model=models.StoredTrackList, responses=problems(422, 503), tags=["tracks"])
    async def stored_tracks(
        span: Span,
        callsign: Annotated[str | None, Query(max_length=8)] = None,
        limit: Limit = 200,
    ) -> Response:
        """Stored tracks, newest first."""
        if store is None:
            return answer({"mode": mode, "tracks": []})
        asked = store
        return await context.reads.ask(
            lambda: answer({"mode": mode, "tracks": asked.tracks(*span, callsign=callsign, limit=limit)})
        )


def _alert_routes(router: APIRouter, context: Context) -> None:
    service, store, mode = context.service, context.store, context.settings.mode

    def in_memory() -> dict[int, Row]:
        """Alerts of this run as they are now; what the database does not have yet is among them."""
        picture = service.picture()
        live = {one.id: one for one in picture.alerts} if picture is not None else {}
        return {id: context.wire.alert(one) for id, one in {**context.hub.recent.copy(), **live}.items()}

    @router.get("/alerts", response_model=models.AlertList, responses=problems(422), tags=["alerts"])
    async def alerts(
        span: Span,
        state: Annotated[Literal["live", "new", "ongoing", "acknowledged", "cleared"] | None, Query()] = None,
        limit: Limit = 200,
    ) -> Response:
        """Live and stored alerts that were raised within the given times, newest first.

        While the database does not answer, those of this run that are still in memory; `complete` is false then.
        """

        def told(stored: list[Row], complete: bool) -> Response:
            merged = {one["id"]: one for one in stored}
            for id, row in in_memory().items():
                merged.pop(id, None)
                live = state == "live" and row["state"] != "cleared"
                if (state is None or live or state == row["state"]) and _within(row["raised_at"], *span):
                    merged[id] = row
            rows = sorted(merged.values(), key=lambda row: (row["raised_at"], row["id"]), reverse=True)
            return answer({"mode": mode, "alerts": rows[:limit], "complete": complete})

        if store is None:
            return told([], True)
        asked = store
        return await _unless_down(
            context, lambda: told(asked.alerts(state, *span, limit), True), lambda: told([], False)
        )

    @router.get("/alerts/{id}", response_model=models.AlertLife, responses=problems(404, 422, 503), tags=["alerts"])
    async def alert(id: AlertId) -> Response:
        """One alert with every stored step of its life.

        While the database does not answer, without these steps, if it is still in memory; `complete` is false then.
        """

        def told(changes: list[Row], complete: bool) -> Response:
            row = in_memory().get(id) or (changes[-1]["alert"] if changes else None)
            if row is None and not complete:
                raise ApiProblem(503, "the database does not answer", headers={"Retry-After": str(RETRY_LATE_S)})
            if row is None:
                raise ApiProblem(404, f"there is no alert {id}")
            return answer({"mode": mode, "alert": row, "changes": changes, "complete": complete})

        if store is None:
            return told([], True)
        asked = store
        return await _unless_down(context, lambda: told(asked.alert_changes(id), True), lambda: told([], False))


def _acknowledge_route(router: APIRouter, context: Context) -> None:
    service, mode = context.service, context.settings.mode

    @router.post(
        "/alerts/{id}/acknowledge",
        response_model=models.AlertAnswer,
        responses=problems(400, 403, 404, 409, 413, 422, 503),
        tags=["alerts"],
    )
    async def acknowledge(id: AlertId, who: models.Acknowledgement) -> Response:
        """Acknowledge a live alert: it stays in the picture until it clears, but no longer calls."""
        made = await context.order(lambda: context.ask(lambda: service.acknowledge(id, who.by)))
        return answer({"mode": mode, "alert": context.wire.alert(made)})


def _runway_routes(router: APIRouter, context: Context) -> None:
    service, mode = context.service, context.settings.mode

    @router.get("/runways", response_model=models.RunwayList, tags=["runways"])
    async def runways() -> Response:
        """How each runway is used, and what is on it."""
        picture = service.picture()
        rows = [context.wire.runway(one) for one in picture.runways] if picture is not None else []
        return answer({"mode": mode, "runways": rows})

    @router.put(
        "/runways/{id:path}/state",
        response_model=models.RunwayAnswer,
        responses=problems(400, 403, 404, 409, 413, 422, 503),
        tags=["runways"],
    )
    async def set_runway(
        id: Annotated[str, Path(max_length=32, description='"06/24", also written "06-24"')], order: models.RunwayOrder
    ) -> Response:
        """Open or close a runway, put a direction into use, set low visibility."""
        known = {one.id for one in service.airport.runways}
        name = id if id in known else id.replace("-", "/")
        made = await context.order(
            lambda: context.ask(
                lambda: service.set_runway(name, open=order.open, in_use=order.in_use, visibility=order.visibility)
            )
        )
        return answer({"mode": mode, "runway": context.wire.runway(made)})


async def _unless_down(context: Context, ask: Callable[[], Response], instead: Callable[[], Response]) -> Response:
    """What the database says; what is told `instead` while it does not answer."""
    try:
        return await context.reads.ask(ask)
    except (SQLAlchemyError, NoAnswer) as error:
        log.warning("the database does not answer; told from memory: %s", type(error).__name__)
    return instead()


def _within(time: float, first: float | None, last: float | None) -> bool:
    return (first is None or time >= first) and (last is None or time <= last)


def _feature(row: Row) -> dict[str, Any]:
    properties = {name: value for name, value in row.items() if name not in ("lat", "lon")}
    return {
        "type": "Feature",
        "id": row["id"],
        "geometry": {"type": "Point", "coordinates": [row["lon"], row["lat"]]},
        "properties": properties,
    }
