"""What plots and looks without one say about a track, kept apart for each sensor."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.airport.model import SurfaceKind
from pipeline.filter.kalman import Kalman
from pipeline.tables.arrays import Array
from pipeline.track.evidence import LEAST_SCORE, count_misses, score_plots
from pipeline.track.false_plots import FalsePlots
from pipeline.track.plot_pool import POOL
from pipeline.track.settings import EvidenceSettings
from pipeline.track.store import TrackStore
from tests.pipeline.track.scene import RADAR, A
from tests.pipeline.track.test_false_plots import density as density_of

RULE = EvidenceSettings()
NONE = FalsePlots.around(RADAR)
SPREAD = 9.0 * np.eye(4)


def store_of(rows: int) -> TrackStore:
    store = TrackStore(rows, 2, Kalman().columns)
    store.append(rows)
    return store


def plot(**words: Any) -> Array:
    made = np.zeros(1, POOL)
    made["covariance"], made["position"], made["cells"] = 4.0 * np.eye(2), (300.0, -400.0), 12
    made["surface"] = SurfaceKind.TAXIWAY
    for name, value in words.items():
        made[name] = value
    return made


def scored(
    pool: Array, *, squared: float = 0.0, hits: int = 99, before: float = 0.0, false_plots: FalsePlots = NONE,
    covariance: Any = SPREAD, hit: int = 0, history: int = 1,
) -> float:  # fmt: skip
    """What one look adds to the score of the second radar."""
    store = store_of(1)
    store.hits[0], store.evidence["score"][0], store.evidence["history"][0, 1] = hits, before, history
    score_plots(
        RULE, store, np.array([0]), 1, np.array([covariance]), np.array([0]), pool, np.array([hit], np.int32),
        np.array([squared]), false_plots,
    )  # fmt: skip
    others = np.delete(store.evidence["score"][0], 1)
    assert (others == before).all()
    return float(store.evidence["score"][0, 1]) - before


def log_likelihood_ratio(density: float, squared: float = 0.0, cells: float = 2.5, variance: float = 13.0) -> float:
    """Of a target that is found with 0.9 where it is expected to `variance` m^2, over false plots a m^2 and turn."""
    return math.log(0.9 / (2 * math.pi * variance * density)) - 0.5 * squared + cells


def test_a_plot_adds_the_logarithm_of_its_likelihood_ratio() -> None:
    assert scored(plot()) == pytest.approx(log_likelihood_ratio(1e-6))
    assert scored(plot(), squared=6.0) == pytest.approx(log_likelihood_ratio(1e-6, 6.0))
    assert scored(plot(), squared=np.nan) == pytest.approx(log_likelihood_ratio(1e-6, 2.0))
    oblique = 9.0 * np.eye(4)
    oblique[0, 1] = oblique[1, 0] = 5.0
    assert scored(plot(), covariance=oblique) == pytest.approx(log_likelihood_ratio(1e-6, variance=12.0))


@pytest.mark.parametrize(("cells", "adds"), [(0, -2.0), (1, -2.0), (2, 0.5), (3, 1.5), (4, 2.5), (90, 2.5)])
def test_small_plots_say_less(cells: int, adds: float) -> None:
    assert scored(plot(cells=cells)) == pytest.approx(log_likelihood_ratio(1e-6, cells=adds))


@pytest.mark.parametrize(
    ("kind", "density"),
    [
        (SurfaceKind.RUNWAY, 1e-6), (SurfaceKind.TAXIWAY, 1e-6), (SurfaceKind.APRON, 1e-6), (SurfaceKind.ROAD, 1e-6),
        (SurfaceKind.GRASS, 2e-5), (SurfaceKind.BUILDING, 2e-5),
    ],
)  # fmt: skip
def test_off_the_pavement_false_plots_are_more(kind: SurfaceKind, density: float) -> None:
    assert scored(plot(surface=kind)) == pytest.approx(log_likelihood_ratio(density))


def test_off_the_pavement_what_was_learnt_of_the_place_counts() -> None:
    learnt = FalsePlots.around(RADAR)
    for turn in range(40):
        learnt.turn(turn * A, A)
        learnt.learn(np.array([[300.0, -400.0, 1.0]]))
    density = float(density_of(learnt, np.array([[300.0, -400.0]]))[0])
    assert density > 1e-3
    grass = plot(surface=SurfaceKind.GRASS)
    assert scored(grass, false_plots=learnt) == pytest.approx(log_likelihood_ratio(density))
    assert scored(plot(), false_plots=learnt) == pytest.approx(log_likelihood_ratio(1e-6))


def test_a_score_is_bounded_by_how_often_the_target_was_seen() -> None:
    assert scored(plot(), before=15.0) == pytest.approx(5.0)
    assert scored(plot(), before=15.0, hits=15) == pytest.approx(3.0)
    assert scored(plot(), before=19.0, hits=5) == 0.0  # but it does not fall for that


@pytest.mark.parametrize(("before", "adds"), [(0.0, math.log(0.1)), (LEAST_SCORE + 1.0, -1.0), (LEAST_SCORE, 0.0)])
def test_a_look_without_a_plot_costs_down_to_the_least_score(before: float, adds: float) -> None:
    assert scored(plot(), hit=-1, before=before) == pytest.approx(adds)


def test_a_radar_that_has_not_seen_the_target_says_nothing_by_not_seeing_it() -> None:
    assert scored(plot(), hit=-1, history=0) == 0.0
    assert scored(plot(), history=0) == pytest.approx(log_likelihood_ratio(1e-6))


def missed(words: dict[str, Any], time: float = 100.0, hit: int = -1) -> Array:
    """The evidence of the second radar after a look at that time of a track seen two looks before."""
    store = store_of(1)
    store.updated[0] = 99.0
    store.evidence["history"][0], store.evidence["looks"][0] = 0b101, 3
    for name, value in words.items():
        getattr(store, name)[0] = value
    count_misses(store, np.array([0]), np.array([hit], np.int32), 1, np.array([time]), 0.5, 50.0)
    for other in (0, 2, 3):
        assert store.evidence[0, other].tolist()[:3] == (0b101, 3, 0)
    made: Array = store.evidence[0, 1]
    return made


MISSED, NOT_ASKED = (0b1010, 4, 1), (0b101, 3, 0)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ({}, MISSED),
        ({"on_ground": False}, NOT_ASKED),
        ({"altitude": 49.0}, MISSED),
        ({"altitude": 51.0}, NOT_ASKED),
        ({"updated": 100.4}, MISSED),
        ({"updated": 100.6}, NOT_ASKED),
    ],
)
def test_a_look_that_found_nothing_is_a_miss_of_what_the_radar_could_see(words: Any, expected: Any) -> None:
    one = missed(words)
    assert (int(one["history"]), int(one["looks"]), int(one["misses"])) == expected


def test_a_look_that_found_something_is_no_miss() -> None:
    one = missed({}, hit=0)
    assert (int(one["history"]), int(one["looks"]), int(one["misses"])) == NOT_ASKED


@settings(deadline=None, derandomize=True, max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_many_tracks_are_scored_as_each_alone(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, m = 6, 9
    pool = np.concatenate([plot(cells=int(rng.integers(1, 6)), surface=int(rng.integers(0, 7))) for _ in range(m)])
    origin, hit = rng.permutation(8)[:n], rng.integers(-1, m, n).astype(np.int32)
    root = rng.uniform(-3, 3, (8, 4, 4))
    covariance, squared = root @ root.transpose(0, 2, 1) + np.eye(4), rng.uniform(0, 13, n)
    store, rows = store_of(12), rng.permutation(12)[:n]
    store.hits[:] = rng.integers(1, 40, 12)
    store.evidence["history"][:] = 1
    store.evidence["score"][:, 1] = before = rng.uniform(-9, 19, 12)
    score_plots(RULE, store, rows, 1, covariance, origin, pool, hit, squared, NONE)
    for k, row in enumerate(rows):
        alone = scored(
            pool, squared=squared[k], hits=int(store.hits[row]), before=float(before[row]), hit=int(hit[k]),
            covariance=covariance[origin[k]],
        )  # fmt: skip
        assert store.evidence["score"][row, 1] == pytest.approx(before[row] + alone)
    rest = np.setdiff1d(np.arange(12), rows)
    np.testing.assert_array_equal(store.evidence["score"][rest, 1], before[rest])
