"""Bad days, on purpose: random datagrams, a silent radar, SIGTERM in mid-scan, kill -9, wrong settings."""

from __future__ import annotations

import random
import signal
import socket
import sqlite3
from pathlib import Path

from tests.whole.conftest import Airside, free_port, launch
from tests.whole.test_demo import eventually, radar


def test_hostile_datagrams_are_counted_and_the_picture_goes_on(demo: Airside) -> None:
    chance = random.Random(5)
    before = radar(demo)["counters"]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for size in (0, 1, 3, 50, 1472, 9000):
            for _ in range(5):
                sender.sendto(chance.randbytes(size), ("127.0.0.1", demo.udp_port))
    refused = ("malformed", "wrong_category", "truncated", "oversized")

    def counted() -> bool:
        after = radar(demo)["counters"]
        return sum(after.get(k, 0) - before.get(k, 0) for k in refused) >= 20

    eventually(counted, 20, "the refused datagrams in the counters")
    assert demo.get("/health/ready").status_code == 200


def stored(running: Airside) -> None:
    """Wait until some track points have been committed."""

    def points() -> int:
        sensors = running.get("/api/v1/sensors").json()["sensors"]
        return int(next(one for one in sensors if one["kind"] == "store")["counters"]["points"])

    eventually(points, 60, "track points in the database")


def test_sigterm_in_mid_scan_drains_and_ends_well(tmp_path: Path) -> None:
    running = launch("demo", tmp_path / "data")
    try:
        running.wait_ready()
        stored(running)
        assert running.end() == 0, running.output.read_text()
    finally:
        running.end(signal.SIGKILL)
    with sqlite3.connect(tmp_path / "data" / "airside.sqlite3") as database:
        assert database.execute("select count(*) from track_points").fetchone()[0] > 0


def test_after_kill_9_the_database_opens_and_the_next_start_is_quick(tmp_path: Path) -> None:
    running = launch("demo", tmp_path / "data")
    try:
        running.wait_ready()
        stored(running)
    finally:
        running.end(signal.SIGKILL)
    with sqlite3.connect(tmp_path / "data" / "airside.sqlite3") as database:
        assert database.execute("pragma integrity_check").fetchone()[0] == "ok"
        kept = database.execute("select count(*) from track_points").fetchone()[0]
    assert kept > 0
    again = launch("demo", tmp_path / "data")
    try:
        again.wait_ready()
        with sqlite3.connect(tmp_path / "data" / "airside.sqlite3") as database:
            assert database.execute("select count(*) from track_points").fetchone()[0] >= kept
    finally:
        again.end()


def test_a_silent_radar_turns_red_and_the_service_lives(tmp_path: Path) -> None:
    settings = tmp_path / "airside.toml"
    settings.write_text(
        'airport = "LSZH"\nview3d = false\n[[radars]]\nid = "smr"\nlatitude = 47.4581\nlongitude = 8.5556\n'
        f"[radars.udp]\nport = {free_port(socket.SOCK_DGRAM)}\n"
    )
    running = launch("serve", tmp_path / "data", "--settings", str(settings))
    try:
        running.wait_ready()
        assert radar(running)["status"] == "waiting"
        assert running.get("/api/v1/picture").json()["tracks"] == []
        assert running.get("/health/live").status_code == 200
    finally:
        assert running.end() == 0


def test_wrong_settings_stop_the_start_with_the_right_word(tmp_path: Path) -> None:
    settings = tmp_path / "airside.toml"
    settings.write_text('[parts]\ndetect = "hybird"\n')
    running = launch("serve", tmp_path / "data", "--settings", str(settings))
    try:
        assert running.process.wait(60) != 0
    finally:
        running.end(signal.SIGKILL)
    assert "hybrid" in running.output.read_text()


def test_a_taken_port_is_said(tmp_path: Path) -> None:
    with socket.socket() as holder:
        holder.bind(("127.0.0.1", 0))
        holder.listen()
        port = holder.getsockname()[1]
        running = launch("serve", tmp_path / "data", AIRSIDE_PORT=str(port), AIRSIDE_VIEW3D="false")
        try:
            assert running.process.wait(60) != 0
        finally:
            running.end(signal.SIGKILL)
    assert str(port) in running.output.read_text()
