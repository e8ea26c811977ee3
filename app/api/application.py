"""The web application: all routes, errors as problems, security headers, the live feed, the pages."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from importlib.metadata import version
from typing import TYPE_CHECKING

from fastapi import APIRouter, FastAPI, WebSocket
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import Response

from app.api import models, problems
from app.api.asyncapi import document as asyncapi_document
from app.api.bodies import Bodies
from app.api.context import Context, answer
from app.api.intake import intake_router
from app.api.metrics import metrics_router
from app.api.middleware import Guard, allowed_hosts
from app.api.openapi import document, operation_id, served_at
from app.api.pages import pages_router
from app.api.parts import parts_router
from app.api.readsb import readsb_router
from app.api.replay import replay_router
from app.api.surveillance import surveillance_router
from app.api.video import video_router
from app.contract import Service
from app.live.hub import Hub
from app.live.session import serve
from app.wire import Wire

if TYPE_CHECKING:
    from app.store.store import Store


DESCRIPTION = """
Times are Unix seconds (UTC). Angles are degrees clockwise from true north. Positions are WGS 84 degrees and metres east
and north of the airport's reference point. What is not known is null. `mode` is in every answer: anything but `live` is
no live traffic. Errors are `application/problem+json` (RFC 9457) with the fault in `detail`.

The live feed is a WebSocket at `/api/v1/live`, described in `/asyncapi.json`.
"""


def create_app(service: Service, *, hub: Hub, store: Store | None, view3d_router: APIRouter | None = None) -> FastAPI:
    """The application over a service that may still be starting. The hub begins and ends with the application."""
    settings = service.settings
    context = Context(service, hub, store, settings, Wire(service.airport, settings.mode))

    @asynccontextmanager
    async def lifespan(_app: FastAPI) -> AsyncIterator[None]:
        hub.start()
        try:
            yield
        finally:
            await hub.stop()
            context.reads.close()

    app = FastAPI(
        title="Airside",
        summary="Live picture and runway alerts of the airport surface",
        description=DESCRIPTION,
        version=version("airside"),
        openapi_url=None,
        docs_url=None,
        redoc_url=None,
        lifespan=lifespan,
        redirect_slashes=False,
        generate_unique_id_function=operation_id,
    )
    app.state.refused = context.refused
    problems.install(app)
    app.add_middleware(
        Guard,
        bodies=Bodies(settings.limits.body_bytes, settings.limits.bodies_bytes, context.refused),
        allowed_origins=settings.allowed_origins,
        root_path=settings.root_path,
    )
    # outermost: nothing is answered, and no WebSocket opened, under a foreign name
    app.add_middleware(TrustedHostMiddleware, allowed_hosts=allowed_hosts(settings), www_redirect=False)
    app.include_router(_operation_router(service))
    app.include_router(surveillance_router(context))
    app.include_router(video_router(context))
    app.include_router(parts_router(context))
    app.include_router(replay_router(context))
    app.include_router(intake_router(context))
    app.include_router(readsb_router(context))
    app.include_router(metrics_router(context))
    app.include_router(_document_router(app, context))
    if view3d_router is not None:
        app.include_router(view3d_router)
    app.include_router(pages_router())
    return app


def _operation_router(service: Service) -> APIRouter:
    router = APIRouter(prefix="/health", tags=["operation"])

    @router.get("/live", response_model=models.Health)
    async def live() -> Response:
        """The process answers."""
        return answer({"status": "ok", "checks": {}})

    @router.get("/ready", response_model=models.Health, responses={503: {"model": models.Health}})
    async def ready() -> Response:
        """200 after migrations, warm-up and the first picture; 503 with the checks before."""
        readiness = service.readiness()
        body = {"status": "ok" if readiness.ready else "starting", "checks": readiness.checks}
        return answer(body, 200 if readiness.ready else 503)

    return router


def _document_router(app: FastAPI, context: Context) -> APIRouter:
    router = APIRouter()
    icao = context.wire.airport.icao

    @router.websocket("/api/v1/live")
    async def live(websocket: WebSocket) -> None:
        """The live feed; /asyncapi.json describes it."""
        await serve(websocket, context.hub)

    @router.get("/openapi.json", include_in_schema=False)
    async def openapi(request: Request) -> Response:
        return answer(served_at(document(app), request.scope["root_path"]))

    @router.get("/asyncapi.json", tags=["operation"])
    async def asyncapi(request: Request) -> Response:
        """The AsyncAPI 3.0 document of the live feed and the bus."""
        return answer(asyncapi_document(icao, version("airside"), request.scope["root_path"]))

    return router
