"""One that rolls, after touchdown or for take-off, and somebody ahead of it; and what the rules say of such a pair."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.alert.monitor import AlertMonitor
from pipeline.picture import RunwayState
from pipeline.tables import TargetClass
from tests.pipeline.alert.scene import IN_USE, RULES, Mover, arrival, departure, monitor, parked, play

VEHICLE = TargetClass.VEHICLE


def rolls(speed: float, from_east: float = -1400.0, id: int = 2, way: int = 1) -> Mover:
    """Rolls along the runway at constant speed; it has not landed."""
    return Mover(id, [(0, from_east, 0), (40, from_east + way * 40 * speed, 0)], extra={"callsign": f"DEP{id}"})


@pytest.fixture
def watch() -> AlertMonitor:
    return monitor()


def test_a_vehicle_that_enters_after_touchdown_is_an_alarm(watch: AlertMonitor) -> None:
    # touchdown at 60 s; the van is in the area at 64 s, 1,100 m ahead of an aircraft at 60 m/s
    van = Mover(3, [(0, 0, -300), (62, 0, -115), (65, 0, -70), (200, 0, -69)], VEHICLE)
    played = play(watch, [arrival(1, 60), van], 30, 80)
    first = played.changes[0]
    assert first.operation == "raise"
    assert 63.0 <= first.time <= 65.0
    alarms = [one for one in played.changes if one.alert.stage == "alarm"]
    assert 63.0 <= alarms[0].time <= 66.0
    occupied = [one.alert for one in alarms if one.alert.rule == "runway_occupied"]
    assert occupied
    assert "AFR1 landed 09" in occupied[0].text
    assert occupied[0].time_to_threshold is None
    assert {one.track for one in occupied[0].targets} == {1, 3}


def test_who_is_behind_a_rolling_aircraft_is_nothing(watch: AlertMonitor) -> None:
    assert play(watch, [rolls(40.0, -1000.0), parked(3, -1400, 0)], 0, 30).changes == []


@pytest.mark.parametrize("landed", [False, True])
def test_an_occupant_is_told_of_only_when_a_rolling_aircraft_will_soon_be_there(landed: bool) -> None:
    # departures within 45 and 30 s at 1.5 m/s^2 from now on, landed ones within 30 and 15 s at the speed they have
    speed, places = 17.0, {"silent": 2700.0, "information": 1800.0, "alarm": 1000.0}
    if landed:
        speed, places = 30.0, {"silent": 1300.0, "information": 850.0, "alarm": 420.0}
    for expected, ahead in places.items():
        mover = rolls(speed)
        if landed:  # seen on final before
            mover.path = [(-30, -1400 - 30 * 60.0, 0), *mover.path]
        occupant = Mover(3, [(0, -1400 + ahead, 10), (99, -1400 + ahead, 11)], VEHICLE)
        played = play(monitor(), [mover, occupant], -20, 8)
        assert {one.alert.stage for one in played.changes} == (set() if expected == "silent" else {expected}), expected


def test_one_that_rolls_and_one_far_out_in_the_other_direction_are_information() -> None:
    # they would meet in 45 to 40 s; two that roll are an alarm however far apart they are
    out = Mover(1, [(0, 2600, 0), (10, 1900, 0)], extra={"callsign": "AFR1"})
    played = play(monitor(rules=RULES[2:3]), [rolls(20.0, -1450.0), out], 0, 5)
    assert [one.alert.stage for one in played.changes if one.operation == "raise"] == ["information"]
    assert {one.alert.stage for one in played.changes} == {"information"}
    both = play(monitor(rules=RULES[2:3]), [rolls(20.0, -1450.0), rolls(20.0, 1450.0, 4, way=-1)], 0, 5)
    assert {one.alert.stage for one in both.changes} == {"alarm"}


def test_the_least_separation_is_that_of_two_that_go_straight_on() -> None:
    # a van crosses towards the centreline at 12 m/s, 60 m away from it, 1,200 m ahead of one that lands at 70 m/s
    van = Mover(3, [(0, 0, -120), (10, 0, 0)], VEHICLE)
    lands = Mover(1, [(-60, -5750, 0), (10, -850, 0)], extra={"callsign": "AFR1"})
    played = play(monitor(rules=RULES[:1]), [lands, van], -20, 5)
    (alert,) = played.live[-1][1]
    apart, relative = np.array([1200.0, -60.0]), np.array([-70.0, 12.0])
    time = -(apart @ relative) / (relative @ relative)
    assert alert.separation == pytest.approx(np.hypot(*apart), abs=0.5)
    assert alert.predicted_separation == pytest.approx(np.hypot(*(apart + time * relative)), abs=0.5)
    assert alert.predicted_separation == pytest.approx(143.7, abs=0.5)
    assert alert.time_to_conflict == pytest.approx(time, abs=0.02)
    assert alert.conflict_position == pytest.approx((0.0, -60.0 + 12.0 * time), abs=0.5)


def test_those_that_draw_apart_are_nearest_now(watch: AlertMonitor) -> None:
    # the van leaves along the runway faster than the arrival comes: the least separation is that of now
    van = Mover(3, [(0, -1000, 10), (10, -600, 10)], VEHICLE)
    slow = Mover(1, [(-60, -3480, 0), (10, -1380, 0)], extra={"callsign": "AFR1"})
    alert = play(watch, [slow, van], -5, 3).live[-1][1][0]
    assert alert.time_to_conflict == 0.0
    assert alert.predicted_separation == alert.separation == pytest.approx(710.0, abs=1.0)


CLOSED = (RunwayState("09/27", open=False),)


@pytest.mark.parametrize(
    ("name", "movers", "runways", "types"),
    [
        ("runway_occupied", [arrival(1, 40), parked(3, 200, 0)], IN_USE, (9, 1)),
        ("runway_occupied", [departure(2, 5), parked(3, 400, 0)], IN_USE, (12, 1)),
        (
            "hold_entry",
            [arrival(1, 40), Mover(3, [(0, 0, -200), (20, 0, -100), (60, 0, 99)], VEHICLE)],
            IN_USE,
            (13, 2),
        ),
        ("hold_entry", [Mover(3, [(0, 0, -200), (20, 0, -100), (60, 0, 99)], VEHICLE)], IN_USE, (16, 2)),
        ("opposite_direction", [arrival(1, 40), arrival(4, 40, way=-1)], IN_USE, (11, 3)),
        ("closed_runway", [arrival(1, 40)], CLOSED, (30, 4)),
    ],
    ids=["arrival", "departure", "crossing", "stop bar", "opposite", "closed"],
)
def test_each_rule_gives_its_types_of_asterix(
    name: str, movers: list[Mover], runways: tuple[RunwayState, ...], types: tuple[int, int]
) -> None:
    (rule,) = (one for one in RULES if type(one).__module__.endswith(name))
    told = play(monitor(rules=(rule,), runways=runways), movers, 0, 39).changes
    assert {(one.alert.rule, one.alert.cat004_type, one.alert.cat011_type) for one in told} == {(name, *types)}


@pytest.mark.parametrize(("speed", "alarms"), [(8.0, False), (0.5, True)], ids=["moves on", "has stopped"])
def test_one_that_landed_and_is_on_its_way_to_an_exit_far_ahead_is_nothing(speed: float, alarms: bool) -> None:
    # the one before is 200 m before the far end when the arrival is 15 s out, more than a minute behind it
    path = [(-100, -8400, 0), (-40, -1400, 0), (0, 900, 0), (20, 1100, 0), (60, 1100 + 40 * speed, 0)]
    played = play(monitor(), [Mover(5, path, extra={"callsign": "AFR5"}), arrival(1, 40)], -90, 39)
    assert any(one.alert.stage == "alarm" for one in played.changes) is alarms


def test_one_that_landed_and_moves_on_near_the_threshold_is_an_alarm() -> None:
    path = [(-100, -8400, 0), (-40, -1400, 0), (0, -900, 0), (60, -420, 0)]
    played = play(monitor(), [Mover(5, path, extra={"callsign": "AFR5"}), arrival(1, 40)], -90, 39)
    assert any(one.alert.stage == "alarm" for one in played.changes)
