from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from pipeline.lab.simulate.recording import (
    Recording,
    RecordingError,
    cut,
    from_document,
    recorded_movements,
    to_document,
)
from pipeline.lab.simulate.traffic import CleaningRules, Trajectory, busiest_window, clean, motion
from pipeline.reference.types import TYPES, type_of
from tests.pipeline.lab.simulate.field import FRAME

START = 1_600_000_000.0


def row(time: float, east: float, north: float, **more: Any) -> dict[str, Any]:
    latitude, longitude = FRAME.to_geodetic(east, north)
    return {
        "timestamp": round((START + time) * 1e3),
        "icao24": "ABC123",
        "callsign": "TST1 ",
        "latitude": float(latitude),
        "longitude": float(longitude),
        "altitude": None,
        "onground": True,
        "groundspeed": 103.0,
        "track": 63.4,
        **more,
    }


def taxi(seconds: int, speed: float = 10.0) -> list[dict[str, Any]]:
    return [row(t, speed * t, 50.0) for t in range(seconds)]


def test_a_clean_run_is_kept_whole_with_motion_from_its_positions() -> None:
    (one,), report = clean(taxi(60), FRAME, START)
    assert report.rows == report.kept == 60
    assert report.left_out == {}
    assert one.address == "abc123"
    assert one.callsign == "TST1"
    middle = slice(10, 50)
    # the record claims 103 knots towards 63 degrees all the time
    np.testing.assert_allclose(one.speed[middle], 10.0, atol=0.05)
    np.testing.assert_allclose(one.heading[middle], math.pi / 2, atol=0.01)


def test_every_row_is_either_kept_or_counted_with_its_reason() -> None:
    rows = taxi(80)
    rows[30] = row(30, 300.0, 2050.0)  # impossible
    for t in range(50, 55):
        rows[t] = row(t, 490.0, 50.0)  # stale while it moves
    rows += [row(20, 200.0, 50.0), row(25, 900.0, 900.0)]  # second rows of one time
    rows += [row(90, 20_000.0, 0.0), {"icao24": "abc123"}, row(91, math.nan, 0.0)]
    rows += [row(92, 800.0, 50.0, onground=False, altitude=None), row(93, 800.0, 50.0, onground=False, altitude=9000.0)]
    _, report = clean(rows, FRAME, START)
    assert report.left_out == {
        "impossible jump": 1,
        "frozen while moving": 5,
        "duplicate time": 2,
        "outside the area": 1,
        "invalid": 2,
        "airborne without altitude": 1,
        "above the ceiling": 1,
    }
    assert report.kept + sum(report.left_out.values()) == report.rows


def test_a_jump_leaves_no_trace_in_the_trajectory() -> None:
    rows = taxi(60)
    rows[30] = row(30, 300.0, 2050.0)
    (one,), _ = clean(rows, FRAME, START)
    np.testing.assert_allclose(one.east, 10.0 * one.time, atol=8.0)
    assert np.abs(one.north - 50.0).max() < 1.0


def test_a_jump_in_the_first_row_does_not_cost_the_rest() -> None:
    rows = taxi(60)
    rows[0] = row(0, 0.0, 5000.0)
    (one,), report = clean(rows, FRAME, START)
    assert report.left_out == {"impossible jump": 1}
    assert one.time[0] == 1.0


def test_stale_positions_are_bridged_at_the_speed_of_the_run() -> None:
    rows = taxi(60)
    for t in range(20, 26):
        rows[t] = row(t, 190.0, 50.0)
    (one,), _ = clean(rows, FRAME, START)
    np.testing.assert_allclose(one.speed[15:35], 10.0, atol=0.3)


def test_an_aircraft_that_stands_stays_where_it_is_and_keeps_its_heading() -> None:
    rows = (
        taxi(30)
        + [row(t, 290.0, 50.0) for t in range(30, 130)]
        + [row(130 + t, 290.0 + 5 * t, 50.0) for t in range(20)]
    )
    (one,), report = clean(rows, FRAME, START)
    assert report.left_out == {"standing, repeated": 100}
    standing = (one.time > 40) & (one.time < 120)
    assert np.abs(one.east[standing] - 290.0).max() < 0.5
    assert one.speed[standing].max() == 0.0
    np.testing.assert_allclose(one.heading[standing], math.pi / 2, atol=0.05)


