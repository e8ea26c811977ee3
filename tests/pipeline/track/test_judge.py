"""How tracks are judged, numbered and ended, and what those that came to nothing teach."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from pipeline.associate.gnn import GlobalNearestNeighbour
from pipeline.classify.extent_speed import ExtentSpeed
from pipeline.contracts.lifecycle import Evidence
from pipeline.contracts.measured import Measured
from pipeline.filter.kalman import Kalman
from pipeline.sites import RadarSite
from pipeline.tables import Source, TrackPhase, VideoFormat
from pipeline.tables.arrays import Array
from pipeline.track.core import Core, make_core
from pipeline.track.judge import judge_tracks
from pipeline.track.settings import ReportingSettings, TrackerSettings
from pipeline.track.store import ENDED
from pipeline.track.update import start_tracks, unknown_velocity
from tests.pipeline.track.scene import RADAR, T0, FlatZones

SLOW = RadarSite("slow", 0.0, 0.0, 22.0, VideoFormat(period_s=2.5))
FAST = RadarSite("fast", 0.0, 0.0, 22.0, VideoFormat(period_s=0.5))


class Told:
    """A lifecycle that keeps what it is told of the tracks, and answers what it was given."""

    def __init__(self, phase: Any = (), ended: Any = ()) -> None:
        self.phase, self.ended = np.array(phase, np.uint8), np.array(ended, np.bool_)
        self.evidence: Evidence | None = None

    def judge(self, evidence: Evidence) -> tuple[Array, Array]:
        self.evidence = evidence
        n = len(evidence.phase)
        phase = self.phase if len(self.phase) else evidence.phase
        return phase, self.ended if len(self.ended) else np.zeros(n, np.bool_)


def core_of(
    lifecycle: Told, rows: int, *, radars: tuple[RadarSite, ...] = (RADAR, SLOW, FAST), numbered: bool = False,
    **words: Any,
) -> Core:  # fmt: skip
    """Tentative tracks of the first radar, last seen at T0; `words` are columns."""
    settings = TrackerSettings(reporting=ReportingSettings(asterix_numbers=numbered))
    core = make_core(radars, (), FlatZones(), settings, 8, Kalman(), GlobalNearestNeighbour(), lifecycle, ExtentSpeed())
    core.time = T0
    place = np.array([[100.0 * k, 50.0] for k in range(rows)])
    measured = Measured.of(np.full(rows, T0), place, np.tile(np.eye(2), (rows, 1, 1)))
    start_tracks(core, measured, unknown_velocity(core, rows), 0, Source.RADAR, False)
    core.store.rows["radar"][:rows] = 0
    for name, value in words.items():
        core.store.rows[name][:rows] = value
    return core


def told(core: Core, time: float = T0 + 5.0) -> Evidence:
    rows = core.alive()
    judge_tracks(core, rows, np.full(len(rows), time))
    assert isinstance(core.lifecycle, Told)
    assert core.lifecycle.evidence is not None
    return core.lifecycle.evidence


def test_the_evidence_of_each_sensor_is_handed_on_as_it_is() -> None:
    core = core_of(Told(), 2)
    evidence = core.store.evidence
    for k, name in enumerate(("history", "looks", "misses", "score")):
        evidence[name][:2] = np.arange(10).reshape(2, 5) + 100 * k
    core.store.phase[:2] = TrackPhase.COASTING, TrackPhase.CONFIRMED
    given = told(core)
    for k, name in enumerate(("history", "looks", "misses", "score")):
        assert getattr(given, name).tolist() == (np.arange(10).reshape(2, 5) + 100 * k).tolist()
    assert given.phase.tolist() == [TrackPhase.COASTING, TrackPhase.CONFIRMED]
    assert given.radars == 3


@pytest.mark.parametrize(
    ("history", "period"),
    [([1, 0, 0, 0, 0], 1.0), ([0, 1, 0, 0, 0], 2.5), ([0, 0, 1, 0, 0], 1.0), ([1, 1, 0, 0, 0], 1.0),
     ([0, 0, 0, 0, 1], 1.0), ([0, 1, 0, 1, 1], 2.5)],
)  # fmt: skip
def test_silence_counts_in_turns_of_the_fastest_radar_that_saw_it_and_of_a_second_at_least(
    history: list[int], period: float
) -> None:
    core = core_of(Told(), 1)
    core.store.evidence["history"][0] = history
    assert told(core).silence.tolist() == [5.0 / period]
    assert told(core, T0 - 1.0).silence.tolist() == [0.0]


def test_a_report_protects_for_ten_seconds_what_it_named() -> None:
    core = core_of(Told(), 3, named=[True, True, False], report_time=[T0 - 5.0, T0 - 5.1, T0])
    assert told(core).identified.tolist() == [True, False, False]


def test_how_well_the_position_is_known_is_that_of_the_time_judged() -> None:
    core = core_of(Told(), 3, hits=[2, 1, 2])
    covariance = np.diag([3.0, 5.0, 0.5, 0.7])
    covariance[0, 2] = covariance[2, 0] = 0.2
    covariance[1, 3] = covariance[3, 1] = 0.4
    core.store.rows["covariance"][:2] = covariance
    core.store.rows["covariance"][2] = -np.eye(4)
    variance = 8.0 + 2 * 5.0 * 0.6 + 25.0 * 1.2
    assert told(core).position_sd == pytest.approx([math.sqrt(0.5 * variance), 0.0, 0.0])
    assert told(core, T0).position_sd == pytest.approx([2.0, 0.0, 0.0])
    assert told(core, T0 - 9.0).position_sd == pytest.approx([2.0, 0.0, 0.0])
    assert core.counters == {}


@pytest.mark.parametrize("place", [0, 1, 2, 3])
def test_states_that_are_not_numbers_are_counted(place: int) -> None:
    core = core_of(Told(), 2)
    core.store.rows["state"][1, place] = np.nan
    assert np.isnan(told(core).position_sd).tolist() == [False, True]
    assert core.counters == {"state_invalid": 1}


def test_the_confirmed_get_ids_and_where_wanted_numbers_and_keep_them() -> None:
    for numbered in (False, True):
        core = core_of(Told([1, 0, 1, 1], [False, False, False, True]), 4, numbered=numbered)
        assert TrackPhase.CONFIRMED == 1
        told(core)
        store = core.store
        assert store.phase[:4].tolist() == [1, 0, 1, ENDED]
        assert (store.id[:4] > 0).tolist() == [True, False, True, False]
        assert (store.number[:4] > 0).tolist() == [numbered, False, numbered, False]
        assert core.counters == {"confirmed": 2}
        before = store.rows[:4].tobytes()
        core.lifecycle = Told([1, 0, 1], [False] * 3)
        told(core)
        assert store.rows[:4].tobytes() == before
        assert core.counters == {"confirmed": 2}


def test_what_ends_is_counted_once_when_it_had_an_id() -> None:
    core = core_of(Told([1, 1, 0], [True, False, True]), 3, id=[7, 8, 0])
    told(core)
    assert core.store.phase[:3].tolist() == [ENDED, 1, ENDED]
    assert core.counters == {"ended": 1}


def learnt(core: Core) -> list[list[list[float]]]:
    """Of each radar: east, north and number of the false plots that it was taught."""
    return [one.coming.tolist() for one in core.false_plots]


def test_tentative_tracks_that_end_were_false_plots_at_their_first_and_last_place() -> None:
    core = core_of(Told([0, 0, 1, 0], [True, True, True, False]), 4, radar=[1, 0, 0, 0], hits=[3, 2, 9, 9])
    core.store.rows["state"][:4, :2] += (7.0, -8.0)
    told(core)
    first = [[100.0, 50.0, 1.0], [107.0, 42.0, 1.0]]
    second = [[0.0, 50.0, 1.5], [7.0, 42.0, 1.5]]
    assert learnt(core) == [first, second, []]


def test_with_one_radar_all_false_plots_are_its_own() -> None:
    core = core_of(Told([0, 0], [True, True]), 2, radars=(RADAR,), hits=[2, 4])
    told(core)
    assert learnt(core) == [[[0, 50, 1], [0, 50, 1], [100, 50, 2], [100, 50, 2]]]


@pytest.mark.parametrize(
    ("words", "taught"),
    [
        ({}, True), ({"radar": -1}, False), ({"node_time": T0 - 99.0}, False), ({"report_time": T0 - 99.0}, False),
        ({"length": 12.5}, False), ({"length": 12.0}, True),
    ],
)  # fmt: skip
def test_what_another_sensor_saw_or_is_as_long_as_an_aircraft_was_no_false_plot(
    words: dict[str, Any], taught: bool
) -> None:
    core = core_of(Told([0], [True]), 1, **words)
    told(core)
    assert (learnt(core)[0] != []) == taught
    assert learnt(core)[1:] == [[], []]
