"""What a subscriber is told, and when: alerts at once, the last picture though none follows, its own topics only."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from typing import Any

import pytest

from app.settings import FeedSettings
from tests.support.live_client import LiveClient, live
from tests.support.running import Server, first_picture, running, until

HEARTBEATS = 40
"""A client that has got so many signs of life while nothing else came will get nothing else."""


@pytest.fixture
def server() -> Iterator[Server]:
    with running(feed=FeedSettings(heartbeat_s=0.25)) as made:
        first_picture(made)
        yield made


@pytest.fixture
def calm() -> Iterator[Server]:
    """Without a sign of life for a minute: nothing wakes a client but what it is told."""
    with running(feed=FeedSettings(heartbeat_s=60.0)) as made:
        first_picture(made)
        yield made


async def stand_at(client: LiveClient, seq: int) -> None:
    """Take messages until the client stands there; fails when only signs of life come."""
    idle = 0
    while client.seq < seq:
        idle = idle + 1 if (await client.take())["type"] == "heartbeat" else 0
        assert idle < HEARTBEATS, f"stands at {client.seq} for ever, the newest picture is {seq}"


def rows_of(server: Server, **wanted: Any) -> dict[int, dict[str, Any]]:
    rows = json.loads(json.dumps(server.hub.wire.tracks(server.hub.picture.tracks)))
    return {row["id"]: row for row in rows if all(row[name] == value for name, value in wanted.items())}


@pytest.mark.parametrize("topics", [["alerts"], ["alerts", "tracks"]], ids=["alone", "with tracks at a low rate"])
async def test_an_alert_reaches_a_subscriber_at_once(calm: Server, topics: list[str]) -> None:
    async with live(calm.live) as client:
        await client.subscribe(topics=topics, max_rate_hz=0.1)
        await client.until("snapshot", "alerts")
        calm.service.step()  # the first delta of a client is not held back
        for text in ("first", "second"):
            alert = calm.service.raise_alert(text)
            calm.service.step()
            async with asyncio.timeout(30):  # a sign of life, which would bring it along, comes after a minute
                message = await client.until("alert")
            assert (message["op"], message["alert"]["id"], message["alert"]["text"]) == ("raise", alert.id, text)


async def test_the_last_picture_comes_though_it_was_too_early_and_none_follows(server: Server) -> None:
    async with live(server.live) as client:
        await client.subscribe(topics=["tracks"], max_rate_hz=1)
        await client.until("snapshot", "tracks")
        before = server.hub.seq
        for _ in range(4):  # one of them is due; those after it come less than a second later
            server.service.step()
        until(lambda: server.hub.picture is server.service.picture(), "the newest picture is numbered")
        assert server.hub.picture_seq > before
        await stand_at(client, server.hub.picture_seq)
        assert client.rows == rows_of(server)


async def test_a_filtered_subscription_resumes(server: Server) -> None:
    async with live(server.live) as client:
        await client.subscribe(filter={"classes": ["vehicle"]}, max_rate_hz=32)
        await client.until("snapshot", "tracks")
        server.service.step()
        until(lambda: server.hub.picture is server.service.picture(), "the newest picture is numbered")
        await stand_at(client, server.hub.picture_seq)
    assert 0 < len(client.rows) < len(rows_of(server))
    until(lambda: not server.hub.clients, "the client has gone")
    for _ in range(5):
        server.service.step()
    until(lambda: server.hub.picture is server.service.picture(), "the newest picture is numbered")
    async with live(server.live) as again:
        again.rows = client.rows
        place = {"epoch": client.epoch, "seq": client.seq}
        result = await again.subscribe(resume=place, filter={"classes": ["vehicle"]}, max_rate_hz=32)
        assert result["recovered"] is True
        await stand_at(again, server.hub.picture_seq)
        assert all(one["type"] != "snapshot" for one in again.seen)
        assert again.rows == rows_of(server, **{"class": "vehicle"})


async def test_a_resumed_box_is_told_what_left_it_meanwhile(server: Server) -> None:
    edge = sorted(row["lon"] for row in rows_of(server).values())[6]
    box = {"bbox": [edge, 48.0, 3.0, 49.0]}
    async with live(server.live) as client:
        await client.subscribe(filter=box, max_rate_hz=32)
        await client.until("snapshot", "tracks")
        place = {"epoch": client.epoch, "seq": client.seq}
    until(lambda: not server.hub.clients, "the client has gone")
    for k in range(1, 20):
        server.service.step(server.service.picture().time + 5.0 * k)
    until(lambda: server.hub.picture is server.service.picture(), "the newest picture is numbered")
    inside = {id for id, row in rows_of(server).items() if row["lon"] >= edge}
    assert inside != set(client.rows), "something has come or gone"
    async with live(server.live) as again:
        again.rows = client.rows
        assert (await again.subscribe(resume=place, filter=box, max_rate_hz=32))["recovered"] is True
        await stand_at(again, server.hub.picture_seq)
        assert set(again.rows) == inside


async def test_another_filter_than_before_is_a_snapshot(server: Server) -> None:
    async with live(server.live) as client:
        await client.subscribe(filter={"classes": ["vehicle"]})
        await client.until("snapshot", "tracks")
        place = {"epoch": client.epoch, "seq": client.seq}
    server.service.step()
    until(lambda: server.hub.picture is server.service.picture(), "the newest picture is numbered")
    async with live(server.live) as again:
        other = {"classes": ["vehicle"], "bbox": [2.0, 48.0, 3.0, 49.0]}
        assert (await again.subscribe(resume=place, filter=other))["recovered"] is False
        await again.until("snapshot", "tracks")


async def test_status_is_told_to_its_subscribers_only(server: Server) -> None:
    async with live(server.live) as status, live(server.live) as tracks, live(server.live) as alerts:
        for client, topic in ((status, "status"), (tracks, "tracks"), (alerts, "alerts")):
            await client.subscribe(topics=[topic], max_rate_hz=32)
        runway = server.service.airport.runways[0].id
        for low in ("low", "normal"):
            server.service.set_runway(runway, open=None, in_use=None, visibility=low)
            server.service.raise_alert(low)
            server.service.step()
            told = await status.until("status")
            while next(one for one in told["runways"] if one["id"] == runway)["visibility"] != low:
                told = await status.until("status")
        until(lambda: server.hub.picture is server.service.picture(), "the newest picture is numbered")
        await stand_at(tracks, server.hub.picture_seq)
        for client in (status, tracks, alerts):
            await client.until("heartbeat")
        kinds = [{one["type"] for one in client.seen} for client in (status, tracks, alerts)]
        always = {"welcome", "result", "heartbeat"}
        assert kinds[0] - always == {"status"}
        assert kinds[1] - always == {"snapshot", "delta"}
        assert kinds[2] - always == {"snapshot", "alert"}
        assert {one.get("topic") for one in tracks.seen if one["type"] == "snapshot"} == {"tracks"}
