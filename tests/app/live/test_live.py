from __future__ import annotations

import asyncio
import json
import socket as sockets
import time
from collections.abc import Iterator
from typing import Any

import jsonschema_rs
import msgspec
import pytest
import websockets

from app.api import feed_models
from app.api.asyncapi import document as asyncapi_document
from app.live.hub import Hub
from app.live.messages import BadMessage, Subscribe, decode, granted_rate
from app.live.session import origin_allowed
from app.settings import FeedSettings
from tests.support.live_client import LiveClient, live
from tests.support.running import Server, first_picture, running, until

HEARTBEAT_S = 0.2


@pytest.fixture
def server() -> Iterator[Server]:
    feed = FeedSettings(heartbeat_s=HEARTBEAT_S, lag_limit_s=1.0, max_clients=8, max_message_bytes=2048)
    with running(feed=feed) as made:
        first_picture(made)
        yield made


async def settled(client: LiveClient, server: Server) -> None:
    """Take messages until the client stands at the newest picture."""
    while client.seq < server.hub.picture_seq:
        await client.take()


async def test_hello_subscribe_snapshot_delta(server: Server) -> None:
    async with live(server.live) as client:
        assert client.socket.subprotocol == "airside.v1.json"
        result = await client.subscribe(max_rate_hz=1000)
        assert (result["ok"], result["max_rate_hz"], result["recovered"]) == (True, 32.0, False)
        await client.until("snapshot", "tracks")
        assert len(client.rows) == 12
        for _ in range(3):
            server.service.step()
            await client.until("delta")
        whole = {row["id"]: row for row in json.loads(json.dumps(server.hub.wire.tracks(server.hub.picture.tracks)))}
        assert client.rows == whole
        assert all(one["mode"] == "demo" for one in client.seen if one["type"] != "result")
        deltas = [one for one in client.seen if one["type"] == "delta"]
        assert [one["prev"] for one in deltas[1:]] == [one["seq"] for one in deltas[:-1]]
        assert all("callsign" not in row for one in deltas for row in one["upd"])


async def test_every_message_is_as_the_asyncapi_document_says(server: Server) -> None:
    document = asyncapi_document("LFPO", "0")
    names = [kind.__name__ for kind in feed_models.TO_CLIENT]
    references = [{"$ref": f"#/components/schemas/{name}"} for name in names]
    validator = jsonschema_rs.Draft202012Validator({"oneOf": references, "components": document["components"]})
    async with live(server.live) as client:
        await client.subscribe(max_rate_hz=32)
        alert = server.service.raise_alert()
        server.service.step()
        server.service.clear_alert(alert.id)
        server.service.step()
        await client.say(type="nonsense")
        while {one["type"] for one in client.seen} < {
            "welcome", "result", "snapshot", "delta", "alert", "status", "heartbeat",
        }:  # fmt: skip
            await client.take()
        for message in client.seen:
            validator.validate(message)


@pytest.mark.parametrize("kind", feed_models.FROM_CLIENT)
def test_what_the_document_lets_a_client_say_is_understood(kind: Any) -> None:
    examples = {
        "Hello": {"type": "hello", "id": 1, "resume": {"epoch": "a", "seq": 4}},
        "Subscribe": {
            "type": "subscribe", "id": "x", "topics": ["tracks"], "max_rate_hz": 2,
            "filter": {"classes": ["vehicle"], "bbox": [2.0, 48.0, 3.0, 49.0]},
        },
        "Ping": {"type": "ping", "id": None},
    }  # fmt: skip
    for message in (examples[kind.__name__], {"type": examples[kind.__name__]["type"]}):
        kind.model_validate(message)
        decode(json.dumps(message))


async def test_filters_by_class_and_box(server: Server) -> None:
    rows = server.hub.wire.tracks(server.hub.picture.tracks)
    middle = sorted(row["lon"] for row in rows)[6]
    box = [middle, 48.0, 3.0, 49.0]
    async with live(server.live) as some, live(server.live) as near:
        await some.subscribe(filter={"classes": ["vehicle"]}, max_rate_hz=32)
        await near.subscribe(filter={"bbox": box}, max_rate_hz=32)
        for client in (some, near):
            await client.until("snapshot", "tracks")
        start = server.hub.picture.time
        for k in range(1, 20):
            server.service.step(start + 5.0 * k)
            await asyncio.sleep(0.04)
        for client in (some, near):
            await settled(client, server)
        rows = server.hub.wire.tracks(server.hub.picture.tracks)
        assert set(some.rows) == {row["id"] for row in rows if row["class"] == "vehicle"}
        assert set(near.rows) == {row["id"] for row in rows if row["lon"] >= middle}
        assert any(one["reason"] == "filter" for m in near.seen if m["type"] == "delta" for one in m["del"])


