"""Nodes in lanes of any direction: how far they reach along and across, which end of a target they feel, what they
start.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.sites import NodeSite
from pipeline.tables import NodeEventKind, NodeEvents, Source
from pipeline.track.tracker import Tracker
from tests.pipeline.track.scene import T0, Target, line, make_plots, make_tracker, run, split_scan, truth_at

PLACE = np.array([500.0, -400.0])
HEADINGS = [0.0, 0.7, np.pi / 2, 2.5, np.pi, 4.4]
"""rad: north, south and slanting lanes in all four quadrants beside the one that lies due east."""


def lane_of(heading: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit vectors along the lane and to its right."""
    along = np.array([np.sin(heading), np.cos(heading)])
    return along, np.array([along[1], -along[0]])


def node(heading: float, *, simulated: bool = False) -> NodeSite:
    return NodeSite("n1", PLACE[0], PLACE[1], heading, simulated=simulated)


def event(t: float, kind: NodeEventKind = NodeEventKind.PASSAGE, **words: float) -> NodeEvents:
    return NodeEvents.build(1, time=T0 + t, node=0, kind=kind, **words)


def driven(heading: float, off: float, sense: int, length: float = 38.0, width: float = 30.0) -> Target:
    """A target whose centre passes the node at T0 + 10 with 10 m/s, `off` m to the right of it."""
    along, right = lane_of(heading)
    begin = PLACE + off * right - 100.0 * sense * along
    return Target(line(*begin, *(10.0 * sense * along)), length, width)


@pytest.mark.parametrize("heading", HEADINGS)
@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize(("kind", "t"), [(NodeEventKind.ARRIVED, 8.1), (NodeEventKind.LEFT, 11.9)])
def test_the_end_that_is_felt_depends_on_the_sense_in_which_the_lane_is_driven(
    heading: float, sense: int, kind: NodeEventKind, t: float
) -> None:
    """38 m long at 10 m/s: the front is felt 1.9 s before the centre passes, the tail as long after it."""
    aircraft = driven(heading, 0.0, sense)
    tracker = run(make_tracker([node(heading)]), [aircraft], int(t), sd=4.0)
    before = tracker.tracks(T0 + t)
    tracker.node_events(event(t, kind))
    after = tracker.tracks(T0 + t)
    along, right = lane_of(heading)
    assert tracker.counters["node_pulled"] == 1
    assert len(after) == 1
    assert abs((after.state[0, :2] - truth_at(aircraft, T0 + t)[0]) @ along) < 4.5
    sd = [np.sqrt([v @ one.covariance[0, :2, :2] @ v for v in (along, right)]) for one in (before, after)]
    gain = sd[1] / sd[0]
    assert gain[0] < 0.95 * gain[1]  # a lane is wide: less is learnt across it


@pytest.mark.parametrize("heading", HEADINGS)
@pytest.mark.parametrize("away", [1, -1])
@pytest.mark.parametrize(
    ("along_m", "across_m", "pulled"),
    [(5.0, 0.0, True), (15.0, 0.0, False), (0.0, 15.0, True), (0.0, 32.0, False), (-5.0, 12.0, True)],
)
def test_a_node_reaches_farther_across_its_lane_than_along(
    heading: float, along_m: float, across_m: float, pulled: bool, away: int
) -> None:
    """A car that stands beside or before the node, known to a metre; a node is sure to 2 m along, 6 m across."""
    along, right = lane_of(heading)
    at = PLACE + away * (along_m * along + across_m * right)
    tracker = run(make_tracker([node(heading)]), [Target(line(*at, 0, 0), 4, 2)], 12, sd=1.0)
    tracker.node_events(event(12.0))
    assert tracker.counters.get("node_pulled", 0) == pulled
    assert tracker.counters.get("node_started", 0) == (not pulled)


@pytest.mark.parametrize(("distance", "pulled"), [(60.0, True), (74.0, True), (76.0, False), (90.0, False)])
@pytest.mark.parametrize("bearing", [0.3, 1.8, 3.9])
def test_a_track_of_unknown_velocity_takes_no_event_farther_away_than_half_the_gate(
    distance: float, pulled: bool, bearing: float
) -> None:
    """One plot, then an event 2 s later: 25 m/s for each component would reach to 185 m."""
    place = PLACE + distance * np.array([np.sin(bearing), np.cos(bearing)])
    tracker = make_tracker([node(0.7)])
    azimuth = np.arctan2(*place) % (2 * np.pi)
    for sector in split_scan(make_plots(T0 + azimuth / (2 * np.pi), [place], 2.0), 0, 1):
        tracker.sector(sector)
    tracker.node_events(event(2.0))
    assert tracker.counters.get("node_pulled", 0) == pulled
    assert tracker.counters.get("node_started", 0) == (not pulled)


