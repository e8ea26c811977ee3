"""Records what was sent to the displays: the messages of the live feed, as a client without a filter gets them."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable

from app.journal.names import DISPLAY
from app.journal.writer import JournalWriter
from app.live.client import Client
from app.live.hub import Hub
from app.live.messages import DEFAULT_RATE_HZ, Subscribe

log = logging.getLogger(__name__)

BEGIN_S = 0.1
"""How often the event loop checks whether the journal has begun."""


class DisplayRecorder:
    """A client of the feed within the service: tracks, alerts and status go to the journal as they go to a display.

    It begins with the event loop of the hub and ends with it. writer: gives the journal, None while there is none. now:
    UTC s of this host. Every snapshot of the engine is followed by whole messages, so that each
    file alone tells what was shown. It takes a place among the clients of the feed.
    """

    def __init__(self, hub: Hub, writer: Callable[[], JournalWriter | None], now: Callable[[], float]) -> None:
        self._hub, self._writer, self._now = hub, writer, now
        self._task: asyncio.Task[None] | None = None
        hub.on_start.append(self._begin)

    def _begin(self) -> None:
        self._task = asyncio.get_running_loop().create_task(self._follow(), name="journal-display")

    async def _follow(self) -> None:
        while (writer := self._writer()) is None or not writer.snapshots_taken:  # noqa: ASYNC110
            await asyncio.sleep(BEGIN_S)  # another thread begins it
        client = _Recording(self._hub, writer, self._now)
        self._hub.clients.add(client)
        client.subscribe(Subscribe(max_rate_hz=DEFAULT_RATE_HZ))
        tasks = [asyncio.create_task(client.write()), asyncio.create_task(client.over.wait())]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            if tasks[0].done() and (error := tasks[0].exception()) is not None:
                log.error("what is sent to the displays is no longer recorded", exc_info=error)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            client.leave()
            self._hub.clients.discard(client)


class _Recording(Client):
    """Writes its messages into the journal. It asks nothing, so that answers need no record."""

    def __init__(self, hub: Hub, writer: JournalWriter, now: Callable[[], float]) -> None:
        super().__init__(hub, self._record)
        self._writer, self._now = writer, now
        self._snapshots = writer.snapshots_taken

    def reply(self, row: object) -> None:
        """Nobody waits for an answer."""

    def wake(self) -> None:
        """There is something to send; after a snapshot of the engine, everything is sent again."""
        taken = self._writer.snapshots_taken
        if taken != self._snapshots:
            self._snapshots = taken
            self._snapshot, self._status = True, 0
        super().wake()

    async def _record(self, text: str) -> None:
        data = text.encode()
        self._writer.put(DISPLAY, self._now(), lambda: data, size=len(data))