async def test_a_rate_is_kept(server: Server) -> None:
    async with live(server.live) as client:
        assert (await client.subscribe(max_rate_hz=2.9))["max_rate_hz"] == 2.0
        await client.until("snapshot", "tracks")
        began = time.monotonic()
        for _ in range(40):
            server.service.step()
            await asyncio.sleep(0.025)
        lasted = time.monotonic() - began
        await client.until("heartbeat")
        deltas = sum(one["type"] == "delta" for one in client.seen)
        assert 1 <= deltas <= 2 * lasted + 2


async def test_resume_brings_what_was_missed_and_no_snapshot(server: Server) -> None:
    async with live(server.live) as client:
        await client.subscribe(max_rate_hz=32)
        await client.until("snapshot", "tracks")
        server.service.step()
        await settled(client, server)
    alert = server.service.raise_alert("while away")
    for _ in range(5):
        server.service.step()
    until(lambda: server.hub.picture is server.service.picture(), "the newest picture is numbered")
    held, place = client.rows, {"epoch": client.epoch, "seq": client.seq}
    async with live(server.live) as again:
        again.rows = held
        assert (await again.subscribe(resume=place, max_rate_hz=32))["recovered"] is True
        await settled(again, server)
        assert all(one["type"] != "snapshot" for one in again.seen)
        assert again.alerts == [("raise", alert.id, "while away")]
        whole = json.loads(json.dumps(server.hub.wire.tracks(server.hub.picture.tracks)))
        assert list(again.rows.values()) == whole


@pytest.mark.parametrize(
    "place", [{"epoch": "other", "seq": 1}, {"epoch": None, "seq": 10**9}, {"epoch": None, "seq": -1}]
)
async def test_resume_from_nowhere_brings_a_snapshot(server: Server, place: dict[str, Any]) -> None:
    async with live(server.live) as client:
        resume = {**place, "epoch": place["epoch"] or server.hub.epoch}
        assert (await client.subscribe(resume=resume))["recovered"] is False
        await client.until("snapshot", "tracks")


async def test_time_that_steps_back_begins_a_new_epoch(server: Server) -> None:
    async with live(server.live) as client:
        await client.subscribe(max_rate_hz=32)
        first = (await client.until("snapshot", "tracks"))["epoch"]
        server.service.step(server.hub.picture.time - 100.0)
        again = await client.until("snapshot", "tracks")
        assert again["epoch"] != first
        assert len(client.rows) == 12


async def test_heartbeats_come_while_nothing_else_does(server: Server) -> None:
    async with live(server.live) as client:
        await client.subscribe()
        await client.until("snapshot", "tracks")
        first, second = await client.until("heartbeat"), await client.until("heartbeat")
        assert second["seq"] == client.seq
        assert second["server_time"] > first["server_time"]
        assert second["time"] == first["time"]


async def test_no_alert_is_lost_at_a_low_rate(server: Server) -> None:
    async with live(server.live) as client:
        await client.subscribe(max_rate_hz=0.1)
        await client.until("snapshot", "tracks")
        alert = server.service.raise_alert("0")
        for i in range(1, 200):
            server.service.update_alert(alert.id, text=str(i))
            if i % 7 == 0:
                server.service.step()
        server.service.step()
        while len(client.alerts) < 200:
            await client.take()
        assert [text for _, _, text in client.alerts] == [str(i) for i in range(200)]


async def read_on(socket: Any) -> None:
    while True:
        await socket.recv()


async def flood(client: LiveClient) -> None:
    for i in range(2000):
        await client.say(type="ping", id=i)
    await client.until("nothing")


def shrunk(url: str) -> sockets.socket:
    """A connection with a small receive buffer, so that a client that does not read is noticed soon."""
    host, port = url.split("/")[2].split(":")
    made = sockets.socket()
    made.setsockopt(sockets.SOL_SOCKET, sockets.SO_RCVBUF, 4096)
    made.connect((host, int(port)))
    return made


async def test_a_client_that_never_reads_is_cut_and_delays_nobody(server: Server) -> None:
    pad = "x" * 20_000
    stuck = await websockets.connect(
        server.live, sock=shrunk(server.live), max_queue=1, max_size=None, ping_interval=None
    )
    try:
        async with live(server.live) as reader:
            await stuck.send('{"type":"hello"}')
            await stuck.send('{"type":"subscribe","max_rate_hz":32}')
            await reader.subscribe(max_rate_hz=32)
            alert = server.service.raise_alert("0")
            sent = 0
            while server.hub.counters["closed_lagging"] == 0:
                assert sent < 3000, "the client that never reads was not closed"
                sent += 1
                server.service.update_alert(alert.id, text=f"{sent} {pad}")
                server.service.step()
                while len(reader.alerts) < sent:
                    await reader.take()
            until(lambda: len(server.hub.clients) == 1, "the stuck client is forgotten")
            assert [int(text.split(maxsplit=1)[0]) for _, _, text in reader.alerts] == list(range(sent))
    finally:
        stuck.transport.abort()


