"""The door to the 3D view: viser's page and its WebSocket under /3d, on the one public port.

viser checks neither users nor origins and trusts what it is sent; it therefore listens on loopback only, and what goes
through here is limited to what its page needs.
"""

from __future__ import annotations

import asyncio
import base64
import contextlib
import gzip
import hashlib
import importlib.metadata
import importlib.util
import logging
import re
from collections.abc import AsyncIterator
from functools import lru_cache
from pathlib import Path
from typing import Protocol

from fastapi import APIRouter, WebSocket
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.websockets import WebSocketDisconnect
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, WebSocketException
from websockets.typing import Subprotocol

from app.live.session import close_or_cut, origin_allowed
from app.settings import Settings
from app.view3d.page_messages import Malformed, Unwanted, check

log = logging.getLogger(__name__)

FRAME_BYTES = 64 * 1024 * 1024
"""Of what viser sends; what its page may send is bounded by the web server, for the feed and for this."""

FRAMES_QUEUED = 8
VIEWERS = 16
OPEN_S = 5.0
STALL_S = 20.0
"""A page that takes nothing for this long is cut; viser then drops what it kept for it."""

CLOSE_S = 3.0


class View(Protocol):
    """What the door needs to know about the 3D view."""

    host: str

    @property
    def port(self) -> int | None:
        """Where viser listens on loopback; None while it does not."""

    def count(self, what: str) -> None:
        """Count something that happened at the door."""


class Refusal(Exception):
    """Close the connection with this code."""

    def __init__(self, code: int, reason: str) -> None:
        super().__init__(reason)
        self.code, self.reason = code, reason


def router(view: View, settings: Settings) -> APIRouter:
    """Routes of the 3D view. GET /3d/ is the page, the WebSocket beside it goes to viser."""
    made = APIRouter(include_in_schema=False)
    open_now: set[WebSocket] = set()

    @made.get("/3d")
    async def redirect() -> Response:
        return RedirectResponse("3d/", status_code=308)

    @made.api_route("/3d/", methods=["GET", "HEAD"])
    def page(request: Request) -> Response:
        content, packed, tag, policy = _page(settings.mode)
        headers = {
            "ETag": tag,
            "Cache-Control": "no-cache",
            "Vary": "Accept-Encoding",
            "Content-Security-Policy": policy,
        }
        if request.headers.get("if-none-match") == tag:
            return Response(status_code=304, headers=headers)
        if "gzip" in request.headers.get("accept-encoding", ""):
            return Response(packed, media_type="text/html", headers={**headers, "Content-Encoding": "gzip"})
        return Response(content, media_type="text/html", headers=headers)

    # viser's page leaves the last slash of its own address away.
    @made.websocket("/3d")
    @made.websocket("/3d/")
    async def through(websocket: WebSocket) -> None:
        headers = websocket.headers
        if not origin_allowed(headers.get("origin"), headers.get("host"), settings.allowed_origins):
            view.count("refused_origin")
            await websocket.close(1008, "origin not allowed")
            return
        wanted = subprotocol()
        if wanted not in (websocket.scope.get("subprotocols") or []):
            await websocket.close(1002, f"subprotocol {wanted} wanted")
            return
        await websocket.accept(wanted)
        if len(open_now) >= VIEWERS:
            view.count("refused_full")
            await close_or_cut(websocket, 1013, "too many viewers", CLOSE_S)
            return
        open_now.add(websocket)
        try:
            await _serve(websocket, view, wanted)
        finally:
            open_now.discard(websocket)

    return made


@lru_cache(maxsize=1)
def subprotocol() -> str:
    """The subprotocol of the installed viser; its server takes no other."""
    return f"viser-v{importlib.metadata.version('viser')}"


async def _serve(websocket: WebSocket, view: View, wanted: str) -> None:
    code, reason = 1000, ""
    try:
        async with _upstream(view, wanted) as viser:
            tasks = [
                asyncio.create_task(_to_viser(websocket, viser, view)),
                asyncio.create_task(_to_page(viser, websocket)),
            ]
            try:
                await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            finally:
                for task in tasks:
                    task.cancel()
                outcomes = await asyncio.gather(*tasks, return_exceptions=True)
        raised = [one for one in outcomes if isinstance(one, Exception)]
        if any(isinstance(one, WebSocketDisconnect) for one in raised):
            return
        code, reason = 1013, "the 3D view has stopped"
        for one in raised:
            if isinstance(one, Refusal):
                raise one
            if not isinstance(one, WebSocketException | OSError | RuntimeError):
                log.error("3D view: a connection failed", exc_info=one)
                code, reason = 1011, "internal error"
    except Refusal as refusal:
        code, reason = refusal.code, refusal.reason
    await close_or_cut(websocket, code, reason, CLOSE_S)


