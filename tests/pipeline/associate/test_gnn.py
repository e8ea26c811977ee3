from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from pipeline.associate.gnn import GlobalNearestNeighbour
from pipeline.contracts.associate import Expected, Measured
from pipeline.kernels.assignment import assign_sparse
from tests.pipeline.contracts.track import AssociateContract, expected, measured

PART = GlobalNearestNeighbour()


def slow_costs(tracks: Expected, plots: Measured) -> np.ndarray:
    """Every pair by itself, without a grid; inf outside the gate."""
    made = np.full((len(tracks.time), len(plots.time)), np.inf)
    for i in range(len(tracks.time)):
        for j in range(len(plots.time)):
            dt = plots.time[j] - tracks.time[i]
            off = plots.position[j] - tracks.state[i, :2] - dt * tracks.state[i, 2:]
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


@pytest.mark.parametrize("seed", range(8))
def test_the_grid_finds_what_the_slow_twin_finds_and_the_sum_is_the_least(seed: int) -> None:
    rng = np.random.default_rng(seed)
    half = [150.0, 600.0, 5000.0, 40.0][seed % 4]
    tracks, plots = expected(rng, 40, half), measured(rng, 60, half)
    slow = slow_costs(tracks, plots)
    answer = PART(tracks, plots)
    fast = np.full(slow.shape, np.inf)
    for i in range(40):
        fast[i, answer.pair[answer.first[i] : answer.first[i + 1]]] = answer.cost[answer.first[i] : answer.first[i + 1]]
    np.testing.assert_allclose(fast, slow, rtol=1e-9, atol=1e-9)
    hit = answer.measurement >= 0
    assert slow[hit, answer.measurement[hit]].sum() == pytest.approx(best_sum(slow), abs=1e-6)


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
    state = np.array([[0.0, 0, 0, 0], [8.0, 0, 0, 0]])
    tracks = Expected(np.zeros(2), state, np.tile(4 * np.eye(4), (2, 1, 1)), np.ones(2), np.zeros((2, 3)), np.zeros(2))
    plots = Measured(np.zeros(2), np.array([[1.0, 0], [-6.0, 0]]), np.tile(4 * np.eye(2), (2, 1, 1)))
    assert PART(tracks, plots).measurement.tolist() == [1, 0]


def test_a_penalty_makes_a_track_give_way() -> None:
    tracks = expected(np.random.default_rng(0), 2)
    place = np.zeros((2, 4))
    both = Expected(
        np.zeros(2), place, np.tile(9 * np.eye(4), (2, 1, 1)), np.ones(2), tracks.extent * 0, np.array([6.0, 0])
    )
    plot = Measured(np.zeros(1), np.array([[0.0, 1.0]]), 4 * np.eye(2)[None])
    assert PART(both, plot).measurement.tolist() == [-1, 0]


@pytest.mark.parametrize(
    "word", [{"gate": 0.0}, {"detection": 1.0}, {"extent_sd": -0.1}, {"new_density": float("nan")}]
)
def test_settings_out_of_bounds(word: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(word))):
        GlobalNearestNeighbour(**word)
