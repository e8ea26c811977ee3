"""`airside replay JOURNAL` in a process of its own: REST, feed and steering over the recorded picture."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import httpx
import pytest

from tests.app.replay.recording import eventful, record
from tests.pipeline.track.scene import T0
from tests.support.live_client import live
from tests.whole.conftest import Airside, launch


@pytest.fixture(scope="module")
def replay(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Airside]:
    folder = tmp_path_factory.mktemp("replay")
    journal = record(folder / "journal", eventful())
    running = launch("replay", folder / "service", str(journal))
    try:
        running.wait_ready()
        yield running
    finally:
        assert running.end() == 0


def steered(replay: Airside, **order: Any) -> dict[str, Any]:
    answer = httpx.put(replay.url + "/api/v1/replay", json=order, timeout=10)
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    return found


def until(replay: Airside, path: str, condition: Callable[[dict[str, Any]], bool], within: float = 30.0) -> Any:
    end = time.monotonic() + within
    while not condition(found := replay.get(path).json()):
        assert time.monotonic() < end, f"waited in vain: {found}"
        time.sleep(0.02)
    return found


def test_the_recorded_picture_is_served_with_the_time_of_the_recording(replay: Airside) -> None:
    steered(replay, playing=False, time=T0 + 20.0)
    picture = until(replay, "/api/v1/picture", lambda found: abs(found["time"] - (T0 + 20.0)) < 0.5)
    assert picture["mode"] == "replay"
    assert len(picture["tracks"]) >= 3
    assert {one["id"] for one in replay.get("/api/v1/sensors").json()["sensors"]} == {"smr", "replay"}
    state = replay.get("/api/v1/replay").json()
    assert (state["playing"], state["speed"]) == (False, 1.0)
    assert state["begin"] < T0 + 1.0 < T0 + 39.0 < state["end"]


def test_it_plays_pauses_and_seeks_back(replay: Airside) -> None:
    steered(replay, playing=True, speed=16.0, time=T0 + 5.0)
    until(replay, "/api/v1/picture", lambda found: found["time"] > T0 + 15.0)
    steered(replay, playing=False, time=T0 + 6.0)
    picture = until(replay, "/api/v1/picture", lambda found: found["time"] < T0 + 7.0)
    still = steered(replay, speed=1.0)
    assert still["time"] == pytest.approx(T0 + 6.0, abs=0.5)
    assert replay.get("/api/v1/picture").json()["time"] == picture["time"]


def test_what_would_change_the_past_is_refused(replay: Airside) -> None:
    for method, path, body in (
        ("POST", "/api/v1/alerts/41/acknowledge", {"by": "tower"}),
        ("PUT", "/api/v1/runways/06%2F24/state", {"open": False}),
        ("POST", "/api/v1/nodes/events", {"node": "N1", "time": time.time()}),
        ("PUT", "/api/v1/radars/smr/parts", {"detect": "hybrid"}),
    ):
        answer = httpx.request(method, replay.url + path, json=body, timeout=10)
        assert answer.status_code in (409, 422, 503), f"{path}: {answer.status_code}"
        assert "replay of a recording" in answer.json()["detail"]
    answer = httpx.put(replay.url + "/api/v1/replay", json={"time": T0 - 3600.0}, timeout=10)
    assert answer.status_code == 422
    assert "is outside" in answer.json()["detail"]


async def test_a_client_of_the_feed_gets_a_new_epoch_after_a_seek(replay: Airside) -> None:
    steered(replay, playing=False, time=T0 + 30.0)
    until(replay, "/api/v1/picture", lambda found: found["time"] > T0 + 29.0)
    async with live(f"ws://127.0.0.1:{replay.port}/api/v1/live") as client:
        await client.subscribe(topics=["tracks", "alerts"])
        await client.until("snapshot", "tracks")
        before = client.epoch
        steered(replay, time=T0 + 10.0)
        while client.epoch == before:
            await client.take()
        while not (client.seen[-1]["type"] == "snapshot" and client.seen[-1]["topic"] == "tracks"):
            await client.take()
        snapshot = client.seen[-1]
        assert snapshot["mode"] == "replay"
        assert snapshot["time"] == pytest.approx(T0 + 10.0, abs=0.5)
