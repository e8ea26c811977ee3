"""The table of tracks that is handed out: which are in it, where they stand, and what is said of them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from pipeline.airport.model import SurfaceKind
from pipeline.associate.gnn import GlobalNearestNeighbour
from pipeline.classify.extent_speed import ExtentSpeed
from pipeline.contracts.filter import Prior
from pipeline.contracts.measured import Measured
from pipeline.filter.kalman import Kalman
from pipeline.lifecycle.score import Score
from pipeline.sites import RadarSite
from pipeline.tables import Source, TrackPhase, VideoFormat
from pipeline.track.core import Core, make_core
from pipeline.track.reported import reported_tracks
from pipeline.track.settings import ReportingSettings, TrackerSettings
from pipeline.track.update import start_tracks
from tests.pipeline.track.scene import RADAR, T0, FlatZones

SLOW = RadarSite("slow", 0.0, 0.0, 22.0, VideoFormat(period_s=4.0))
CONFIRMED, COASTING, TENTATIVE = TrackPhase.CONFIRMED, TrackPhase.COASTING, TrackPhase.TENTATIVE


def core_of(
    *tracks: dict[str, Any], surface: SurfaceKind = SurfaceKind.TAXIWAY, radars: tuple[RadarSite, ...] = (RADAR, RADAR),
    fixed: bool = False,
) -> Core:  # fmt: skip
    """A tracker at T0 + 3 with confirmed tracks, last seen at T0, that move by (3, -4) m/s; these columns differ."""
    settings = TrackerSettings(reporting=ReportingSettings(fixed_off_pavement=fixed))
    core = make_core(
        radars, (), FlatZones(surface), settings, 8, Kalman(), GlobalNearestNeighbour(), Score(), ExtentSpeed()
    )
    n = len(tracks)
    place = np.array([[500.0 + 100.0 * k, -400.0] for k in range(n)])
    prior = Prior(np.tile([3.0, -4.0], (n, 1)), np.tile(np.eye(2), (n, 1, 1)), np.ones(n, np.bool_))
    start_tracks(core, Measured.of(np.full(n, T0), place, np.tile(np.eye(2), (n, 1, 1))), prior, 0, Source.RADAR, False)
    core.time = T0 + 3.0
    for row, words in enumerate(tracks):
        for name, value in ({"phase": CONFIRMED, "id": row + 1} | words).items():
            core.store.rows[name][row] = value
    return core


def ids(core: Core) -> list[int]:
    return [int(one) for one in reported_tracks(core).id]


def test_tentative_ended_and_nameless_tracks_are_not_shown() -> None:
    assert ids(core_of({}, {"phase": COASTING}, {"phase": TENTATIVE}, {"phase": 255}, {"id": 0}, {})) == [1, 2, 6]


def test_each_stands_at_its_last_measurement_and_a_coasting_one_at_the_time_of_the_tracker() -> None:
    core = core_of({}, {"phase": COASTING}, {"phase": COASTING})
    core.store.time[2] = T0 + 5.0  # newer than the tracker
    tracks = reported_tracks(core)
    assert tracks.time.tolist() == [T0, T0 + 3.0, T0 + 5.0]
    assert tracks.state.tolist() == [[500, -400, 3, -4], [609, -412, 3, -4], [700, -400, 3, -4]]
    _, expected = core.predicted(np.array([1]), np.array([T0 + 3.0]))
    assert tracks.covariance[1] == pytest.approx(expected.covariance[0])
    assert tracks.covariance[0] == pytest.approx(np.eye(4))
    assert core.store.state[1].tolist() == [600, -400, 3, -4]


def test_on_demand_all_stand_at_one_time() -> None:
    tracks = reported_tracks(core_of({}, {"phase": COASTING}), T0 + 2.0)
    assert tracks.time.tolist() == [T0 + 2.0] * 2
    assert tracks.state.tolist() == [[506, -408, 3, -4], [606, -408, 3, -4]]


@pytest.mark.parametrize(
    ("words", "shown"),
    [
        ({}, False), ({"moved": True}, True), ({"named": True}, True), ({"node_time": T0}, True),
        ({"report_time": T0}, True), ({"length": 12.0, "extent_count": 3}, True),
        ({"length": 11.9, "extent_count": 3}, False), ({"length": 30.0, "extent_count": 2}, False),
    ],
)  # fmt: skip
def test_off_the_pavement_only_what_moved_is_known_or_is_as_large_as_an_aircraft(
    words: dict[str, Any], shown: bool
) -> None:
    assert (ids(core_of(words, surface=SurfaceKind.GRASS)) == [1]) == shown
    assert ids(core_of(words, surface=SurfaceKind.GRASS, fixed=True)) == [1]
    assert ids(core_of(words, surface=SurfaceKind.APRON)) == [1]


@pytest.mark.parametrize(
    ("words", "shown"),
    [
        ({"phase": CONFIRMED}, True), ({}, False), ({"named": True}, True), ({"report_time": T0}, True),
        ({"node_time": T0}, True),
    ],
)  # fmt: skip
def test_what_its_radar_has_lost_is_not_shown_in_a_building(words: dict[str, Any], shown: bool) -> None:
    given = {"phase": COASTING, "moved": True} | words
    core = core_of(given, {}, surface=SurfaceKind.BUILDING, fixed=True)
    assert ids(core) == ([1, 2] if shown else [2])


def test_misses_are_those_of_the_radar_that_has_seen_it_and_missed_it_least() -> None:
    core = core_of({}, {}, {})
    evidence = core.store.evidence
    evidence["history"][:3] = [[8, 2, 0, 0], [8, 0, 0, 0], [0, 0, 0, 1]]
    evidence["misses"][:3] = [[3, 1, 0, 0], [3, 0, 0, 0], [0, 0, 0, 0]]
    assert reported_tracks(core).misses.tolist() == [1, 3, 0]


def test_extent_and_heading_are_those_of_the_track_and_without_an_extent_the_course_of_what_moves() -> None:
    known = {"length": 30.0, "width": 9.0, "heading": 1.5, "axis_bearing": 0.25}
    core = core_of({**known, "extent_count": 1}, known, known, known)
    for row, velocity in ((2, (-1.1, 1.7)), (3, (-1.1, 1.6))):
        core.store.rows["state"][row, 2:] = velocity
    tracks = reported_tracks(core)
    assert tracks.length[0] == 30.0
    assert tracks.width[0] == 9.0
    assert tracks.heading[0] == 1.5
    assert tracks.axis[0] == 0.25
    assert np.isnan(tracks.axis[1:]).all()
    assert np.isnan(tracks.length[1:]).all()
    assert np.isnan(tracks.width[1:]).all()
    assert tracks.heading[1] == pytest.approx(math.atan2(3, -4))
    assert tracks.heading[2] == pytest.approx(2 * math.pi - math.atan2(1.1, 1.7))
    assert np.isnan(tracks.heading[3])  # 1.94 m/s


@pytest.mark.parametrize(("width", "known"), [(30.0, True), (30.1, False), (np.nan, False)])
def test_the_axis_is_told_of_what_is_clearly_longer_than_wide(width: float, known: bool) -> None:
    core = core_of({"length": 39.0, "width": width, "axis_bearing": 0.25, "extent_count": 1})
    assert np.isfinite(reported_tracks(core).axis[0]) == known


@pytest.mark.parametrize(("radars", "memory"), [((RADAR,), 5.0), ((RADAR, SLOW), 8.0)])
def test_a_sensor_is_shown_for_five_seconds_or_two_turns(radars: tuple[RadarSite, ...], memory: float) -> None:
    now, old = T0 + 3.0 - memory + 0.1, T0 + 3.0 - memory - 0.1
    core = core_of(
        {"radar_time": now, "node_time": old, "report_time": old},
        {"radar_time": old, "node_time": now, "report_time": old},
        {"radar_time": old, "node_time": old, "report_time": now},
        {"radar_time": now, "node_time": now, "report_time": now},
        radars=radars,
    )
    seen = [Source.RADAR, Source.NODE, Source.REPORT, Source.RADAR | Source.NODE | Source.REPORT]
    assert reported_tracks(core).sources.tolist() == [int(one) for one in seen]


def test_zone_and_runway_are_those_of_the_place() -> None:
    core = core_of({}, {}, {})
    for name in ("rows", "filter"):
        getattr(core.store, name)["state"][:3, 1] = 500.0, 20.0, -20.0
    tracks = reported_tracks(core)
    assert tracks.zone.tolist() == [3, 3, -1]
    assert tracks.runway.tolist() == [-1, 0, 0]


def test_what_flies_over_a_runway_is_not_on_it() -> None:
    core = core_of(
        {"altitude": 3000.0, "on_ground": False}, {"altitude": 30.0, "on_ground": False},
        {"altitude": 3000.0, "on_ground": True}, {"on_ground": False},
    )  # fmt: skip
    for name in ("rows", "filter"):
        getattr(core.store, name)["state"][:4, 1] = 20.0
    tracks = reported_tracks(core)
    assert tracks.runway.tolist() == [-1, 0, 0, 0]
    assert tracks.zone.tolist() == [-1, 3, 3, 3]
