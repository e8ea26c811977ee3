"""Nodes over MQTT: the broker is real (marked `services`), the rest needs none."""

import contextlib
import json
import os
import shutil
import socket
import subprocess
import threading
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import paho.mqtt.client as paho
import pytest
from paho.mqtt.enums import CallbackAPIVersion

from app.contract import Refused, RefusedRow, RefusedTime, Submitted
from app.ingest.mqtt import (
    CONNECT_S,
    LONGEST_WAIT_S,
    Away,
    MqttThread,
    client_id,
    node_of_topic,
    parse_url,
    take,
)
from app.settings import MqttSettings, Settings
from pipeline.sites import NodeSite
from pipeline.tables import NodeEvents
from tests.support.running import until
from tests.support.tcp_proxy import TcpProxy

NODES = (NodeSite("A1", 0, 0, 0), NodeSite("B2", 10, 0, 0))
PATTERN = "airside/nodes/+/events"


MOSQUITTO = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin")


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[int]:
    """The port of a broker of the test's own."""
    if MOSQUITTO is None:
        assert os.environ.get("AIRSIDE_REQUIRE_SERVICES") != "1", "mosquitto is not installed"
        pytest.skip("mosquitto is not installed")
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = int(free.getsockname()[1])
    (tmp_path / "broker.conf").write_text(
        f"listener {port} 127.0.0.1\nallow_anonymous true\nuser root\nmax_queued_messages 10000\n"
    )
    running = subprocess.Popen([MOSQUITTO, "-c", str(tmp_path / "broker.conf")], stderr=subprocess.DEVNULL)
    try:
        until(lambda: answers(port), "the broker listens", 30.0)
        yield port
    finally:
        running.terminate()
        running.wait(10.0)


def answers(port: int) -> bool:
    try:
        socket.create_connection(("127.0.0.1", port), 1.0).close()
    except OSError:
        return False
    return True


class Nodes:
    """Nodes that send with QoS 1, each event with another strength."""

    def __init__(self, port: int) -> None:
        self.client = paho.Client(CallbackAPIVersion.VERSION2)
        self.client.connect("127.0.0.1", port)
        self.client.loop_start()

    def send(self, numbers: range, time_s: float) -> None:
        for number in numbers:
            body = json.dumps({"time": time_s, "strength": number})
            self.client.publish("airside/nodes/A1/events", body, qos=1).wait_for_publish(30.0)

    def close(self) -> None:
        self.client.disconnect()
        self.client.loop_stop()


class Service:
    """Takes events while it has room."""

    def __init__(self) -> None:
        self.nodes = NODES
        self.room = True
        self.tried = threading.Event()
        self.got: list[float] = []
        self.kept: list[float] = []
        self.keep_node_events = lambda events: self.kept.extend(events.strength.tolist())

    def submit_node_events(self, events: NodeEvents) -> Submitted:
        self.tried.set()
        if not self.room:
            raise Refused("the queue for nodes is full")
        self.got.extend(events.strength.tolist())
        return Submitted(len(events))


@contextlib.contextmanager
def listening(port: int, service: Service, name: str = "airside1", keepalive_s: int = 5) -> Iterator[MqttThread]:
    settings = MqttSettings(url=f"mqtt://127.0.0.1:{port}")
    thread = MqttThread(settings, service, name, keepalive_s=keepalive_s)
    before = thread.counters().get("mqtt_connects", 0)
    thread.start()
    try:
        until(lambda: thread.counters().get("mqtt_connects", 0) > before, "it listens", 60.0)
        yield thread
    finally:
        thread.stop()


class NoRoom(Refused):
    """The service has no room, which is not for the message to mend."""


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
            raise NoRoom("the queue for nodes is full")
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
        ("airside/nodes/A1/events", b""),
        ("airside/nodes/A1/events", b"[" + b" " * 300_000 + b"]"),
        ("airside/nodes/A1/events", b'{"time": 1700000000}'),
    ]:
        with contextlib.suppress(NoRoom):
            take(topic, payload, PATTERN, NODES, submit, counted)
    assert [one.node.tolist() for one in got] == [[0], [1, 1], [0, 0], [0]]
    assert counted == {
        "messages": 10, "events": 5, "wrong_node": 2, "bad_value": 1, "unknown_node": 1, "bad_json": 2, "too_many": 1,
        "events_refused": 3, "refused_time": 1,
    }  # fmt: skip


def test_without_a_broker_it_tries_again_and_can_be_ended(caplog: pytest.LogCaptureFixture) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        url = f"mqtt://127.0.0.1:{taken.getsockname()[1]}"
        thread = MqttThread(MqttSettings(url=url), Service(), "airside1")
        thread.start()
        until(lambda: thread.counters().get("mqtt_connect_failures", 0) >= 2, "it tries again", 60.0)
        thread.stop()
    assert not thread._thread.is_alive()
    assert len([one for one in caplog.records if "mqtt" in one.getMessage()]) == 1, "told once, not at each attempt"


