"""viser's own server answers this machine only, under its own name.

It listens on loopback, but a browser on this machine can be led there: by a name of a foreign page that was made to
point to 127.0.0.1, or by a page that opens a WebSocket to a port it guessed. viser looks at neither Host nor Origin,
and has no setting for it; what it makes its server with is therefore wrapped here.
"""

from __future__ import annotations

from collections.abc import Callable
from http import HTTPStatus
from types import SimpleNamespace
from typing import Any
from urllib.parse import urlsplit

import websockets.asyncio.server
import websockets.datastructures
import websockets.exceptions
from websockets.http11 import Request, Response

from app.live.session import LOOPBACK, origin_allowed


def refusal(request: Request) -> Response | None:
    """What is answered to a request under a foreign name or from a foreign page; None for one that is let in."""
    hosts, origins = request.headers.get_all("Host"), request.headers.get_all("Origin")
    host = hosts[0] if len(hosts) == 1 else ""
    if _name(host) in LOOPBACK and all(origin_allowed(one, host, ()) for one in origins):
        return None
    text = b"this port is for the service itself"
    headers = websockets.datastructures.Headers(
        {"Content-Type": "text/plain", "Content-Length": str(len(text)), "Connection": "close"}
    )
    return Response(HTTPStatus.FORBIDDEN, "Forbidden", headers, text)


def answer_loopback_only(infra: Any) -> None:
    """Have servers that this module of viser (`viser.infra._infra`) makes refuse everyone else."""
    infra.websockets = SimpleNamespace(
        asyncio=SimpleNamespace(server=SimpleNamespace(serve=_serve)),
        datastructures=websockets.datastructures,
        exceptions=websockets.exceptions,
    )


def _serve(*words: Any, process_request: Callable[..., Any] | None = None, **given: Any) -> Any:
    def first(connection: Any, request: Request) -> Any:
        refused = refusal(request)
        if refused is not None or process_request is None:
            return refused
        return process_request(connection, request)

    return websockets.asyncio.server.serve(*words, process_request=first, **given)


def _name(host: str) -> str:
    try:
        return urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return ""
