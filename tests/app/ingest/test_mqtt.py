"""Nodes over MQTT: the broker is real (marked `services`), the rest needs none."""

import asyncio
import json
import os
import socket
from collections import Counter
from collections.abc import Callable

import aiomqtt
import numpy as np
import pytest

from app.contract import Refused, RefusedRow, RefusedTime, Submitted
from app.ingest.mqtt import MqttThread, _take, listen, node_of_topic, parse_url
from app.settings import MqttSettings
from pipeline.sites import NodeSite
from pipeline.tables import NodeEvents

NODES = (NodeSite("A1", 0, 0, 0), NodeSite("B2", 10, 0, 0))
PATTERN = "airside/nodes/+/events"


def broker() -> None:
    try:
        socket.create_connection(("localhost", 1883), 1.0).close()
    except OSError:
        if os.environ.get("AIRSIDE_REQUIRE_SERVICES") == "1":
            raise
        pytest.skip("no MQTT broker on localhost:1883")


async def until(reached: Callable[[], bool], limit: float = 10.0) -> None:
    async with asyncio.timeout(limit):
        while not reached():  # noqa: ASYNC110
            await asyncio.sleep(0.01)


@pytest.mark.parametrize(
    ("topic", "pattern", "node"),
    [
        ("airside/nodes/A1/events", PATTERN, "A1"),
        ("x/A1", "$share/g/x/+", "A1"),
        ("x/y", "x/y", None),
        ("x", "x/+/#", None),
    ],
)
def test_the_topic_names_the_node(topic: str, pattern: str, node: str | None) -> None:
    assert node_of_topic(topic, pattern) == node


def test_urls() -> None:
    plain, secure = parse_url("mqtt://host"), parse_url("mqtts://a:b%40@host")
    assert (plain.host, plain.port, plain.username, plain.secure) == ("host", 1883, None, False)
    assert (secure.port, secure.username, secure.password, secure.secure) == (8883, "a", "b@", True)
    for bad in (None, "", "host:1883", "http://host", "mqtt://"):
        with pytest.raises(ValueError, match=r"mqtt\.url"):
            parse_url(bad)


def test_every_message_is_taken_or_counted_by_reason() -> None:
    got: list[NodeEvents] = []
    counted: Counter[str] = Counter()

    def submit(events: NodeEvents) -> Submitted:
        if events.time.max() > 2e9:
            why = "time is 3,600 s ahead of this host"
            raise RefusedTime(why, [RefusedRow(row, "ahead", why) for row in range(len(events))])
        if len(got) == 4:
            raise Refused("the queue for nodes is full")
        got.append(events)
        late = np.flatnonzero(events.time < 1.6e9).tolist()
        return Submitted(len(events) - len(late), tuple(RefusedRow(row, "behind", "late") for row in late))

    for topic, payload in [
        ("airside/nodes/A1/events", b'{"time": 1700000000}'),
        ("airside/nodes/B2/events", b'[{"time": 1700000000, "node": "B2"}, {"time": 1700000001}]'),
        ("airside/nodes/A1/events", b'{"time": 1700000000, "node": "B2"}'),
        ("airside/nodes/C3/events", b'{"time": 1700000000}'),
        ("airside/nodes/A1/events", b'{"time": NaN}'),
        ("airside/nodes/A1/events", b'[{"time": 1500000000}, {"time": 1700000000}]'),
        ("airside/nodes/A1/events", b'[{"time": "soon"}, {"time": 1700000000}, {"time": 1700000000, "node": "B2"}]'),
        ("airside/nodes/A1/events", b'[{"time": 2500000000}, {"time": 2500000000}]'),
        ("airside/nodes/A1/events", None),
        ("airside/nodes/A1/events", b"[" + b" " * 300_000 + b"]"),
        ("airside/nodes/A1/events", b'{"time": 1700000000}'),
    ]:
        _take(topic, payload, PATTERN, NODES, submit, counted)
    assert [one.node.tolist() for one in got] == [[0], [1, 1], [0, 0], [0]]
    assert counted == {
        "messages": 11, "events": 5, "wrong_node": 2, "bad_value": 1, "unknown_node": 1, "bad_json": 2, "too_many": 1,
        "refused": 1, "events_refused": 3, "refused_time": 1,
    }  # fmt: skip


async def test_without_a_broker_it_tries_again_and_can_be_ended() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        counted: Counter[str] = Counter()
        settings = MqttSettings(url=f"mqtt://127.0.0.1:{taken.getsockname()[1]}")
        task = asyncio.create_task(listen(settings, NODES, lambda _: Submitted(0), counted))
        await until(lambda: counted["connect_failures"] >= 2)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task


class Service:
    def __init__(self) -> None:
        self.nodes = NODES
        self.got: list[NodeEvents] = []

    def submit_node_events(self, events: NodeEvents) -> Submitted:
        self.got.append(events)
        return Submitted(len(events))


def test_the_thread_ends_when_told() -> None:
    thread = MqttThread(MqttSettings(url="mqtt://127.0.0.1:9"), Service())
    thread.start()
    thread.stop()
    assert not thread._thread.is_alive()


@pytest.mark.services
async def test_events_arrive_through_a_broker() -> None:
    broker()
    service = Service()
    topic = f"airside-test-{os.getpid()}/nodes/+/events"
    thread = MqttThread(MqttSettings(url="mqtt://localhost:1883", topic=topic), service)
    thread.start()
    try:
        await until(lambda: thread.counters().get("mqtt_connects") == 1)
        async with aiomqtt.Client("localhost") as client:
            await client.publish(topic.replace("+", "B2"), json.dumps({"time": 1.7e9, "speed_mps": 9}), qos=1)
            await client.publish(topic.replace("+", "A1"), b"junk", qos=1)
            await until(lambda: thread.counters().get("mqtt_messages") == 2)
    finally:
        thread.stop()
    assert [(one.node.tolist(), one.speed.tolist()) for one in service.got] == [([1], [9.0])]
    assert thread.counters()["mqtt_bad_json"] == 1
