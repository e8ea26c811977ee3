"""GET /api/v1/radars/{id}/video.png: the newest turn of a radar as a north-up picture with its place on earth."""

from __future__ import annotations

import threading
import time
from typing import Annotated, Literal

from fastapi import APIRouter, Path, Query
from starlette.requests import Request
from starlette.responses import Response

from app.api.context import Context, problems
from app.api.scan_picture import ScanPictures, half_width
from app.contract import Video

FRESH = 0.5
"""Part of a turn for which a fetched video serves further requests."""


class _Fetched:
    """The video that was fetched last, radar by radar: a radar's newest turn is asked for at most twice a turn."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._kept: dict[str, tuple[float, Video]] = {}
        self._lock = threading.Lock()

    def video(self, radar: str) -> Video:
        with self._lock:
            kept = self._kept.get(radar)
            if kept is not None and time.monotonic() - kept[0] < FRESH * kept[1].site.video.period_s:
                return kept[1]
            video: Video = self._context.ask(lambda: self._context.service.video(radar))
            self._kept[radar] = (time.monotonic(), video)
            return video


def video_router(context: Context) -> APIRouter:
    """The radar picture."""
    router = APIRouter(prefix="/api/v1")
    pictures, fetched = ScanPictures(), _Fetched(context)

    @router.get(
        "/radars/{id}/video.png",
        response_class=Response,
        responses={
            200: {"content": {"image/png": {"schema": {"type": "string", "contentMediaType": "image/png"}}}},
            304: {"description": "the picture that the client has is the newest"},
            **problems(404, 409, 422, 503),
        },
        tags=["picture"],
    )
    def video(
        request: Request,
        id: Annotated[str, Path(max_length=32)],
        size: Annotated[int, Query(ge=64, le=2048, description="pixels a side")] = 1024,
        palette: Annotated[Literal["green", "amber", "blue", "grey"], Query()] = "green",
        floor: Annotated[int | None, Query(ge=0, le=254, description="amplitude below which nothing is drawn")] = None,
    ) -> Response:
        """North-up; edges in X-Airside-West, -South, -East, -North (degrees) and, with -M, in local metres."""
        newest = fetched.video(id)
        headers = _place(context, newest)
        headers["ETag"] = f'"{id}-{newest.time:.3f}-{size}-{palette}-{floor}"'
        headers["Cache-Control"] = "no-cache"
        if request.headers.get("if-none-match") == headers["ETag"]:
            return Response(status_code=304, headers=headers)
        return Response(pictures.png(newest, size, palette, floor), media_type="image/png", headers=headers)

    return router


def _place(context: Context, video: Video) -> dict[str, str]:
    site, half = video.site, half_width(video.site)
    west, east, south, north = site.east - half, site.east + half, site.north - half, site.north + half
    latitude, longitude = context.service.airport.frame.to_geodetic(
        [west, east, site.east, site.east], [site.north, site.north, south, north]
    )
    return {
        "X-Airside-West": f"{longitude[0]:.7f}",
        "X-Airside-East": f"{longitude[1]:.7f}",
        "X-Airside-South": f"{latitude[2]:.7f}",
        "X-Airside-North": f"{latitude[3]:.7f}",
        "X-Airside-West-M": f"{west:.2f}",
        "X-Airside-East-M": f"{east:.2f}",
        "X-Airside-South-M": f"{south:.2f}",
        "X-Airside-North-M": f"{north:.2f}",
        "X-Airside-Time": f"{video.time:.3f}",
        "X-Airside-Simulated": "true" if site.simulated else "false",
        "X-Airside-Mode": context.settings.mode,
    }
