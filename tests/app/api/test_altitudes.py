"""Heights above the airport leave as altitudes above the sea, once the map says how high the airport lies."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import httpx
import pytest

from app.airports import load_airport
from pipeline.tables import Tracks
from tests.support.fake_traffic import synthetic_tracks
from tests.support.running import first_picture, running
from tests.support.small_airport import as_geojson

HEIGHT = 500.0


def airborne(*given: Any) -> Tracks:
    return synthetic_tracks(*given).replace(altitude=HEIGHT, on_ground=False)


@pytest.mark.parametrize(("elevation", "altitude"), [(432.0, 3050), (-3.0, 1625), (None, None)])
def test_an_aircraft_above_the_airport(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, elevation: float | None, altitude: int | None
) -> None:
    more = {} if elevation is None else {"elevation_m": elevation}
    monkeypatch.setattr("tests.support.fake_service.synthetic_tracks", airborne)
    monkeypatch.setattr("tests.support.fake_service.as_geojson", lambda airport: as_geojson(airport) | more)
    with running(tmp_path) as server:
        first_picture(server)
        told = httpx.get(f"{server.url}/data/aircraft.json", timeout=20.0).json()["aircraft"]
    assert {one.get("alt_baro") for one in told} == {altitude}


@pytest.mark.parametrize(("code", "elevation"), [("LFPO", 89.0), ("LSZH", 432.0)])
def test_the_shipped_maps_know_their_elevation(code: str, elevation: float) -> None:
    assert load_airport(code)[1]["elevation_m"] == elevation
