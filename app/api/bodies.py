"""The bodies of requests: how large each may be, how long it may take to come in, and how much all may hold."""

from __future__ import annotations

import asyncio
import time
from collections import Counter
from collections.abc import Callable

from starlette.types import Message, Receive, Send

from app.api.problems import ApiProblem

STALL_S = 10.0
"""Seconds within which more of a body must come: a client that has died or waits on purpose."""

WHOLE_S = 60.0
"""Seconds within which a body must have come: the largest (8 MiB) does over a line of 1.2 Mbit/s."""

SMALL_BYTES = 65536
"""Bytes of each body that do not count against the total of all, so that reports, events and a controller's orders are
taken while large bodies fill it. The bound on connections bounds these."""

RETRY_S = 5
"""Seconds after which a client that was sent away for want of room may come again."""

CLOSE = {"Connection": "close"}


class Bodies:
    """What the bodies of all requests hold. most_each: bytes of one; most_all: bytes of all above `SMALL_BYTES` each.

    refused: where it is counted what was refused, by reason. clock: seconds.
    """

    def __init__(
        self,
        most_each: int,
        most_all: int,
        refused: Counter[str],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.most_each = most_each
        self.most_all = most_all
        self.refused = refused
        self.clock = clock
        self.held = 0

    def refuses(self, length: str) -> bool:
        """Whether this Content-Length is above what a body may have."""
        return length.isdecimal() and int(length) > self.most_each

    def too_long(self) -> ApiProblem:
        """The refusal of a body that is too long."""
        self.refused["body_too_long"] += 1
        return ApiProblem(413, f"the body may have {self.most_each} bytes", headers=CLOSE)


class Body:
    """The body of one request, passed on as it comes. `end` has to be called when the request is over."""

    def __init__(self, bodies: Bodies, receive: Receive, send: Send) -> None:
        self._bodies = bodies
        self._receive = receive
        self._send = send
        self._taken = self._held = 0
        self._begun: float | None = None
        self._complete = self._answered = False

    async def receive(self) -> Message:
        """The next part. Raises ApiProblem: 413 too long, 408 too slow, 503 no room for it beside the others."""
        if self._complete:
            return await self._receive()
        now = self._bodies.clock()
        if self._begun is None:
            self._begun = now
        left = self._begun + WHOLE_S - now
        if left <= 0:
            return self._late()
        try:
            async with asyncio.timeout(min(STALL_S, left)):
                message = await self._receive()
        except TimeoutError:
            return self._late()
        if message["type"] == "http.request":
            self._complete = not message.get("more_body", False)
            self._take(len(message.get("body", b"")))
        return message

    def _late(self) -> Message:
        self._bodies.refused["body_late"] += 1
        if self._answered:
            return {"type": "http.disconnect"}
        raise ApiProblem(408, "the body came in too slowly", headers=CLOSE)

    async def send(self, message: Message) -> None:
        """Pass on a part of the answer."""
        self._answered = True
        await self._send(message)

    def end(self) -> None:
        """The request is over: nothing is held for it any more."""
        self._bodies.held -= self._held
        self._held = 0

    def _take(self, size: int) -> None:
        bodies = self._bodies
        self._taken += size
        if self._taken > bodies.most_each:
            raise bodies.too_long()
        more = max(0, self._taken - SMALL_BYTES) - self._held
        if more > 0 and bodies.held + more > bodies.most_all:
            bodies.refused["bodies_full"] += 1
            raise ApiProblem(
                503,
                "the bodies of other requests take all the room there is",
                headers={**CLOSE, "Retry-After": str(RETRY_S)},
            )
        bodies.held += more
        self._held += more
