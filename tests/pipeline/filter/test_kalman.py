from __future__ import annotations

import numpy as np
import pytest
from filterpy.common import Q_continuous_white_noise
from filterpy.kalman import KalmanFilter
from scipy.stats import chi2

from pipeline.contracts.filter import Innovations
from pipeline.contracts.measured import Hypotheses, Measured
from pipeline.filter.kalman import Kalman, mixture
from tests.pipeline.contracts.filter import FilterContract
from tests.pipeline.contracts.rows import TrackRows, plots_at, prior, spread

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


def holding(part: Kalman, state: np.ndarray, covariance: np.ndarray) -> TrackRows:
    """A store whose rows, in their order, hold these at time 0."""
    store = TrackRows(part, len(state))
    store.filter["state"], store.filter["covariance"], store.filter["one_point"] = state, covariance, False
    store.time[:] = 0.0
    return store


def update(part: Kalman, store: TrackRows, time: np.ndarray, z: np.ndarray, r: np.ndarray) -> Innovations:
    """Every row takes one position of its own."""
    each = np.arange(len(z))
    predicted = part.predict(store, each, time)
    return part.update(store, predicted, Measured.of(time, z, r), Hypotheses.single(each))


class TestKalmanContract(FilterContract):
    part = Kalman()


@pytest.mark.parametrize("part", [CONSTANT, Kalman()])
def test_thirty_turns_as_filterpy_does_them(part: Kalman) -> None:
    rng = np.random.default_rng(7)
    n = 20
    state, cov = rng.normal(0, 15, (n, 4)), spread(rng, n, 4)
    store, now = holding(part, state, cov), np.zeros(n)
    oracles = []
    for k in range(n):
        one = KalmanFilter(dim_x=4, dim_z=2)
        one.x, one.P, one.H = state[k].copy(), cov[k].copy(), np.eye(2, 4)
        oracles.append(one)
    for _ in range(30):
        dt, z, r = rng.uniform(0, 3, n), rng.normal(0, 15, (n, 2)), spread(rng, n, 2)
        now += dt
        for k, one in enumerate(oracles):
            one.predict(F=transition(dt[k]), Q=filterpy_noise(part, one.x[2:], dt[k]))
            one.update(z[k], R=r[k])
        predicted = part.predict(store, np.arange(n), now)
        likelihood = part.log_likelihood(predicted, Measured.of(now, z, r), np.arange(n), np.arange(n))
        nis = update(part, store, now, z, r).squared
        np.testing.assert_allclose(store.filter["state"], [one.x for one in oracles], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(store.filter["covariance"], [one.P for one in oracles], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(nis, [one.y @ np.linalg.inv(one.S) @ one.y for one in oracles], rtol=1e-8)
        np.testing.assert_allclose(likelihood, [one.log_likelihood for one in oracles], rtol=1e-8)


def test_two_steps_are_one_step() -> None:
    rng = np.random.default_rng(1)
    state, cov = rng.normal(0, 10, (10, 4)), spread(rng, 10, 4)
    store, each = holding(CONSTANT, state, cov), np.arange(10)
    once = CONSTANT.moments(CONSTANT.predict(store, each, np.full(10, 1.0)))
    half = CONSTANT.moments(CONSTANT.predict(store, each, np.full(10, 0.3)))
    twice = CONSTANT.moments(CONSTANT.predict(holding(CONSTANT, *half), each, np.full(10, 0.7)))
    for a, b in zip(once, twice, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-10, atol=1e-12)


def test_two_point_start() -> None:
    """Bar-Shalom, Li, Kirubarajan, 5.5.3: covariances R, R / dt and (R + R) / dt^2."""
    part, row = Kalman(), np.zeros(1, np.int64)
    store = TrackRows(part, 1)
    part.start(store, row, plots_at(0.0, [5.0, 6], 2.0), prior([0.0, 0], 25.0, known=False))
    assert store.filter["state"][0].tolist() == [5, 6, 0, 0]
    z, r = np.array([[25.0, -4]]), 4 * np.eye(2)[None]
    assert np.isnan(update(part, store, np.array([2.0]), z, r).squared)
    np.testing.assert_allclose(store.filter["state"][0], [25, -4, 10, -5])
    expected = np.block([[4 * np.eye(2), 2 * np.eye(2)], [2 * np.eye(2), 2 * np.eye(2)]])
    np.testing.assert_allclose(store.filter["covariance"][0], expected)
    update(part, store, np.array([4.0]), np.array([[45.0, -4]]), r)
    assert -5 < store.filter["state"][0, 3] < 0  # the third is no two-point start


@pytest.mark.parametrize(("dt", "made"), [(0.29, False), (0.3, True)])
def test_a_second_point_too_soon_gives_no_velocity_of_its_own(dt: float, made: bool) -> None:
    part, row = Kalman(), np.zeros(1, np.int64)
    store = TrackRows(part, 1)
    part.start(store, row, plots_at(0.0, [0.0, 0], 2.0), prior([0.0, 0], 25.0, known=False))
    update(part, store, np.array([dt]), np.array([[6.0, 0]]), 4 * np.eye(2)[None])
    assert (store.filter["state"][0, 2] == pytest.approx(6.0 / dt)) == made
    assert store.filter["one_point"][0] == (not made)


def test_a_mixture_is_that_of_its_samples() -> None:
    mean, cov = mixture(np.array([[0.0, 0], [10, 0]]), np.array([np.eye(2), 4 * np.eye(2)]), np.array([0.8, 0.2]))
    assert mean.tolist() == [2.0, 0.0]
    np.testing.assert_allclose(cov, np.diag([1.6 + 0.8 * 4 + 0.2 * 64, 1.6]))


def test_an_old_measurement_is_compared_with_the_state_looked_back() -> None:
    rng = np.random.default_rng(2)
    state, cov, r = rng.normal(0, 10, (9, 4)), spread(rng, 9, 4), spread(rng, 9, 2)
    z, dt = rng.normal(0, 10, (9, 2)), -rng.uniform(0.1, 2, 9)
    store = holding(CONSTANT, state, cov)
    update(CONSTANT, store, dt, z, r)
    got_state, got_cov = store.filter["state"], store.filter["covariance"]
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
    store = holding(CONSTANT, state, cov)
    root = np.linalg.cholesky(Q(1.0))
    over = []
    for turn in range(1, turns + 1):
        truth = truth @ transition(1.0).T + rng.normal(size=(n, 4)) @ root.T
        z = truth[:, :2] + rng.normal(0, np.sqrt(r), (n, 2))
        over.append(update(CONSTANT, store, np.full(n, float(turn)), z, np.tile(r * np.eye(2), (n, 1, 1))).squared)
    off = store.filter["state"] - truth
    nees = np.einsum("ni,nij,nj->n", off, np.linalg.inv(store.filter["covariance"]), off)
    low, high = chi2.ppf([0.0005, 0.9995], 4 * n) / n
    assert low < nees.mean() < high
    low, high = chi2.ppf([0.0005, 0.9995], 2 * n * turns) / (n * turns)
    assert low < np.mean(over) < high


@pytest.mark.parametrize("word", ["still_sd", "along_sd", "full_speed", "two_point_after"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan")])
def test_settings_out_of_bounds(word: str, value: float) -> None:
    with pytest.raises(ValueError, match=word):
        Kalman(**{word: value})


def test_a_merge_that_gives_all_weight_to_the_older_row_is_that_row_at_its_own_time() -> None:
    part = Kalman()
    store = holding(part, np.array([[1.0, 2, 3, 4], [5, 6, 7, 8]]), np.array([np.eye(4), 3 * np.eye(4)]))
    store.time[:2] = 4.0, 1.0
    store.filter["one_point"][1] = True
    part.merge(store, np.array([0]), np.array([1]), np.ones(1))
    assert store.time[:2].tolist() == [1.0, 1.0]
    assert store.filter[0].tobytes() == store.filter[1].tobytes()
    assert store.filter["state"][0].tolist() == [5, 6, 7, 8]
