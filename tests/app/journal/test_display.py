"""What was sent to the displays is in the journal, word for word."""

from __future__ import annotations

import asyncio
import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import uvicorn
from typer.testing import CliRunner

from app.cli import app
from app.journal.names import DISPLAY
from app.journal.reader import open_journal
from app.replay.verify import verify
from app.run import Running
from pipeline.tables import TargetReports
from tests.app.replay.recording import document, settings
from tests.support.live_client import LiveClient, live
from tests.support.running import until


@contextmanager
def served(place: Path, **journal: Any) -> Iterator[tuple[Running, str]]:
    """The whole service with its server, without radars; reports are all it hears."""
    place.joinpath("map.geojson").write_text(json.dumps(document()))
    chosen = {"folder": place / "journal", "snapshot_every_s": 1.0, **journal}
    made = settings(
        radars=(), airport=str(place / "map.geojson"), data_dir=place / "data", journal=chosen, port=0
    )  # fmt: skip
    running = Running(made)
    server = uvicorn.Server(
        uvicorn.Config(running.app, host="127.0.0.1", port=0, log_config=None, ws="websockets-sansio")
    )
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    until(lambda: server.started, "the server starts")
    running.begin(lambda _: None)
    try:
        yield running, f"ws://127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}/api/v1/live"
    finally:
        begun = time.monotonic()
        server.should_exit = True
        thread.join(15.0)
        running.end()
        assert time.monotonic() - begun < 14.0


def report(running: Running, k: int) -> None:
    taxiing = TargetReports.build(
        1, time=time.time() - 0.05, address="3944ef", callsign="AFR12", east=-100.0 + k, north=40.0, speed=8.0
    )
    running.service.submit_target_reports(taxiing)


async def watched(running: Running, url: str) -> LiveClient:
    async with live(url) as client:
        await client.subscribe()
        for k in range(30):
            report(running, k)
            if k == 10:
                running.service.set_runway("06/24", open=False, in_use=None, visibility=None)
            await asyncio.sleep(0.05)
            for _ in range(20):
                try:
                    async with asyncio.timeout(0.02):
                        await client.take()
                except TimeoutError:
                    break
        return client


def test_what_a_client_got_is_in_the_journal(tmp_path: Path) -> None:
    with served(tmp_path, display=True) as (running, url):
        until(lambda: len(running.hub.clients) == 1, "the recorder follows the feed")
        client = asyncio.run(watched(running, url))
        until(lambda: len(running.hub.clients) == 1, "the client has gone")
    journal = open_journal(tmp_path / "journal")
    messages = [json.loads(one.data) for one in journal.records() if one.topic == DISPLAY]
    kinds = {(one["type"], one.get("topic")) for one in messages}
    assert {("snapshot", "tracks"), ("snapshot", "alerts"), ("delta", "tracks"), ("status", None)} <= kinds
    assert not kinds & {("welcome", None), ("result", None)}
    got = [one for one in client.seen if one["type"] in ("delta", "alert", "status")]
    assert len([one for one in got if one["type"] == "delta"]) > 3
    missing = [one for one in got[2:] if one not in messages and one["type"] != "delta"]
    assert missing == []
    rows = {
        one["seq"]: shown for one, shown in zip(messages, replayed(messages), strict=True) if one["type"] == "delta"
    }
    common = [one for one in got if one["type"] == "delta" and one["seq"] in rows]
    assert len(common) > 3
    last = common[-1]["seq"]
    mine = shown_at(client.seen, last)
    assert mine
    assert rows[last] == mine
    assert verify(journal).difference is None
    told = CliRunner().invoke(app, ["journal", "info", str(tmp_path / "journal")], env={"COLUMNS": "300"}).stdout
    assert any(one.split()[:2] == ["display", str(len(messages))] for one in told.splitlines())
    snapshots = [one for one in messages if (one["type"], one.get("topic")) == ("snapshot", "tracks")]
    assert len(snapshots) >= 2, "after every snapshot of the engine all is told again"


def replayed(messages: list[dict[str, Any]]) -> list[dict[int, Any]]:
    """The rows shown after each message."""
    rows: dict[int, Any] = {}
    made = []
    for one in messages:
        if (one["type"], one.get("topic")) == ("snapshot", "tracks"):
            rows = {row["id"]: dict(row) for row in one["tracks"]}
        elif one["type"] == "delta":
            for gone in one["del"]:
                rows.pop(gone["id"], None)
            rows |= {row["id"]: dict(row) for row in one["add"]}
            for row in one["upd"]:
                rows[row["id"]] = {**rows[row["id"]], **row}
        made.append({id: dict(row) for id, row in rows.items()})
    return made


def shown_at(messages: list[dict[str, Any]], seq: int) -> dict[int, Any]:
    shown = [
        rows
        for one, rows in zip(messages, replayed(messages), strict=True)
        if one.get("seq") == seq and one["type"] == "delta"
    ]
    return shown[-1]


def test_it_is_off_unless_asked_for(tmp_path: Path) -> None:
    with served(tmp_path) as (running, _):
        assert running.hub.on_start == []
        report(running, 0)
        until(lambda: running.service.picture() is not None, "a picture")
        until(lambda: running.hub.picture is not None, "the feed has it")
        assert running.hub.clients == set()
    assert DISPLAY not in open_journal(tmp_path / "journal").topics()


def test_without_a_journal_nothing_follows(tmp_path: Path) -> None:
    with served(tmp_path, folder=None, display=True) as (running, _):
        assert running.hub.on_start == []


@pytest.fixture(autouse=True)
def no_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("AIRSIDE_SETTINGS", raising=False)
