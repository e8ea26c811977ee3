"""The picture for tar1090 and its like."""

from __future__ import annotations

import re
from typing import Any

import httpx
import numpy as np
import pytest

from app.api.readsb import aircraft_document, airport_elevation, trail_document
from app.wire import Row, Wire
from pipeline.picture import Picture
from pipeline.tables import Source, TargetClass, Tracks
from tests.support.running import Server, until
from tests.support.small_airport import small_airport

NOW = 1.7e9


def test_readsb_conventions(http: httpx.Client, server: Server) -> None:
    body = http.get("/data/aircraft.json").json()
    rows = {row["id"]: row for row in http.get("/api/v1/tracks").json()["tracks"]}
    assert len(body["aircraft"]) == len(rows)
    assert isinstance(body["now"], float)
    for one in body["aircraft"]:
        assert re.fullmatch(r"~?[0-9a-f]{6}", one["hex"])
        assert None not in one.values()
        assert one["alt_baro"] == "ground"
        assert {"seen", "seen_pos", "messages", "mlat", "tisb", "type", "lat", "lon", "gs"} <= set(one)
        assert len(one.get("flight", "12345678")) == 8
    fast = next(one for one in body["aircraft"] if one["hex"] == "390000")
    assert fast["gs"] == round(rows[1]["speed_mps"] * 3600 / 1852, 1)
    vehicle = next(one for one in body["aircraft"] if one["hex"] == "390002")
    assert (vehicle["category"], vehicle["type"]) == ("C2", "adsb_icao_nt")
    unknown = next(one for one in body["aircraft"] if one["hex"].startswith("~"))
    assert "flight" not in unknown
    assert unknown["type"] == "tisb_trackfile"
    receiver = http.get("/data/receiver.json").json()
    assert {"version", "refresh", "history", "lat", "lon"} <= set(receiver)


def document(elevation: float | None = 432.0, trail: bool = False, **columns: Any) -> Row:
    """What is told of one track."""
    given = {"id": 26, "time": NOW, "state": np.zeros((1, 4)), "covariance": np.eye(4), "updated": NOW, **columns}
    picture = Picture(NOW, Tracks.build(1, **given))
    rows = Wire(small_airport(), "live").tracks(picture.tracks)
    return (trail_document if trail else aircraft_document)(picture, rows, elevation)


def one(**columns: Any) -> Row:
    made: Row = document(**columns)["aircraft"][0]
    return made


@pytest.mark.parametrize("sources", [Source.REPORT, Source.RADAR, Source.NODE, Source.RADAR | Source.REPORT, 0])
def test_a_real_address_stays_one_whatever_carries_the_track_on(sources: int) -> None:
    assert one(address="4b1815", sources=sources)["type"] == "adsb_icao"
    assert one(address="4b1815", sources=sources, category=TargetClass.VEHICLE)["type"] == "adsb_icao_nt"


def test_an_address_that_is_not_of_icao_is_told_as_that() -> None:
    made = one(address="~2a1b3c", category=TargetClass.VEHICLE, sources=Source.REPORT)
    assert (made["hex"], made["type"], made["category"]) == ("~2a1b3c", "adsb_other", "C2")


def test_without_an_address_it_is_a_track_file() -> None:
    made = one(sources=Source.RADAR)
    assert (made["hex"], made["type"]) == ("~00001a", "tisb_trackfile")


def test_altitudes_are_above_the_sea() -> None:
    flying = {"altitude": 300.0, "on_ground": False}
    assert one(**flying)["alt_baro"] == 2400  # 732 m are 2,402 ft, in steps of 25
    assert one(**flying, elevation=0.0)["alt_baro"] == 975
    assert "alt_baro" not in one(**flying, elevation=None)
    assert "alt_baro" not in one(on_ground=False)
    assert one(altitude=2.0)["alt_baro"] == "ground"


@pytest.mark.parametrize(
    ("given", "elevation"),
    [
        ({"elevation_m": 432}, 432.0), ({"ele": "432"}, 432.0), ({"ele": "-3.5 m"}, -3.5), ({"ele": "1416 ft"}, 431.6),
        ({"ele": "high"}, None), ({"ele": None}, None), ({"ele": True}, None), ({"ele": float("nan")}, None),
        ({}, None),
    ],
)  # fmt: skip
def test_how_high_the_airport_lies(given: dict[str, Any], elevation: float | None) -> None:
    expected = None if elevation is None else pytest.approx(elevation, abs=0.1)
    assert airport_elevation({"features": [{"properties": given}, {"properties": None}]}) == expected
    assert airport_elevation({**given, "features": []}) == expected


def test_trails_are_of_what_was_measured_lately() -> None:
    made = document(trail=True, address="4b1815", altitude=300.0, on_ground=False)["aircraft"]
    assert made[0].keys() >= {"hex", "type", "alt_baro", "lat", "lon", "seen", "seen_pos", "gs"}
    assert document(trail=True, updated=NOW - 9.9)["aircraft"]
    assert document(trail=True, updated=NOW - 10.1)["aircraft"] == []


def test_tar1090_finds_the_last_hour_when_its_page_is_opened(http: httpx.Client, server: Server) -> None:
    """As its page does: the names of the chunks, then each of them; where it finds none, the numbered files."""
    begin = server.service.step().time
    for step in range(1, 70):
        newest = server.service.step(begin + 8.5 * step)
        until(lambda: server.hub.picture is newest, "the picture is numbered")  # noqa: B023
    names = http.get("/chunks/chunks.json").json()["chunks"]
    assert len(names) == 2
    chunks = [http.get(f"/chunks/{name}").json()["files"] for name in names]
    times = [one["now"] for chunk in chunks for one in chunk]
    assert times[-69:] == [begin + 8.5 * step for step in range(1, 70)]
    assert len(chunks[0]) == 60
    last = chunks[-1][-1]["aircraft"]
    assert len(last) == 12
    assert {one["hex"] for one in last} == {one["hex"] for one in http.get("/data/aircraft.json").json()["aircraft"]}
    count = http.get("/data/receiver.json").json()["history"]
    files = [http.get(f"/data/history_{i}.json").json() for i in range(count)]
    assert [one["now"] for one in files] == times[::4]
    assert http.get(f"/data/history_{count}.json").status_code == 404


def test_history_is_packed_where_the_client_takes_it_so(http: httpx.Client) -> None:
    packed = http.get("/chunks/current.json", headers={"accept-encoding": "gzip"})
    plain = http.get("/chunks/current.json", headers={"accept-encoding": "identity"})
    assert (packed.headers["content-encoding"], packed.headers["vary"]) == ("gzip", "Accept-Encoding")
    assert "content-encoding" not in plain.headers
    assert int(packed.headers["content-length"]) < len(plain.content)
    assert packed.json() == plain.json()
