"""Which connections the web server keeps: how many at once, how long a request may take to begin, who reads nothing.

A client that opens connections and says nothing, or never reads an answer, costs a descriptor each. Without descriptors
the whole process goes deaf, so there is a bound below what the operating system allows, and nobody keeps a place for
nothing.
"""

from __future__ import annotations

import asyncio
import logging
import resource
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from app.quiet_log import SAID_EVERY_S

log = logging.getLogger(__name__)

HEAD_S = 10.0
"""Seconds that a client has for the head of a request, or for the rest of a body whose answer is already sent."""

UNREAD_S = 20.0
"""Seconds after which a connection is cut whose client takes nothing of what it is sent."""

SWEEP_S = 1.0
"""Seconds between two looks at all connections."""

ACCEPTS = 8
"""Connections that are accepted before the event loop does anything else: those above the bound hold a descriptor until
they are closed, and only so many may."""

DESCRIPTORS_KEPT = 128
"""Descriptors that are not for clients: files, database, sensors and libraries (about 40), three for each of 16 viewers
of the 3D view, and a few turns of `ACCEPTS`."""

FEWEST = 16
"""Connections that are allowed in any case: below it no display works."""


def most_connections(wanted: int) -> int:
    """How many clients may be connected: `wanted`, or what the limit on open files of this process leaves."""
    files, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    if files == resource.RLIM_INFINITY:
        return wanted
    return max(FEWEST, min(wanted, files - DESCRIPTORS_KEPT))


class Waiting(Protocol):
    """A connection whose client owes a request."""

    transport: asyncio.Transport

    def too_late(self) -> None:
        """Close it: the request did not come in time."""


@dataclass(slots=True)
class _Unsent:
    """What a connection still has to send, in bytes, and since when (s of the clock) that did not become less."""

    size: int
    since: float


class Connections:
    """All connections of one web server. To be used in the thread of its event loop only.

    most: how many are kept at once. refused: where it is counted what was refused or cut, by reason. clock: seconds.
    """

    def __init__(self, most: int, refused: Counter[str], clock: Callable[[], float] = time.monotonic) -> None:
        self.most = most
        self.refused = refused
        self._clock = clock
        self._open: dict[asyncio.Transport, _Unsent] = {}
        self._waiting: dict[Waiting, float] = {}
        self._said_full = -SAID_EVERY_S
        self._full_since_said = 0

    def __len__(self) -> int:
        return len(self._open)

    def enter(self, transport: asyncio.Transport) -> bool:
        """Take a new connection in; False when there is no room.

        When all places are taken, the one that has waited longest without asking for anything has to go: a client that
        does ask finds room even while others fill up the places.
        """
        if len(self._open) >= self.most:
            self._tell_full()
            longest = next(iter(self._waiting), None)
            if longest is None:
                self.refused["connections_full"] += 1
                return False
            self.refused["connections_pushed_out"] += 1
            self.leave(longest.transport)
            self.asked(longest)
            longest.transport.abort()
        self._open[transport] = _Unsent(0, self._clock())
        return True

    def leave(self, transport: asyncio.Transport) -> None:
        """The connection is gone."""
        self._open.pop(transport, None)

    def waits(self, one: Waiting) -> None:
        """The client of this connection owes a request, from now on unless it did before."""
        self._waiting.setdefault(one, self._clock())

    def asked(self, one: Waiting) -> None:
        """The head of a request has come, or the connection is gone: nothing is owed any more."""
        self._waiting.pop(one, None)

    def taken(self, transport: asyncio.Transport) -> None:
        """The client has taken so much that the connection may be written to again."""
        unsent = self._open.get(transport)
        if unsent is not None:
            unsent.since = self._clock()

    def sweep(self) -> None:
        """Close those whose request did not come in time, cut those whose clients take nothing."""
        now = self._clock()
        late = [one for one, since in self._waiting.items() if now - since >= HEAD_S]
        for one in late:
            self.asked(one)
            self.refused["head_late"] += 1
            one.too_late()
        for transport, unsent in list(self._open.items()):
            size = transport.get_write_buffer_size()
            if size == 0 or size < unsent.size:
                unsent.since = now
            unsent.size = size
            # What a WebSocket is slow to take is the business of the feed and of the 3D view, until it is closed.
            bounded = transport.is_closing() or not getattr(transport.get_protocol(), "bounds_itself", False)
            if bounded and now - unsent.since >= UNREAD_S:
                self.refused["answer_unread"] += 1
                transport.abort()

    async def watch(self) -> None:
        """Sweep again and again."""
        while True:
            await asyncio.sleep(SWEEP_S)
            self.sweep()

    def _tell_full(self) -> None:
        self._full_since_said += 1
        now = self._clock()
        if now - self._said_full < SAID_EVERY_S:
            return
        log.warning(
            "web server: all %d places for connections are taken; %d without a request or the newest closed so far "
            "(limits.connections, and the limit on open files of the process)",
            self.most,
            self._full_since_said,
        )
        self._said_full = now
