"""Two tracks near each other become one only when they can be one target, and stay two otherwise."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pipeline.associate.gnn import GlobalNearestNeighbour
from pipeline.classify.extent_speed import ExtentSpeed
from pipeline.contracts.measured import Measured
from pipeline.filter.kalman import Kalman
from pipeline.lifecycle.score import Score
from pipeline.tables import Source, TargetCategory, TargetClass, TargetReports, TrackPhase
from pipeline.track.core import Core, make_core
from pipeline.track.maintenance import keep_house
from pipeline.track.settings import TrackerSettings
from pipeline.track.update import start_tracks, unknown_velocity
from tests.pipeline.track.scene import RADAR, T0, FlatZones, Target, line, make_tracker, run, truth_at

SURE = np.diag([1.0, 1.0, 0.25, 0.25])
AT = np.array([500.0, -400.0])


def pair(
    off: tuple[float, float], one: dict[str, Any], other: dict[str, Any], *, velocity: tuple[float, float] = (0.0, 0.0)
) -> Core:
    """Two confirmed tracks `off` m and `velocity` m/s apart, of which the second has had no plots for three seconds.

    one, other: columns of theirs that are not as usual: named the same, 4 m long, sure to a metre.
    """
    core = make_core(
        (RADAR,), (), FlatZones(), TrackerSettings(), 8, Kalman(), GlobalNearestNeighbour(), Score(), ExtentSpeed()
    )
    core.time = T0
    place = np.array([AT, AT + off])
    measured = Measured.of(np.full(2, T0), place, np.tile(np.eye(2), (2, 1, 1)))
    start_tracks(core, measured, unknown_velocity(core, 2), 0, Source.RADAR, False)
    store = core.store
    store.phase[:2], store.evidence["score"][:2, 0], store.id[:2] = TrackPhase.CONFIRMED, 20.0, (1, 2)
    store.filter["one_point"][:2] = False
    state = np.column_stack([place, [(3.0, 4.0), np.add((3.0, 4.0), velocity)]])
    store.length[:2], store.width[:2] = 4.0, 2.0
    store.born[:2] = T0 - 60.0, T0 - 50.0
    store.radar_time[:2] = T0, T0 - 3.0
    for row, words in enumerate((one, other)):
        known(core, row, state[row], words.get("covariance", SURE))
        for name in words.keys() - {"covariance"}:
            getattr(store, name)[row] = words[name]
        store.named[row] = store.address[row] != ""
    return core


def known(core: Core, row: int, state: Any, covariance: Any) -> None:
    """The filter holds this of the track."""
    for records in (core.store.filter, core.store.rows):
        records["state"][row], records["covariance"][row] = state, covariance


def merged(core: Core, checks: int = 3) -> bool:
    """Whether the two are one after so many checks, between which nothing about them changes."""
    for _ in range(checks):
        keep_house(core, core.time)
        for name in ("updated", "radar_time"):
            core.column(name)[:] += 1.0
        core.store.time[: core.store.n] += 1.0
        core.time += 1.0
    assert core.counters.get("merged", 0) == 2 - core.store.n
    return core.store.n == 1


def test_two_tracks_in_one_place_become_the_older_one_after_three_checks() -> None:
    core = pair((2.0, 0.0), {}, {})
    assert not merged(core, 2)
    assert merged(core, 1)
    assert core.store.id[0] == 1
    core = pair((2.0, 0.0), {"born": T0 - 40.0}, {})
    assert merged(core)
    assert core.store.id[0] == 2


def test_checks_count_only_in_a_row() -> None:
    core = pair((2.0, 0.0), {}, {})
    assert not merged(core, 2)
    here = core.store.state[1].copy()
    known(core, 1, here + 20.0 * np.eye(4)[0], SURE)
    assert not merged(core, 1)
    known(core, 1, here, SURE)
    assert not merged(core, 2)
    assert merged(core, 1)


@pytest.mark.parametrize(("one", "other", "made_one"), [(3.0, 3.0, True), (3.0, 0.0, True), (0.0, 3.0, True)])
def test_one_of_them_without_plots_is_enough(one: float, other: float, made_one: bool) -> None:
    core = pair((2.0, 0.0), {"radar_time": T0 - one}, {"radar_time": T0 - other})
    assert merged(core) == made_one


def test_two_tracks_that_both_get_plots_stay_two() -> None:
    assert not merged(pair((2.0, 0.0), {"radar_time": T0 - 2.0}, {"radar_time": T0 - 2.0}), 10)


@pytest.mark.parametrize("turn", [0.0, 0.5, 1.3, 2.0, 2.8])
@pytest.mark.parametrize("uncertain", [0, 1])
@pytest.mark.parametrize(("along", "across", "made_one"), [(20.0, 0.0, True), (26.0, 0.0, False), (0.0, 7.0, False)])
@pytest.mark.parametrize("sense", [1, -1])
def test_how_far_apart_they_may_be_is_what_their_covariances_say(
    turn: float, uncertain: int, along: float, across: float, made_one: bool, sense: int
) -> None:
    """One is unsure by 10 m along a direction and by 1 m across it; 95 % lie within 24.6 m along and 4.8 m across."""
    axis, side = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    covariance = SURE.copy()
    covariance[:2, :2] = 100.0 * np.outer(axis, axis) + np.outer(side, side)
    east, north = sense * (along * axis + across * side)
    words: list[dict[str, Any]] = [{}, {}]
    words[uncertain] = {"covariance": covariance}
    assert merged(pair((east, north), *words)) == made_one


@pytest.mark.parametrize("long", [0, 1])
@pytest.mark.parametrize(("distance", "made_one"), [(24.0, True), (32.0, False)])
def test_two_sensors_may_follow_the_two_ends_of_a_long_target(long: int, distance: float, made_one: bool) -> None:
    words: list[dict[str, Any]] = [{}, {}]
    words[long] = {"length": 38.0, "width": 30.0}
    assert merged(pair((0.6 * distance, -0.8 * distance), *words)) == made_one


@pytest.mark.parametrize(("off", "made_one"), [(145.0, True), (155.0, False)])
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("sense", [1, -1])
def test_beyond_what_a_late_report_may_be_off_they_stay_two(off: float, made_one: bool, axis: int, sense: int) -> None:
    """150 m: a large aircraft, and a second of its final approach; both places are unsure by 80 m."""
    one, other = ({"covariance": np.diag([6400.0, 6400.0, 1.0, 1.0])} for _ in range(2))
    east, north = sense * off * np.eye(2)[axis]
    assert merged(pair((east, north), one, other)) == made_one


@pytest.mark.parametrize(
    ("variance", "faster", "made_one"),
    [((0.25, 0.25), 3.0, True), ((0.25, 0.25), 3.4, False), ((9.0, 0.25), 7.0, True), ((0.25, 9.0), 7.0, True)],
)
@pytest.mark.parametrize("uncertain", [0, 1])
@pytest.mark.parametrize("bearing", [0.3, 1.9, 3.6, 5.2])
def test_tracks_of_different_velocity_stay_two(
    variance: tuple[float, float], faster: float, made_one: bool, uncertain: int, bearing: float
) -> None:
    words: list[dict[str, Any]] = [{}, {}]
    words[uncertain] = {"covariance": np.diag([1.0, 1.0, *variance])}
    velocity = faster * np.sin(bearing), faster * np.cos(bearing)
    assert merged(pair((0.5, 0.5), *words, velocity=velocity)) == made_one


@pytest.mark.parametrize(
    ("one", "other", "made_one"), [("a", "b", False), ("a", "", True), ("", "b", True), ("", "", True)]
)
def test_tracks_of_two_addresses_stay_two(one: str, other: str, made_one: bool) -> None:
    words = [{"address": name, "report_time": T0 if name else -np.inf, "plot_since": np.inf} for name in (one, other)]
    core = pair((2.0, 0.0), *words)
    checks = 3 if bool(one) == bool(other) else core.settings.grouping.merge_named_after
    assert not merged(core, checks - 1)
    assert merged(core, 1) == made_one
    if made_one:
        assert core.store.address[0] == one + other


def reported_and_not(speed: float, plot_since: float = np.inf) -> Core:
    """Two tracks that move alike, eastward, of which the second bears an address. plot_since: of the second."""
    core = pair((2.0, 0.0), {"plot_since": T0 - 60.0}, {"address": "a", "report_time": T0, "plot_since": plot_since})
    for records in (core.store.filter, core.store.rows):
        records["state"][:2, 2:] = speed, 0.0
    return core


@pytest.mark.parametrize(("together", "made_one"), [(2.5, True), (5.5, False)])
def test_a_vehicle_that_the_radar_saw_beside_another_target_is_not_that_target(together: float, made_one: bool) -> None:
    """Its last plot is 3 s old, and one second newer at each further check."""
    assert merged(reported_and_not(9.0, T0 - 3.0 - together)) == made_one


def test_a_report_and_an_echo_that_move_fast_and_alike_soon_become_one() -> None:
    assert not merged(reported_and_not(7.5))
    assert merged(reported_and_not(8.5))


VEHICLE = {"claimed": TargetCategory.VEHICLE, "category": TargetClass.VEHICLE}
AIRCRAFT = {"claimed": 0, "category": TargetClass.AIRCRAFT}
REPORTED_AIRCRAFT = {"claimed": TargetCategory.AIRCRAFT, "category": TargetClass.AIRCRAFT}
UNKNOWN = {"claimed": 0, "category": TargetClass.UNKNOWN}
SMALL = {"claimed": 0, "category": TargetClass.VEHICLE}
LONG_VEHICLE = {"claimed": TargetCategory.VEHICLE, "category": TargetClass.AIRCRAFT}


@pytest.mark.parametrize(
    ("one", "other", "made_one"),
    [
        (VEHICLE, AIRCRAFT, False),
        (VEHICLE, REPORTED_AIRCRAFT, False),
        (LONG_VEHICLE, AIRCRAFT, False),
        (VEHICLE, LONG_VEHICLE, True),
        (VEHICLE, VEHICLE, True),
        (VEHICLE, UNKNOWN, True),
        (AIRCRAFT, AIRCRAFT, True),
        (AIRCRAFT, UNKNOWN, True),
        (AIRCRAFT, SMALL, True),
    ],
)
@pytest.mark.parametrize("order", [1, -1])
def test_a_reported_vehicle_beside_an_aircraft_stays_itself(
    one: dict[str, Any], other: dict[str, Any], made_one: bool, order: int
) -> None:
    assert merged(pair((2.0, 1.0), *[one, other][::order])) == made_one


def say(target: Target, t: float, address: str, category: TargetCategory) -> TargetReports:
    place = truth_at(target, T0 + t)[0]
    return TargetReports.build(
        1, time=T0 + t, address=address, east=place[0], north=place[1], accuracy=3.0, category=category
    )


@pytest.mark.parametrize(("length", "width", "beside"), [(6.0, 3.0, 20.0), (38.0, 30.0, 24.0)])
def test_a_car_that_the_radar_has_lost_beside_another_target_is_not_swallowed(
    length: float, width: float, beside: float
) -> None:
    """A reported car drives beside a car or an aircraft and is in its radar shadow from the tenth second on."""
    seen = Target(line(300, -400, 8, 1), length, width)
    car = Target(line(300, -400 + beside, 8, 1), 5, 2, hidden=((10.0, 99.0),))
    tracker = make_tracker()
    for scan in range(30):
        run(tracker, [seen, car], 1, first=scan)
        tracker.target_reports(say(car, scan + 0.9, "car", TargetCategory.VEHICLE))
    tracks = tracker.tracks(T0 + 30)
    assert sorted(tracks.address.tolist()) == ["", "car"]
    for address, target in (("car", car), ("", seen)):
        mine = tracks[tracks.address == address]
        assert np.hypot(*(mine.state[0, :2] - truth_at(target, T0 + 30)[0])) < 8
    assert "merged" not in tracker.counters
