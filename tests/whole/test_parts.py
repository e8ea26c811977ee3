"""The parts of the demonstration's radar change under a listening client; kill -9 does not make it learn anew."""

from __future__ import annotations

import json
import signal
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from tests.whole.conftest import Airside, launch
from tests.whole.test_demo import eventually, picture, radar

PATH = "/api/v1/radars/SMR1/parts"
FEED = Subprotocol("airside.v1.json")


def test_a_listening_client_keeps_its_tracks_over_a_change_of_parts(demo: Airside) -> None:
    def aircraft() -> set[str]:
        return {t["callsign"] for t in picture(demo)["tracks"] if t["callsign"] and t["phase"] == "confirmed"}

    before = eventually(lambda: aircraft() if len(aircraft()) >= 5 else None, 90, "five labelled tracks")
    running = demo.get(PATH).json()["running"]
    order = {
        "detect": {**running["detect"], "pfa": 3e-7, "learn_scans": 3},
        "extract": {"name": "manhattan", "min_cells": 2},
    }
    # the parts take long to compile: a client that does not listen meanwhile is taken for dead
    with (
        ThreadPoolExecutor(1) as pool,
        connect(f"ws://127.0.0.1:{demo.port}/api/v1/live", subprotocols=[FEED]) as feed,
    ):
        feed.send(json.dumps({"type": "hello"}))
        feed.send(json.dumps({"type": "subscribe", "topics": ["tracks", "status"]}))
        asked = pool.submit(httpx.put, demo.url + PATH, json=order, timeout=120)
        times: list[float] = []
        swept: list[int] = []

        def turned() -> bool:
            message: dict[str, Any] = json.loads(feed.recv(20))
            if message.get("topic") == "tracks":
                times.append(message["time"])
            if message["type"] == "status":
                state = next(one for one in message["sensors"] if one["id"] == "SMR1")
                swept.append(state["counters"]["sweeps"])
                return bool(state["counters"]["parts_changed"] == 1)
            return False

        while not turned():
            if asked.done():
                assert asked.result().status_code == 200, asked.result().text
        answer = asked.result()
        assert answer.status_code == 200, answer.text
        for _ in range(20):
            turned()
    assert times == sorted(times)
    assert swept == sorted(swept)
    body = demo.get(PATH).json()
    assert body["next"] is None
    assert body["running"]["detect"]["pfa"] == 3e-7
    assert body["running"]["extract"]["min_cells"] == 2
    assert len(before & aircraft()) >= 0.7 * len(before), "the tracks stay"
    wrong = httpx.put(demo.url + PATH, json={"detect": "hybird"}, timeout=20)
    assert wrong.status_code == 422
    assert "hybrid" in wrong.json()["detail"]
    httpx.put(demo.url + PATH, json=running, timeout=120)


def test_after_kill_9_the_detector_goes_on_with_what_it_had_learned(tmp_path: Path) -> None:
    def counted(running: Airside) -> dict[str, int]:
        return dict(radar(running)["counters"])

    how = {"AIRSIDE_STORAGE__STATE_INTERVAL_S": "2"}
    running = launch("demo", tmp_path / "data", **how)
    try:
        running.wait_ready()
        eventually(lambda: counted(running)["plots"] > 0, 120, "the detector has learned")
        saves = counted(running)["states_saved"]
        eventually(lambda: counted(running)["states_saved"] > saves, 60, "and that is saved")
    finally:
        running.end(signal.SIGKILL)
    again = launch("demo", tmp_path / "data", **how)
    try:
        again.wait_ready()
        eventually(lambda: counted(again)["sweeps"] >= 3 * 4096, 60, "three turns")
        now = counted(again)
        assert now["states_resumed"] == 1, again.output.read_text()
        assert now["plots"] > 20
    finally:
        again.end()
