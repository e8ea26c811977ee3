"""A client of the live feed for tests: applies deltas as the AsyncAPI document says."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import websockets

Row = dict[str, Any]


class LiveClient:
    def __init__(self, socket: Any) -> None:
        self.socket = socket
        self.rows: dict[int, Row] = {}
        self.alerts: list[tuple[str, int, str]] = []
        self.epoch = ""
        self.seq = 0
        self.seen: list[Row] = []

    async def say(self, **message: Any) -> None:
        await self.socket.send(json.dumps(message))

    async def take(self) -> Row:
        """The next message, applied."""
        message: Row = json.loads(await self.socket.recv())
        self.seen.append(message)
        if message["type"] != "welcome":
            self.epoch = message.get("epoch", self.epoch)
            self.seq = message.get("seq", self.seq)
        if message["type"] == "snapshot" and message["topic"] == "tracks":
            self.rows = {row["id"]: row for row in message["tracks"]}
        elif message["type"] == "delta":
            for one in message["del"]:
                self.rows.pop(one["id"], None)
            for one in message["add"]:
                self.rows[one["id"]] = one
            for one in message["upd"]:
                self.rows[one["id"]].update(one)
        elif message["type"] == "alert":
            self.alerts.append((message["op"], message["alert"]["id"], message["alert"]["text"]))
        return message

    async def until(self, type: str, topic: str | None = None) -> Row:
        """The next message of a type."""
        while True:
            message = await self.take()
            if message["type"] == type and (topic is None or message.get("topic") == topic):
                return message

    async def subscribe(self, resume: Row | None = None, **wanted: Any) -> Row:
        """Hello, subscribe, and the result."""
        await self.say(type="hello", **({"resume": resume} if resume else {}))
        await self.until("welcome")
        await self.say(type="subscribe", id=1, **wanted)
        return await self.until("result")


@asynccontextmanager
async def live(url: str, **words: Any) -> AsyncIterator[LiveClient]:
    async with websockets.connect(url, subprotocols=["airside.v1.json"], max_size=None, **words) as socket:  # type: ignore[list-item]
        yield LiveClient(socket)
