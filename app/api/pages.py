"""The pages: everything under `static/`, with ETags, below the routes of the service."""

from __future__ import annotations

from fastapi import APIRouter
from starlette.convertors import Convertor, register_url_convertor
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.staticfiles import StaticFiles

from app.settings import ROOT

STATIC = ROOT / "static"


class _PageConvertor(Convertor[str]):
    """Paths that are pages: none of the service's own."""

    regex = r"(?!api/|data/|chunks/|health/|metrics$|3d/|3d$).*"

    def convert(self, value: str) -> str:
        return value

    def to_string(self, value: str) -> str:
        return value


register_url_convertor("page", _PageConvertor())


def pages_router() -> APIRouter:
    """GET / and every file of the pages; the documentation at /docs."""
    router = APIRouter()
    files = StaticFiles(directory=STATIC, html=True, check_dir=False)

    @router.get("/docs", include_in_schema=False)
    async def docs() -> Response:
        return RedirectResponse("docs/")

    @router.api_route("/{path:page}", methods=["GET", "HEAD"], include_in_schema=False)
    async def page(path: str, request: Request) -> Response:
        try:
            response = await files.get_response(path or "index.html", request.scope)
        except (OSError, ValueError) as error:
            raise HTTPException(404, "there is no such page") from error
        response.headers.setdefault("Cache-Control", "no-cache")
        return response

    return router
