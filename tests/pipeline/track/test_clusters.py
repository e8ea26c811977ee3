"""Which looks and plots are decided apart, and when each is asked about."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.associate.gnn import GlobalNearestNeighbour
from pipeline.contracts.associate import Expected
from pipeline.contracts.measured import Measured
from pipeline.group.enclosing import farthest_within
from pipeline.tables.arrays import Array
from pipeline.track.clusters import Clusters, find_clusters, next_question, one_cluster
from tests.pipeline.contracts.associate import expected, expected_at
from tests.pipeline.contracts.rows import plots_at, spread

PART, MARGIN = GlobalNearestNeighbour(), 4.0
NUMBER, ROW = np.arange(100, 108), np.arange(1000, 1800, 100)
"""Eight marks, at these rows."""


class Keeping(GlobalNearestNeighbour):
    """Keeps several rows of a target."""

    @property
    def branching(self) -> bool:
        return True


class Case(NamedTuple):
    expected: Expected
    established: Array
    measured: Measured
    plot_row: Array
    near: Array
    due: Array

    def clusters(self, part: GlobalNearestNeighbour = PART) -> Clusters:
        return find_clusters(
            part, self.expected, self.established, self.measured, self.plot_row, self.due, NUMBER, ROW, MARGIN
        )


def case(places: Any, plots: Any, *, due: Any = 103, rows: Any = 1050, established: Any = False, **words: Any) -> Case:
    tracks = expected_at([(east, north, 0.0, 0.0) for east, north in places], sd=2.0, **words)
    measured = plots_at(10.0, np.reshape(plots, (-1, 2)), 2.0)
    n, m = len(tracks.time), len(measured.time)
    every = (np.broadcast_to(established, (n,)), np.broadcast_to(rows, (m,)), np.broadcast_to(due, (n,)))
    return Case(tracks, every[0].copy(), measured, every[1].copy(), every[2] - 2, every[2].copy())


def test_tracks_that_reach_the_same_plot_are_one_cluster() -> None:
    made = case([(0, 0), (20, 0), (500, 0)], [(10, 0), (501, 0), (900, 0)]).clusters()
    assert made.of_look.tolist() == [0, 0, 1]
    assert made.of_plot.tolist() == [0, 1, made.alone]
    assert made.alone == 2


def test_a_chain_of_plots_makes_one_cluster() -> None:
    made = case([(20.0 * k, 0) for k in range(6)], [(20.0 * k + 10, 0) for k in range(5)]).clusters()
    assert set(made.of_look.tolist()) == {0}


def test_what_may_lie_within_the_extent_of_a_track_belongs_to_its_cluster() -> None:
    words: dict[str, Any] = {"extent": np.array([[60.0, 20.0, 1.0]])}
    part = GlobalNearestNeighbour(extent_sd=0.0)
    assert case([(0, 0)], [(35, 0)], **words).clusters(part).of_plot.tolist() == [1]
    assert case([(0, 0)], [(35, 0)], established=True, **words).clusters(part).of_plot.tolist() == [0]


def test_rows_of_one_target_are_one_cluster_where_several_are_kept() -> None:
    one = case([(0, 0), (500, 0), (900, 0)], [(1, 0)], target=np.array([7, 3, 7]))
    assert one.clusters().of_look.tolist() == [0, 1, 2]
    assert one.clusters(Keeping()).of_look.tolist() == [0, 1, 0]


def anything(seed: int) -> Case:
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(0, 40)), int(rng.integers(0, 60))
    due, half = rng.integers(100, 111, n), float(rng.choice([60.0, 200.0, 800.0]))
    plots = Measured.of(rng.uniform(10, 11, m), rng.uniform(-half, half, (m, 2)), 5 * spread(rng, m, 2))
    row = np.sort(rng.integers(950, 1850, m))
    return Case(expected(rng, n, half), rng.random(n) < 0.5, plots, row, due - rng.integers(0, 4, n), due)


@settings(deadline=None, derandomize=True, max_examples=60)
@given(st.integers(0, 2**32 - 1))
def test_no_track_touches_a_plot_of_another_cluster(seed: int) -> None:
    one = anything(seed)
    made, answer = one.clusters(), None
    n, m = len(one.due), len(one.plot_row)
    answer = PART(one.expected, one.measured, np.arange(n), np.arange(m))
    for i in range(n):
        for j in answer.pair[answer.first[i] : answer.first[i + 1]]:
            assert made.of_look[i] == made.of_plot[j]
        for j in range(m) if one.established[i] else []:
            dt = one.measured.time[j] - one.expected.time[i]
            off = one.measured.position[j] - one.expected.mean[i, :2] - dt * one.expected.mean[i, 2:]
            if np.hypot(*off) <= farthest_within(one.expected.extent[i], MARGIN):
                assert made.of_look[i] == made.of_plot[j]


def questions(one: Case, clusters: Clusters, number: Array = NUMBER, row: Array = ROW) -> list[Any]:
    """All questions; each look that is due and each plot that nobody who is not due might take is over afterwards."""
    open_looks, spent = np.ones(len(one.due), np.bool_), np.zeros(len(one.plot_row), np.bool_)
    made = []
    while (
        asked := next_question(clusters, one.near, one.due, open_looks, one.plot_row, spent, number, row)
    ) is not None:
        made.append(asked)
        open_looks[asked.due] = False
        waiting = set(clusters.of_look[asked.tracks[~asked.due[asked.tracks]]].tolist())
        for plot in asked.plots:
            spent[plot] = clusters.of_plot[plot] not in waiting
    return made


@settings(deadline=None, derandomize=True, max_examples=60)
@given(st.integers(0, 2**32 - 1))
def test_each_look_is_decided_at_its_mark_among_the_plots_before_it(seed: int) -> None:
    one = anything(seed)
    clusters = one.clusters()
    decided: dict[int, int] = {}
    first_asked: dict[int, int] = {}
    last_mark: dict[int, int] = {}
    for asked in questions(one, clusters):
        marks: dict[int, int] = {}
        for track, mark in zip(asked.tracks.tolist(), asked.mark_of_track.tolist(), strict=True):
            cluster = int(clusters.of_look[track])
            assert marks.setdefault(cluster, mark) == mark > last_mark.get(cluster, -1)
            assert one.near[track] <= NUMBER[mark]
            assert asked.due[track] == (one.due[track] <= NUMBER[mark])
            if asked.due[track]:
                assert decided.setdefault(track, mark) == mark
        last_mark |= marks
        for plot, mark in zip(asked.plots.tolist(), asked.mark_of_plot.tolist(), strict=True):
            assert one.plot_row[plot] < ROW[mark]
            first_asked.setdefault(plot, mark)
            if clusters.of_plot[plot] in marks:
                assert marks[clusters.of_plot[plot]] == mark
        assert np.flatnonzero(asked.due).tolist() == [k for k in asked.tracks.tolist() if asked.due[k]]
        assert (np.diff(asked.tracks) > 0).all()
        assert (np.diff(asked.plots) > 0).all()
    assert decided == {k: max(int(due) - 100, 0) for k, due in enumerate(one.due) if due <= NUMBER[-1]}
    before_last = [k for k, row in enumerate(one.plot_row) if row < ROW[-1]]
    assert first_asked == {k: int(np.searchsorted(ROW, one.plot_row[k], side="right")) for k in before_last}


@settings(deadline=None, derandomize=True, max_examples=60)
@given(st.integers(0, 2**32 - 1))
def test_at_a_single_mark_all_open_looks_that_it_may_reach_meet_the_plots_before_it(seed: int) -> None:
    one, rng = anything(seed), np.random.default_rng(seed)
    open_looks, spent = rng.random(len(one.due)) < 0.7, rng.random(len(one.plot_row)) < 0.3
    clusters = one_cluster(len(one.due), len(one.plot_row))
    words = (one.near, one.due, open_looks, one.plot_row, spent, NUMBER[4:5], ROW[4:5])
    asked = next_question(clusters, *words)
    assert asked is not None
    reached: Any = open_looks & (one.near <= NUMBER[4])
    assert asked.tracks.tolist() == np.flatnonzero(reached).tolist()
    assert asked.due.tolist() == (reached & (one.due <= NUMBER[4])).tolist()
    assert asked.plots.tolist() == np.flatnonzero((one.plot_row < ROW[4]) & ~spent).tolist()
    assert next_question(clusters, *words) is None


@pytest.mark.parametrize(("looks", "plots"), [(0, 0), (0, 3), (3, 0)])
def test_nothing_is_no_question_beyond_what_there_is(looks: int, plots: int) -> None:
    one = case([(0, 100.0 * k) for k in range(looks)], [(0, 100.0 * k) for k in range(plots)])
    asked = questions(one, one.clusters())
    assert [(len(each.tracks), len(each.plots)) for each in asked] == ([(looks, plots)] if looks + plots else [])
