"""From datagram to screen: how old a track is when a WebSocket client has it."""

from __future__ import annotations

import asyncio
import time
from dataclasses import dataclass

import msgspec
import numpy as np
from websockets.asyncio.client import connect

from app.bench.subject import Subject

SUBPROTOCOL = "airside.v1.json"


@dataclass(frozen=True, slots=True)
class Delay:
    """Seconds from the sweep that saw a target to the client that has its track."""

    tracks: int
    updates: int
    p50_s: float
    p99_s: float


def measure_delay(subject: Subject, seconds: float, rate_hz: float = 32.0) -> Delay:
    """Listen for `seconds` as one client, and look at the age of every new state of a radar track."""
    return asyncio.run(_listen(subject.feed, seconds, rate_hz))


async def _listen(url: str, seconds: float, rate_hz: float) -> Delay:
    ages: list[float] = []
    times: dict[int, float] = {}
    on_radar: set[int] = set()
    async with connect(url, subprotocols=[SUBPROTOCOL], max_size=None) as feed:  # type: ignore[list-item]
        await subscribe(feed, rate_hz)
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            message = msgspec.json.decode(await feed.recv())
            now = time.time()
            for row in (*message.get("tracks", ()), *message.get("add", ()), *message.get("upd", ())):
                if "sources" in row:
                    (on_radar.add if "radar" in row["sources"] else on_radar.discard)(row["id"])
                moved = row.get("time")
                known = times.get(row["id"])
                if moved is not None:
                    times[row["id"]] = moved
                    if known is not None and moved > known and row["id"] in on_radar:
                        ages.append(now - moved)
    values = np.array(ages) if ages else np.array([np.nan])
    return Delay(len(on_radar), len(ages), float(np.percentile(values, 50)), float(np.percentile(values, 99)))


async def subscribe(feed: object, rate_hz: float) -> None:
    """Say hello and ask for everything at `rate_hz`."""
    await feed.send('{"type":"hello"}')  # type: ignore[attr-defined]
    await feed.recv()  # type: ignore[attr-defined]
    wanted = {"id": 1, "type": "subscribe", "topics": ["tracks", "alerts", "status"], "max_rate_hz": rate_hz}
    await feed.send(msgspec.json.encode(wanted).decode())  # type: ignore[attr-defined]
