"""What of an association is decided at a mark: hypotheses of the tracks that are due, plots taken, waiting and left."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.contracts.associate import Association, Expected
from pipeline.contracts.measured import Hypotheses
from pipeline.group.split_plots import join_split_plots
from pipeline.tables.arrays import Array
from pipeline.track.clusters import Asked, Clusters
from pipeline.track.plot_pool import POOL, add_centroid_noise
from pipeline.track.resolve import Decided, resolve, together
from tests.pipeline.group.enclosing_track import enclosing_track

MARGIN, CENTROID_SD = 4.0, 0.08


class Case(NamedTuple):
    """tracks: rows of expected that were asked for. sets: of each, its hypotheses as (plots, weight).

    near: of each, the plots in its gate with their squared distances. clusters: (n,), (m,) of tracks and plots.
    """

    tracks: list[int]
    sets: list[list[tuple[list[int], float]]]
    near: list[dict[int, float]]
    due: Array
    plots: list[int]
    expected: Expected
    established: Array
    pool: Array
    clusters: tuple[Array, Array]

    def answer(self) -> Association:
        every = [one for each in self.sets for one in each]
        hypotheses = Hypotheses(
            offsets(len(each) for each in self.sets),
            offsets(len(plots) for plots, _ in every),
            np.array([plot for plots, _ in every for plot in plots], np.int32),
            np.log([weight for _, weight in every]),
        )
        pairs = [(plot, squared) for each in self.near for plot, squared in each.items()]
        pair, squared = np.array([one[0] for one in pairs], np.int32), np.array([one[1] for one in pairs], float)
        none = np.zeros(0, np.int32)
        return Association(hypotheses, offsets(len(each) for each in self.near), pair, squared, squared, none)

    def resolve(self) -> Decided:
        tracks, plots = np.array(self.tracks, np.int64), np.array(self.plots, np.int32)
        asked = Asked(tracks, self.due, plots, 100 + tracks.astype(np.int32), 200 + plots)
        clusters = Clusters(*(one.astype(np.int32) for one in self.clusters), np.zeros(9, np.int64), 8)
        made = resolve(self.answer(), asked, clusters, self.expected, self.established, self.pool, MARGIN, CENTROID_SD)
        assert made.mark.tolist() == (100 + made.track).tolist()
        assert made.left_mark.tolist() == (200 + made.left).tolist()
        return made


def offsets(counts: Any) -> Array:
    return np.cumsum([0, *counts]).astype(np.int32)


def case(
    places: Any, plots: Any, *, sets: Any, near: Any = None, due: Any = True, extent: Any = (0.0, 0.0, 0.0),
    established: Any = True, tracks: Any = None, asked: Any = None, cells: Any = 5,
) -> Case:  # fmt: skip
    """Tracks that stand at these places, known to a metre, and plots of 3 m at others."""
    n, m = len(places), len(plots)
    state = np.zeros((n, 4))
    state[:, :2] = np.reshape(places, (n, 2))
    expected = Expected(
        np.zeros(n), state, np.tile(np.eye(4), (n, 1, 1)), np.ones(n), np.tile(np.array(extent, float), (n, 1)),
        np.zeros(n), np.arange(n), np.zeros(n),
    )  # fmt: skip
    pool = np.zeros(m, POOL)
    pool["position"], pool["noise"], pool["extent"] = np.reshape(plots, (m, 2)), np.eye(2), (3.0, 3.0, 0.0)
    pool["cells"] = cells
    sets = [[(one, 1.0)] if not one or isinstance(one[0], int) else one for one in sets]
    near = near or [{plot: 1.0 for plots, _ in each for plot in plots} for each in sets]
    return Case(
        list(range(n)) if tracks is None else tracks, sets, near, np.broadcast_to(due, (n,)).copy(),
        list(range(m)) if asked is None else asked, expected, np.broadcast_to(established, (n,)).copy(), pool,
        (np.zeros(n, np.int32), np.zeros(m, np.int32)),
    )  # fmt: skip


def hypotheses_of(made: Decided) -> list[list[tuple[list[int], float]]]:
    sets = [made.plot[a:b].tolist() for a, b in zip(made.plot_first[:-1], made.plot_first[1:], strict=True)]
    each = list(zip(sets, np.exp(made.log_weight).tolist(), strict=True))
    return [each[a:b] for a, b in zip(made.track_first[:-1], made.track_first[1:], strict=True)]


def test_due_tracks_take_theirs_and_what_nobody_takes_is_left() -> None:
    one = case([(0, 0), (500, 0)], [(1, 0), (501, 0), (900, 0)], sets=[[0], [1]], near=[{0: 2.5}, {1: 3.5}])
    made = one.resolve()
    assert hypotheses_of(made) == [[([0], 1.0)], [([1], 1.0)]]
    assert (made.track.tolist(), made.hit.tolist(), made.squared.tolist()) == ([0, 1], [0, 1], [2.5, 3.5])
    assert (made.left.tolist(), made.absorbed) == ([2], 0)
    assert one.pool["spent"].tolist() == [True, True, True]


def test_what_a_track_that_is_not_due_may_still_take_waits_for_it() -> None:
    one = case(
        [(0, 0), (500, 0)], [(1, 0), (501, 0), (502, 0)], sets=[[0], [1]], near=[{0: 1.0}, {0: 9.0, 1: 1.0, 2: 2.0}],
        due=[True, False],
    )  # fmt: skip
    made = one.resolve()
    assert (made.track.tolist(), made.left.tolist()) == ([0], [])
    assert one.pool["spent"].tolist() == [True, False, False]  # but what one that is due takes is taken


def test_a_track_without_a_plot_has_missed() -> None:
    made = case([(0, 0)], [], sets=[[]]).resolve()
    assert hypotheses_of(made) == [[([], 1.0)]]
    assert made.hit.tolist() == [-1]
    assert np.isnan(made.squared).all()


def test_a_plot_within_the_extent_of_a_track_is_part_of_its_echo() -> None:
    one = case([(0, 0)], [(0, -10), (0, 12), (60, 0)], sets=[[0]], extent=(40.0, 30.0, 0.0), cells=[3, 1, 1])
    made = one.resolve()
    assert (hypotheses_of(made), made.absorbed, made.left.tolist()) == ([[([0], 1.0)]], 1, [2])
    np.testing.assert_allclose(one.pool["position"][0], [0.0, -4.5])
    np.testing.assert_allclose(one.pool["extent"][0], [25.0, 3.0, 0.0])


def test_a_track_that_missed_takes_what_lies_within_its_extent() -> None:
    one = case([(0, 0)], [(0, -10), (0, 12)], sets=[[]], near=[{}], extent=(40.0, 30.0, 0.0))
    made = one.resolve()
    assert (hypotheses_of(made), made.hit.tolist(), made.absorbed) == ([[([0], 1.0)]], [0], 2)
    assert np.isnan(made.squared).all()
    np.testing.assert_allclose(one.pool["position"][0], [0.0, 1.0])


@pytest.mark.parametrize(("weight", "left"), [(0.6, []), (0.4, [0])])
def test_a_plot_taken_in_the_lesser_part_of_the_hypotheses_begins_a_track(weight: float, left: list[int]) -> None:
    made = case([(0, 0)], [(9, 0)], sets=[[([0], weight), ([], 1 - weight)]], established=False).resolve()
    assert made.left.tolist() == left
    assert made.hit.tolist() == ([0] if weight > 0.5 else [-1])


def slow_twin(one: Case) -> tuple[list[Any], list[int], Array, int]:
    """Hypotheses, hits and squared distances of the tracks that are due; plots left; pool; plots absorbed."""
    pool, expected = one.pool.copy(), one.expected
    used = dict.fromkeys(one.plots, 0.0)
    for row, each in zip(one.tracks, one.sets, strict=True):
        for plots, weight in each if one.due[row] else []:
            for plot in plots:
                used[plot] += weight
    contested = {plot for row, near in zip(one.tracks, one.near, strict=True) if not one.due[row] for plot in near}
    owner, left = {}, []
    for plot in one.plots:
        if used[plot] >= 0.5 or plot not in contested:
            pool["spent"][plot] = True
            add_centroid_noise(pool["extent"][plot], CENTROID_SD, pool["noise"][plot])
        if used[plot] < 0.5 and plot not in contested:
            record = pool[plot]
            near = one.established & (one.clusters[0] == one.clusters[1][plot])
            owner[plot] = enclosing_track(
                np.array(one.tracks, np.int64), near, expected.time, expected.mean, expected.covariance,
                expected.extent, record["time"], record["position"], record["noise"], record["extent"][0], MARGIN,
            )  # fmt: skip
            if owner[plot] < 0:
                left.append(plot)
    made = []
    for k, row in enumerate(one.tracks):
        if not one.due[row]:
            continue
        mine, sets = [plot for plot in one.plots if owner.get(plot, -1) == k], []
        missed = not one.sets[k][0][0]
        for number, (plots, weight) in enumerate(one.sets[k]):
            took = list(plots)
            if missed and mine and number == 0:
                took = [mine[0]]
                mine = mine[1:]
            if len(took) == 1 and mine:
                join_split_plots(
                    np.array(took + mine, np.int32), pool["position"].copy(), pool["cells"], pool["extent"].copy(),
                    expected.extent[row, 2], pool["position"][took[0]], pool["extent"][took[0]],
                )  # fmt: skip
            sets.append((took, weight))
        best = max(sets, key=lambda each: each[1])[0]
        hit = best[0] if best else -1
        made.append((row, sets, hit, one.near[k].get(hit, np.nan)))
    return made, left, pool, sum(place >= 0 for place in owner.values())


def anything(seed: int) -> Case:
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 6)), int(rng.integers(0, 9))
    tracks = rng.permutation(n)[: rng.integers(1, n + 1)].tolist()
    asked = sorted(rng.permutation(m)[: rng.integers(0, m + 1)].tolist())
    free, near, sets = list(asked), [], []
    for _ in tracks:
        near.append({plot: float(rng.uniform(0, 13)) for plot in asked if rng.random() < 0.4})
        choice = [plot for plot in near[-1] if plot in free]
        mine = [([plot] if plot is not None else []) for plot in [*choice[: rng.integers(0, 2)]] or [None]]
        if rng.random() < 0.4:
            mine.append(choice[1:3] if rng.random() < 0.5 else [])
        free = [plot for plot in free if not any(plot in plots for plots in mine)]
        weight = rng.dirichlet(np.ones(len(mine)))
        sets.append([(plots, float(share)) for plots, share in zip(mine, weight, strict=True)])
    made = case(
        rng.uniform(-60, 60, (n, 2)), rng.uniform(-60, 60, (m, 2)), sets=sets, near=near, due=rng.random(n) < 0.7,
        established=rng.random(n) < 0.7, tracks=tracks, asked=asked, cells=rng.integers(1, 30, m),
    )  # fmt: skip
    for column in made.clusters:
        column[:] = rng.integers(0, 3, len(column))
    made.expected.extent[:] = np.column_stack([rng.uniform(0, 60, (n, 2)), rng.uniform(0, np.pi, n)])
    return made


@settings(deadline=None, derandomize=True, max_examples=200)
@given(st.integers(0, 2**32 - 1))
def test_any_answer_is_resolved_as_by_the_slow_twin(seed: int) -> None:
    one = anything(seed)
    expected, left, pool, absorbed = slow_twin(one)
    made = one.resolve()
    assert (made.left.tolist(), made.absorbed) == (left, absorbed)
    assert made.track.tolist() == [row for row, *_ in expected]
    assert made.hit.tolist() == [hit for _, _, hit, _ in expected]
    np.testing.assert_allclose(made.squared, [squared for *_, squared in expected])
    for mine, (_, sets, *_) in zip(hypotheses_of(made), expected, strict=True):
        assert [plots for plots, _ in mine] == [plots for plots, _ in sets]
        np.testing.assert_allclose([weight for _, weight in mine], [weight for _, weight in sets])
    assert one.pool["spent"].tolist() == pool["spent"].tolist()
    for name in ("position", "extent", "noise"):
        np.testing.assert_allclose(one.pool[name], pool[name], atol=1e-9)


def test_what_was_decided_of_several_clusters_is_in_order_of_marks_and_rows() -> None:
    def one(track: list[int], mark: list[int], plots: list[list[int]], left: list[int], absorbed: int) -> Decided:
        return Decided(
            np.array(track), np.array(mark, np.int32), offsets([1] * len(track)), offsets(len(each) for each in plots),
            np.array([plot for each in plots for plot in each], np.int32), -np.array(track, float),
            np.array(left, np.int32), np.array([4 - plot for plot in left], np.int32),
            np.array([each[0] if each else -1 for each in plots], np.int32), 0.5 * np.array(track), absorbed,
        )  # fmt: skip

    made = together([one([2, 5], [3, 0], [[7], []], [1, 3], 1), one([4, 6], [0, 3], [[8, 9], [2]], [0], 2)])
    assert made.track.tolist() == [4, 5, 2, 6]
    assert made.mark.tolist() == [0, 0, 3, 3]
    assert [plots for each in hypotheses_of(made) for plots, _ in each] == [[8, 9], [], [7], [2]]
    assert made.log_weight.tolist() == [-4.0, -5.0, -2.0, -6.0]
    assert made.hit.tolist() == [8, -1, 7, 2]
    assert made.squared.tolist() == [2.0, 2.5, 1.0, 3.0]
    assert (made.left.tolist(), made.left_mark.tolist(), made.absorbed) == ([3, 1, 0], [1, 3, 4], 3)
