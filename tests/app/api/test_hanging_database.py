"""Reads that hang, or threads that other requests fill, keep neither measurements nor operators waiting."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.support.running import Server, first_picture, running, until

CALLS = 60
"""More than the server has threads for."""

LIMITS = httpx.Limits(max_connections=CALLS + 10, max_keepalive_connections=0)
"""Each request has a connection of its own: the server closes those that are idle for 5 s."""


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    with running(tmp_path) as made:
        first_picture(made)
        yield made


class Hanging:
    """Calls that do not come back until the test ends."""

    def __init__(self) -> None:
        self.begun = threading.Semaphore(0)
        self.over = threading.Event()

    def __call__(self, *_: Any, **__: Any) -> Any:
        self.begun.release()
        self.over.wait(120.0)
        return []


@pytest.fixture
def hanging(server: Server, monkeypatch: pytest.MonkeyPatch) -> Iterator[Hanging]:
    call = Hanging()
    assert server.store is not None
    for name in ("alerts", "alert_changes", "tracks", "track_history"):
        monkeypatch.setattr(server.store, name, call)
    monkeypatch.setattr(server.service, "front_end", call)
    yield call
    call.over.set()


async def works(http: httpx.AsyncClient, server: Server) -> None:
    """Reports, events, readiness and operators' orders are answered."""
    alert = server.service.raise_alert()
    report = {"time": time.time(), "lat": 48.72, "lon": 2.38, "address": "4b1815"}
    event = {"node": "node-1", "time": time.time()}
    answers = [
        await http.get("/health/live"),
        await http.get("/health/ready"),
        await http.post("/api/v1/targets/reports", json=report),
        await http.post("/api/v1/nodes/events", json=event),
        await http.post(f"/api/v1/alerts/{alert.id}/acknowledge", json={"by": "TWR"}),
        await http.put("/api/v1/runways/06-24/state", json={"visibility": "low"}),
        await http.get("/api/v1/runways"),
        await http.get("/api/v1/picture"),
    ]
    assert [one.status_code for one in answers] == [200] * len(answers)


@pytest.mark.parametrize("path", ["/api/v1/history/tracks", "/api/v1/tracks/1/history"])
async def test_history_that_hangs_is_refused_and_all_else_is_answered(
    path: str, server: Server, hanging: Hanging
) -> None:
    async with httpx.AsyncClient(base_url=server.url, timeout=60.0, limits=LIMITS) as http:
        calls = [asyncio.create_task(http.get(path)) for _ in range(CALLS)]
        await asyncio.to_thread(hanging.begun.acquire)
        await works(http, server)
        told = await http.get("/api/v1/alerts")
        assert (told.status_code, told.json()["complete"]) == (200, False)
        refused = await asyncio.gather(*calls)
    assert {one.status_code for one in refused} == {503}
    texts = {(one.json()["detail"], one.headers["retry-after"]) for one in refused}
    assert texts == {
        ("too many questions to the database wait for their answers; ask again later", "2"),
        ("the database has not answered within 5 s", "5"),
    }
    hanging.over.set()
    with httpx.Client(base_url=server.url, timeout=60.0) as again:
        until(lambda: again.get("/api/v1/alerts").json()["complete"], "the database is asked again", 60.0)


async def test_requests_that_fill_the_servers_threads_keep_nobody_else_waiting(
    server: Server, hanging: Hanging
) -> None:
    async with httpx.AsyncClient(base_url=server.url, timeout=60.0, limits=LIMITS) as http:
        calls = [asyncio.create_task(http.get("/api/v1/radars/smr-1/parts")) for _ in range(CALLS)]
        for _ in range(40):
            await asyncio.to_thread(hanging.begun.acquire)
        await works(http, server)
        for one in calls:
            one.cancel()