def test_it_is_back_within_5_s_of_the_brokers_return() -> None:
    assert CONNECT_S + LONGEST_WAIT_S <= 5.0


def test_the_client_id_stays_and_is_its_own(tmp_path: Path) -> None:
    def of(**values: object) -> str:
        return client_id(Settings(**{"data_dir": tmp_path, **values}), "LFPO")

    assert of() == of()
    assert of().startswith("airsideLFPO")
    assert of().isalnum()
    assert len(of()) == 23
    others = [of(port=8001), of(data_dir=tmp_path / "b"), of(mqtt=MqttSettings(topic="x/+"))]
    assert len({of(), *others}) == 4
    assert of(mqtt=MqttSettings(client_id="tower-2")) == "tower-2"


def test_what_the_broker_kept_is_stored_and_what_is_fresh_is_shown() -> None:
    service = Service()
    thread = MqttThread(MqttSettings(url="mqtt://127.0.0.1:9"), service, "airside1", late_s=5.0)
    now = time.time()
    events = NodeEvents.build(4, time=[now - 200, now - 60, now - 20, now], node=0, strength=[1, 2, 3, 4])
    assert thread._submit(events).taken == 4
    assert (service.got, service.kept) == ([1, 2, 3, 4], []), "never away: the times are for the service to judge"
    service.got.clear()
    thread._away = Away(now - 90, now - 30)
    assert thread._submit(events).taken == 4
    assert (service.got, service.kept) == ([1, 3, 4], [2])


@pytest.mark.services
def test_events_arrive_through_a_broker(broker: int) -> None:
    service, nodes = Service(), Nodes(broker)
    with listening(broker, service) as thread:
        nodes.send(range(9, 10), time.time())
        nodes.client.publish("airside/nodes/A1/events", b"junk", qos=1)
        until(lambda: thread.counters().get("mqtt_messages") == 2, "both are there", 60.0)
    nodes.close()
    assert service.got == [9.0]
    assert thread.counters()["mqtt_bad_json"] == 1


@pytest.mark.services
@pytest.mark.parametrize("silently", [False, True], ids=["closed", "silent"])
def test_no_event_is_lost_while_the_connection_is_cut(silently: bool, broker: int) -> None:
    service, nodes = Service(), Nodes(broker)
    with TcpProxy(broker) as proxy, listening(proxy.port, service, keepalive_s=2) as thread:
        nodes.send(range(100), time.time())
        until(lambda: len(service.got) == 100, "the first arrive", 60.0)
        before = thread.counters()
        proxy.cut(silently)
        lost = before.get("mqtt_disconnects", 0) + 1
        until(lambda: thread.counters().get("mqtt_disconnects", 0) >= lost, "the cut is noticed", 60.0)
        nodes.send(range(100, 224), time.time() - 8.0)
        assert len(service.got) == 100
        proxy.mend()
        until(lambda: thread.counters()["mqtt_connects"] > before["mqtt_connects"], "it is back", 60.0)
        nodes.send(range(224, 324), time.time())
        until(lambda: len(service.got) + len(service.kept) >= 324, "all arrive", 60.0)
        counters = thread.counters()
    nodes.close()
    assert sorted(service.got) == [*range(100), *range(224, 324)]
    assert service.kept == list(range(100, 224)), "too old to be shown, and stored"
    assert (counters["mqtt_events"], counters["mqtt_events_late"]) == (324, 124)


@pytest.mark.services
def test_a_message_without_room_stays_with_the_broker(broker: int) -> None:
    service, nodes = Service(), Nodes(broker)
    service.room = False
    with listening(broker, service) as first:
        nodes.send(range(3), time.time())
        assert service.tried.wait(60.0)
    assert (service.got, first.counters().get("mqtt_messages"), first.counters()["mqtt_refused"]) == ([], None, 1)
    service.room = True
    with listening(broker, service):
        until(lambda: len(service.got) >= 3, "they are delivered again", 60.0)
    nodes.close()
    assert service.got == [0.0, 1.0, 2.0]


def test_a_message_that_is_delivered_again_is_taken_once() -> None:
    service = Service()
    thread = MqttThread(MqttSettings(url="mqtt://127.0.0.1:9"), service, "airside1")
    message = paho.MQTTMessage(1, b"airside/nodes/A1/events")
    message.payload, message.qos = b'{"time": 1700000000, "strength": 7}', 1
    for repeated in (False, True, False):
        message.dup = repeated
        thread._on_message(thread._client, None, message)
    assert service.got == [7.0, 7.0], "only what the broker calls a repetition is left out"
    assert thread.counters()["mqtt_messages_repeated"] == 1
