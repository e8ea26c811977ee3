"""One conflict is one alert: whatever the rules say about one intruder on one runway has one number and one sound."""

from __future__ import annotations

from typing import Any

import pytest

from pipeline.airport.model import Airport
from pipeline.alert.monitor import AlertMonitor
from pipeline.contracts.alert import Conflict, Situation
from pipeline.picture import AlertChange
from pipeline.tables import TargetClass, Tracks
from tests.pipeline.alert.scene import (
    Mover,
    Played,
    arrival,
    departure,
    monitor,
    parked,
    play,
    small_airport,
    tracks_at,
)
from tests.support.small_airport import small_airport as crossing_runways

THREE = tracks_at(
    [
        parked(1, 0, -300, address="39aaaa", callsign="AFR1"),
        parked(2, 50, -300, address="39bbbb", callsign="AFR2"),
        parked(3, 90, -300, address="39cccc", callsign="FLCO3"),
    ],
    0.0,
)


def van(until: float = 300.0) -> Mover:
    """Passes B1 at 20 s, stands on the runway from 30 s on and leaves to the north at the end."""
    path = [(0.0, 0.0, -200.0), (20.0, 0.0, -100.0), (30.0, 0.0, 0.0), (until, 0.0, 0.1), (until + 30, 0.0, 300.0)]
    return Mover(3, path, TargetClass.VEHICLE)


def numbers(played: Played) -> set[int]:
    return {one.alert.id for one in played.changes}


@pytest.mark.parametrize("seed", [None, 1, 2])
def test_a_vehicle_keeps_its_alert_while_rules_and_partners_and_stages_change(seed: int | None) -> None:
    # one lands beside it, it is alone again, another departs towards it
    movers = [van(150.0), arrival(1, 60), departure(2, 120)]
    played = play(monitor(), movers, 0, 190, noise=seed)
    assert numbers(played) == {1}
    assert {one.alert.rule for one in played.changes} == {"hold_entry", "runway_occupied"}
    partners = {target.track for one in played.changes for target in one.alert.targets}
    assert partners == {1, 2, 3}
    stages = [one.alert.stage for one in played.changes]
    assert stages[0] == "information"
    assert "alarm" in stages
    assert played.changes[-1].operation == "clear"


def test_two_vehicles_are_two_alerts() -> None:
    played = play(monitor(), [arrival(1, 60), parked(3, 200, 0), parked(4, 400, 0)], 0, 55)
    assert {frozenset(t.track for t in one.targets) for one in played.raised()} == {
        frozenset({1, 3}),
        frozenset({1, 4}),
    }


def test_an_arrival_that_has_landed_is_called_landed_in_every_text() -> None:
    crossing = Mover(3, [(0, 500, -300), (62, 500, -105), (66, 500, -70), (200, 500, -70)], TargetClass.VEHICLE)
    played = play(monitor(), [arrival(1, 60), crossing], 0, 80)
    texts = [one.alert.text for one in played.changes if one.time > 62]
    assert any("landed" in one for one in texts)
    assert not any("rolling" in one for one in texts)


class Script:
    """A monitor whose one rule says what the test says."""

    def __init__(self, airport: Airport | None = None) -> None:
        self.conflicts: tuple[Conflict, ...] = ()
        self.monitor = AlertMonitor(airport or small_airport(), [self])
        self.time = 1000.0

    def __call__(self, situation: Situation) -> tuple[Conflict, ...]:
        return self.conflicts

    def step(self, *conflicts: Conflict, tracks: Tracks = THREE, seconds: float = 1.0) -> list[AlertChange]:
        self.conflicts = conflicts
        self.time += seconds
        return list(self.monitor.update(tracks, self.time))


def says(
    rule: str,
    tracks: tuple[int, ...],
    intruder: int | None,
    stage: Any = "information",
    runway: str = "09/27",
    **rest: Any,
) -> Conflict:
    return Conflict(rule, runway, tracks, stage, f"{rule} {stage}", intruder, certain=True, **rest)