async def test_a_client_that_reads_late_finds_the_close_code(server: Server) -> None:
    stuck = await websockets.connect(server.live, sock=shrunk(server.live), max_queue=1, max_size=None)
    await stuck.send('{"type":"hello"}')
    await stuck.send('{"type":"subscribe","max_rate_hz":32}')
    alert = server.service.raise_alert("0")
    while server.hub.counters["closed_lagging"] == 0:
        server.service.update_alert(alert.id, text="x" * 50_000)
        server.service.step()
        await asyncio.sleep(0.01)
    with pytest.raises(websockets.ConnectionClosed) as closed:
        await read_on(stuck)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1013


async def test_merged_deltas_of_a_slow_client_are_told() -> None:
    """A client whose transport has no room gets one merged delta when it has."""
    with running(feed=FeedSettings(heartbeat_s=5.0)) as server:
        server.service.step()
        gate, written, sent = asyncio.Event(), asyncio.Event(), []
        from app.live.client import Client
        from app.live.hub import Hub

        hub = Hub(server.service, server.service.settings)
        hub.start()

        async def send(text: str) -> None:
            sent.append(json.loads(text))
            written.set()
            if sent[-1]["type"] == "delta":
                await gate.wait()

        client = Client(hub, send)
        hub.clients.add(client)
        writer = asyncio.create_task(client.write())
        client.hello(None)
        client.subscribe(msgspec.convert({"type": "subscribe", "topics": ["tracks"], "max_rate_hz": 32}, Subscribe))
        start = server.hub.wire and server.service.picture().time
        for k in range(1, 12):
            hub.publish(server.service.step(start + k), ())
            await asyncio.sleep(0.04)
        assert sum(one["type"] == "delta" for one in sent) == 1
        before = len(sent)
        gate.set()
        while len(sent) < before + 2:
            written.clear()
            await written.wait()
        held, lagging, merged = sent[before - 1 : before + 2]
        assert (held["type"], lagging["type"], merged["type"]) == ("delta", "lagging", "delta")
        assert lagging["dropped"] >= 1
        assert merged["prev"] == held["seq"]
        writer.cancel()
        hub.clients.clear()
        await hub.stop()


async def test_what_is_not_understood_is_answered_then_ended(server: Server) -> None:
    bad = ["not json", '{"type":"subscribe","topics":["fish"]}', '{"id":3,"type":"fly"}', '{"type":NaN}', "[]"]
    async with live(server.live) as client:
        await client.say(type="hello")
        await client.until("welcome")
        for text in bad:
            await client.socket.send(text)
        for _ in bad:
            answer = await client.until("result")
            assert answer["ok"] is False
            assert answer["error"]
        with pytest.raises(websockets.ConnectionClosed) as closed:
            await client.until("nothing")
        assert closed.value.rcvd.code == 1008
    assert [one["id"] for one in client.seen if one["type"] == "result"][2] == 3


@pytest.mark.parametrize(
    "wish",
    [
        {"filter": {"bbox": [3, 48, 2, 49]}},
        {"filter": {"bbox": [2, 48, 3]}},
        {"filter": {"bbox": [2, 48, 3, 1e9]}},
        {"max_rate_hz": 0},
        {"max_rate_hz": -1},
        {"topics": "tracks"},
        {"filter": {"colour": "red"}},
    ],
)
async def test_wishes_that_make_no_sense_are_refused(server: Server, wish: dict[str, Any]) -> None:
    async with live(server.live) as client:
        await client.say(type="hello")
        await client.say(type="subscribe", id=9, **wish)
        answer = await client.until("result")
        assert (answer["ok"], answer["id"]) == (False, 9)
        await client.say(type="ping", id=10)
        assert (await client.until("result"))["ok"] is True


async def test_hello_comes_first(server: Server) -> None:
    async with live(server.live) as client:
        await client.say(type="subscribe", id=1)
        assert (await client.until("result"))["ok"] is False


@pytest.mark.parametrize(("frame", "code"), [("x" * 5000, 1009), (b"\x00\x01", 1003)], ids=["too long", "binary"])
async def test_frames_that_are_not_taken(server: Server, frame: str | bytes, code: int) -> None:
    async with live(server.live) as client:
        await client.socket.send(frame)
        with pytest.raises(websockets.ConnectionClosed) as closed:
            await client.until("nothing")
        assert closed.value.rcvd.code == code