@pytest.mark.parametrize("side", [1, -1])
def test_an_event_goes_to_the_nearer_of_two_tracks(side: int) -> None:
    near, far = driven(0.7, 4.0 * side, 1, 6, 3), driven(0.7, -14.0 * side, 1, 6, 3)
    tracker = run(make_tracker([node(0.7)]), [near, far], 10, sd=1.0)
    tracker.node_events(event(10.0))
    tracks = tracker.tracks()
    felt = tracks[(tracks.sources & Source.NODE) > 0]
    assert (len(tracks), len(felt)) == (2, 1)
    assert np.hypot(*(felt.state[0, :2] - truth_at(near, felt.time[0])[0])) < 4


def started(site: NodeSite, words: dict[str, float]) -> Tracker:
    """A node event with a speed starts a track that the plots of the radar confirm."""
    along, _ = lane_of(site.heading)
    car = Target(line(*PLACE, *(10.0 * along)), 6, 3)
    tracker = make_tracker([site])
    tracker.node_events(event(0.0, speed=10.0, **words))
    return run(tracker, [car], 3)


@pytest.mark.parametrize(
    ("of_event", "of_node", "simulated"), [(True, False, True), (False, True, True), (False, False, False)]
)
def test_an_event_of_a_simulated_node_starts_a_simulated_track(of_event: bool, of_node: bool, simulated: bool) -> None:
    tracks = started(node(0.7, simulated=of_node), {"simulated": of_event}).tracks()
    assert len(tracks) == 1
    assert tracks.simulated.tolist() == [simulated]


@pytest.mark.parametrize("heading", HEADINGS)
@pytest.mark.parametrize("sense", [1, -1])
def test_a_track_begun_by_a_speed_may_go_either_way_along_the_lane(heading: float, sense: int) -> None:
    along, _ = lane_of(heading)
    tracker = make_tracker([node(heading)])
    tracker.node_events(event(0.0, speed=10.0))
    run(tracker, [Target(line(*PLACE, *(10.0 * sense * along)), 6, 3)], 2)
    tracks = tracker.tracks()
    assert len(tracks) == 1
    assert tracks.state[0, 2:] @ along == pytest.approx(10.0 * sense, abs=3)


@pytest.mark.parametrize("heading", HEADINGS)
def test_a_track_begun_by_a_speed_is_fast_along_its_lane_only(heading: float) -> None:
    """At 30 m/s it may be 30 m farther along the lane a second later, but not 45 m beside it."""
    along, right = lane_of(heading)
    for offset, taken in ((30.0 * along, 1), (-30.0 * along, 1), (45.0 * right, 0), (-45.0 * right, 0)):
        tracker = make_tracker([node(heading)])
        place = PLACE + offset
        azimuth = np.arctan2(*place) % (2 * np.pi)
        tracker.node_events(event(azimuth / (2 * np.pi) - 1.0, speed=30.0))
        for sector in split_scan(make_plots(T0 + azimuth / (2 * np.pi), [place], 1.0), 0, 4):
            tracker.sector(sector)
        assert tracker.save()["store"]["rows"]["hits"][0] == 1 + taken


@pytest.mark.parametrize("heading", HEADINGS)
@pytest.mark.parametrize("speed", [10.0, np.nan])
def test_a_track_begun_by_an_event_is_sure_along_its_lane_and_unsure_across(heading: float, speed: float) -> None:
    along, right = lane_of(heading)
    tracker = make_tracker([node(heading)])
    tracker.node_events(event(0.0, speed=speed))
    covariance = tracker.save()["store"]["rows"]["covariance"][0]
    expected = 2.0**2 * np.outer(along, along) + 6.0**2 * np.outer(right, right)
    np.testing.assert_allclose(covariance[:2, :2], expected, atol=1e-9)


@pytest.mark.parametrize("speed", [-1.0, 120.0, 500.0, np.nan])
def test_a_speed_that_cannot_be_is_not_believed(speed: float) -> None:
    """The event counts as one without a speed: three plots are needed and not one."""
    tracker = make_tracker([node(0.7)])
    tracker.node_events(event(0.0, speed=speed))
    store = tracker.save()["store"]
    assert store["filter"]["one_point"].tolist() == [True]
    assert store["evidence"]["looks"].tolist() == [[0, 1, 0]]
    covariance = store["rows"]["covariance"]
    assert covariance[0, 2, 2] == covariance[0, 3, 3] == 25.0**2