def test_the_gravest_leads_and_the_others_are_named_after_it() -> None:
    script = Script()
    (change,) = script.step(
        says("hold_entry", (3,), 3, holding_point="B1"),
        says("runway_occupied", (1, 3), 3),
        says("runway_occupied", (2, 3), 3, "alarm"),
    )
    alert = change.alert
    assert (alert.rule, alert.stage, alert.holding_point) == ("runway_occupied", "alarm", "B1")
    assert [one.track for one in alert.targets] == [2, 3, 1]
    assert alert.text == "runway_occupied alarm; also AFR1"


def test_a_change_of_rule_is_told_at_once_under_the_same_number() -> None:
    script = Script()
    script.step(says("hold_entry", (3,), 3))
    (change,) = script.step(says("runway_occupied", (1, 3), 3), seconds=0.1)
    assert (change.operation, change.alert.id, change.alert.rule) == ("update", 1, "runway_occupied")


def test_what_is_acknowledged_sounds_again_only_at_a_higher_stage() -> None:
    script = Script()
    (change,) = script.step(says("hold_entry", (3,), 3))
    assert change.alert.aural
    script.monitor.acknowledge(1, "tower", script.time)
    for one in (says("runway_occupied", (1, 3), 3), says("runway_occupied", (2, 3), 3), says("hold_entry", (3,), 3)):
        assert [c.alert.aural for c in script.step(one)] == [False]
    (change,) = script.step(says("runway_occupied", (1, 3), 3, "alarm"))
    assert (change.alert.id, change.alert.aural) == (1, True)


def test_a_pair_without_an_intruder_is_the_pair_of_another_rule() -> None:
    script = Script()
    changes = script.step(says("opposite_direction", (1, 2), None), says("runway_occupied", (2, 1), 1))
    assert [one.operation for one in changes] == ["raise"]
    assert {one.operation for one in script.step(says("opposite_direction", (2, 1), None))} == {"update"}
    assert {one.operation for one in script.step(says("runway_occupied", (1, 2), 2))} == {"update"}
    assert len(script.monitor.alerts) == 1


def test_a_pair_that_meets_where_two_runways_cross_is_one_alert_whichever_runway_leads() -> None:
    script = Script(crossing_runways())
    here, there = (
        says("runway_occupied", (1, 2), 2, runway="06/24"),
        says("runway_occupied", (2, 1), 1, "alarm", runway="02/20"),
    )
    changes = script.step(here, there)
    assert [(one.operation, one.alert.id, one.alert.runway) for one in changes] == [("raise", 1, "02/20")]
    (change,) = script.step(says("runway_occupied", (1, 2), 2, "alarm", runway="06/24"))
    assert (change.operation, change.alert.id, change.alert.runway) == ("update", 1, "06/24")
    assert len(script.monitor.alerts) == 1


def test_a_lone_target_on_two_runways_is_two_alerts() -> None:
    script = Script(crossing_runways())
    script.step(says("hold_entry", (3,), 3, runway="06/24"), says("hold_entry", (3,), 3, runway="02/20"))
    assert {one.runway for one in script.monitor.alerts} == {"02/20", "06/24"}


def test_two_conflicts_of_one_look_never_share_an_alert() -> None:
    script = Script()
    script.step(says("runway_occupied", (1, 2), 2))
    script.step(says("runway_occupied", (3, 2), 2), says("runway_occupied", (2, 1), 1))
    assert len(script.monitor.alerts) == 2


def test_an_intruder_with_a_new_track_and_its_address_keeps_its_alert() -> None:
    script = Script()
    script.step(says("runway_occupied", (1, 3), 3))
    renumbered = THREE.replace(id=[1, 2, 9])
    script.step(says("hold_entry", (9,), 9), tracks=renumbered)
    assert [(one.id, one.targets[0].track) for one in script.monitor.alerts] == [(1, 9)]
