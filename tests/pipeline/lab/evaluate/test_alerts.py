"""Alerts of the demonstration and of recorded traffic: how they are counted, and that a false one would be seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app.evaluate.traffic import shipped_traffic
from app.settings import Settings
from pipeline.inputs import Envelope, Tick
from pipeline.lab.evaluate import RecordedTraffic, Trial
from pipeline.lab.evaluate.alert_feeds import FRONT_END, RULES, TRACKER, Said, report_inputs
from pipeline.lab.evaluate.alerts import CASES, Alerts, Blame
from pipeline.lab.simulate.incidents import Incident, Use
from pipeline.lab.simulate.paths import Movement, Paths
from pipeline.lab.simulate.recording import Recording
from pipeline.lab.simulate.traffic import Trajectory
from pipeline.lab.simulate.world import World
from pipeline.picture import Alert, AlertChange, AlertTarget
from pipeline.tables import TargetReports

CHANCE = np.random.default_rng(1)


def change(
    id: int, stage: Any = "information", time: float = 50.0, *targets: AlertTarget, text: str = ""
) -> AlertChange:
    alert = Alert(id, "hold_entry", stage, "new", text or f"{id} {stage}", time, time, targets, runway="06/24")
    return AlertChange("raise", time, alert)


def target(address: str | None, east: float = 0.0, north: float = 0.0) -> AlertTarget:
    return AlertTarget(1, None, address, "vehicle", east, north, 1.0, None)


def world(traffic: RecordedTraffic) -> World:
    """Two intruders that stand 500 m apart and pass their holds at 40 and 60 s."""
    made = []
    for number in (0, 1):
        still = np.zeros(200)
        vehicle = Movement(
            "CAR", f"FLCO {number}", f"3a010{number}", 0.0, still + 500.0 * number, still, still, still, still,
            still == 0, still == 0,
        )  # fmt: skip
        time = 40.0 + 20.0 * number
        made.append(Incident(time, time, "H1", "06/24", Use(time, "06/24", "06", 30.0, 0.0, 0), vehicle))
    return World(traffic.airport, Paths([one.vehicle for one in made], 400.0), 0.0, incidents=tuple(made))


@pytest.fixture(scope="module")
def orly() -> RecordedTraffic:
    return shipped_traffic()[0]


def test_an_alert_belongs_to_the_intruder_that_it_names_or_that_is_there(orly: RecordedTraffic) -> None:
    blame = Blame(world(orly))
    blame.look([change(1, "alarm", 50.0, target("39aaaa"), target("3a0100"))])
    blame.look([change(2, "alarm", 51.0, target(None, 30.0, 40.0)), change(3, "alarm", 51.0, target(None, 440.0))])
    blame.look([change(4, "alarm", 52.0, target(None, 250.0)), change(5, "alarm", 52.0, target("39aaaa", 0.0))])
    each, other = blame.result(30.0, 100.0)
    assert each.tolist() == [2, 1], "number 2 is at the first, number 3 at the second"
    assert [text.split()[1] for text in other] == ["4", "5"]
    assert blame.result(50.0, 100.0)[0].tolist() == [1], "only the second passes its hold then"


def test_an_alert_that_gets_its_intruder_later_is_counted_once(orly: RecordedTraffic) -> None:
    blame = Blame(world(orly))
    blame.look([change(1, "alarm", 50.0, target(None, 250.0))])
    for time in (51.0, 52.0):
        blame.look([replace(change(1, "alarm", time, target("3a0101")), operation="update")])
    each, other = blame.result(30.0, 100.0)
    assert (each.tolist(), other.tolist()) == ([0, 1], [])


def test_an_alert_counts_by_its_gravest_stage() -> None:
    said = Said.of([change(1), change(2), change(1, "alarm", text="worse"), change(1), change(3, "alarm")])
    assert [one.split(maxsplit=1)[1] for one in said.alarms] == ["worse", "3 alarm"]
    assert [one.split(maxsplit=1)[1] for one in said.information] == ["2 information"]


REPORTS = TargetReports.build(
    1000, time=1.6e9 + 0.1 * np.arange(1000), address="39aaaa", east=0.0, north=0.0, accuracy=5.0
)


def parts(inputs: Sequence[Envelope]) -> list[TargetReports]:
    return [one.body for one in inputs if isinstance(one.body, TargetReports)]


@pytest.mark.parametrize("smoothed", [False, True])
def test_reports_are_given_in_order_with_ticks_and_a_few_are_lost(smoothed: bool) -> None:
    inputs = list(report_inputs(REPORTS, 1, smoothed=smoothed, seconds=1e9))
    given = TargetReports.concatenate(parts(inputs))
    assert 950 <= len(given) < 990
    assert (np.diff(given.time) > 0).all()
    assert all(
        (one.time < envelope.arrival).all() for envelope in inputs if isinstance(one := envelope.body, TargetReports)
    )
    assert sum(isinstance(one.body, Tick) for one in inputs) >= 400
    assert float(given.east.std()) == pytest.approx(3.0 if smoothed else 0.0, abs=0.3)
    again = TargetReports.concatenate(parts(list(report_inputs(REPORTS, 1, smoothed=smoothed, seconds=1e9))))
    other = TargetReports.concatenate(parts(list(report_inputs(REPORTS, 2, smoothed=smoothed, seconds=1e9))))
    np.testing.assert_array_equal(again.time, given.time)
    assert other.time.tolist() != given.time.tolist()


def test_only_the_first_seconds_are_given() -> None:
    given = parts(list(report_inputs(REPORTS, 1, smoothed=False, seconds=10.0)))
    assert 9.5 < max(float(one.time[-1]) for one in given) - float(REPORTS.time[0]) <= 10.25
    assert list(report_inputs(REPORTS[:0], 1, smoothed=False, seconds=10.0)) == []


def test_the_rows_say_what_is_asked_and_whether_it_is_met() -> None:
    def found(each: list[int], alarms: int) -> list[Trial]:
        texts, none = np.array(["50.0 one"] * alarms, np.str_), np.array([], np.str_)
        said = {"alarms": texts, "information": none, "seconds": np.array([1800.0])}
        named = {"named_alarms": none, "named_information": texts}
        return [{"each": np.array(each), "other": none}, said, said | named]

    good = {row.name: row for row in Alerts().rows(found([1, 1, 1, 1, 2], 0) * 2)}
    assert good["demonstration: alerts an intruder"].measured == pytest.approx(1.2)
    assert good["demonstration: intruders"].measured == 10
    assert good["recorded traffic as reports alone: played"].measured == 1.0
    assert {row.met for row in good.values()} == {True, None}
    bad = {row.name for row in Alerts().rows(found([1, 0, 3], 1)) if row.met is False}
    assert bad == {
        "demonstration: alerts an intruder", "demonstration: intruders without an alert",
        "recorded traffic as reports alone: false alarms", "recorded traffic through the radar alone: false alarms",
    }  # fmt: skip


def test_its_parts_are_those_of_the_settings() -> None:
    chosen = Settings().parts
    assert tuple(one.name for one in chosen.alert) == RULES
    assert {verb: getattr(chosen, verb).name for verb in TRACKER} == TRACKER
    assert {verb: getattr(chosen, verb).name for verb, _ in FRONT_END.values()} == dict(FRONT_END.values())


def landing_on(one: RecordedTraffic) -> RecordedTraffic:
    """An aircraft that lands where another one stands."""
    end = one.airport.runways[0].ends[0]
    unit = np.array([np.sin(end.heading), np.cos(end.heading)])
    time = np.arange(90.0)
    made = []
    for address, along, speed in (("39aaaa", -4200.0 + 70.0 * time, 70.0), ("39bbbb", 900.0 + 0.0 * time, 0.0)):
        east, north = end.threshold.x + unit[0] * along, end.threshold.y + unit[1] * along
        height = np.maximum(-along, 0.0) * 0.052
        made.append(
            Trajectory(
                address, address, time, east, north, height, 0 * time + end.heading, 0 * time + speed, height < 5.0
            )
        )
    return replace(one, recording=Recording("LFPO", 1.6e9, 90.0, tuple(made)), reports=None)


@pytest.mark.parametrize("seed", [1, 5])
def test_recorded_reports_raise_no_alarm_and_a_conflict_among_them_would(orly: RecordedTraffic, seed: int) -> None:
    number = CASES.index("reports") + len(CASES) * (seed - 1)
    quiet = Alerts(traffic=(orly,), longest_s=300.0).trial(CHANCE, number, lambda: 0.0)
    assert quiet["alarms"].tolist() == []
    assert quiet["seconds"].tolist() == pytest.approx([300.0], abs=1.0)
    loud = Alerts(traffic=(landing_on(orly),)).trial(CHANCE, number, lambda: 0.0)
    assert len(loud["alarms"]) == 1
    assert "39bbbb" in str(loud["alarms"][0])


def test_without_traffic_it_says_so() -> None:
    with pytest.raises(ValueError, match="--file"):
        Alerts().trial(CHANCE, 0, lambda: 0.0)


@pytest.mark.slow
def test_the_demonstration_and_the_radar_for_two_minutes() -> None:
    short = Alerts(traffic=shipped_traffic()).quick()
    rows = {row.name: row for row in short.rows([short.trial(CHANCE, number, lambda: 0.0) for number in range(3)])}
    assert rows["demonstration: intruders"].measured >= 1
    assert [row.name for row in rows.values() if row.met is False] == []
