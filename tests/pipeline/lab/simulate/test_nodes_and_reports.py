from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from pipeline.lab.simulate.nodes import NodeBehaviour, NodeSimulator, node_sites
from pipeline.lab.simulate.paths import Movement, Paths, Truth
from pipeline.lab.simulate.reports import ReportSimulator
from pipeline.reference.types import TYPES
from pipeline.sites import NodeSite
from pipeline.tables import NodeEventKind, NodeEvents, TargetReports
from tests.pipeline.lab.simulate.field import airport

EXACT = NodeBehaviour(timing=0.0, speed=0.0, length=0.0, missed=0.0, false_per_hour=0.0)
NODE = NodeSite("N1", 300.0, 1.0, math.pi / 2)


def drive(name: str = "A320", speed: float = 10.0, count: int = 100, simulated: bool = False) -> Paths:
    t = np.arange(float(count))
    ground = np.ones(count, bool)
    return Paths(
        [
            Movement(
                name, "TST1", "abc123", 0.0, speed * t, 0 * t, 0 * t, 0 * t + math.pi / 2, 0 * t + speed, ground,
                ground, simulated=simulated,
            )
        ],
        1000.0,
    )  # fmt: skip


@pytest.mark.parametrize("name", ["A320", "CAR"])
def test_events_come_when_nose_middle_and_tail_pass(name: str) -> None:
    events = NodeSimulator((NODE,), 1, EXACT).events(0.0, 100.0, drive(name).at)
    half = TYPES[name].length / 2
    assert events.kind.tolist() == [NodeEventKind.ARRIVED, NodeEventKind.PASSAGE, NodeEventKind.LEFT]
    np.testing.assert_allclose(events.time, [30 - half / 10, 30.0, 30 + half / 10], atol=1e-4)
    np.testing.assert_allclose(events.speed, 10.0, atol=1e-4)
    assert np.isnan(events.length[0])
    np.testing.assert_allclose(events.length[1:], TYPES[name].length, rtol=1e-5)
    assert events.simulated.all()


def test_events_do_not_depend_on_how_the_time_is_split() -> None:
    nodes = tuple(NodeSite(f"N{i}", 40.0 * i, 0.5, 0.0) for i in range(20))
    behaviour = NodeBehaviour(false_per_hour=60.0)
    paths = drive()
    whole = NodeSimulator(nodes, 3, behaviour).events(0.0, 90.0, paths.at)
    parts = NodeSimulator(nodes, 3, behaviour)
    marks = [0.0, 0.1, 7.3, 7.31, 44.25, 90.0]
    again = NodeEvents.concatenate([parts.events(a, b, paths.at) for a, b in itertools.pairwise(marks)])
    assert len(whole) > 50
    np.testing.assert_array_equal(np.sort(again.time), np.sort(whole.time))


def test_a_node_beside_the_lane_feels_nothing() -> None:
    aside = NodeSite("N1", 300.0, 9.0, 0.0)
    assert len(NodeSimulator((aside,), 1, EXACT).events(0.0, 100.0, drive().at)) == 0
    assert len(NodeSimulator((), 1, EXACT).events(0.0, 100.0, drive().at)) == 0


def test_an_aircraft_in_the_air_is_not_felt() -> None:
    def high(time: float) -> Truth:
        return drive().at(time).replace(altitude=40.0)

    assert len(NodeSimulator((NODE,), 1, EXACT).events(0.0, 100.0, high)) == 0


def test_losses_noise_and_false_events_are_as_often_as_set() -> None:
    nodes = tuple(NodeSite(f"N{i}", 0.5 * i + 50.0, 0.0, 0.0) for i in range(1600))
    behaviour = NodeBehaviour(timing=0.05, missed=0.1, false_per_hour=0.0)
    events = NodeSimulator(nodes, 5, behaviour).events(0.0, 99.0, drive().at)
    passages = events[events.kind == NodeEventKind.PASSAGE]
    # 1600 nodes, a tenth lost: 1440 +- 12; four deviations
    assert abs(len(passages) - 1440) < 48
    true = np.array([(nodes[i].east) / 10.0 for i in passages.node])
    error = passages.time - true
    assert error.std() == pytest.approx(0.05, rel=0.1)
    assert abs(error.mean()) < 4 * 0.05 / math.sqrt(len(error))
    false = NodeSimulator(nodes, 5, NodeBehaviour(false_per_hour=3.0)).events(0.0, 3600.0, lambda _: Truth.empty())
    assert abs(len(false) - 4800) < 4 * math.sqrt(4800)


def test_nodes_lie_at_every_hold_and_along_the_taxiways() -> None:
    field = airport()
    sites = node_sites(field)
    assert sites[0].hold == "H1"
    assert sites[0].runway == "09/27"
    along = [one for one in sites if one.hold is None]
    assert len(along) >= 4
    assert all(abs(one.north + 200.0) < 12.0 or abs(one.east - 600.0) < 12.0 for one in along)
    assert len({one.id for one in sites}) == len(sites)
    assert all(one.simulated for one in sites)


def test_recorded_positions_are_reported_once_a_second_unchanged_and_not_as_simulated() -> None:
    paths = drive()
    reports = ReportSimulator(1, missed=0.0).reports(0.0, 60.0, paths.at)
    assert len(reports) == 60
    np.testing.assert_allclose(np.diff(reports.time), 1.0)
    np.testing.assert_allclose(reports.east, 10.0 * reports.time, atol=1e-6)
    np.testing.assert_allclose(reports.course, math.pi / 2, atol=1e-6)
    assert not reports.simulated.any()
    assert set(reports.address.tolist()) == {"abc123"}
    assert set(reports.source.tolist()) == {"traffic-record"}


def test_vehicles_report_as_simulated_with_error() -> None:
    reports = ReportSimulator(1, missed=0.0).reports(0.0, 90.0, drive("CAR", simulated=True).at)
    assert reports.simulated.all()
    assert (reports.category == 2).all()
    assert (reports.source == "beacons").all()
    error = np.concatenate([reports.east - 10 * reports.time, reports.north])
    assert error.std() == pytest.approx(2.5, rel=0.3)


def test_reports_do_not_depend_on_how_the_time_is_split() -> None:
    paths = drive("CAR", simulated=True)
    whole = ReportSimulator(2).reports(0.0, 60.0, paths.at)
    marks = [0.0, 0.3, 0.31, 12.0, 33.33, 60.0]
    one = ReportSimulator(2)
    again = TargetReports.concatenate([one.reports(a, b, paths.at) for a, b in itertools.pairwise(marks)])
    np.testing.assert_array_equal(whole.time, again.time)
    np.testing.assert_array_equal(whole.east, again.east)


def test_a_silent_transponder_reports_nothing() -> None:
    def silent(time: float) -> Truth:
        return drive().at(time).replace(reporting=False)

    assert len(ReportSimulator(1).reports(0.0, 20.0, silent)) == 0
