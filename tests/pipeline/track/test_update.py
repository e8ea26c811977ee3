"""What is written of tracks when measurements of any sensor begin or update them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from pipeline.associate.gnn import GlobalNearestNeighbour
from pipeline.classify.extent_speed import ExtentSpeed
from pipeline.contracts.filter import Prior
from pipeline.contracts.measured import Hypotheses, Measured
from pipeline.filter.kalman import Kalman
from pipeline.lifecycle.score import Score
from pipeline.tables import Source
from pipeline.track.core import Core, make_core
from pipeline.track.settings import TrackerSettings
from pipeline.track.update import (
    FIRST_SCORE,
    add_score,
    node_sensor,
    report_sensor,
    restate,
    start_tracks,
    unknown_velocity,
    update_tracks,
)  # fmt: skip
from tests.pipeline.track.scene import RADAR, T0, A, FlatZones

SETTINGS = TrackerSettings()
PLACE = np.array([[500.0, -400.0], [-300.0, 200.0]])


def core_of(capacity: int = 8) -> Core:
    """A tracker of two radars, of which the second was decided up to the mark 32 turns on."""
    core = make_core(
        (RADAR, RADAR), (), FlatZones(), SETTINGS, capacity, Kalman(), GlobalNearestNeighbour(), Score(), ExtentSpeed()
    )  # fmt: skip
    core.clocks[1].decided = 32 * 32
    return core


def start(core: Core, rows: int = 2, sensor: int = 0, source: Source = Source.RADAR, **words: Any) -> Any:
    """Tracks at PLACE, begun at T0."""
    measured = Measured.of(np.full(rows, T0), PLACE[:rows], np.tile(4.0 * np.eye(2), (rows, 1, 1)))
    return start_tracks(
        core, measured, unknown_velocity(core, rows), sensor, source, words.pop("simulated", False), **words
    )


def update(core: Core, place: Any, *, row: int = 0, time: float = T0 + 1.0, sensor: int = 0, sd: float = 0.01) -> None:
    """The track takes one position, at the second of two rows that are looked at; the first of them takes nothing."""
    other = 1 - row
    rows = np.array([other, row])
    predicted, _ = core.predicted(rows, np.full(2, time))
    measured = Measured.of(np.array([time]), np.array([place], float), np.array([sd**2 * np.eye(2)]))
    first = np.array([0, 1, 2], np.int32)
    hypotheses = Hypotheses(first, np.array([0, 0, 1], np.int32), np.zeros(1, np.int32), np.zeros(2))
    update_tracks(core, predicted, measured, hypotheses, sensor, Source.RADAR if sensor < 2 else Source.REPORT)


def test_the_sensors_besides_the_radars_are_nodes_and_reports() -> None:
    core = core_of()
    assert (node_sensor(core), report_sensor(core)) == (2, 3)
    assert core.store.evidence.shape[1] == 4


def test_a_new_track_stands_where_it_was_seen_and_was_hit_once() -> None:
    core = core_of()
    rows = start(core, sensor=1, simulated=np.array([True, False]))
    store = core.store
    assert rows.tolist() == [0, 1]
    assert store.state[:2].tolist() == [[*PLACE[0], 0.0, 0.0], [*PLACE[1], 0.0, 0.0]]
    assert store.covariance[:2] == pytest.approx(
        np.tile(np.diag([4.0, 4.0, *[SETTINGS.start.speed_sd**2] * 2]), (2, 1, 1))
    )
    assert store.rows["birthplace"][:2].tolist() == PLACE.tolist()
    for name in ("updated", "born", "radar_time"):
        assert store.rows[name][:2].tolist() == [T0, T0], name
    assert store.time[:2].tolist() == [T0, T0]
    assert np.isinf(store.rows["node_time"][:2]).all()
    assert np.isinf(store.rows["report_time"][:2]).all()
    assert store.hits[:2].tolist() == [1, 1]
    assert store.simulated[:2].tolist() == [True, False]
    assert store.evidence["history"][:2].tolist() == [[0, 1, 0, 0]] * 2
    assert store.evidence["looks"][:2].tolist() == [[0, 1, 0, 0]] * 2
    assert not store.evidence["score"][:2].any()
    assert core.counters == {}


def test_a_head_start_counts_as_looks_that_hit_and_gives_a_score() -> None:
    core = core_of()
    start(core, 1, report_sensor(core), Source.REPORT, head_start=2)
    assert core.store.evidence["history"][0].tolist() == [0, 0, 0, 0b111]
    assert core.store.evidence["looks"][0].tolist() == [0, 0, 0, 3]
    assert core.store.evidence["score"][0] == pytest.approx([0, 0, 0, 3 * SETTINGS.evidence.other_sensor * FIRST_SCORE])
    assert core.store.report_time[0] == T0
    assert np.isinf(core.store.radar_time[0])


def test_every_radar_looks_at_a_new_track_next_as_if_it_had_half_a_turn_ago() -> None:
    core = core_of()
    start(core, 1)
    last = core.store.look["last"][0]
    assert last[1] == core.clocks[1].decided_row(A) - A // 2
    assert last[0] < -A


def test_what_finds_no_room_is_counted() -> None:
    core = core_of(1)
    rows = start(core, simulated=np.array([True, False]))
    assert rows.tolist() == [0]
    assert core.store.state[0, :2].tolist() == PLACE[0].tolist()
    assert core.store.simulated[0]
    assert core.counters == {"no_room": 1}
    assert start(core, 1).tolist() == []
    assert core.counters == {"no_room": 2}


def test_a_track_that_took_something_is_where_the_filter_says_and_was_seen() -> None:
    core = core_of()
    start(core)
    core.store.evidence["misses"][:2] = 3
    before = core.store.rows[1].tobytes()
    update(core, (510.0, -400.0), sensor=1)
    store = core.store
    assert store.state[0] == pytest.approx([510.0, -400.0, 10.0, 0.0], abs=0.01)
    assert store.covariance[0] == pytest.approx(store.filter["covariance"][0])
    assert (store.updated[0], store.radar_time[0], store.born[0], store.hits[0]) == (T0 + 1.0, T0 + 1.0, T0, 2)
    assert store.evidence["history"][0].tolist() == [1, 1, 0, 0]
    assert store.evidence["looks"][0].tolist() == [1, 1, 0, 0]
    assert store.evidence["misses"][:2].tolist() == [[0] * 4, [3] * 4]
    assert store.rows[1].tobytes() == before
    update(core, (520.0, -400.0), sensor=1, time=T0 + 2.0)
    assert store.evidence["history"][0].tolist() == [1, 0b11, 0, 0]
    assert store.evidence["looks"][0].tolist() == [1, 2, 0, 0]


def test_what_comes_late_makes_no_time_older() -> None:
    core = core_of()
    start(core)
    update(core, PLACE[0], time=T0 + 2.0)
    update(core, PLACE[0], time=T0 + 1.0)
    assert (core.store.updated[0], core.store.radar_time[0]) == (T0 + 2.0, T0 + 2.0)
    assert core.store.hits[0] == 3


@pytest.mark.parametrize(
    ("size", "least_half_extent", "bound"),
    [(math.nan, 0.0, 0.0), (20.0, 0.0, 10.0), (20.0, 21.0, 21.0), (50.0, 21.0, 25.0)],
)
@pytest.mark.parametrize("bearing", [0.0, 1.0, 3.0, 5.0])
def test_it_has_moved_once_it_is_away_from_its_birthplace_by_more_than_half_its_size(
    size: float, least_half_extent: float, bound: float, bearing: float
) -> None:
    way = np.array([math.sin(bearing), math.cos(bearing)])
    for beyond, moved in ((-0.5, False), (0.5, True)):
        core = core_of()
        start(core)
        core.store.length[:2], core.store.least_half_extent[:2] = size, least_half_extent
        update(core, PLACE[0] + (SETTINGS.reporting.moved_by + bound + beyond) * way)
        assert core.store.moved[:2].tolist() == [moved, False]
        update(core, PLACE[0], time=T0 + 2.0)
        assert core.store.moved[0] == moved


def test_the_looks_of_the_other_radars_are_planned_anew() -> None:
    core = core_of()
    start(core)
    look = core.store.look
    look["planned"][:2], look["wake"][:2] = True, 77
    update(core, PLACE[0], sensor=1)
    assert look["planned"][:2].tolist() == [[False, True], [True, True]]
    assert look["wake"][:2].tolist() == [[0, 77], [77, 77]]


def test_a_score_is_added_up_to_the_greatest() -> None:
    core = core_of()
    start(core)
    most = SETTINGS.evidence.max_score
    core.store.evidence["score"][:2, 2] = most - 3.0
    add_score(core, np.array([1]), 2, 2.0)
    assert core.store.evidence["score"][:2, 2].tolist() == [most - 3.0, most - 1.0]
    add_score(core, np.array([1]), 2, 2.0)
    assert core.store.evidence["score"][:2, 2].tolist() == [most - 3.0, most]
    assert not np.delete(core.store.evidence["score"], 2, axis=1).any()


def test_a_track_stated_anew_keeps_its_velocity_and_is_less_sure_of_its_place() -> None:
    core = core_of()
    start(core)
    update(core, (510.0, -395.0), sd=2.0)
    store = core.store
    state, covariance, other = store.state[0].copy(), store.covariance[0].copy(), store.rows[1].tobytes()
    store.look["planned"][:2], store.look["wake"][:2] = True, 77
    more = np.array([[9.0, 2.0], [2.0, 5.0]])
    restate(core, np.array([0]), np.array([[3.0, -4.0]]), more[None])
    expected = np.zeros((4, 4))
    expected[:2, :2], expected[2:, 2:] = covariance[:2, :2] + more, covariance[2:, 2:]
    assert store.state[0] == pytest.approx(state + np.array([3.0, -4.0, 0.0, 0.0]))
    assert store.covariance[0] == pytest.approx(expected)
    assert store.filter["covariance"][0] == pytest.approx(expected)
    assert store.time[0] == T0 + 1.0
    assert not store.filter["one_point"][0]
    assert store.look["planned"][:2].tolist() == [[False] * 2, [True] * 2]
    assert store.look["wake"][:2].tolist() == [[0] * 2, [77] * 2]
    assert store.rows[1].tobytes() == other


def test_a_known_velocity_is_kept_and_an_unknown_one_found_by_two_points() -> None:
    core = core_of()
    measured = Measured.of(np.full(2, T0), PLACE, np.tile(4.0 * np.eye(2), (2, 1, 1)))
    prior = Prior(np.array([[5.0, 6.0], [0.0, 0.0]]), np.tile(0.01 * np.eye(2), (2, 1, 1)), np.array([True, False]))
    start_tracks(core, measured, prior, 0, Source.RADAR, False)
    assert core.store.state[0].tolist() == [*PLACE[0], 5.0, 6.0]
    update(core, PLACE[0] + (15.0, 6.0), sd=2.0)
    assert core.store.state[0, 2:] == pytest.approx([5.0, 6.0], abs=2.0)
    update(core, PLACE[1] + (15.0, 6.0), row=1, sd=2.0)
    assert core.store.state[1, 2:] == pytest.approx([15.0, 6.0])
