"""What each rule must see, when, and at which stage."""

from __future__ import annotations

import pytest

from pipeline.alert import hold_entry, runway_occupied
from pipeline.picture import AlertTarget, RunwayState
from pipeline.sites import NodeSite
from pipeline.tables import TargetClass
from tests.pipeline.alert.scene import IN_USE, RULES, Mover, Played, arrival, departure, monitor, parked, play

CLOSED = (RunwayState("09/27", open=False),)
LOW = (RunwayState("09/27", in_use="09", visibility="low"),)


def first(played: Played, rule: str, stage: str) -> float:
    times = [c.time for c in played.changes if c.alert.rule == rule and c.alert.stage == stage]
    assert times, f"{rule} never came to {stage}"
    return min(times)


@pytest.mark.parametrize(("runways", "information", "alarm"), [(IN_USE, 30.0, 15.0), (LOW, 45.0, 30.0)])
def test_arrival_to_an_occupied_runway(runways: tuple[RunwayState, ...], information: float, alarm: float) -> None:
    played = play(monitor(runways=runways), [arrival(1, 60), parked(3, 200, 0)], 0, 60)
    # certain geometry: within one update of the time that the settings name
    assert 60 - information <= first(played, "runway_occupied", "information") <= 60 - information + 1
    assert 60 - alarm <= first(played, "runway_occupied", "alarm") <= 60 - alarm + 1
    assert len(played.raised("runway_occupied")) == 1


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_arrival_to_an_occupied_runway_with_noise_either_way(way: int, seed: int) -> None:
    played = play(monitor(), [arrival(1, 60, way=way), parked(3, 200, 0)], 0, 60, noise=seed)
    assert len(played.raised("runway_occupied")) == 1
    assert 43 <= first(played, "runway_occupied", "alarm") <= 49


@pytest.mark.parametrize("way", [1, -1])
def test_an_alarm_for_a_departure_ahead_stays_while_the_arrival_gains_on_it(way: int) -> None:
    # the departure passes lead_speed (41 m/s) at 49 s and is still slower than the arrival at its threshold
    played = play(monitor(), [arrival(1, 60, way=way), departure(2, 26, way=way)], 0, 59)
    assert {live[0].stage for time, live in played.live if time >= 46} == {"alarm"}


def test_a_departure_that_draws_away_from_a_slow_arrival_is_nothing() -> None:
    assert play(monitor(), [arrival(1, 60, speed=45.0), departure(2, 19)], 0, 59).changes == []


def test_departure_towards_an_occupant_ahead() -> None:
    played = play(monitor(), [departure(2, 100), parked(3, 600, 10)], 0, 140)
    assert played.stages("runway_occupied") >= {"alarm"}
    assert first(played, "runway_occupied", "alarm") <= 121


def test_the_alert_goes_on_after_touchdown_and_clears_when_the_way_is_free() -> None:
    crossing = Mover(3, [(0, 1200, -300), (40, 1200, -50), (75, 1200, 0), (80, 1200, 60), (90, 1200, 200)])
    played = play(monitor(rules=RULES[:1]), [arrival(1, 60), crossing], 0, 130)
    assert played.changes[0].operation == "raise"
    assert played.changes[-1].operation == "clear"
    assert played.changes[-1].alert.clear_reason == "conflict ended"
    assert len(played.raised()) == 1


def test_who_cannot_stop_before_the_area_is_foreseen() -> None:
    # at 15 m/s it needs 45 m to stop: it can no longer from 57.9 s on, and comes into the area at 60.7 s
    racer = Mover(3, [(0, 0, -1000), (100, 0, 500)], TargetClass.VEHICLE)
    played = play(monitor(rules=RULES[:1]), [arrival(1, 84), racer], 30, 84)
    raised = played.raised("runway_occupied")[0]
    assert (raised.stage, raised.raised_at) == ("information", 59.0), "the second look at which it cannot stop"
    without = play(monitor(rules=(runway_occupied.PART(predicted=False),)), [arrival(1, 84), racer], 30, 84)
    assert without.raised()[0].raised_at == 61.0


