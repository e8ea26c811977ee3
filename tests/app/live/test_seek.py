"""A seek in a recording: what clients hold of before is void, and they are told everything of after."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from app.live.client import Client
from app.live.hub import Hub
from app.live.messages import Subscribe
from tests.support.fake_service import FakeService
from tests.support.live_client import live
from tests.support.running import Server, first_picture, running, until


@pytest.fixture
def server() -> Iterator[Server]:
    with running() as made:
        first_picture(made)
        yield made


async def reached(condition: Callable[[], bool]) -> None:
    """Let the event loop turn until the condition holds."""
    for _ in range(10_000):
        if condition():
            return
        await asyncio.sleep(0)
    raise AssertionError("the condition was never reached")


async def test_a_seek_begins_a_new_epoch_even_forward(server: Server) -> None:
    """The picture after `begin_anew` is sent whole, with the alerts of after and the status, and no older alert."""
    before = server.service.raise_alert("before")
    server.service.step()
    until(lambda: server.hub.picture is server.service.picture(), "the newest picture is numbered")
    async with live(server.live) as client:
        await client.subscribe(max_rate_hz=0.1)
        old = await client.until("snapshot", "tracks")
        assert [one["id"] for one in (await client.until("snapshot", "alerts"))["alerts"]] == [before.id]
        await client.until("status")
        server.service.step(old["time"] + 1.0)
        server.hub.begin_anew()
        server.service._alerts.clear()
        after = server.service.raise_alert("after", now=old["time"] + 500.0)
        server.service.step(old["time"] + 500.0)
        fresh = await client.until("snapshot", "tracks")
        assert fresh["epoch"] != old["epoch"]
        assert fresh["time"] == old["time"] + 500.0
        assert len(fresh["tracks"]) == 12
        alerts = await client.until("snapshot", "alerts")
        assert [one["id"] for one in alerts["alerts"]] == [after.id]
        assert (await client.until("status"))["epoch"] == fresh["epoch"]
        assert "before" not in [text for _, _, text in client.alerts]
    async with live(server.live) as again:
        place = {"epoch": old["epoch"], "seq": old["seq"]}
        assert (await again.subscribe(resume=place))["recovered"] is False
        assert (await again.until("snapshot", "tracks"))["epoch"] == fresh["epoch"]


async def test_what_waits_for_the_event_loop_is_forgotten_at_a_seek() -> None:
    """A picture and an alert of before that the loop has not taken yet are never told."""
    service = FakeService()
    hub = Hub(service, service.settings)
    sent: list[dict[str, Any]] = []

    async def send(text: str) -> None:
        sent.append(json.loads(text))

    client = Client(hub, send)
    hub.publish(service.step(1000.0), ())
    hub.start()
    hub.clients.add(client)
    client.hello(None)
    client.subscribe(Subscribe(topics=("tracks", "alerts")))
    writer = asyncio.create_task(client.write())
    epoch = hub.epoch
    service.raise_alert("before", now=1001.0)
    service.listen(hub.publish)
    service.step(1001.0)  # waits: this coroutine has not given the loop up
    hub.begin_anew()
    for _ in range(20):
        await asyncio.sleep(0)  # the loop takes what waits: nothing
    assert hub.epoch == epoch, "the new epoch begins with the first picture of after"
    service._alerts.clear()
    service.step(1300.0)
    await reached(lambda: any(one.get("time") == 1300.0 and one.get("topic") == "alerts" for one in sent))
    assert hub.epoch != epoch
    assert 1001.0 not in [one.get("time") for one in sent]
    assert all(one["alerts"] == [] for one in sent if one.get("topic") == "alerts")
    assert not any(one["type"] == "alert" for one in sent)
    writer.cancel()
    hub.clients.clear()
    await hub.stop()


async def test_alerts_that_a_slow_client_has_not_taken_are_void_after_a_seek() -> None:
    service = FakeService()
    hub = Hub(service, service.settings)
    gate, sent = asyncio.Event(), []

    async def send(text: str) -> None:
        sent.append(json.loads(text))
        if sent[-1]["type"] == "status":
            await gate.wait()

    client = Client(hub, send)
    hub.publish(service.step(1000.0), ())
    hub.start()
    hub.clients.add(client)
    service.listen(hub.publish)
    writer = asyncio.create_task(client.write())
    client.subscribe(Subscribe())
    await reached(lambda: any(one["type"] == "status" for one in sent))
    service.raise_alert("before", now=1001.0)
    service.step(1001.0)
    await reached(lambda: hub.picture is service.picture())
    hub.begin_anew()
    service._alerts.clear()
    service.step(1500.0)
    await reached(lambda: hub.picture is service.picture())
    gate.set()
    await reached(lambda: any(one.get("time") == 1500.0 and one["type"] == "status" for one in sent))
    assert not any(one["type"] == "alert" for one in sent)
    writer.cancel()
    hub.clients.clear()
    await hub.stop()
