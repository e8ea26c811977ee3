"""The web server: uvicorn with bounds on what clients may hold without asking for anything."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections import Counter
from functools import partial
from typing import Any, cast

import h11
import uvicorn
from h11._connection import DEFAULT_MAX_INCOMPLETE_EVENT_SIZE
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import CloseCode, Frame

from app.connections import ACCEPTS, Connections, most_connections
from app.settings import Settings

LISTEN_QUEUE = 2048
"""Connections that the operating system keeps until they are accepted; a storm of displays that reconnect fits in."""

SMALLEST_FRAME_LIMIT = 65536
"""Bytes of a WebSocket message that are taken in any case: what the page of the 3D view says has a few hundred, and
the largest request of the feed is below this."""

MOST_FRAGMENTS = 256
"""Frames that one WebSocket message may come in; without a bound, empty ones could go on for ever."""

_TOO_LATE = b"the request came in too slowly"
REQUEST_TIMEOUT = b"\r\n".join([
    b"HTTP/1.1 408 Request Timeout", b"content-type: text/plain; charset=utf-8", b"content-length: %d" % len(_TOO_LATE),
    b"connection: close", b"", _TOO_LATE,
])  # fmt: skip
"""The answer to a head that did not come to its end in time."""


class _StrictConnection(h11.Connection):
    """HTTP/1.1 that takes no request of two lengths: a proxy before us might believe the other one."""

    def next_event(self) -> Any:
        """What came. Raises h11.RemoteProtocolError for what is not right."""
        event = super().next_event()
        if isinstance(event, h11.Request):
            names = {name for name, _ in event.headers}
            if {b"content-length", b"transfer-encoding"} <= names:
                raise h11.RemoteProtocolError("both Content-Length and Transfer-Encoding")
        return event


class HttpProtocol(H11Protocol):
    """An HTTP connection that has a place among `open_now`, and loses it when no request comes."""

    def __init__(self, open_now: Connections, **given: Any) -> None:
        super().__init__(**given)
        self._open_now = open_now
        self.conn = _StrictConnection(
            h11.SERVER, self.config.h11_max_incomplete_event_size or DEFAULT_MAX_INCOMPLETE_EVENT_SIZE
        )

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """A client has connected."""
        super().connection_made(transport)
        if self._open_now.enter(transport):
            self._open_now.waits(self)
        else:
            transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        """The client is gone."""
        self._open_now.asked(self)
        self._open_now.leave(self.transport)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Something came."""
        super().data_received(data)
        self._look()

    def on_response_complete(self) -> None:
        """The answer is written: from now on the next request is owed."""
        super().on_response_complete()
        self._look()

    def resume_writing(self) -> None:
        """The client has read enough to be sent more."""
        super().resume_writing()
        self._open_now.taken(self.transport)

    def too_late(self) -> None:
        """Close it: the request did not come in time."""
        if self.transport.is_closing():
            return
        received, _ = self.conn.trailing_data
        if received and self.conn.our_state is h11.IDLE:
            self.transport.write(REQUEST_TIMEOUT)
        self.transport.close()

    def shutdown(self) -> None:
        """The server ends: what is still being sent or not read does not hold it up."""
        if self.conn.their_state is h11.SEND_BODY or self.flow.write_paused:
            self.transport.abort()
            return
        # a connection that already failed may not be closed twice in the eyes of h11
        with contextlib.suppress(h11.LocalProtocolError):
            super().shutdown()
            return
        self.transport.close()

    def _look(self) -> None:
        busy = self.cycle is not None and not self.cycle.response_complete
        handed_over = self.transport.get_protocol() is not self
        if busy or handed_over or self.transport.is_closing():
            self._open_now.asked(self)
        else:
            self._open_now.waits(self)


class WebSocketProtocol(WebSocketsSansIOProtocol):
    """A WebSocket whose messages are bounded in number of frames too, and whose pongs do not pile up."""

    bounds_itself = True

    def __init__(self, open_now: Connections, **given: Any) -> None:
        super().__init__(**given)
        self._open_now = open_now
        self._pong: bytes | None = None

    def connection_lost(self, exc: Exception | None) -> None:
        """The client is gone."""
        self._open_now.leave(self.transport)
        super().connection_lost(exc)

    def resume_writing(self) -> None:
        """The client has read enough to be sent more."""
        super().resume_writing()
        self._open_now.taken(self.transport)
        if self._pong is not None and not self.transport.is_closing():
            pong, self._pong = self._pong, None
            self.transport.write(pong)

    def handle_ping(self) -> None:
        """Answer; while the client reads nothing, only the last of its pings will be answered (RFC 6455, 5.5.3)."""
        pong = b"".join(self.conn.data_to_send())
        if self.writable.is_set():
            self.transport.write(pong)
        else:
            self._pong = pong

    def handle_cont(self, event: Frame) -> None:
        """A further frame of a message."""
        if self.close_sent:
            return
        if len(self.frames) >= MOST_FRAGMENTS:
            self.conn.fail(CloseCode.MESSAGE_TOO_BIG, f"a message of more than {MOST_FRAGMENTS} frames")
            self.handle_parser_exception()
            return
        super().handle_cont(event)

    def handle_parser_exception(self) -> None:
        """Close: what came is no WebSocket, or too much."""
        sent = self.conn.close_sent
        if sent is not None:
            too_much = sent.code == CloseCode.MESSAGE_TOO_BIG
            self._open_now.refused["message_too_big" if too_much else "not_websocket"] += 1
        super().handle_parser_exception()


class WebServer(uvicorn.Server):
    """uvicorn that accepts few connections at a time, sweeps them, and ends without waiting for slow clients."""

    def __init__(self, config: uvicorn.Config, connections: Connections) -> None:
        super().__init__(config)
        self.connections = connections
        self._watch: asyncio.Task[None] | None = None

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Listen."""
        await super().startup(sockets=sockets)
        # asyncio takes the number that it accepts at a time for the length of the queue as well
        for one in sockets or []:
            one.listen(LISTEN_QUEUE)
        self._watch = asyncio.create_task(self.connections.watch())

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Close everything."""
        await super().shutdown(sockets=sockets)
        if self._watch is not None:
            self._watch.cancel()


def web_server(app: Any, settings: Settings, refused: Counter[str], graceful_s: int = 3) -> WebServer:
    """The server of an application. refused: where it is counted what was refused; graceful_s: for requests at the end.

    It serves on the sockets that `run` is given.
    """
    connections = Connections(most_connections(settings.limits.connections), refused)
    config = uvicorn.Config(
        app,
        host=settings.host,
        port=settings.port,
        log_config=None,
        http=cast(Any, partial(HttpProtocol, connections)),
        ws=cast(Any, partial(WebSocketProtocol, connections)),
        ws_max_size=max(SMALLEST_FRAME_LIMIT, settings.feed.max_message_bytes),
        ws_ping_interval=20.0,
        ws_ping_timeout=20.0,
        ws_per_message_deflate=settings.feed.compress,
        timeout_graceful_shutdown=graceful_s,
        access_log=False,
        backlog=ACCEPTS,
    )
    return WebServer(config, connections)
