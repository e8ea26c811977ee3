from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from pipeline.associate.gnn import GlobalNearestNeighbour
from pipeline.contracts.associate import Association, Expected
from pipeline.contracts.measured import Measured
from pipeline.kernels.assignment import assign_sparse
from tests.pipeline.contracts.associate import AssociateContract, expected, expected_at, measured
from tests.pipeline.contracts.rows import plots_at

PART = GlobalNearestNeighbour()


def slow_costs(tracks: Expected, plots: Measured) -> np.ndarray:
    """Every pair by itself, without a grid; inf outside the gate."""
    made = np.full((len(tracks.time), len(plots.time)), np.inf)
    for i in range(len(tracks.time)):
        for j in range(len(plots.time)):
            dt = plots.time[j] - tracks.time[i]
            off = plots.position[j] - tracks.mean[i, :2] - dt * tracks.mean[i, 2:]
            length, width, heading = tracks.extent[i]
            turn = np.array([[np.sin(heading), np.cos(heading)], [np.cos(heading), -np.sin(heading)]])
            wander = turn @ np.diag([(PART.extent_sd * length) ** 2, (PART.extent_sd * width) ** 2]) @ turn.T
            s = tracks.covariance[i, :2, :2] + plots.noise[j] + wander
            d2 = off @ np.linalg.solve(s, off)
            if d2 <= PART.gate and abs(dt) <= tracks.window[i] and np.hypot(*off) <= PART.max_gate_m:
                made[i, j] = d2 + np.log(np.linalg.det(s)) - PART.log_likelihood_ratio + tracks.penalty[i]
    return made


def best_sum(cost: np.ndarray) -> float:
    """scipy's optimum, each row with a private column of cost 0."""
    n, m = cost.shape
    square = np.full((n, m + n), 1e7)
    square[:, :m] = np.where(np.isfinite(cost), cost, 1e7)
    square[np.arange(n), m + np.arange(n)] = 0.0
    rows, columns = linear_sum_assignment(square)
    return float(square[rows, columns].sum())


class TestGlobalNearestNeighbourContract(AssociateContract):
    part = PART


def taken(answer: Association) -> np.ndarray:
    """The measurement of each track, -1 for none; it makes one hypothesis of each, of one measurement at most."""
    one, n = answer.hypotheses, len(answer.hypotheses.track_first) - 1
    assert one.track_first.tolist() == list(range(n + 1))
    assert set(np.diff(one.plot_first).tolist()) <= {0, 1}
    assert one.log_weight.tolist() == [0.0] * n
    made = np.full(n, -1)
    made[np.diff(one.plot_first) == 1] = one.plot
    return made


def answered(tracks: Expected, plots: Measured) -> list[int]:
    return taken(PART(tracks, plots, np.arange(len(tracks.time)), np.arange(len(plots.time)))).tolist()


@pytest.mark.parametrize("seed", range(8))
def test_the_grid_finds_what_the_slow_twin_finds_and_the_sum_is_the_least(seed: int) -> None:
    """Among a part of the tracks and plots, in any order."""
    rng = np.random.default_rng(seed)
    half = [150.0, 600.0, 5000.0, 40.0][seed % 4]
    tracks, plots = expected(rng, 60, half), measured(rng, 80, half)
    tracks = tracks._replace(penalty=rng.choice([0.0, 3.0], 60))
    plots.position[:40] = tracks.mean[:40, :2] + rng.normal(0, 10.0, (40, 2))  # else far apart over a large area
    asked, among = rng.permutation(60)[:40], rng.permutation(80)[:60]
    slow = slow_costs(tracks, plots)[asked]
    slow[:, np.setdiff1d(np.arange(80), among)] = np.inf
    answer = PART(tracks, plots, asked, among)
    fast, squared = np.full(slow.shape, np.inf), np.full(slow.shape, np.nan)
    for i in range(40):
        own = slice(answer.first[i], answer.first[i + 1])
        fast[i, answer.pair[own]], squared[i, answer.pair[own]] = answer.cost[own], answer.squared[own]
    np.testing.assert_allclose(fast, slow, rtol=1e-9, atol=1e-9)
    assert (squared[np.isfinite(slow)] >= 0).all()
    assert (answer.squared <= PART.gate).all()
    assert len(answer.pair) > 5
    chosen = taken(answer)
    hit = chosen >= 0
    assert slow[hit, chosen[hit]].sum() == pytest.approx(best_sum(slow), abs=1e-6)


def test_the_squared_distance_is_that_of_mahalanobis() -> None:
    answer = PART(expected_at([[0.0, 0, 2, 0]], 2.0), plots_at(10.5, [4.0, 4.0], 1.0), np.arange(1), np.arange(1))
    assert answer.squared[0] == pytest.approx((3**2 + 4**2) / (4 + 1))
    assert answer.cost[0] == pytest.approx(25 / 5 + np.log(25) - PART.log_likelihood_ratio)


def test_more_plots_in_gates_than_were_reckoned_with() -> None:
    rng = np.random.default_rng(3)
    answer = PART(
        expected_at(np.zeros((2, 4))), plots_at(10.0, rng.normal(0, 0.5, (90, 2))), np.arange(2), np.arange(90)
    )
    assert answer.first.tolist() == [0, 90, 180]
    assert sorted(answer.pair[90:].tolist()) == list(range(90))


@given(st.data())
@settings(max_examples=150, deadline=None)
def test_assignment_is_as_good_as_scipys(data: st.DataObject) -> None:
    n, m = data.draw(st.integers(1, 12)), data.draw(st.integers(1, 12))
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
    cost = np.where(rng.random((n, m)) < data.draw(st.floats(0, 1)), rng.integers(-9, 5, (n, m)), np.inf)
    first = np.r_[0, np.cumsum(np.isfinite(cost).sum(axis=1))].astype(np.int32)
    chosen = np.empty(n, np.int32)
    assign_sparse(first, np.nonzero(np.isfinite(cost))[1].astype(np.int32), cost[np.isfinite(cost)], m, chosen)
    hit = np.flatnonzero(chosen >= 0)
    assert len(set(chosen[hit].tolist())) == len(hit)
    assert cost[hit, chosen[hit]].sum() == pytest.approx(best_sum(cost))


def test_the_pair_that_is_best_for_all_wins_over_the_nearest() -> None:
    """The plot nearest to one track is left to the other, which has no second choice."""
    tracks = expected_at([[0.0, 0, 0, 0], [8.0, 0, 0, 0]], 2.0)
    assert answered(tracks, plots_at(10.0, [[1.0, 0], [-6.0, 0]], 2.0)) == [1, 0]


@pytest.mark.parametrize("extent_sd", [0.0, 1.0])
def test_settings_at_their_bounds_are_taken(extent_sd: float) -> None:
    assert GlobalNearestNeighbour(extent_sd=extent_sd).extent_sd == extent_sd


@pytest.mark.parametrize(
    "word", [{"gate": 0.0}, {"detection": 1.0}, {"extent_sd": -0.1}, {"new_density": float("nan")}]
)
def test_settings_out_of_bounds(word: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(word))):
        GlobalNearestNeighbour(**word)
