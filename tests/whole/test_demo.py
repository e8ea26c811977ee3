"""The demonstration as a user meets it: recorded movements, through radar video, to a picture with an alert."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from typing import Any

import httpx
import pytest
from websockets.sync.client import connect

from tests.whole.conftest import Airside


def eventually(look: Callable[[], Any], within: float, what: str) -> Any:
    until = time.monotonic() + within
    while time.monotonic() < until:
        found = look()
        if found:
            return found
        time.sleep(0.25)
    raise AssertionError(f"not within {within} s: {what}")


def picture(demo: Airside) -> dict[str, Any]:
    return dict(demo.get("/api/v1/picture").json())


def radar(demo: Airside) -> dict[str, Any]:
    return next(s for s in demo.get("/api/v1/sensors").json()["sensors"] if s["kind"] == "radar")


def test_orly_is_there_with_callsigns_seen_by_radar(demo: Airside) -> None:
    def seen() -> list[dict[str, Any]]:
        tracks = picture(demo)["tracks"]
        return [t for t in tracks if t["callsign"] and "radar" in t["sources"] and t["class"] == "aircraft"]

    aircraft = eventually(lambda: seen() if len(seen()) >= 5 else None, 60, "five labelled aircraft on radar")
    assert all(48.6 < t["lat"] < 48.85 and 2.2 < t["lon"] < 2.55 for t in aircraft)


def test_everything_says_that_it_is_a_demo(demo: Airside) -> None:
    found = picture(demo)
    assert found["mode"] == "demo"
    assert radar(demo)["simulated"] is True
    vehicles = eventually(
        lambda: [t for t in picture(demo)["tracks"] if t["class"] == "vehicle"], 60, "a simulated vehicle"
    )
    assert all(t["simulated"] for t in vehicles)


def test_targets_move(demo: Airside) -> None:
    def moved() -> bool:
        before = {t["id"]: (t["east_m"], t["north_m"]) for t in picture(demo)["tracks"] if t["speed_mps"] > 3}
        time.sleep(2)
        after = {t["id"]: (t["east_m"], t["north_m"]) for t in picture(demo)["tracks"]}
        return any(abs(after[i][0] - e) + abs(after[i][1] - n) > 3 for i, (e, n) in before.items() if i in after)

    eventually(moved, 60, "a target that moved")


def test_an_alert_comes_within_two_minutes_and_can_be_acknowledged(demo: Airside) -> None:
    def acknowledged() -> dict[str, Any] | None:
        for alert in demo.get("/api/v1/alerts?state=live").json()["alerts"]:
            path = f"{demo.url}/api/v1/alerts/{alert['id']}/acknowledge"
            answer = httpx.post(path, json={"by": "test"}, timeout=10)
            if answer.status_code == 409:
                continue  # it was cleared between the two calls; the next one will do
            assert answer.status_code == 200, answer.text
            return dict(answer.json()["alert"])
        return None

    alert = eventually(acknowledged, 240, "a runway alert that is acknowledged while it is live")
    assert (alert["state"], alert["acknowledged_by"]) == ("acknowledged", "test")
    assert alert["simulated"] is True
    assert alert["runway"]


def test_video_arrives_as_fast_as_it_is_sent(demo: Airside) -> None:
    def sweeps() -> int:
        return int(radar(demo)["counters"]["taken"])

    first, begun = sweeps(), time.monotonic()
    time.sleep(3)
    rate = (sweeps() - first) / (time.monotonic() - begun)
    assert rate > 0.5 * 4096


def test_the_live_feed_gives_a_snapshot_then_changes(demo: Airside) -> None:
    url = demo.url.replace("http", "ws") + "/api/v1/live"
    with connect(url, subprotocols=["airside.v1.json"]) as feed:
        feed.send(json.dumps({"type": "hello"}))
        kinds: list[str] = []
        welcome = json.loads(feed.recv(timeout=5))
        assert welcome["type"] == "welcome"
        feed.send(json.dumps({"id": 1, "type": "subscribe", "topics": ["tracks", "alerts", "status"]}))
        until = time.monotonic() + 10
        while time.monotonic() < until and not {"result", "snapshot", "delta"} <= set(kinds):
            kinds.append(json.loads(feed.recv(timeout=5))["type"])
    assert kinds.index("snapshot") < kinds.index("delta")


def test_the_radar_picture_is_a_png(demo: Airside) -> None:
    answer = demo.get(f"/api/v1/radars/{radar(demo)['id']}/video.png")
    assert answer.status_code == 200
    assert answer.content.startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("method", "path", "body", "status"),
    [
        ("GET", f"/api/v1/tracks/{2**53}", None, 422),
        ("GET", "/api/v1/tracks/4095", None, 404),
        ("GET", "/api/v1/radars/none/video.png", None, 404),
        ("POST", "/api/v1/alerts/999999/acknowledge", b'{"by": "x"}', 404),
        ("POST", "/api/v1/nodes/events", b'{"node": "none", "time": NaN}', 422),
        ("POST", "/api/v1/nodes/events", b"{", 422),
        ("PUT", "/api/v1/runways/99/state", b'{"open": false}', 404),
        ("POST", "/api/v1/radars/none/sweeps", b"junk", 415),
    ],
)
def test_bad_input_is_answered_with_words(
    demo: Airside, method: str, path: str, body: bytes | None, status: int
) -> None:
    answer = httpx.request(
        method, demo.url + path, content=body, headers={"content-type": "application/json"}, timeout=10
    )
    assert answer.status_code in ({400, 422} if status == 422 else {status})
    assert answer.headers["content-type"].startswith("application/problem+json")
    assert answer.json()["detail"]
