from __future__ import annotations

import asyncio
import json
import os
import socket
import uuid

import nats
import pytest

from app.bus import MemoryBus, NatsBus, connect_bus
from tests.support.fake_service import FakeService
from tests.support.running import until
from tests.support.small_airport import small_airport

NATS = "nats://127.0.0.1:4222"


def test_the_default_bus_does_nothing() -> None:
    service = FakeService()
    bus = connect_bus("memory://", service)
    assert isinstance(bus, MemoryBus)
    assert service._listeners == []
    bus.close()


def test_an_unknown_bus_is_refused() -> None:
    with pytest.raises(ValueError, match="kafka"):
        connect_bus("kafka://somewhere", FakeService())


def test_a_bus_that_is_not_there_delays_nobody() -> None:
    with socket.socket() as held:
        held.bind(("127.0.0.1", 0))
        service = FakeService()
        bus = connect_bus(f"nats://127.0.0.1:{held.getsockname()[1]}", service)
        assert isinstance(bus, NatsBus)
        for _ in range(5):
            service.raise_alert()
            service.step()
        until(lambda: bus.counters()["retries"] >= 1, "the bus tries again")
        bus.close()
        assert not bus._thread.is_alive()


@pytest.mark.services
async def test_pictures_and_alerts_reach_nats() -> None:
    icao = f"T{uuid.uuid4().hex[:6]}"
    airport = small_airport()
    object.__setattr__(airport, "icao", icao)
    try:
        client = await nats.connect(NATS, connect_timeout=2, allow_reconnect=False)
    except (OSError, nats.errors.Error) as error:
        if os.environ.get("AIRSIDE_REQUIRE_SERVICES") == "1":
            raise
        pytest.skip(f"no NATS on localhost:4222: {error}")
    service = FakeService(airport=airport)
    pictures = await client.subscribe(f"airside.{icao}.picture")
    bus = connect_bus(NATS, service)
    stream = client.jetstream()
    try:
        alert = service.raise_alert("first")
        service.step()
        service.clear_alert(alert.id)
        service.step()
        picture = json.loads((await pictures.next_msg(timeout=10)).data)
        assert picture["airport"] == icao
        assert len(picture["tracks"]) == 12
        for _ in range(200):
            if bus.counters()["alerts"] == 2:
                break
            await asyncio.sleep(0.05)
        kept = await stream.subscribe(f"airside.{icao}.alert", ordered_consumer=True)
        steps = [json.loads((await kept.next_msg(timeout=5)).data) for _ in range(2)]
        assert [(one["op"], one["alert"]["text"]) for one in steps] == [("raise", "first"), ("clear", "first")]
    finally:
        await asyncio.to_thread(bus.close)
        await stream.delete_stream(f"airside_{icao}_alert")
        await client.close()