def test_vehicle_passes_a_holding_position_with_an_arrival_on_final() -> None:
    van = Mover(3, [(0, 0, -200), (35, 0, -100), (47, 0, -30), (200, 0, -30)], TargetClass.VEHICLE)
    played = play(monitor(), [arrival(1, 60), van], 0, 60)
    raised = played.raised("hold_entry")[0]
    assert raised.holding_point == "B1"
    assert first(played, "hold_entry", "alarm") <= 39  # the bar is passed, with its margin, at 37.3 s


def test_vehicle_passes_a_holding_position_with_a_departure_rolling() -> None:
    van = Mover(3, [(0, 0, -300), (110, 0, -100), (122, 0, -30), (300, 0, -30)], TargetClass.VEHICLE)
    played = play(monitor(rules=RULES[1:2]), [departure(2, 100), van], 0, 140)
    assert first(played, "hold_entry", "alarm") <= 115


def test_vehicle_enters_a_runway_in_use_with_nobody_near_and_the_alert_clears_when_it_leaves() -> None:
    van = Mover(3, [(0, 0, -200), (20, 0, -100), (50, 0, 150), (100, 0, 400)], TargetClass.VEHICLE)
    played = play(monitor(), [van], 0, 70)
    assert {c.alert.rule for c in played.changes} == {"hold_entry"}
    assert played.stages("hold_entry") == {"information"}
    assert played.changes[-1].operation == "clear"


def test_entry_to_a_runway_that_is_not_in_use_is_nothing() -> None:
    van = Mover(3, [(0, 0, -200), (20, 0, -100), (50, 0, 150), (100, 0, 400)], TargetClass.VEHICLE)
    assert play(monitor(runways=()), [van], 0, 70).changes == []


def test_leaving_over_a_holding_position_is_nothing() -> None:
    van = Mover(3, [(0, 0, -40), (30, 0, -200)], TargetClass.VEHICLE)
    assert play(monitor(), [van], 0, 30).changes == []


def test_a_holding_position_far_out_leads_elsewhere_too() -> None:
    turning = Mover(3, [(0, 700, -300), (20, 700, -205), (60, 300, -190)], TargetClass.VEHICLE)
    assert play(monitor(), [turning], 0, 60).changes == []
    onward = Mover(3, [(0, 700, -300), (20, 700, -200), (50, 700, -40), (90, 700, -39)], TargetClass.VEHICLE)
    assert play(monitor(), [onward], 0, 60).raised("hold_entry")[0].holding_point == "F1"


def test_a_pavement_node_makes_the_entry_certain_at_once() -> None:
    nodes = (NodeSite("n1", 0, -90, 0.0, hold="B1"),)
    van = Mover(3, [(0, 0, -200), (22, 0, -90), (32, 0, -40), (100, 0, -40)], TargetClass.VEHICLE, {"hits": 3})
    with_node = play(monitor(nodes=nodes), [arrival(1, 60), van], 0, 60, events={22.0: 0})
    without = play(monitor(nodes=nodes), [arrival(1, 60), van], 0, 60)
    assert with_node.raised("hold_entry")[0].raised_at == 22.0
    assert without.raised("hold_entry")[0].raised_at > 22.0


def test_a_node_event_of_somebody_who_leaves_is_nothing() -> None:
    nodes = (NodeSite("n1", 0, -90, 0.0, hold="B1"),)
    van = Mover(3, [(0, 0, -40), (30, 0, -200)], TargetClass.VEHICLE)
    assert play(monitor(nodes=nodes), [van], 0, 30, events={9.0: 0}).changes == []


