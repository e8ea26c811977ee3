"""One client of the live feed: what it wants, where it stands, and the one task that writes to it."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable

from app.live.allowance import Allowance
from app.live.hub import Hub
from app.live.messages import (
    DEFAULT_RATE_HZ,
    SUBSCRIPTION_BURST,
    SUBSCRIPTIONS_IN_VAIN,
    SUBSCRIPTIONS_PER_S,
    Resume,
    Subscribe,
    granted_rate,
    track_filter,
)
from app.live.stream import TooManyViews, View
from app.wire import Row, encode

REPLIES = 64
"""Answers that may wait for a client; one that asks more without reading is closed."""


class Ended(Exception):
    """The client's connection is to be closed with this code and reason."""

    def __init__(self, code: int, reason: str) -> None:
        super().__init__(reason)
        self.code = code
        self.reason = reason


class Client:
    """Holds no messages but answers and alerts: tracks and status are made from the hub's state when there is room.

    send: writes one text frame and returns when the transport has room again.
    waiting_since: loop time at which the frame being written was begun; None when none is.
    """

    def __init__(self, hub: Hub, send: Callable[[str], Awaitable[None]]) -> None:
        self.hub = hub
        self.topics: frozenset[str] = frozenset()
        self.rate_hz = DEFAULT_RATE_HZ
        self.place = 0
        self.merged = 0
        self.waiting_since: float | None = None
        self.ended: Ended | None = None
        self.over = asyncio.Event()
        self._send = send
        self._changes = Allowance(SUBSCRIPTIONS_PER_S, SUBSCRIPTION_BURST)
        self._view: View | None = None
        self._resume: Resume | None = None
        self._replies: deque[str] = deque()
        self._alerts: deque[str] = deque()
        self._snapshot = False
        self._due = False
        self._status = 0
        self._event = asyncio.Event()

    def hello(self, resume: Resume | None) -> None:
        """Greet, and remember where the client says it stood."""
        self._resume = resume
        self.reply(self.hub.welcome())

    def subscribe(self, wanted: Subscribe) -> None:
        """Begin (or change) what the client gets; what is refused is answered and changes nothing.

        Raises BadMessage, and Ended when the client goes on changing it too often.
        """
        filter, rate = track_filter(wanted), granted_rate(wanted)
        left = self._changes.take(self.hub.loop_time())
        if left < 0:
            self._refuse(wanted, left)
            return
        try:
            view = self.hub.view(filter, self._view)
        except TooManyViews as error:
            self.hub.counters["refused_filters"] += 1
            self.reply({"type": "result", "id": wanted.id, "ok": False, "error": str(error)})
            return
        self.leave()
        self._view = view
        self._view.clients += 1
        resume, self._resume = self._resume, None
        place = self.hub.recover(resume, self._view) if resume is not None else None
        self.topics, self.rate_hz = frozenset(wanted.topics), rate
        self._status = 0
        self._alerts.clear()
        granted: Row = {"type": "result", "id": wanted.id, "ok": True, "topics": sorted(self.topics)}
        self.reply({**granted, "max_rate_hz": rate, "recovered": place is not None})
        if place is not None and resume is not None:
            self.place, self._due, self._snapshot = place, True, False
            if "alerts" in self.topics:
                self._alerts.extend(self.hub.alerts_after(resume.seq))
        else:
            self._snapshot = True
        self.wake()

    def _refuse(self, wanted: Subscribe, left: float) -> None:
        """Answer a change that comes too soon. left: of the allowance."""
        self.hub.counters["refused_subscriptions"] += 1
        limit = f"more than {SUBSCRIPTIONS_PER_S:g} subscriptions a second"
        if left < -SUBSCRIPTIONS_IN_VAIN:
            raise Ended(1008, limit)
        error = f"{limit}: this one changes nothing; the connection is closed when that goes on"
        self.reply({"type": "result", "id": wanted.id, "ok": False, "error": error})

    def leave(self) -> None:
        """Give the view back."""
        if self._view is not None:
            self._view.clients -= 1
            self._view.idle_since = self.hub.loop_time()
            self._view = None

    def begin_again(self, *, forget_alerts: bool) -> None:
        """The epoch changed: send a snapshot next. forget_alerts: alert messages that wait are void."""
        if forget_alerts:
            self._alerts.clear()
        if self._view is not None:
            self._view = self.hub.stream.view(self._view.filter)
            self._view.clients += 1
            self._snapshot = True
            self.wake()

    def due(self) -> None:
        """The client's rate allows a delta; one that still waits is merged with it."""
        if self._due:
            self.merged += 1
        self._due = True
        self.wake()

    def alert(self, text: str) -> None:
        """Queue an alert message; none is ever dropped (a client that takes none for too long is closed)."""
        self._alerts.append(text)
        self.wake()

    def reply(self, row: Row) -> None:
        """Queue an answer. Raises Ended when the client asks without reading."""
        if len(self._replies) >= REPLIES:
            raise Ended(1008, "too many requests without reading the answers")
        self._replies.append(encode(row).decode())
        self.wake()

    def end(self, code: int, reason: str) -> None:
        """Have the connection closed, whatever it waits for."""
        if self.ended is None:
            self.ended = Ended(code, reason)
            self.over.set()

    def wake(self) -> None:
        """There is something to look at."""
        self._event.set()

    async def write(self) -> None:
        """Write what is due, until the connection ends."""
        heartbeat = self.hub.settings.feed.heartbeat_s
        while True:
            try:
                async with asyncio.timeout(heartbeat):
                    await self._event.wait()
            except TimeoutError:
                in_step = self.topics and "tracks" not in self.topics
                await self._put(self.hub.heartbeat_text(self.hub.seq if in_step else self.place))
                continue
            self._event.clear()
            await self._flush()

    async def answers(self) -> None:
        """Write the answers that still wait; for the moment before a connection is closed."""
        while self._replies:
            await self._put(self._replies.popleft())

    async def _flush(self) -> None:
        while self._replies:
            await self._put(self._replies.popleft())
        if self._snapshot:
            await self._put_snapshots()
        while self._alerts:
            await self._put(self._alerts.popleft())
        if "status" in self.topics and self._status != self.hub.status_version:
            self._status = self.hub.status_version
            text = self.hub.status_text()
            if text is not None:
                await self._put(text)
        if self._due and self._view is not None and "tracks" in self.topics:
            await self._put_delta(self._view)

    async def _put_snapshots(self) -> None:
        self._snapshot = self._due = False
        view = self._view
        if view is not None and "tracks" in self.topics:
            self.place = self.hub.stream.seq
            await self._put(self.hub.snapshot_text(view))
        if "alerts" in self.topics:
            await self._put(self.hub.alerts_snapshot())

    async def _put_delta(self, view: View) -> None:
        self._due = False
        if self.merged:
            merged, self.merged = self.merged, 0
            self.hub.counters["merged_deltas"] += merged
            await self._put(encode({"type": "lagging", "dropped": merged, "mode": self.hub.settings.mode}).decode())
        if self.place < self.hub.stream.seq:
            text = self.hub.delta_text(view, self.place)
            self.place = self.hub.stream.seq
            await self._put(text)

    async def _put(self, text: str) -> None:
        self.waiting_since = self.hub.loop_time()
        await self._send(text)
        self.waiting_since = None
        self.hub.counters["messages_sent"] += 1
