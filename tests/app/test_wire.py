from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.api import models
from app.wire import RADIUS_95, Wire, ellipse_95, encode
from pipeline.tables import Tracks
from tests.support.fake_service import FakeService
from tests.support.small_airport import small_airport

WIRE = Wire(small_airport(), "demo")


def one_track(**columns: object) -> Tracks:
    state = columns.pop("state", [[100.0, 200.0, 3.0, 4.0]])
    return Tracks.build(1, **{"id": 7, "time": 1000.0, "state": state, "covariance": np.eye(4)[None], **columns})


def test_a_track_has_exactly_the_fields_of_the_model() -> None:
    row = WIRE.tracks(one_track())[0]
    assert list(row) == [field.alias or name for name, field in models.Track.model_fields.items()]
    models.Track.model_validate(row)


def test_units_at_the_edge() -> None:
    row = WIRE.tracks(one_track(heading=math.pi / 2, zone=2, runway=1, sources=5, category=2, phase=2))[0]
    assert row["speed_mps"] == 5.0
    assert row["course_deg"] == round(math.degrees(math.atan2(3, 4)), 1)
    assert row["heading_deg"] == 90.0
    assert (row["east_m"], row["north_m"]) == (100.0, 200.0)
    east, north = WIRE.airport.frame.to_local(row["lat"], row["lon"])
    assert math.hypot(float(east) - 100, float(north) - 200) < 0.02
    assert (row["zone"], row["runway"]) == ("W", "02/20")
    assert row["sources"] == ("radar", "report")
    assert (row["class"], row["phase"]) == ("vehicle", "coasting")


def test_what_is_not_known_is_null() -> None:
    row = WIRE.tracks(one_track(state=[[1.0, 2.0, 0.1, 0.1]]))[0]
    for name in (
        "course_deg",
        "heading_deg",
        "length_m",
        "width_m",
        "altitude_m",
        "callsign",
        "address",
        "zone",
        "runway",
    ):
        assert row[name] is None, name


@given(st.lists(st.floats(allow_nan=True, allow_infinity=True), min_size=8, max_size=8), st.integers(-5, 300))
def test_nothing_in_a_table_can_put_nan_on_the_wire(values: list[float], index: int) -> None:
    tracks = one_track(
        state=[values[:4]], heading=values[4], length=values[5], altitude=values[6], zone=index, runway=index % 9 - 3
    )
    text = encode(WIRE.tracks(tracks))
    assert b"NaN" not in text
    assert b"Infinity" not in text
    row = json.loads(text)[0]
    assert row["course_deg"] is None or 0 <= row["course_deg"] < 360
    assert row["heading_deg"] is None or 0 <= row["heading_deg"] < 360


def test_the_accuracy_holds_95_percent_of_a_round_gaussian() -> None:
    rng = np.random.default_rng(3)
    points = rng.normal(0, 4.0, (200_000, 2))
    radius, minor = (float(one[0]) for one in ellipse_95(np.eye(2)[None] * 16.0)[:2])
    assert minor == radius
    assert radius == RADIUS_95 * 4.0
    share = float(np.mean(np.hypot(*points.T) <= radius))
    assert abs(share - 0.95) < 5 * math.sqrt(0.95 * 0.05 / len(points))


@pytest.mark.parametrize("bearing", [0.0, 0.6, 1.5, 2.2, 3.1])
def test_the_accuracy_is_a_tilted_ellipse(bearing: float) -> None:
    along = np.array([np.sin(bearing), np.cos(bearing)])
    across = np.array([np.cos(bearing), -np.sin(bearing)])
    covariance = np.zeros((1, 4, 4))
    covariance[0, :2, :2] = 25.0 * np.outer(along, along) + 4.0 * np.outer(across, across)
    (row,) = WIRE.tracks(one_track(covariance=covariance))
    assert row["accuracy_m"] == pytest.approx(RADIUS_95 * 5.0, abs=0.05)
    assert row["accuracy_minor_m"] == pytest.approx(RADIUS_95 * 2.0, abs=0.05)
    assert row["accuracy_bearing_deg"] == pytest.approx(math.degrees(bearing), abs=0.06)


def test_an_axis_has_no_sense_and_is_null_where_unknown() -> None:
    axes = [WIRE.tracks(one_track(axis=axis))[0]["axis_deg"] for axis in (0.0, 1.0, np.pi, np.nan)]
    assert axes == [0.0, 57.3, 0.0, None]


def test_an_alert_has_exactly_the_fields_of_the_model() -> None:
    service = FakeService()
    row = WIRE.alert(service.raise_alert(now=1000.0))
    assert list(row) == [field.alias or name for name, field in models.Alert.model_fields.items()]
    models.Alert.model_validate(json.loads(encode(row)))


def test_empty_tables_make_empty_lists() -> None:
    assert WIRE.tracks(Tracks.empty()) == []