def test_a_gap_splits_a_trajectory_and_each_part_has_the_callsign_of_its_time() -> None:
    rules = CleaningRules(gap=45.0)
    rows = taxi(60) + [row(200 + t, 300.0 + 10 * t, 90.0, callsign="TST2") for t in range(60)]
    made, report = clean(rows, FRAME, START, rules)
    assert [one.callsign for one in made] == ["TST1", "TST2"]
    assert report.splits == 1


def test_altitude_is_above_the_airport_whatever_the_pressure() -> None:
    rows = taxi(40)
    for t in (3, 4, 5, 6):
        rows[t]["altitude"] = -100.0
    rows += [row(40 + t, 400 + 70 * t, 50.0, onground=False, altitude=-100.0 + 40 * t) for t in range(30)]
    (one,), report = clean(rows, FRAME, START)
    assert report.ground_pressure_altitude_ft == pytest.approx(-100.0)
    assert one.altitude[:35].max() < 0.5
    assert one.altitude[-1] == pytest.approx(29 * 40 * 0.3048, abs=30)
    assert bool(one.on_ground[10])
    assert not bool(one.on_ground[-1])


def test_a_standing_start_looks_where_it_goes_first() -> None:
    east = np.concatenate([np.zeros(20), np.arange(30.0) * 5])
    _, heading = motion(east, np.zeros(50))
    np.testing.assert_allclose(heading[:15], math.pi / 2, atol=0.05)


def straight(start: float, seconds: int, heading: float, speed: float, address: str = "a00001") -> Trajectory:
    t = np.arange(seconds, dtype=float)
    run = speed * (t - seconds / 2)
    full = np.full(seconds, 1.0)
    return Trajectory(
        address, "TST9", start + t, run * math.sin(heading), run * math.cos(heading), 0 * t, heading * full,
        speed * full, np.ones(seconds, bool),
    )  # fmt: skip


def test_the_busiest_window_does_not_straddle_a_change_of_direction() -> None:
    east = [straight(100.0 * i, 60, math.pi / 2, 60.0) for i in range(10)]
    west = [straight(1000.0 + 100.0 * i, 90, 3 * math.pi / 2, 60.0) for i in range(20)]
    begin = busiest_window(east + west, 1000.0, 50.0)
    # the first half is too quiet, a mixed window is not wanted
    assert begin >= 1000.0


def test_the_compact_record_gives_the_trajectories_back() -> None:
    one = straight(5.0, 100, 1.0, 12.0)
    recording = Recording("XXXX", START, 200.0, (one,), "nobody")
    back = from_document(to_document(recording, FRAME, {}), FRAME)
    np.testing.assert_allclose(back.trajectories[0].east, one.east, atol=0.06)
    np.testing.assert_allclose(back.trajectories[0].speed, 12.0, atol=0.2)
    assert (back.length, back.attribution) == (200.0, "nobody")


@pytest.mark.parametrize(
    "document", [{}, {"format": "airside-traffic-1"}, {"format": "airside-traffic-1", "origin": [1]}]
)
def test_another_document_is_refused(document: dict[str, Any]) -> None:
    with pytest.raises(RecordingError):
        from_document(document, FRAME)


def test_cutting_counts_time_from_the_window() -> None:
    (one,) = cut([straight(50.0, 100, 0.0, 5.0)], 100.0, 30.0)
    assert (one.time[0], one.time[-1]) == (0.0, 30.0)


def test_an_arrival_stays_at_its_stand_in_silence_until_another_needs_it() -> None:
    t = np.arange(50.0)
    arriving = np.minimum(10 * t, 300.0) - 300.0
    zero, ground = np.zeros(50), np.ones(50, bool)
    speed = np.where(t < 30, 10.0, 0.0)
    arrival = Trajectory("a00001", "IN1", t, arriving, zero, zero, zero + math.pi / 2, speed, ground)
    later = Trajectory("a00002", "OUT2", t + 400, arriving, zero, zero, zero + math.pi / 2, speed, ground)
    first, second = recorded_movements(Recording("XXXX", START, 600.0, (arrival, later)))
    assert first.reporting.sum() == 50
    assert 400 < first.end < 430
    assert second.end == 600
    assert not first.simulated


def test_types_are_the_same_for_the_same_aircraft_and_known() -> None:
    assert type_of("AFR12AB", "3944f0") is type_of("AFR12AB", "3944f0")
    assert {type_of(f"XYZ{i}", f"{i:06x}").name for i in range(200)} <= set(TYPES)
    assert len({type_of(f"XYZ{i}", f"{i:06x}").name for i in range(200)}) > 2
