"""What holds for every request: security headers, bounds on bodies, plain addresses, no writing from foreign pages."""

from __future__ import annotations

import re
from typing import Any
from urllib.parse import unquote_to_bytes

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import ClientDisconnect
from starlette.responses import RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.bodies import CLOSE, Bodies, Body
from app.api.problems import problem
from app.api.subpath import below, path_below, root_of
from app.live.session import LOOPBACK, origin_allowed
from app.settings import Settings

STRICT = (
    "default-src 'self'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; "
    "object-src 'none'; base-uri 'self'; form-action 'self'; frame-ancestors 'self'"
)
VIEW_3D = (
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' blob: data:; connect-src 'self' blob: data:; "
    "worker-src 'self' blob:; object-src 'none'; base-uri 'self'; frame-ancestors 'self'"
)
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "X-Frame-Options": "SAMEORIGIN",
    "Cross-Origin-Opener-Policy": "same-origin",
}
UNCACHED = ("/api/", "/data/", "/chunks/", "/health/", "/metrics")
OPEN = "/data/"
"""What pages of any origin may read: it is made for them, and nothing can be written there."""

OPEN_METHODS = "GET, HEAD, OPTIONS"
PREFLIGHT = {
    "Access-Control-Allow-Methods": OPEN_METHODS,
    "Access-Control-Allow-Headers": "*",
    "Access-Control-Max-Age": "86400",
}
CONTROL = re.compile(rb"[\x00-\x1f\x7f]")
"""Control characters: no name in an address has one, and a log, a database or a file system may stumble over it."""

WRITING = frozenset({"POST", "PUT", "PATCH", "DELETE"})


def allowed_hosts(settings: Settings) -> list[str]:
    """What the Host of a request may be: loopback names, the address listened on, and what the settings add.

    A page of a foreign name that was made to point to this machine would otherwise count as a page of this service.
    """
    names = (*LOOPBACK, settings.host, *settings.allowed_hosts)
    return list(dict.fromkeys(name for one in names for name in ((one, f"[{one}]") if ":" in one else (one,))))


class Guard:
    """ASGI middleware. bodies: the bounds on bodies; allowed_origins: further pages that may write.

    root_path: below which a proxy serves all of it (`app.api.subpath`). HEAD is answered wherever GET is.
    """

    def __init__(self, app: ASGIApp, bodies: Bodies, allowed_origins: tuple[str, ...], root_path: str = "") -> None:
        self.app = app
        self.bodies = bodies
        self.allowed_origins = allowed_origins
        self.root_path = root_path

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, guarded."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        scope = below(scope, root_of(headers, self.root_path))
        if scope["type"] == "websocket":
            # The live feed must be able to cut a peer that never reads; ASGI itself has no word for that.
            scope["airside.protocol"] = getattr(send, "__self__", None)
            await self.app(scope, receive, send)
            return
        path = path_below(scope)
        answer = _with_headers(path, send)
        if scope["method"] == "HEAD":
            scope["method"] = "GET"
            answer = _without_body(answer)
        refusal = self._refusal(scope, headers) or _short_answer(scope, path)
        if refusal is not None:
            await refusal(scope, receive, answer)
            return
        body = Body(self.bodies, receive, answer)
        try:
            await self.app(scope, body.receive, body.send)
        except ClientDisconnect:
            # gone in the middle of its body: nobody is left to answer, and nothing of ours has failed
            self.bodies.refused["body_aborted"] += 1
        finally:
            body.end()

    def _refusal(self, scope: Scope, headers: Headers) -> Any:
        if CONTROL.search(unquote_to_bytes(scope["raw_path"])) or CONTROL.search(
            unquote_to_bytes(scope["query_string"])
        ):
            return problem(400, "the address holds a control character")
        if self.bodies.refuses(headers.get("content-length", "0")):
            refused = self.bodies.too_long()
            return problem(refused.status_code, str(refused.detail), headers=CLOSE)
        if scope["method"] in WRITING and not origin_allowed(
            headers.get("origin"), headers.get("host"), self.allowed_origins
        ):
            return problem(
                403,
                f"the page comes from {headers.get('origin')} and this service is called as {headers.get('host')}: "
                "have the proxy pass on the Host of the request, or add the origin to allowed_origins in the settings",
            )
        return None


def _short_answer(scope: Scope, path: str) -> Response | None:
    """What is answered here: the root without its slash, and the question of a foreign page whether it may read."""
    if not path:
        return RedirectResponse(f"{scope['root_path']}/", 308)
    if scope["method"] == "OPTIONS" and path.startswith(OPEN):
        return Response(status_code=204, headers={"Allow": OPEN_METHODS, **PREFLIGHT})
    return None


def _with_headers(path: str, send: Send) -> Send:
    policy = VIEW_3D if path == "/3d" or path.startswith("/3d/") else STRICT

    async def answer(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in HEADERS.items():
                headers.setdefault(name, value)
            headers.setdefault("Content-Security-Policy", policy)
            if path.startswith(UNCACHED):
                headers.setdefault("Cache-Control", "no-store")
            if path.startswith(OPEN):
                headers["Access-Control-Allow-Origin"] = "*"
            allowed = headers.get("allow", "").split(", ")
            if "GET" in allowed and "HEAD" not in allowed:
                headers["Allow"] = ", ".join([*allowed, "HEAD"])
        await send(message)

    return answer


def _without_body(send: Send) -> Send:
    """Send the head of an answer alone, as if it were to a GET."""

    async def head(message: Message) -> None:
        if message["type"] == "http.response.start":
            await send(message)
        elif message["type"] == "http.response.body" and not message.get("more_body", False):
            await send({"type": "http.response.body", "body": b""})

    return head
