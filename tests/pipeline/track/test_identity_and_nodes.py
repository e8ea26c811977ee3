"""The tracker on target reports and node events, alone and with radar."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from pipeline.sites import NodeSite
from pipeline.tables import (
    NodeEventKind,
    NodeEvents,
    Source,
    TargetCategory,
    TargetClass,
    TargetReports,
    TrackPhase,
    Tracks,
)
from pipeline.track.tracker import Tracker
from tests.pipeline.track.scene import T0, Target, line, make_tracker, run, truth_at

NODE = NodeSite("n1", 600.0, 300.0, np.pi / 2, hold="A1", simulated=True)


def report(target: Target, t: float, address: str, *, sd: float = 0.0, seed: int = 0, **words: Any) -> TargetReports:
    """A report of where the target is at T0 + t."""
    place = truth_at(target, T0 + t)[0] + np.random.default_rng((seed, int(t * 10))).normal(0, sd, 2)
    return TargetReports.build(1, time=T0 + t, address=address, east=place[0], north=place[1], **words)


def both(
    tracker: Tracker, targets: Sequence[Target], scans: int, reports: Callable[[int], list[TargetReports]],
    first: int = 0, **words: Any,
) -> Tracker:  # fmt: skip
    """Radar turns with reports after each."""
    for scan in range(first, first + scans):
        run(tracker, targets, 1, first=scan, **words)
        tracker.target_reports(TargetReports.concatenate(reports(scan)))
    return tracker


def by_address(tracks: Tracks, address: str) -> Tracks:
    return tracks[tracks.address == address]


def off(tracks: Tracks, target: Target) -> float:
    return float(np.hypot(*(truth_at(target, tracks.time[0])[0] - tracks.state[0, :2])))


TAXI = Target(line(500, 300, 10, 0), 38, 30)
OTHER = Target(line(500, 340, 10, 0), 38, 30)


def test_a_report_names_the_radar_track_and_is_not_a_second_track() -> None:
    say = {"callsign": "AFR12", "category": TargetCategory.AIRCRAFT, "altitude": 0.0}
    tracker = both(make_tracker(), [TAXI], 15, lambda s: [report(TAXI, s + 0.8, "39abcd", sd=5, **say)])
    tracks = tracker.tracks()
    assert len(tracks) == 1
    assert tracker.counters["confirmed"] == 1
    assert (tracks.address[0], tracks.callsign[0], tracks.category[0]) == ("39abcd", "AFR12", TargetClass.AIRCRAFT)
    assert tracks.sources[0] == Source.RADAR | Source.REPORT
    assert off(tracks, TAXI) < 6


def test_what_a_report_says_overrides_what_radar_believes() -> None:
    tracker = run(make_tracker(), [TAXI], 10)
    assert tracker.tracks().category[0] == TargetClass.AIRCRAFT
    both(tracker, [TAXI], 3, lambda s: [report(TAXI, s + 0.8, "39abcd", category=TargetCategory.VEHICLE)], 10)
    assert tracker.tracks().category[0] == TargetClass.VEHICLE


def test_an_arrival_beyond_the_radar_lives_on_reports_and_stays_the_same_track_when_the_radar_sees_it() -> None:
    arrival = Target(line(-9000, 150, 72, 0), 38, 30, born=90)
    ids = set()
    tracker = make_tracker()
    for scan in range(125):
        air = {"on_ground": False, "altitude": max(3000 - 30.0 * scan, 0), "speed": 72.0, "course": np.pi / 2}
        run(tracker, [arrival], 1, first=scan)
        tracker.target_reports(report(arrival, scan + 0.6, "4ca123", sd=6, **air))
        tracks = tracker.tracks()
        if scan >= 3:
            assert len(tracks) == 1
            ids.add(int(tracks.id[0]))
            assert off(tracks, arrival) < 45
        if scan == 50:
            assert tracks.sources[0] == Source.REPORT
            assert not tracks.on_ground[0]
            assert tracks.altitude[0] == 1500
    assert len(ids) == 1
    assert tracker.tracks().sources[0] == Source.REPORT | Source.RADAR
    assert off(tracker.tracks(), arrival) < 10


def test_two_aircraft_side_by_side_never_swap_names() -> None:
    """40 m apart for two minutes, reports 6 m noisy, radar misses some: the names stay where they were given."""
    tracker = make_tracker()
    pair = [Target(one.path, 38, 30, 0.9) for one in (TAXI, OTHER)]

    def say(s: int) -> list[TargetReports]:
        return [report(one, s + 0.5, name, sd=6, seed=k) for k, (one, name) in enumerate(zip(pair, "ab", strict=True))]

    ids: dict[str, set[int]] = {"a": set(), "b": set()}
    for scan in range(120):
        both(tracker, pair, 1, say, scan)
        if scan > 12:
            for name, one in zip("ab", pair, strict=True):
                mine = by_address(tracker.tracks(), name)
                assert len(mine) == 1
                assert off(mine, one) < 15
                ids[name].add(int(mine.id[0]))
    assert all(len(one) == 1 for one in ids.values())
    assert len(tracker.tracks()) == 2


def test_one_report_between_two_unnamed_tracks_waits_for_evidence() -> None:
    near = Target(line(500, 312, 10, 0), 6, 3)
    pair = [Target(line(500, 300, 10, 0), 6, 3), near]
    tracker = run(make_tracker(), pair, 10)
    assert len(tracker.tracks()) == 2
    middle = Target(line(500, 306.5, 10, 0))
    tracker.target_reports(report(middle, 10.0, "aaaaaa"))
    assert (tracker.tracks().address == "").all()
    assert tracker.counters["report_ambiguous"] == 1
    both(tracker, pair, 6, lambda s: [report(near, s + 0.9, "aaaaaa")], 10)
    named = by_address(tracker.tracks(), "aaaaaa")
    assert len(named) == 1
    assert off(named, near) < 7


def test_an_address_between_two_tracks_that_stay_alike_goes_to_one_of_them_with_the_fourth_report() -> None:
    one, other = Target(line(500, 300, 0, 0), 5, 3), Target(line(500, 312, 0, 0), 5, 3)
    middle = Target(line(500, 304.5, 0, 0))
    tracker = run(make_tracker(), [one, other], 12, sd=0.5)
    for k in range(4):
        assert by_address(tracker.tracks(), "abc").id.tolist() == []
        run(tracker, [one, other], 1, first=12 + k, sd=0.5)
        tracker.target_reports(report(middle, 12.9 + k, "abc", accuracy=10.0))
    assert len(by_address(tracker.tracks(), "abc")) == 1
    assert tracker.counters["report_ambiguous"] == 3


def test_an_identity_moves_when_reports_insist_and_not_before() -> None:
    far = Target(line(500, 700, 10, 0), 38, 30)
    tracker = both(make_tracker(), [TAXI, far], 12, lambda s: [report(TAXI, s + 0.5, "a")])
    before = int(by_address(tracker.tracks(), "a").id[0])
    both(tracker, [TAXI, far], 2, lambda s: [report(far, s + 0.5, "a")], 12)
    assert int(by_address(tracker.tracks(), "a").id[0]) == before
    both(tracker, [TAXI, far], 4, lambda s: [report(far, s + 0.5, "a")], 14)
    mine = by_address(tracker.tracks(), "a")
    assert len(mine) == 1
    assert int(mine.id[0]) != before
    assert off(mine, far) < 8
    assert len(tracker.tracks()) == 2
    assert tracker.counters["identity_moved"] == 1


def test_a_name_nobody_says_any_more_is_dropped() -> None:
    tracker = both(make_tracker(), [TAXI], 12, lambda s: [report(TAXI, s + 0.5, "a", callsign="X")])
    still = Target(lambda t: TAXI.path(12.0), 38, 30)
    run(tracker, [still], 100, first=12, sectors=1)
    assert by_address(tracker.tracks(), "a").callsign.tolist() == ["X"]
    run(tracker, [still], 40, first=112, sectors=1)
    assert tracker.tracks().address.tolist() == [""]
    assert tracker.counters["identity_stale"] == 1


def test_simulated_is_what_the_report_says_once_there_is_one() -> None:
    tracker = run(make_tracker(), [TAXI], 10)
    assert not tracker.tracks().simulated[0]
    tracker.target_reports(report(TAXI, 10.0, "a", simulated=True))
    assert tracker.tracks().simulated[0]


def test_doubles_of_one_target_become_one() -> None:
    """Reports 45 m off the echo start their own track; when they come right, one track with the name remains."""
    wrong = Target(line(545, 345, 10, 0))
    tracker = both(make_tracker(), [TAXI], 12, lambda s: [report(wrong, s + 0.5, "a", accuracy=3.0)])
    assert len(tracker.tracks()) == 2
    both(
        tracker,
        [TAXI],
        40,
        lambda s: [report(Target(line(545 - 3 * min(s - 12, 15), 345 - 3 * min(s - 12, 15), 10, 0)), s + 0.5, "a")],
        12,
    )
    tracks = tracker.tracks()
    assert tracks.address.tolist() == ["a"]
    assert tracker.counters["merged"] == 1
    assert off(tracks, TAXI) < 10


def test_reports_without_an_address_still_pull_and_start() -> None:
    tracker = make_tracker()
    for k in range(10):
        tracker.target_reports(report(TAXI, float(k), ""))
    assert len(tracker.tracks()) == 1
    assert tracker.tracks().address[0] == ""
    assert off(tracker.tracks(), TAXI) < 5


def test_an_older_report_is_taken_back_in_time() -> None:
    tracker = both(make_tracker(), [TAXI], 15, lambda s: [report(TAXI, s - 0.9, "a", accuracy=2.0)] if s > 5 else [])
    assert tracker.counters.get("report_late", 0) == 0
    assert len(tracker.tracks()) == 1
    assert off(tracker.tracks(), TAXI) < 5


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ({"time": np.nan}, "report_invalid"),
        ({"east": np.inf}, "report_invalid"),
        ({"accuracy": 0.0}, "report_invalid"),
        ({"accuracy": np.nan}, "report_invalid"),
        ({"time": T0 - 600}, "report_late"),
        ({"time": T0 + 600}, "report_future"),
        ({"east": 90_000.0}, "report_out_of_area"),
        ({"altitude": 9_000.0}, "report_out_of_area"),
    ],
)
def test_reports_that_cannot_be_taken_are_counted(words: dict[str, float], reason: str) -> None:
    tracker = run(make_tracker(), [TAXI], 8)
    before = tracker.save()["store"]["rows"]
    given = {"time": T0 + 8.0, "east": 0.0, "north": 0.0, "address": "a"} | words
    tracker.target_reports(TargetReports.build(1, **given))
    assert tracker.counters[reason] == 1
    np.testing.assert_array_equal(tracker.save()["store"]["rows"]["state"], before["state"])


def event(t: float, kind: NodeEventKind = NodeEventKind.PASSAGE, **words: Any) -> NodeEvents:
    return NodeEvents.build(1, time=T0 + t, node=0, kind=kind, **words)


def test_a_node_confirms_a_tentative_track() -> None:
    car = Target(line(580, 300, 10, 0), 6, 3)
    tracker = run(make_tracker([NODE]), [car], 2)
    assert len(tracker.tracks()) == 0
    tracker.node_events(event(2.0))
    tracks = tracker.tracks()
    assert len(tracks) == 1
    assert tracks.sources[0] == Source.RADAR | Source.NODE
    assert off(tracks, car) < 6


def test_a_node_pulls_a_track_along_the_lane() -> None:
    car = Target(line(500, 300, 10, 0), 6, 3)
    blind = run(make_tracker([NODE]), [car], 10, sd=8.0)
    tracker = make_tracker([NODE])
    tracker.restore(blind.save())
    tracker.node_events(event(10.0))
    spread = [np.diag(one.tracks(T0 + 10).covariance[0])[:2] for one in (blind, tracker)]
    assert spread[1][0] < 0.3 * spread[0][0]
    assert off(tracker.tracks(), car) < 4
    assert tracker.tracks().id[0] == blind.tracks().id[0]


@pytest.mark.parametrize(("kind", "t"), [(NodeEventKind.ARRIVED, 8.1), (NodeEventKind.LEFT, 11.9)])
def test_front_and_tail_of_an_aircraft_over_a_node(kind: NodeEventKind, t: float) -> None:
    """38 m long at 10 m/s: the front reaches the node 1.9 s before its middle does, the tail leaves it 1.9 s after."""
    tracker = run(make_tracker([NODE]), [TAXI], int(t))
    tracker.node_events(event(t, kind))
    assert tracker.counters["node_pulled"] == 1
    assert off(tracker.tracks(), TAXI) < 8
    assert len(tracker.tracks()) == 1


def test_a_node_with_a_speed_starts_a_track_that_the_next_plot_confirms() -> None:
    car = Target(line(600, 300, 10, 0), 6, 3)
    tracker = make_tracker([NODE])
    tracker.node_events(event(0.0, speed=10.0))
    assert len(tracker.tracks()) == 0
    run(tracker, [car], 2)
    tracks = tracker.tracks()
    assert len(tracks) == 1
    assert tracks.state[0, 2] == pytest.approx(10, abs=3)
    assert off(tracks, car) < 6


def test_node_events_alone_confirm_nothing() -> None:
    tracker = make_tracker([NODE])
    for k in range(20):
        tracker.node_events(event(20.0 * k))
        tracker.advance(T0 + 20.0 * k + 10)
        assert len(tracker.tracks()) == 0
    assert tracker.counters["node_started"] == 20


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ({"node": 5}, "node_unknown"),
        ({"node": -1}, "node_unknown"),
        ({"time": np.nan}, "node_invalid"),
        ({"time": T0 - 600}, "node_late"),
        ({"time": T0 + 600}, "node_future"),
    ],
)
def test_events_that_cannot_be_taken_are_counted(words: dict[str, float], reason: str) -> None:
    tracker = run(make_tracker([NODE]), [TAXI], 8)
    tracker.node_events(NodeEvents.build(1, **({"time": T0 + 8.0, "node": 0} | words)))
    assert tracker.counters[reason] == 1
    assert tracker.tracks().phase.tolist() == [TrackPhase.CONFIRMED]


def test_an_event_of_an_unknown_kind_and_no_speed_is_a_passage() -> None:
    tracker = run(make_tracker([NODE]), [TAXI], 10)
    tracker.node_events(event(10.0).replace(kind=9, speed=-5.0))
    assert tracker.counters["node_pulled"] == 1


def test_an_event_for_which_there_is_neither_track_nor_room_is_counted() -> None:
    tracker = make_tracker([NODE], capacity=1)
    run(tracker, [Target(line(-700, -300, 0, 5), 12, 4)], 8)
    tracker.node_events(event(8.0))
    assert tracker.counters["node_without_track"] == 1
    assert "node_started" not in tracker.counters