async def test_a_flood_of_requests_is_ended(server: Server) -> None:
    async with live(server.live) as client:
        await client.say(type="hello")
        with pytest.raises(websockets.ConnectionClosed) as closed:
            await flood(client)
        assert closed.value.rcvd.code == 1008


async def test_filters_that_change_too_often_are_refused_and_change_nothing_then_the_connection_ends(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Hub, "loop_time", lambda _: 0.0)  # all within one moment
    async with live(server.live) as client:
        await client.subscribe(filter={"classes": ["vehicle"]})
        for i in range(2, 27):
            await client.say(type="subscribe", id=i, filter={"bbox": [2.0, 48.0, 2.0 + i / 100, 49.0]})
        with pytest.raises(websockets.ConnectionClosed) as closed:
            await client.until("nothing")
    assert (closed.value.rcvd.code, closed.value.rcvd.reason) == (1008, "more than 2 subscriptions a second")
    results = [one for one in client.seen if one["type"] == "result"]
    assert [one["ok"] for one in results] == [True] * 5 + [False] * 20
    assert all("more than 2 subscriptions a second" in one["error"] for one in results[5:])
    assert sum(one["type"] == "snapshot" and one["topic"] == "tracks" for one in client.seen) <= 5
    assert server.hub.counters["refused_subscriptions"] == 21


async def test_a_refused_change_leaves_the_subscription_as_it_was(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Hub, "loop_time", lambda _: 0.0)
    async with live(server.live) as client:
        await client.subscribe(filter={"classes": ["vehicle"]})
        for i in range(2, 6):
            await client.say(type="subscribe", id=i, filter={"classes": ["aircraft"]})
            assert (await client.until("result"))["ok"]
        await client.say(type="subscribe", id=6)
        assert not (await client.until("result"))["ok"]
        monkeypatch.undo()
        server.service.step()
        await client.until("delta")
        assert {row["class"] for row in client.rows.values()} == {"aircraft"}


async def test_equal_filters_share_a_view_and_the_number_of_views_is_bounded() -> None:
    with running(feed=FeedSettings(max_filters=1)) as server:
        first_picture(server)
        async with live(server.live) as first, live(server.live) as second, live(server.live) as third:
            assert (await first.subscribe(filter={"classes": ["vehicle", "aircraft"]}))["ok"]
            assert (await second.subscribe(filter={"classes": ["aircraft", "vehicle"]}))["ok"]
            refused = await third.subscribe(filter={"classes": ["aircraft"]})
            assert not refused["ok"]
            assert "1 different filters are in use" in refused["error"]
            assert server.hub.counters["refused_filters"] == 1
            for wanted in ({}, {"classes": ["unknown", "vehicle", "aircraft"]}):  # everything is no filter
                await third.say(type="subscribe", id=2, filter=wanted)
                assert (await third.until("result"))["ok"]
            assert len({id(one._view) for one in server.hub.clients}) == 2  # type: ignore[attr-defined]


async def test_pages_of_other_origins_are_refused(server: Server) -> None:
    with pytest.raises(websockets.InvalidStatus) as refused:
        async with live(server.live, origin="https://evil.example"):
            pass
    assert refused.value.response.status_code == 403
    async with live(server.live, origin=server.url) as client:
        assert (await client.subscribe())["ok"] is True


async def test_other_subprotocols_are_refused(server: Server) -> None:
    with pytest.raises(websockets.InvalidStatus):
        await websockets.connect(server.live, subprotocols=["other.v9"])  # type: ignore[list-item]


async def test_too_many_clients_are_told_to_come_later(server: Server) -> None:
    held = [await websockets.connect(server.live) for _ in range(8)]
    ninth = await websockets.connect(server.live)
    with pytest.raises(websockets.ConnectionClosed) as closed:
        await ninth.recv()
    assert closed.value.rcvd.code == 1013
    for one in held:
        await one.close()


def test_origins() -> None:
    assert origin_allowed(None, "a:1", ())
    assert origin_allowed("http://a:1", "a:1", ())
    assert origin_allowed("https://b.example", "a:1", ("https://b.example",))
    assert not origin_allowed("https://b.example", "a:1", ())
    assert not origin_allowed("null", "a:1", ())
    assert not origin_allowed("http://a:1.evil.example", "a:1", ())
    assert not origin_allowed("file://a:1", "a:1", ())


def test_rates_are_rounded_down() -> None:
    assert granted_rate(Subscribe(max_rate_hz=3.9)) == 2.0
    assert granted_rate(Subscribe(max_rate_hz=0.01)) == 0.1
    with pytest.raises(BadMessage):
        granted_rate(Subscribe(max_rate_hz=float("inf")))
