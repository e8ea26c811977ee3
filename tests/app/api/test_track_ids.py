"""Ids beyond 32 bits, and ASTERIX track numbers beside them, on every way out."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.api.readsb import aircraft_document
from app.wire import Wire
from pipeline.picture import Picture
from pipeline.tables import Tracks
from tests.support.fake_traffic import synthetic_tracks
from tests.support.live_client import live
from tests.support.running import Server, first_picture, running, until
from tests.support.small_airport import small_airport

FIRST_ID = 2**31 + 7
"""The first id of the pictures served here, beyond what 32 bits hold."""

LAST_ID = 2**53 - 1
"""The greatest whole number that every reader of JSON takes exactly."""


def far_tracks(*given: Any) -> Tracks:
    """The made-up tracks with ids from FIRST_ID on and numbers from 4090 on; those beyond 4095 have none."""
    tracks = synthetic_tracks(*given)
    number = tracks.id + 4089
    return tracks.replace(id=tracks.id - 1 + FIRST_ID, number=(number <= 4095) * number)


@pytest.fixture
def server(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Server]:
    monkeypatch.setattr("tests.support.fake_service.synthetic_tracks", far_tracks)
    with running(tmp_path) as made:
        first_picture(made)
        yield made


def test_rest_and_storage_carry_them(server: Server) -> None:
    with httpx.Client(base_url=server.url, timeout=20.0) as http:
        rows = http.get("/api/v1/tracks").json()["tracks"]
        assert [row["id"] for row in rows] == list(range(FIRST_ID, FIRST_ID + len(rows)))
        assert [row["number"] for row in rows[:7]] == [*range(4090, 4096), None]
        one = http.get(f"/api/v1/tracks/{FIRST_ID + 1}").json()["track"]
        assert (one["id"], one["number"]) == (FIRST_ID + 1, 4091)
        assert http.get("/api/v1/tracks/4091").status_code == 404  # a number is no key
        assert http.get(f"/api/v1/tracks/{LAST_ID}").status_code == 404
        assert http.get(f"/api/v1/tracks/{LAST_ID + 1}").status_code == 422
        store = server.store
        assert store is not None
        until(lambda: store.writer_counters()["points"] >= len(rows), "the picture is stored")
        stored = http.get(f"/api/v1/tracks/{FIRST_ID + 1}/history").json()
        assert (stored["track"]["id"], stored["track"]["number"]) == (FIRST_ID + 1, 4091)
        listed = http.get("/api/v1/history/tracks").json()["tracks"]
        assert {row["id"]: row["number"] for row in listed} == {row["id"]: row["number"] for row in rows}


async def test_the_live_feed_carries_them(server: Server) -> None:
    async with live(server.live) as client:
        await client.subscribe(max_rate_hz=32)
        await client.until("snapshot", "tracks")
        assert min(client.rows) == FIRST_ID
        assert client.rows[FIRST_ID + 5]["number"] == 4095
        assert client.rows[FIRST_ID + 6]["number"] is None


def test_a_hex_of_readsb_has_24_bits() -> None:
    made = Tracks.build(2, id=[0xABCDE, 2**24 + 5], time=0.0, state=[[0.0] * 4] * 2, covariance=[[[1.0] * 4] * 4] * 2)
    rows = Wire(small_airport(), "demo").tracks(made)
    told = aircraft_document(Picture(0.0, made), rows, None)["aircraft"]
    assert [one["hex"] for one in told] == ["~0abcde", "~000005"]