@pytest.mark.parametrize(
    "pair",
    [
        (arrival(1, 60), arrival(2, 60, way=-1)),
        (arrival(1, 60), departure(2, 30, way=-1)),
        (departure(1, 30), departure(2, 30, way=-1)),
    ],
    ids=["two arrivals", "arrival and departure", "two departures"],
)
def test_opposite_directions(pair: tuple[Mover, Mover]) -> None:
    played = play(monitor(rules=RULES[2:3]), list(pair), 0, 70)
    assert "alarm" in played.stages("opposite_direction")
    alert = played.raised("opposite_direction")[0]
    assert {t.track for t in alert.targets} == {1, 2}
    assert alert.time_to_conflict is not None
    assert alert.time_to_conflict > 0


def test_opposite_directions_after_passing_is_over() -> None:
    first_out = departure(2, 0, way=-1)
    played = play(monitor(rules=RULES[2:3]), [first_out, arrival(1, 260)], 0, 300)
    assert played.changes == []


def test_arrival_to_a_closed_runway() -> None:
    played = play(monitor(runways=CLOSED), [arrival(1, 80)], 20, 80)
    assert first(played, "closed_runway", "information") <= 22
    assert 50 <= first(played, "closed_runway", "alarm") <= 51


def test_departure_and_taxi_on_a_closed_runway() -> None:
    played = play(monitor(runways=CLOSED), [departure(2, 100)], 0, 130)
    assert played.stages("closed_runway") == {"information", "alarm"}
    assert len(played.raised()) == 1


def test_vehicles_may_work_on_a_closed_runway() -> None:
    assert play(monitor(runways=CLOSED), [parked(3, 0, 0)], 0, 30).changes == []


def test_settings_of_one_runway_change_that_runway() -> None:
    rule = runway_occupied.PART(runways={"09/27": {"information_s": 20.0}})
    played = play(monitor(rules=(rule,)), [arrival(1, 60), parked(3, 200, 0)], 0, 60)
    raised = played.raised()[0]
    assert 40 <= raised.raised_at <= 41
    assert raised.parameter_set == "runway 09/27"


def test_an_unknown_setting_of_one_runway_and_senseless_times_are_refused() -> None:
    with pytest.raises(ValueError, match="09/27"):
        runway_occupied.PART(runways={"09/27": {"informatoin_s": 20.0}})
    with pytest.raises(ValueError, match="alarm <= information"):
        runway_occupied.PART(information_s=10.0)
    with pytest.raises(ValueError, match="inform"):
        hold_entry.PART(inform=("bird",))


def test_the_payload_is_complete() -> None:
    van = Mover(3, [(0, 0, -200), (35, 0, -100), (45, 0, 0), (200, 0, 1)], TargetClass.VEHICLE, {"simulated": True})
    played = play(monitor(runways=LOW), [arrival(1, 60), van], 0, 60)
    (alert,) = [one for one in played.live[-1][1] if one.rule == "runway_occupied"]
    assert (alert.stage, alert.state, alert.runway, alert.visibility) == ("alarm", "ongoing", "09/27", "low")
    assert alert.simulated
    assert alert.sensors == ("radar",)
    assert alert.cat004_type == 9
    assert alert.cat011_type == 1
    assert "AFR1" in alert.text
    assert "#3" in alert.text, "as on the map, without a callsign"
    assert "Vehicle" not in alert.text
    mover, occupant = alert.targets
    assert mover.callsign == "AFR1"
    assert mover.address == "390001"
    assert mover.category == "aircraft"
    assert mover.course == pytest.approx(1.5708, abs=0.01)
    assert isinstance(occupant, AlertTarget)
    assert occupant.course is None
    for name in ("separation", "predicted_separation", "time_to_conflict", "conflict_position"):
        assert getattr(alert, name) is not None, name
    before = next(one for t, live in played.live if t == 50.0 for one in live if one.rule == "runway_occupied")
    assert before.time_to_threshold == pytest.approx(10, abs=0.5)
    assert before.distance_to_threshold == pytest.approx(700, abs=20)
