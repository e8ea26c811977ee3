"""One WebSocket connection: who may open it, what is read from it, and how it is closed."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Iterable
from typing import Any
from urllib.parse import urlsplit

from starlette.websockets import WebSocket, WebSocketDisconnect

from app.live.allowance import Allowance
from app.live.client import Client, Ended
from app.live.hub import Hub
from app.live.messages import SUBPROTOCOL, BadMessage, Hello, Ping, Subscribe, decode

log = logging.getLogger(__name__)

HELLO_S = 10.0
FAULTS = 5
"""Messages that may not be understood before the connection is closed as hostile."""

REQUESTS_PER_S = 20.0
REQUEST_BURST = 40.0
CLOSE_S = 5.0
"""How long a closing connection may take to swallow what was written before it is cut."""


LOOPBACK = ("localhost", "127.0.0.1", "::1")
"""Names of this machine for itself, under which it may always be asked."""


def origin_allowed(origin: str | None, host: str | None, allowed: Iterable[str]) -> bool:
    """Programs send no Origin; a page must come from the host it talks to or from a listed origin."""
    if origin is None:
        return True
    if origin in allowed:
        return True
    parts = urlsplit(origin)
    return parts.scheme in ("http", "https") and bool(host) and parts.netloc.lower() == (host or "").lower()


async def serve(websocket: WebSocket, hub: Hub) -> None:
    """Serve one connection to its end."""
    headers = websocket.headers
    offered = websocket.scope.get("subprotocols") or []
    if not origin_allowed(headers.get("origin"), headers.get("host"), hub.settings.allowed_origins):
        hub.counters["refused_origin"] += 1
        await websocket.close(1008, "origin not allowed")
        return
    if offered and SUBPROTOCOL not in offered:
        await websocket.close(1002, f"subprotocol {SUBPROTOCOL} wanted")
        return
    await websocket.accept(SUBPROTOCOL if offered else None)
    if len(hub.clients) >= hub.settings.feed.max_clients:
        hub.counters["refused_full"] += 1
        await websocket.close(1013, "too many clients")
        return
    client = Client(hub, websocket.send_text)
    hub.clients.add(client)
    hub.counters["clients_served"] += 1
    try:
        ended = await _run(websocket, client, hub)
    finally:
        client.leave()
        hub.clients.discard(client)
    if ended is not None:
        if client.waiting_since is None:
            with contextlib.suppress(Exception):
                async with asyncio.timeout(1.0):
                    await client.answers()
        await close_or_cut(websocket, ended.code, ended.reason)


async def _run(websocket: WebSocket, client: Client, hub: Hub) -> Ended | None:
    """Read and write until one of them ends; how to close, None when the connection is gone."""
    tasks: list[asyncio.Task[Any]] = [
        asyncio.create_task(_read(websocket, client, hub)),
        asyncio.create_task(client.write()),
        asyncio.create_task(client.over.wait()),
    ]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        outcomes = await asyncio.gather(*tasks, return_exceptions=True)
    if client.ended is not None:
        return client.ended
    for outcome in outcomes:
        if isinstance(outcome, Ended):
            return outcome
    for outcome in outcomes:
        # A vanished peer shows as WebSocketDisconnect, OSError or the server's own ClientDisconnected (an OSError).
        if isinstance(outcome, Exception) and not isinstance(outcome, WebSocketDisconnect | OSError | RuntimeError):
            log.error("live feed: a connection failed", exc_info=outcome)
            return Ended(1011, "internal error")
    return None


async def _read(websocket: WebSocket, client: Client, hub: Hub) -> None:
    faults, greeted = 0, False
    allowance = Allowance(REQUESTS_PER_S, REQUEST_BURST)
    while True:
        try:
            async with asyncio.timeout(None if greeted else HELLO_S):
                data = await _frame(websocket, hub)
        except TimeoutError:
            raise Ended(1008, f"no hello within {HELLO_S:g} s") from None
        if allowance.take(hub.loop_time()) < 0:
            raise Ended(1008, f"more than {REQUESTS_PER_S:g} requests a second")
        try:
            greeted = _answer(data, client, greeted)
        except BadMessage as fault:
            faults += 1
            hub.counters["bad_messages"] += 1
            client.reply({"type": "result", "id": fault.id, "ok": False, "error": str(fault)})
            if faults >= FAULTS:
                raise Ended(1008, "too many messages that cannot be understood") from fault


def _answer(data: str, client: Client, greeted: bool) -> bool:
    message = decode(data)
    if isinstance(message, Hello):
        client.hello(message.resume)
        return True
    if not greeted:
        raise BadMessage("the first message must be a hello", message.id)
    if isinstance(message, Subscribe):
        client.subscribe(message)
    elif isinstance(message, Ping):
        client.reply({"type": "result", "id": message.id, "ok": True})
    return True


async def _frame(websocket: WebSocket, hub: Hub) -> str:
    message = await websocket.receive()
    if message["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(message.get("code", 1005))
    text: str | None = message.get("text")
    if text is None:
        raise Ended(1003, "text frames only")
    limit = hub.settings.feed.max_message_bytes
    if len(text) > limit or len(text.encode(errors="surrogatepass")) > limit:
        raise Ended(1009, f"message longer than {limit} bytes")
    return text


async def close_or_cut(websocket: WebSocket, code: int, reason: str, patience: float = CLOSE_S) -> None:
    """Close with a code even when the peer does not read; cut the connection when that has not helped in `patience` s.

    The server's protocol (reached through the ASGI `send` that the middleware kept) waits for room before it writes;
    a peer that never reads would hold the connection and its buffers for ever.
    """
    protocol = websocket.scope.get("airside.protocol")
    transport = getattr(protocol, "transport", None)
    writable = getattr(protocol, "writable", None)
    if writable is not None:
        writable.set()
    with contextlib.suppress(Exception):
        async with asyncio.timeout(patience):
            await websocket.close(code, reason)
    if transport is not None:
        asyncio.get_running_loop().call_later(patience, transport.abort)
