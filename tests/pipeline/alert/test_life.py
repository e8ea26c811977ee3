"""The life of an alert: raise, escalate, lower, clear, acknowledge, hand over, save; and what may never happen."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from pipeline.alert.life import LifeSettings
from pipeline.alert.monitor import AlertMonitor
from pipeline.contracts.alert import Conflict, Situation
from pipeline.picture import AlertChange, RunwayState
from pipeline.tables import NodeEvents, TargetClass, Tracks
from tests.pipeline.alert.scene import arrival, monitor, parked, play, small_airport, tracks_at


@dataclass
class Scripted:
    """A rule that reports what the test says."""

    conflicts: list[Conflict] = field(default_factory=list)

    def __call__(self, situation: Situation) -> tuple[Conflict, ...]:
        return tuple(self.conflicts)


def conflict(stage: Any = "information", tracks: tuple[int, ...] = (1, 2), certain: bool = False) -> Conflict:
    return Conflict("scripted", "09/27", tracks, stage, f"{tracks} {stage}", certain=certain)


TWO = tracks_at([parked(1, 0, -300, address="39aaaa"), parked(2, 50, -300, address="39bbbb")], 0.0)


class Bench:
    def __init__(self, **life: Any) -> None:
        self.script = Scripted()
        self.monitor = AlertMonitor(small_airport(), [self.script], life=LifeSettings(**life))
        self.time = 1000.0

    def step(
        self, *conflicts: Conflict, seconds: float = 1.0, tracks: Tracks = TWO, degraded: bool = False
    ) -> list[str]:
        self.script.conflicts = list(conflicts)
        self.time += seconds
        self.changes = self.monitor.update(tracks, self.time, degraded)
        return [f"{c.operation} {c.alert.stage}" for c in self.changes]


def test_uncertain_conflicts_are_raised_at_the_second_of_three_looks() -> None:
    bench = Bench()
    assert bench.step(conflict()) == []
    assert bench.step() == []
    assert bench.step(conflict()) == ["raise information"]
    assert bench.monitor.alerts[0].state == "new"


def test_one_look_in_three_is_not_enough() -> None:
    bench = Bench()
    for _ in range(5):
        assert bench.step(conflict()) == []
        assert bench.step() == []
        assert bench.step() == []


def test_settings_with_which_nothing_could_be_raised_are_refused() -> None:
    with pytest.raises(ValueError, match="at most 16"):
        LifeSettings(raise_hits=17, raise_looks=20)
    with pytest.raises(ValueError, match="raise_hits <= raise_looks"):
        LifeSettings(raise_hits=4)
    with pytest.raises(ValueError, match="most"):
        LifeSettings(most=0)


def test_the_most_hits_that_may_be_asked_for_raise_an_alert() -> None:
    bench = Bench(raise_hits=16, raise_looks=16)
    for _ in range(15):
        assert bench.step(conflict()) == []
    assert bench.step(conflict()) == ["raise information"]


def test_many_updates_within_one_look_count_once() -> None:
    bench = Bench()
    bench.step()
    for _ in range(10):
        assert bench.step(conflict(), seconds=0.03) == []


def test_certain_conflicts_are_raised_at_once_and_escalated_at_once() -> None:
    bench = Bench()
    assert bench.step(conflict(certain=True)) == ["raise information"]
    assert bench.step(conflict("alarm")) == ["update alarm"]


def test_lowered_and_cleared_only_after_a_while_and_with_a_reason() -> None:
    bench = Bench(refresh_s=1e9)
    bench.step(conflict("alarm", certain=True))
    assert bench.step(conflict()) == []
    assert bench.step(conflict(), seconds=2) == []
    assert bench.step(conflict()) == ["update information"]
    assert bench.step(seconds=3.5) == []
    assert bench.step() == ["clear information"]
    alert = bench.changes[0].alert
    assert (alert.state, alert.clear_reason, alert.cleared_at) == ("cleared", "conflict ended", bench.time)
    assert bench.monitor.alerts == ()
    assert bench.monitor.cleared == (alert,)


def test_a_lost_target_is_no_proof_of_safety() -> None:
    bench = Bench(refresh_s=1e9)
    bench.step(conflict("alarm", certain=True))
    assert bench.step(seconds=7.5, tracks=TWO[:1]) == []
    assert bench.monitor.alerts[0].stage == "alarm"
    assert bench.step(seconds=0.5, tracks=TWO[:1]) == ["clear alarm"]
    assert bench.changes[0].alert.clear_reason == "target lost"
    assert len(bench.changes[0].alert.targets) == 2


def test_an_alarm_stays_while_its_lost_target_may_still_be_there_though_another_conflict_goes_on() -> None:
    bench = Bench(refresh_s=1e9)
    alone = replace(conflict(tracks=(1,)), intruder=1)
    bench.step(replace(conflict("alarm", certain=True), intruder=1))
    for _ in range(7):
        bench.step(alone, tracks=TWO[:1])
        assert bench.monitor.alerts[0].stage == "alarm"
    bench.step(alone, tracks=TWO[:1])
    assert [(one.id, one.stage, one.worst_stage) for one in bench.monitor.alerts] == [(1, "information", "alarm")]


def test_a_loss_after_an_alarm_was_lowered_does_not_raise_it_again() -> None:
    bench = Bench(refresh_s=1e9)
    bench.step(conflict("alarm", certain=True))
    bench.step(conflict(), seconds=4)
    assert bench.step(seconds=1, tracks=TWO[:1]) == []
    assert bench.monitor.alerts[0].stage == "information"


def test_the_worst_stage_stays_recorded() -> None:
    bench = Bench()
    bench.step(conflict(certain=True))
    assert bench.monitor.alerts[0].worst_stage == "information"
    bench.step(conflict("alarm"))
    bench.step(conflict(), seconds=4)
    bench.step(seconds=4)
    assert [(one.state, one.stage, one.worst_stage) for one in bench.monitor.cleared] == [
        ("cleared", "information", "alarm")
    ]


def test_degraded_sensors_lower_to_information_but_never_silence() -> None:
    bench = Bench()
    assert bench.step(conflict("alarm", certain=True), degraded=True) == ["raise information"]
    alert = bench.monitor.alerts[0]
    assert alert.degraded
    assert "degraded" in alert.text
    assert bench.step(conflict("alarm")) == ["update alarm"]
    assert bench.step(conflict("alarm"), degraded=True) == ["update information"]


def test_acknowledge_and_what_it_refuses() -> None:
    bench = Bench()
    bench.step(conflict(certain=True))
    change = bench.monitor.acknowledge(1, "tower", bench.time)
    assert (change.operation, change.alert.state, change.alert.acknowledged_by) == (
        "acknowledge",
        "acknowledged",
        "tower",
    )
    assert not change.alert.aural
    again = bench.monitor.acknowledge(1, "ground", bench.time + 1)
    assert again.alert.acknowledged_by == "tower"
    bench.step(conflict())
    assert bench.monitor.alerts[0].state == "acknowledged"
    with pytest.raises(KeyError):
        bench.monitor.acknowledge(2, "tower", bench.time)
    bench.step(seconds=10)
    with pytest.raises(ValueError, match="cleared"):
        bench.monitor.acknowledge(1, "tower", bench.time)


def test_escalation_asks_for_attention_again_but_only_once() -> None:
    bench = Bench()
    bench.step(conflict(certain=True))
    bench.monitor.acknowledge(1, "tower", bench.time)
    bench.step(conflict("alarm"))
    alert = bench.monitor.alerts[0]
    assert (alert.state, alert.acknowledged_by, alert.aural) == ("ongoing", "tower", True)
    assert alert.acknowledged_at is not None
    assert bench.monitor.acknowledge(1, "ground", bench.time).alert.acknowledged_by == "ground"
    bench.step(conflict(), seconds=5)
    bench.step(conflict("alarm"))
    assert bench.monitor.alerts[0].state == "acknowledged"


def test_an_alert_follows_its_target_to_a_new_track_number() -> None:
    bench = Bench(refresh_s=1e9)
    bench.step(conflict(certain=True))
    renumbered = TWO.replace(id=[1, 7])
    assert bench.step(conflict(tracks=(1, 7)), tracks=renumbered) == ["update information"]
    assert [t.track for t in bench.monitor.alerts[0].targets] == [1, 7]
    assert bench.monitor.alerts[0].id == 1
    stranger = renumbered.replace(id=[1, 9], address=["39aaaa", "39cccc"])
    assert bench.step(conflict(tracks=(1, 9), certain=True), tracks=stranger) == ["raise information"]
    assert bench.monitor.alerts[0].id == 2


def test_the_same_pair_the_other_way_round_is_the_same_alert() -> None:
    bench = Bench(refresh_s=1e9)
    bench.step(conflict(certain=True))
    assert bench.step(conflict(tracks=(2, 1), certain=True))[0].startswith("update")
    assert len(bench.monitor.alerts) == 1


def test_time_going_backwards_neither_clears_nor_freezes() -> None:
    bench = Bench(refresh_s=1e9)
    bench.step(conflict(certain=True))
    assert bench.step(conflict(), seconds=-3600) == []
    assert bench.step(seconds=3) == []
    assert bench.step(seconds=1.5) == ["clear information"]
    assert bench.step(conflict(certain=True), seconds=float("nan")) == ["raise information"]


def test_the_number_of_live_alerts_is_bounded_and_alarms_go_first() -> None:
    bench = Bench(most=3)
    many = [conflict(tracks=(1, 100 + i), certain=True) for i in range(5)]
    assert bench.step(*many) == ["raise information"] * 3
    assert bench.monitor.held_back == (2, 2)
    alarm = conflict("alarm", tracks=(1, 2), certain=True)
    changes = bench.step(*many, alarm)
    assert "raise alarm" in changes
    cleared = [c.alert.clear_reason for c in bench.changes if c.operation == "clear"]
    assert cleared == ["displaced by an alarm"]
    assert len(bench.monitor.alerts) == 3
    assert bench.monitor.alerts[0].stage == "alarm"


def test_saved_state_goes_on_as_if_nothing_had_happened() -> None:
    movers = [arrival(1, 60), parked(3, 200, 0)]
    whole = monitor()
    expected = play(whole, movers, 0, 100).changes
    first, second = monitor(), monitor()
    changes = play(first, movers, 0, 40).changes
    saved = first.save()
    play(first, movers, 41, 60)
    second.restore(saved)
    changes += play(second, movers, 41, 100).changes
    assert changes == expected
    assert changes


def test_state_of_another_airport_is_refused() -> None:
    state = monitor().save()
    state.runways = [RunwayState("01/19")]
    with pytest.raises(ValueError, match="another airport"):
        monitor().restore(state)


def test_runways_are_set_and_refused() -> None:
    watch = monitor(runways=())
    assert watch.set_runway("09/27", in_use="27", visibility="low").in_use == "27"
    assert watch.set_runway("09/27", in_use="").in_use is None
    assert watch.set_runway("09/27", in_use="09", open=True).visibility == "low"
    assert watch.set_runway("09/27", open=False).in_use is None
    with pytest.raises(KeyError):
        watch.set_runway("01/19", open=True)
    with pytest.raises(ValueError, match="09 and 27"):
        watch.set_runway("09/27", in_use="10")
    with pytest.raises(ValueError, match="closed"):
        watch.set_runway("09/27", in_use="09")
    with pytest.raises(ValueError, match="no runway"):
        monitor(runways=(RunwayState("01/19"),))


def test_runway_states_tell_occupants_and_the_next_arrival() -> None:
    watch = monitor()
    play(watch, [arrival(1, 60), parked(3, 200, 0)], 0, 40)
    (runway,) = watch.runways
    assert runway.occupants == (3,)
    assert runway.next_arrival == 1
    assert runway.next_arrival_s == pytest.approx(20, abs=0.5)
    play(watch, [], 41, 42)
    assert watch.runways[0].occupants == ()
    assert watch.runways[0].next_arrival is None


def test_rows_that_are_not_finite_and_unknown_nodes_do_no_harm() -> None:
    watch = monitor()
    tracks = tracks_at([arrival(1, 60), parked(3, 200, 0)], 45.0)
    state = tracks.state.copy()
    state[1] = np.nan
    assert watch.update(tracks.replace(state=state), 45.0, False, NodeEvents.build(2, time=45.0, node=[99, -4])) == ()
    assert watch.update(Tracks.empty(), 46.0) == ()
    assert watch.update(tracks, float("nan"))[0].operation == "raise"


@pytest.mark.parametrize(("number", "called"), [(0, 70_003), (17, 17)])
def test_a_text_calls_a_target_by_its_number_and_keeps_its_id(number: int, called: int) -> None:
    movers = [arrival(1, 60), parked(3, 200, 0)]
    tracks = tracks_at(movers, 45.0)
    tracks = tracks.replace(id=tracks.id + 70_000, number=np.array([0, number]))
    alert = monitor().update(tracks, 45.0)[0].alert
    assert f"#{called} on runway" in alert.text
    assert {one.track: one.number for one in alert.targets} == {70_001: None, 70_003: number or None}


def test_a_hundred_random_pictures_break_nothing() -> None:
    rng = np.random.default_rng(7)
    watch = monitor()
    for time in range(100):
        n = int(rng.integers(0, 200))
        tracks = Tracks.build(
            n,
            id=rng.permutation(4095)[:n] + 1,
            time=time,
            state=rng.normal(0, [1500, 60, 40, 40], (n, 4)),
            covariance=np.eye(4) * rng.uniform(0, 400),
            phase=rng.integers(0, 3, n),
            category=rng.integers(0, 3, n),
            hits=rng.integers(0, 20, n),
        )
        for change in watch.update(tracks, float(time), bool(rng.random() < 0.2)):
            assert change.alert.targets
        assert len(watch.alerts) <= 64


class Life(RuleBasedStateMachine):
    """Any order of looks, gaps and acknowledgements keeps the changes a lawful story."""

    def __init__(self) -> None:
        super().__init__()
        self.bench = Bench()
        self.story: dict[int, list[AlertChange]] = {}
        self.clock = 0.0
        self.alarmed: dict[tuple[int, ...], float] = {}

    def tell(self, changes: Any) -> None:
        for change in changes:
            self.story.setdefault(change.alert.id, []).append(change)

    @rule(
        seconds=st.floats(-5, 12),
        stages=st.lists(st.sampled_from([None, "information", "alarm"]), min_size=3, max_size=3),
        certain=st.booleans(),
        degraded=st.booleans(),
    )
    def look(self, seconds: float, stages: list[Any], certain: bool, degraded: bool) -> None:
        pairs = [(1, 2), (1,), (2,)]
        given = [conflict(s, pair, certain) for pair, s in zip(pairs, stages, strict=True) if s]
        before = {a.id: a.stage for a in self.bench.monitor.alerts}
        self.clock += max(0.0, seconds)
        self.alarmed |= {c.tracks: self.clock for c in given if c.stage == "alarm"}
        self.bench.step(*given, seconds=seconds, degraded=degraded)
        self.tell(self.bench.changes)
        for alert in self.bench.monitor.alerts:
            since = self.clock - self.alarmed.get(tuple(t.track for t in alert.targets), -1e9)
            if degraded or since > 4.001:
                assert alert.stage == "information"
            elif since == 0 or (before.get(alert.id) == "alarm" and since < 3.999):
                assert alert.stage == "alarm"

    @rule(number=st.integers(0, 12))
    def acknowledge(self, number: int) -> None:
        live = {a.id for a in self.bench.monitor.alerts}
        try:
            self.tell([self.bench.monitor.acknowledge(number, "tower", self.bench.time)])
            assert number in live
        except (KeyError, ValueError):
            assert number not in live

    @invariant()
    def stories_are_lawful(self) -> None:
        live = {a.id for a in self.bench.monitor.alerts}
        for id, changes in self.story.items():
            operations = [c.operation for c in changes]
            assert operations[0] == "raise"
            assert operations.count("raise") == 1
            assert ("clear" in operations[:-1]) is False
            assert (operations[-1] == "clear") == (id not in live)
        assert live <= set(self.story)


TestLife = Life.TestCase
TestLife.settings = hypothesis_settings(max_examples=40, stateful_step_count=20, deadline=None, derandomize=True)


def test_categories_are_named_in_the_payload() -> None:
    bench = Bench()
    bench.step(conflict(certain=True), tracks=TWO.replace(category=[TargetClass.UNKNOWN, TargetClass.AIRCRAFT]))
    assert [t.category for t in bench.monitor.alerts[0].targets] == ["unknown", "aircraft"]
    assert replace(bench.monitor.alerts[0], id=9).id == 9
