from __future__ import annotations

import numpy as np
import pytest
from filterpy.common import Q_continuous_white_noise
from filterpy.kalman import KalmanFilter
from scipy.stats import chi2

from pipeline.filter.kalman import Kalman
from tests.pipeline.contracts.track import FilterContract, spread

CONSTANT = Kalman(still_sd=1.3, along_sd=1e-12, across_sd=1e-12, turn_rate=1e-12)
"""The same noise in every direction at every speed."""


def transition(dt: float) -> np.ndarray:
    made = np.eye(4)
    made[0, 2] = made[1, 3] = dt
    return made


def filterpy_noise(part: Kalman, velocity: np.ndarray, dt: float) -> np.ndarray:
    """filterpy's matrix along and across the course, turned."""
    speed = np.hypot(*velocity)
    along = (part.still_sd + part.along_sd * min(speed / part.full_speed, 1)) ** 2
    across = (part.still_sd + min(part.turn_rate * speed, part.across_sd)) ** 2
    s, c = velocity / speed
    turn = np.kron(np.eye(2), np.array([[s, c], [c, -s]]))  # columns: along, across
    q = np.zeros((4, 4))
    for axis, density in enumerate((along, across)):
        q[axis::2, axis::2] = Q_continuous_white_noise(2, dt, density)
    return turn @ q @ turn.T


class TestKalmanContract(FilterContract):
    part = Kalman()


@pytest.mark.parametrize("part", [CONSTANT, Kalman()])
def test_thirty_turns_as_filterpy_does_them(part: Kalman) -> None:
    rng = np.random.default_rng(7)
    n = 20
    state, cov = rng.normal(0, 15, (n, 4)), spread(rng, n, 4)
    oracles = []
    for k in range(n):
        one = KalmanFilter(dim_x=4, dim_z=2)
        one.x, one.P, one.H = state[k].copy(), cov[k].copy(), np.eye(2, 4)
        oracles.append(one)
    for _ in range(30):
        dt, z, r = rng.uniform(0, 3, n), rng.normal(0, 15, (n, 2)), spread(rng, n, 2)
        for k, one in enumerate(oracles):
            one.predict(F=transition(dt[k]), Q=filterpy_noise(part, one.x[2:], dt[k]))
            one.update(z[k], R=r[k])
        state, cov, nis = part.update(state, cov, dt, z, r)
        np.testing.assert_allclose(state, [one.x for one in oracles], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(cov, [one.P for one in oracles], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(nis, [one.y @ np.linalg.inv(one.S) @ one.y for one in oracles], rtol=1e-8)


def test_two_steps_are_one_step() -> None:
    rng = np.random.default_rng(1)
    state, cov = rng.normal(0, 10, (10, 4)), spread(rng, 10, 4)
    once = CONSTANT.predict(state, cov, np.full(10, 1.0))
    twice = CONSTANT.predict(*CONSTANT.predict(state, cov, np.full(10, 0.3)), np.full(10, 0.7))
    for a, b in zip(once, twice, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-10, atol=1e-12)


def test_an_old_measurement_is_compared_with_the_state_looked_back() -> None:
    rng = np.random.default_rng(2)
    state, cov, r = rng.normal(0, 10, (9, 4)), spread(rng, 9, 4), spread(rng, 9, 2)
    z, dt = rng.normal(0, 10, (9, 2)), -rng.uniform(0.1, 2, 9)
    got_state, got_cov, _ = CONSTANT.update(state, cov, dt, z, r)
    for k in range(9):
        h = np.eye(2, 4) @ transition(dt[k])
        q = (transition(dt[k]) @ Q(-dt[k]) @ transition(dt[k]).T)[:2, :2]
        gain = cov[k] @ h.T @ np.linalg.inv(h @ cov[k] @ h.T + q + r[k])
        np.testing.assert_allclose(got_state[k], state[k] + gain @ (z[k] - h @ state[k]), rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(got_cov[k], cov[k] - gain @ h @ cov[k], rtol=1e-9, atol=1e-9)


def Q(dt: float) -> np.ndarray:  # noqa: N802
    return Q_continuous_white_noise(2, dt, CONSTANT.still_sd**2, block_size=2, order_by_dim=True)[
        np.ix_([0, 2, 1, 3], [0, 2, 1, 3])
    ]


def test_errors_are_as_large_as_the_filter_says() -> None:
    """NEES and NIS over 300 runs of the model itself lie in their two-sided 99.9 % bounds at the last turn."""
    rng = np.random.default_rng(11)
    n, turns, r = 300, 40, 9.0
    truth = rng.normal(0, 10, (n, 4))
    state, cov = truth + rng.normal(0, 1, (n, 4)) * [3, 3, 2, 2], np.tile(np.diag([9.0, 9, 4, 4]), (n, 1, 1))
    root = np.linalg.cholesky(Q(1.0))
    over = []
    for _ in range(turns):
        truth = truth @ transition(1.0).T + rng.normal(size=(n, 4)) @ root.T
        z = truth[:, :2] + rng.normal(0, np.sqrt(r), (n, 2))
        state, cov, nis = CONSTANT.update(state, cov, np.ones(n), z, np.tile(r * np.eye(2), (n, 1, 1)))
        over.append(nis)
    off = state - truth
    nees = np.einsum("ni,nij,nj->n", off, np.linalg.inv(cov), off)
    low, high = chi2.ppf([0.0005, 0.9995], 4 * n) / n
    assert low < nees.mean() < high
    low, high = chi2.ppf([0.0005, 0.9995], 2 * n * turns) / (n * turns)
    assert low < np.mean(over) < high


@pytest.mark.parametrize("word", ["still_sd", "along_sd", "full_speed"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan")])
def test_settings_out_of_bounds(word: str, value: float) -> None:
    with pytest.raises(ValueError, match=word):
        Kalman(**{word: value})
