"""What every filter has to keep to; the test of a new one inherits the suite and sets `part`.

Only the contract is used: a filter may have a state of any size, and more than one of them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pipeline.contracts.filter import FilterPart, Moments
from pipeline.contracts.measured import Hypotheses, Measured
from tests.pipeline.contracts.rows import T0, TrackRows, on_ground, plots_at, prior, sets, spread

STEPS = [-2.0, -0.3, 0.0, 0.03, 1.0, 20.0]
"""s"""


def random_plots(rng: np.random.Generator, time: Any, centre: Any, sd: float = 3.0) -> Measured:
    """Measurements around places (m, 2); every other one knows its altitude."""
    m = len(centre)
    position = centre + rng.normal(0, sd, (m, 2))
    altitude = np.where(np.arange(m) % 2 == 0, rng.normal(40, 5, m), np.nan)
    return Measured.of(np.broadcast_to(time, m).copy(), position, 3 * spread(rng, m, 2), altitude=altitude)


class FilterContract:
    part: FilterPart

    def begun(self, n: int, seed: int = 0) -> tuple[TrackRows, np.ndarray]:
        """Every second row of a store with tracks that were measured three times, the last time at T0."""
        rng = np.random.default_rng(seed)
        store, rows = TrackRows(self.part, 2 * n + 1), np.arange(1, 2 * n + 1, 2)[rng.permutation(n)]
        place, velocity = rng.uniform(-2000, 2000, (n, 2)), rng.normal(0, 10, (n, 2))
        self.part.start(store, rows, random_plots(rng, T0 - 3, place - 3 * velocity), prior(velocity, 5.0))
        for ago in (1.5, 0.0):
            plots = random_plots(rng, T0 - ago, place - ago * velocity)
            predicted = self.part.predict(store, rows, plots.time)
            self.part.update(store, predicted, plots, Hypotheses.single(np.arange(n)))
        return store, rows

    def held(self, store: TrackRows, rows: Any, time: Any = None) -> Moments:
        at = store.time[rows] if time is None else np.broadcast_to(np.asarray(time, float), len(rows)).copy()
        return self.part.moments(self.part.predict(store, np.asarray(rows), at))

    def take(self, store: TrackRows, rows: Any, plots: Measured, hypotheses: Hypotheses) -> np.ndarray:
        predicted = self.part.predict(store, np.asarray(rows), np.full(len(rows), plots.time.max()))
        return np.asarray(self.part.update(store, predicted, plots, hypotheses).squared)

    def test_no_rows(self) -> None:
        store, none, plots = TrackRows(self.part, 1), np.zeros(0, np.int64), plots_at([], [])
        before = store.image()
        self.part.start(store, none, plots, prior([], 1.0))
        predicted = self.part.predict(store, none, np.zeros(0))
        moments = self.part.moments(predicted)
        assert moments.covariance.shape == (0, moments.mean.shape[1], moments.mean.shape[1])
        assert len(self.part.log_likelihood(predicted, plots, none, none)) == 0
        assert len(self.part.update(store, predicted, plots, Hypotheses.single(none)).squared) == 0
        self.part.branch(store, none, none)
        self.part.merge(store, none, none, np.zeros(0))
        assert store.image() == before

    def test_a_start_holds_the_measurement_and_the_velocity_given(self) -> None:
        store, _ = self.begun(2)
        rng = np.random.default_rng(5)
        plots, held = (
            random_plots(rng, T0 + np.arange(3.0), rng.normal(0, 500, (3, 2))),
            prior(rng.normal(0, 9, (3, 2)), 4),
        )
        for rows in (np.array([1, 3, 4]), np.array([4, 0, 1])):  # also rows that held something
            self.part.start(store, rows, plots, held)
            assert store.time[rows].tolist() == plots.time.tolist()
            mean, cov = on_ground(self.held(store, rows))
            np.testing.assert_allclose(mean, np.c_[plots.position, held.velocity], rtol=1e-12)
            np.testing.assert_allclose(cov[:, :2, :2], plots.noise, rtol=1e-9)
            np.testing.assert_allclose(cov[:, 2:, 2:], held.covariance, rtol=1e-9)
            np.testing.assert_allclose(cov[:, :2, 2:], 0.0, atol=1e-9)

    def test_a_row_begun_anew_holds_nothing_of_before(self) -> None:
        used, rows = self.begun(2)
        fresh = TrackRows(self.part, len(used.time))
        plots = plots_at([T0 + 5, T0 + 6], [[10.0, 20], [-5, 3]])
        for store in (used, fresh):
            self.part.start(store, rows, plots, prior([[0.0, 0], [1, 2]], 25.0, known=False))
            self.take(store, rows, plots_at(T0 + 7, [[30.0, 20], [-5, 9]]), Hypotheses.single(np.arange(2)))
        assert used.filter[rows].tobytes() == fresh.filter[rows].tobytes()

    def test_two_positions_give_the_velocity_when_nothing_else_does(self) -> None:
        store, row = TrackRows(self.part, 1), np.zeros(1, np.int64)
        self.part.start(store, row, plots_at(T0, [5.0, 6]), prior([0.0, 0], 25.0, known=False))
        self.take(store, row, plots_at(T0 + 2, [25.0, -4]), Hypotheses.single(row))
        mean, cov = on_ground(self.held(store, row))
        np.testing.assert_allclose(mean[0], [25, -4, 10, -5], atol=0.2)
        assert np.sqrt(cov[0, [2, 3], [2, 3]]).max() < 3.0

    def test_a_velocity_that_rests_on_something_is_kept(self) -> None:
        store, row = TrackRows(self.part, 1), np.zeros(1, np.int64)
        self.part.start(store, row, plots_at(T0, [0.0, 0], 10.0), prior([10.0, 0], 0.1))
        self.take(store, row, plots_at(T0 + 1, [15.0, 5], 10.0), Hypotheses.single(row))
        np.testing.assert_allclose(on_ground(self.held(store, row))[0][0, 2:], [10, 0], atol=1.0)

    def test_to_predict_and_compare_changes_nothing(self) -> None:
        store, rows = self.begun(6)
        rng = np.random.default_rng(1)
        plots, time = random_plots(rng, T0 + 1, np.zeros((6, 2))), T0 + rng.uniform(-2, 3, 6)
        before = store.image(), time.copy(), rows.copy(), [one.copy() for one in plots]
        predicted = self.part.predict(store, rows, time)
        first = self.part.moments(predicted)
        self.part.log_likelihood(predicted, plots, np.arange(6), np.arange(6)[::-1].copy())
        again = self.part.moments(predicted)
        assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
        assert store.image() == before[0]
        assert np.array_equal(time, before[1])
        assert np.array_equal(rows, before[2])
        assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(plots, before[3], strict=True))
        assert np.array_equal(predicted.rows, rows)
        assert np.array_equal(predicted.time, time)

    def test_rows_do_not_mix(self) -> None:
        """Together and one by one, in any order: the same bits; the other rows of the store stay as they are."""
        (together, rows), (alone, _) = self.begun(7), self.begun(7)
        rng = np.random.default_rng(2)
        time = T0 + rng.uniform(-1, 2, 7)
        plots = random_plots(rng, time, on_ground(self.held(together, rows))[0][:, :2])
        kept = [one.copy() for one in plots]
        predicted = self.part.predict(together, rows, time)
        moments = self.part.moments(predicted)
        likelihood = self.part.log_likelihood(predicted, plots, np.arange(7), np.arange(7))
        squared = self.part.update(together, predicted, plots, Hypotheses.single(np.arange(7))).squared
        assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(plots, kept, strict=True))
        for k in rng.permutation(7):
            own = self.part.predict(alone, rows[[k]], time[[k]])
            for one, all_of_them in zip(self.part.moments(own), moments, strict=True):
                np.testing.assert_array_equal(one[0], all_of_them[k])
            assert self.part.log_likelihood(own, plots, np.array([0]), np.array([k]))[0] == likelihood[k]
            assert self.part.update(alone, own, plots, Hypotheses.single(np.array([k]))).squared[0] == squared[k]
        assert alone.image() == together.image()
        untouched = TrackRows(self.part, 15)
        others = np.setdiff1d(np.arange(15), rows)
        assert together.filter[others].tobytes() == untouched.filter[others].tobytes()

    @pytest.mark.parametrize("dt", STEPS)
    def test_covariances_stay_covariances_and_a_measurement_never_loses(self, dt: float) -> None:
        store, rows = self.begun(30)
        known, expected = self.held(store, rows), self.held(store, rows, T0 + dt)
        plots = plots_at(T0 + dt, on_ground(expected)[0][:, :2], 2.0)
        self.take(store, rows, plots, Hypotheses.single(np.arange(30)))
        updated = self.held(store, rows)
        for made in (expected.covariance, updated.covariance):
            np.testing.assert_allclose(made, made.transpose(0, 2, 1), atol=1e-9)
            assert np.linalg.eigvalsh(made).min() > 0
        before = expected if dt >= 0 else known
        sums = [np.trace(on_ground(one)[1], axis1=1, axis2=2) for one in (before, updated)]
        assert (sums[1] <= sums[0] + 1e-9).all()

    @pytest.mark.parametrize("dt", [0.5, 4.0])
    def test_time_costs_knowledge(self, dt: float) -> None:
        store, rows = self.begun(10)
        now, later = (on_ground(self.held(store, rows, T0 + ahead)) for ahead in (0.0, dt))
        np.testing.assert_allclose(later[0][:, :2], now[0][:, :2] + dt * now[0][:, 2:], atol=0.5 * dt)
        assert (np.trace(later[1], axis1=1, axis2=2) > np.trace(now[1], axis1=1, axis2=2)).all()

    def test_a_perfect_measurement_is_believed(self) -> None:
        store, rows = self.begun(1)
        place = on_ground(self.held(store, rows))[0][:, :2] + [30.0, -20]
        squared = self.take(store, rows, plots_at(T0 + 1, place, 3e-5), Hypotheses.single(np.zeros(1, np.int64)))
        np.testing.assert_allclose(on_ground(self.held(store, rows))[0][0, :2], place[0], atol=1e-3)
        assert squared[0] > 0

    @pytest.mark.parametrize(
        "miss", [sets([((), 1.0)], [((), 1.0)]), sets([((), 0.3), ((), 0.7)], [((), 1.0)]), sets([], [])]
    )
    def test_what_takes_nothing_stays_as_it_is(self, miss: Hypotheses) -> None:
        store, rows = self.begun(2)
        before = store.image()
        assert np.isnan(self.take(store, rows, plots_at(T0 + 1, [0.0, 0]), miss)).all()
        assert store.image() == before

    def test_a_miss_among_hits(self) -> None:
        store, rows = self.begun(3)
        before = store.filter[rows[1]].tobytes()
        plots = plots_at(T0 + 1, on_ground(self.held(store, rows, T0 + 1))[0][:, :2])
        squared = self.take(store, rows, plots, Hypotheses.single(np.array([2, -1, 0])))
        assert store.filter[rows[1]].tobytes() == before
        assert store.time[rows].tolist() == [T0 + 1, T0, T0 + 1]
        assert np.isnan(squared).tolist() == [False, True, False]

    def test_an_update_says_what_it_left(self) -> None:
        """Also of a row that an older measurement corrected; the moments are those at the time it now has."""
        store, rows = self.begun(4)
        plots = random_plots(np.random.default_rng(6), T0 + np.array([1.0, 2.0, -1.0]), np.zeros((3, 2)))
        predicted = self.part.predict(store, rows, np.full(4, T0 + 1.5))
        both = sets([((0,), 1.0)], [((1,), 0.4), ((0,), 0.6)], [((), 1.0)], [((2,), 1.0)])
        made = self.part.update(store, predicted, plots, both).moments
        took = [0, 1, 3]
        for left, held in zip(made, self.held(store, rows), strict=True):
            np.testing.assert_allclose(left[took], held[took], rtol=1e-9, atol=1e-9)

    def test_the_likelihood_is_the_density_of_the_next_position(self) -> None:
        """Over the plane it sums to 1, and its mean and covariance are those expected of a measurement."""
        store, rows = self.begun(2)
        predicted = self.part.predict(store, rows, np.full(2, T0 + 1.0))
        mean, cov = on_ground(self.part.moments(predicted))
        for k in range(2):
            s = cov[k, :2, :2] + 4 * np.eye(2)
            step = 8 * np.sqrt(s.diagonal()) / 60
            offset = np.stack(np.meshgrid(*(np.arange(-60, 61) * d for d in step), indexing="ij"), -1).reshape(-1, 2)
            plots = plots_at(T0 + 1, mean[k, :2] + offset, 2.0)
            each = np.arange(len(offset))
            density = np.exp(self.part.log_likelihood(predicted, plots, np.full(len(offset), k), each)) * step.prod()
            assert density.sum() == pytest.approx(1.0, abs=1e-3)
            np.testing.assert_allclose(density @ offset, 0.0, atol=1e-3)
            np.testing.assert_allclose((offset.T * density) @ offset, s, rtol=1e-2, atol=0.01 * np.trace(s))

    @pytest.mark.parametrize("dt", [-0.4, 0.4])
    def test_a_plot_beside_the_time_predicted_is_compared_at_its_own(self, dt: float) -> None:
        store, rows = self.begun(5)
        plots = plots_at(T0 + 2 + dt, on_ground(self.held(store, rows, T0 + 2 + dt))[0][:, :2] + [3.0, -2.0])
        own, near = (self.part.predict(store, rows, np.full(5, T0 + 2 + ahead)) for ahead in (dt, 0.0))
        each = np.arange(5)
        exact, made = (self.part.log_likelihood(one, plots, each, each) for one in (own, near))
        np.testing.assert_allclose(made, exact, atol=0.3)

    def test_times_of_rows(self) -> None:
        """A row has the time of its newest measurement; one that is older corrects it and leaves the time."""
        store, rows = self.begun(1)
        before = on_ground(self.held(store, rows))
        aside = on_ground(self.held(store, rows, T0 - 1))[0][:, :2] + [6.0, 0]
        self.take(store, rows, plots_at(T0 - 1, aside), Hypotheses.single(np.zeros(1, np.int64)))
        after = on_ground(self.held(store, rows))
        assert store.time[rows[0]] == T0
        assert 0.1 < after[0][0, 0] - before[0][0, 0] < 6.0
        assert np.trace(after[1][0]) < np.trace(before[1][0])
        two = plots_at([T0 + 2, T0 + 1], np.repeat(after[0][:, :2], 2, axis=0))
        self.take(store, rows, two, sets([((1, 0), 1.0)]))
        assert store.time[rows[0]] == T0 + 2

    def test_measurements_out_of_order_give_about_what_they_give_in_order(self) -> None:
        (right, rows), (wrong, _), (without, _) = self.begun(8), self.begun(8), self.begun(8)
        rng = np.random.default_rng(3)
        late, early = (random_plots(rng, T0 + t, on_ground(self.held(right, rows, T0 + t))[0][:, :2]) for t in (2, 1))
        for store, order in ((right, (early, late)), (wrong, (late, early)), (without, (late,))):
            for plots in order:
                self.take(store, rows, plots, Hypotheses.single(np.arange(8)))
        (a, p), (b, _), (c, _) = (on_ground(self.held(store, rows)) for store in (right, wrong, without))
        sd = np.sqrt(np.diagonal(p, axis1=1, axis2=2))
        assert (np.abs(a - b) <= 0.8 * sd).all()
        assert (np.abs(a - b) / sd).mean() < 0.5 * (np.abs(a - c) / sd).mean()  # nearer than had it been left out

    @pytest.mark.parametrize("ahead", [(1.0, 1.0), (1.0, 1.8)])
    def test_a_hypothesis_of_two_plots_takes_both(self, ahead: tuple[float, float]) -> None:
        (together, rows), (in_turn, _) = self.begun(4), self.begun(4)
        rng = np.random.default_rng(4)
        place = on_ground(self.held(together, rows, T0 + 1))[0][:, :2]
        plots = random_plots(rng, T0 + np.repeat(ahead, 4), np.r_[place, place])
        self.take(together, rows, plots, sets(*([((k, 4 + k), 1.0)] for k in range(4))))
        for first in (0, 4):
            self.take(in_turn, rows, plots, Hypotheses.single(first + np.arange(4)))
        assert together.time[rows].tolist() == in_turn.time[rows].tolist()
        for a, b in zip(self.held(together, rows), self.held(in_turn, rows), strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-7, atol=1e-7)

    @pytest.mark.parametrize("weights", [(0.6, 0.3, 0.1), (0.05, 0.05, 0.9)])
    def test_several_hypotheses_become_their_mixture(self, weights: tuple[float, float, float]) -> None:
        """Two plots and a miss: mean and covariance of the mixture of what each makes by itself."""
        mixed, row = self.begun(1)
        place = on_ground(self.held(mixed, row, T0 + 1))[0][0, :2]
        plots = plots_at(T0 + 1, place + np.array([[4.0, 0], [-2, -5]]))
        squared = self.take(mixed, row, plots, sets(list(zip(((0,), (1,), ()), weights, strict=True))))
        parts = []
        for plot in (0, 1, -1):
            single, _ = self.begun(1)
            found = self.take(single, row, plots, Hypotheses.single(np.array([plot])))
            parts.append((self.held(single, row, T0 + 1), found[0]))
        mean = np.array([one.mean[0] for one, _ in parts])
        off, share = mean - weights @ mean, np.array(weights)
        inner = np.einsum("k,kij->ij", share, [one.covariance[0] for one, _ in parts])
        made = self.held(mixed, row)
        assert mixed.time[row[0]] == T0 + 1
        np.testing.assert_allclose(made.mean[0], weights @ mean, rtol=1e-7, atol=1e-6)
        np.testing.assert_allclose(made.covariance[0], inner + (off.T * share) @ off, rtol=1e-5, atol=1e-5)
        np.testing.assert_allclose(squared[0], parts[int(np.argmax(weights))][1], rtol=1e-9)

    def test_a_branch_holds_the_same_and_goes_its_own_way(self) -> None:
        store, rows = self.begun(2)
        into = np.array([0, 4])
        self.part.branch(store, rows, into)
        assert store.time[into].tolist() == store.time[rows].tolist()
        for a, b in zip(self.held(store, rows, T0 + 1), self.held(store, into, T0 + 1), strict=True):
            np.testing.assert_array_equal(a, b)
        before = store.filter[rows].tobytes()
        self.take(store, into, plots_at(T0 + 1, [[0.0, 0], [0, 0]]), Hypotheses.single(np.arange(2)))
        assert store.filter[rows].tobytes() == before

    @pytest.mark.parametrize("weight", [0.0, 0.25, 1.0])
    def test_a_merge_is_the_mixture_at_the_later_time(self, weight: float) -> None:
        store, rows = self.begun(2)
        into, other = rows[:1], rows[1:]
        place = on_ground(self.held(store, other, T0 + 1))[0][:, :2]
        self.take(store, other, plots_at(T0 + 1, place), Hypotheses.single(np.zeros(1, np.int64)))
        kept = store.filter[other].tobytes(), store.time[other].tobytes()
        a, b = self.held(store, into, T0 + 1), self.held(store, other)
        self.part.merge(store, into, other, np.array([weight]))
        assert (store.filter[other].tobytes(), store.time[other].tobytes()) == kept
        made = self.held(store, into)
        assert store.time[into[0]] == T0 + 1
        off = (b.mean - a.mean)[0]
        inner = (1 - weight) * a.covariance[0] + weight * b.covariance[0]
        np.testing.assert_allclose(made.mean[0], a.mean[0] + weight * off, rtol=1e-7, atol=1e-6)
        expected = inner + weight * (1 - weight) * np.outer(off, off)
        np.testing.assert_allclose(made.covariance[0], expected, rtol=1e-6, atol=1e-4)

    def test_targets_on_straight_lines_are_followed_as_well_as_it_says(self) -> None:
        rng = np.random.default_rng(9)
        n = 25
        store, rows, each = TrackRows(self.part, n), np.arange(n), np.arange(n)
        place, velocity = rng.uniform(-3000, 3000, (n, 2)), rng.normal(0, 8, (n, 2))
        self.part.start(store, rows, plots_at(T0, place), prior(np.zeros((n, 2)), 25.0, known=False))
        for scan in range(1, 40):
            plots = plots_at(T0 + scan, place + scan * velocity + rng.normal(0, 3.0, (n, 2)), 3.0, altitude=30.0)
            self.take(store, rows, plots, Hypotheses.single(each))
        mean, cov = on_ground(self.held(store, rows))
        off = mean - np.c_[place + 39 * velocity, velocity]
        assert np.sqrt((off[:, :2] ** 2).mean()) < 3.0  # better than a single measurement
        nees = np.einsum("ni,nij,nj->n", off, np.linalg.inv(cov), off).mean()
        assert 0.3 < nees < 5.5  # 4 were the targets as agile as a filter takes them to be