@contextlib.asynccontextmanager
async def _upstream(view: View, wanted: str) -> AsyncIterator[ClientConnection]:
    port = view.port
    if port is None:
        raise Refusal(1013, "the 3D view is not running yet")
    try:
        connection = await connect(
            f"ws://{view.host}:{port}/", subprotocols=[Subprotocol(wanted)], max_size=FRAME_BYTES,
            max_queue=FRAMES_QUEUED, compression=None, open_timeout=OPEN_S, close_timeout=CLOSE_S, proxy=None,
            ping_interval=None,
        )  # fmt: skip
    except (OSError, TimeoutError, WebSocketException) as error:
        view.count("upstream_refused")
        raise Refusal(1013, "the 3D view does not answer") from error
    try:
        yield connection
    finally:
        with contextlib.suppress(Exception):
            await connection.close()


async def _to_viser(websocket: WebSocket, viser: ClientConnection, view: View) -> None:
    while True:
        message = await websocket.receive()
        if message["type"] == "websocket.disconnect":
            raise WebSocketDisconnect(message.get("code") or 1005)
        data: bytes | None = message.get("bytes")
        if data is None:
            raise Refusal(1003, "binary frames only")
        try:
            check(data)
        except Malformed as error:
            view.count("bad_messages")
            raise Refusal(1007, "not a message of the 3D page") from error
        except Unwanted:
            view.count("unwanted_messages")
            continue
        await viser.send(data)


async def _to_page(viser: ClientConnection, websocket: WebSocket) -> None:
    # One frame at a time: while the page does not take it, viser waits, and merges what it would have sent.
    with contextlib.suppress(ConnectionClosed):
        async for frame in viser:
            try:
                async with asyncio.timeout(STALL_S):
                    await (websocket.send_bytes(frame) if isinstance(frame, bytes) else websocket.send_text(frame))
            except TimeoutError as error:
                raise Refusal(1013, "the page does not keep up") from error


@lru_cache(maxsize=4)
def _page(mode: str) -> tuple[bytes, bytes, str, str]:
    """viser's page with our title and banner: plain, packed, ETag and the policy under which it runs."""
    spec = importlib.util.find_spec("viser")
    if spec is None or not spec.submodule_search_locations:
        raise FileNotFoundError("viser is not installed")
    text = (Path(spec.submodule_search_locations[0]) / "client" / "build" / "index.html").read_text()
    text = text.replace(
        "<title>Viser</title>", f"<title>Airside 3D{'' if mode == 'live' else ' ' + mode.upper()}</title>"
    )
    text = text.replace('<div id="root"></div>', f'<div id="root"></div>{_banner(mode)}')
    content = text.encode()
    tag = f'"{hashlib.sha256(content).hexdigest()[:20]}"'
    return content, gzip.compress(content, 6, mtime=0), tag, _policy(text)


def _banner(mode: str) -> str:
    look = (
        "position:fixed;left:50%;transform:translateX(-50%);top:10px;z-index:5;white-space:nowrap;"
        "font:600 13px system-ui,sans-serif;color:#eaf1f6;"
        "display:flex;gap:8px;align-items:center"
    )
    link = (
        '<a href="../" style="color:#9fd4ff;text-decoration:none;background:#10161ce0;padding:5px 10px;'
        'border:1px solid #34424f;border-radius:4px">&#8592; 2D display</a>'
    )
    words = {"demo": "DEMO: recorded traffic, simulated sensors", "replay": "REPLAY of a recording"}.get(mode)
    note = f'<span style="background:#4b3f73;padding:6px 10px;border-radius:4px">{words}</span>' if words else ""
    return f'<div style="{look}">{link}{note}</div>'


def _policy(text: str) -> str:
    """The page's own script by its hash; it unpacks WebAssembly, evaluates and styles itself."""
    scripts = re.findall(r"<script[^>]*>(.*?)</script>", text, re.DOTALL)
    hashes = " ".join(f"'sha256-{base64.b64encode(hashlib.sha256(one.encode()).digest()).decode()}'" for one in scripts)
    return (
        f"default-src 'self'; script-src 'self' {hashes} 'strict-dynamic' 'unsafe-eval' blob: data:; "
        "style-src 'self' 'unsafe-inline'; img-src 'self' blob: data:; font-src 'self' data:; "
        "connect-src 'self' blob: data:; worker-src 'self' blob: data:; object-src 'none'; base-uri 'self'; "
        "form-action 'self'; frame-ancestors 'self'"
    )
