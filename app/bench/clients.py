"""Many clients on the live feed: what each of them gets, and what they cost the service."""

from __future__ import annotations

import asyncio
import time
from dataclasses import dataclass

from websockets.asyncio.client import connect

from app.bench.delay import SUBPROTOCOL, subscribe
from app.bench.subject import Subject


@dataclass(frozen=True, slots=True)
class FeedLoad:
    """What `clients` clients got in a second, and the processor time the service used in it."""

    clients: int
    messages_per_client_per_second: float
    kilobytes_per_client_per_second: float
    cpu_cores: float
    blocks_dropped: int


def measure_clients(subject: Subject, clients: int, seconds: float, rate_hz: float = 1.0) -> FeedLoad:
    """Connect `clients` clients at `rate_hz` and count for `seconds`."""
    return asyncio.run(_load(subject, clients, seconds, rate_hz))


async def _load(subject: Subject, clients: int, seconds: float, rate_hz: float) -> FeedLoad:
    got = [0, 0]
    counting = asyncio.Event()

    async def client() -> None:
        async with connect(
            subject.feed,
            subprotocols=[SUBPROTOCOL],  # type: ignore[list-item]
            max_size=None,
            compression=None,
        ) as feed:
            await subscribe(feed, rate_hz)
            async for message in feed:
                if counting.is_set():
                    got[0] += 1
                    got[1] += len(message)

    tasks = []
    for _ in range(clients):
        tasks.append(asyncio.create_task(client()))
        await asyncio.sleep(0.01)
    await asyncio.sleep(3.0)
    before = await asyncio.to_thread(subject.counters)
    cpu, begun = subject.cpu_seconds(), time.monotonic()
    counting.set()
    await asyncio.sleep(seconds)
    counting.clear()
    took = time.monotonic() - begun
    cpu = subject.cpu_seconds() - cpu
    after = await asyncio.to_thread(subject.counters)
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    dropped = after.get("queue_dropped_blocks", 0) - before.get("queue_dropped_blocks", 0)
    return FeedLoad(clients, got[0] / clients / took, got[1] / clients / took / 1000, cpu / took, dropped)
