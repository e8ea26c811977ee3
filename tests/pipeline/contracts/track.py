"""What every part of a kind has to keep to; a new part's test inherits the suite of its kind and sets `part`."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pipeline.contracts.associate import AssociatePart, Expected, Measured
from pipeline.contracts.classify import ClassifyPart
from pipeline.contracts.filter import FilterPart
from pipeline.contracts.lifecycle import LifecyclePart
from pipeline.tables import TargetClass, TrackPhase


def spread(rng: np.random.Generator, n: int, dim: int) -> np.ndarray[Any, Any]:
    """Random covariances (n, dim, dim)."""
    a = rng.normal(size=(n, dim, dim))
    return a @ a.transpose(0, 2, 1) + 0.5 * np.eye(dim)


def expected(rng: np.random.Generator, n: int, half: float = 200.0) -> Expected:
    state = np.concatenate([rng.uniform(-half, half, (n, 2)), rng.normal(0, 8, (n, 2))], axis=1)
    extent = np.stack([rng.uniform(0, 60, n), rng.uniform(0, 20, n), rng.uniform(0, 6, n)], axis=1)
    return Expected(rng.uniform(10, 11, n), state, 20 * spread(rng, n, 4), np.full(n, 1.5), extent, np.zeros(n))


def measured(rng: np.random.Generator, m: int, half: float = 200.0) -> Measured:
    return Measured(rng.uniform(10, 11, m), rng.uniform(-half, half, (m, 2)), 5 * spread(rng, m, 2))


class FilterContract:
    part: FilterPart

    def test_no_rows(self) -> None:
        none = np.zeros((0, 4)), np.zeros((0, 4, 4)), np.zeros(0)
        assert len(self.part.predict(*none)[0]) == 0
        assert len(self.part.update(*none, np.zeros((0, 2)), np.zeros((0, 2, 2)))[0]) == 0

    def test_inputs_stay_as_they_are_and_rows_do_not_mix(self) -> None:
        rng = np.random.default_rng(3)
        state, cov, dt = rng.normal(size=(7, 4)), spread(rng, 7, 4), rng.uniform(-1, 2, 7)
        z, r = rng.normal(size=(7, 2)), spread(rng, 7, 2)
        kept = [one.copy() for one in (state, cov, dt, z, r)]
        together = self.part.update(state, cov, dt, z, r)
        for before, after in zip(kept, (state, cov, dt, z, r), strict=True):
            assert np.array_equal(before, after)
        for k in range(7):
            one = slice(k, k + 1)
            alone = self.part.update(state[one], cov[one], dt[one], z[one], r[one])
            for a, b in zip(alone, together, strict=True):
                np.testing.assert_array_equal(a[0], b[k])

    @pytest.mark.parametrize("dt", [-2.0, -0.3, 0.0, 0.03, 1.0, 20.0])
    def test_covariances_stay_covariances_and_a_measurement_never_loses(self, dt: float) -> None:
        rng = np.random.default_rng(4)
        state, cov, step = rng.normal(0, 20, (50, 4)), spread(rng, 50, 4), np.full(50, dt)
        predicted = self.part.predict(state, cov, step)[1]
        updated = self.part.update(state, cov, step, state[:, :2], spread(rng, 50, 2))[1]
        for made in (predicted, updated):
            np.testing.assert_allclose(made, made.transpose(0, 2, 1), atol=1e-9)
            assert np.linalg.eigvalsh(made).min() > 0
        before = predicted if dt >= 0 else cov
        assert (np.trace(updated, axis1=1, axis2=2) <= np.trace(before, axis1=1, axis2=2) + 1e-9).all()

    def test_a_perfect_measurement_is_believed(self) -> None:
        state, cov = np.array([[10.0, 20, 3, 4]]), np.eye(4)[None] * 100
        made, _, nis = self.part.update(state, cov, np.ones(1), np.array([[50.0, -7]]), 1e-9 * np.eye(2)[None])
        np.testing.assert_allclose(made[0, :2], [50, -7], atol=1e-3)
        assert nis[0] > 0


class AssociateContract:
    part: AssociatePart

    @pytest.mark.parametrize(("n", "m"), [(0, 0), (0, 3), (3, 0)])
    def test_nothing_to_assign(self, n: int, m: int) -> None:
        rng = np.random.default_rng(0)
        answer = self.part(expected(rng, n), measured(rng, m))
        assert answer.measurement.tolist() == [-1] * n
        assert len(answer.pair) == 0

    @pytest.mark.parametrize("seed", range(5))
    def test_a_measurement_serves_one_track_and_comes_from_its_gate(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        answer = self.part(expected(rng, 40), measured(rng, 50))
        taken = answer.measurement[answer.measurement >= 0]
        assert len(taken) > 5
        assert len(set(taken.tolist())) == len(taken)
        for i, j in enumerate(answer.measurement):
            assert j < 0 or j in answer.pair[answer.first[i] : answer.first[i + 1]]
            assert (j < 0) == np.isnan(answer.distance[i])
        assert np.nanmax(answer.distance) <= self.part.gate

    @pytest.mark.parametrize("seed", range(5))
    def test_the_order_of_measurements_and_tracks_does_not_matter(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        tracks, plots = expected(rng, 40), measured(rng, 50)
        p, q = rng.permutation(40), rng.permutation(50)
        first = self.part(tracks, plots).measurement
        names = ("time", "state", "covariance", "window", "extent", "penalty")
        shuffled = Expected(**{name: getattr(tracks, name)[p] for name in names})
        second = self.part(shuffled, Measured(plots.time[q], plots.position[q], plots.noise[q])).measurement
        assert np.where(second >= 0, q[second], -1).tolist() == first[p].tolist()

    def test_out_of_the_window_is_out_of_the_gate(self) -> None:
        rng = np.random.default_rng(1)
        tracks = expected(rng, 1)
        late = Measured(tracks.time + 1.6, tracks.state[:, :2] + 1.6 * tracks.state[:, 2:], np.eye(2)[None])
        assert self.part(tracks, late).measurement.tolist() == [-1]


class LifecycleContract:
    part: LifecyclePart

    def judge(self, **given: Any) -> tuple[int, bool]:
        row: dict[str, Any] = {
            "phase": 0, "history": 1, "looks": 1, "misses": 0, "silence": 0.0, "identified": False, "position_sd": 3.0,
            "score": 9.0,
        } | given  # fmt: skip
        kinds = {"phase": "u1", "history": "u4", "looks": "i4", "misses": "i4", "identified": "?"}
        phase, ended = self.part.judge(**{k: np.array([v], dtype=kinds.get(k, "f8")) for k, v in row.items()})
        return int(phase[0]), bool(ended[0])

    def test_one_hit_is_tentative_and_many_confirm(self) -> None:
        assert self.judge() == (TrackPhase.TENTATIVE, False)
        assert self.judge(history=0xFFFFFFFF, looks=32, score=100.0) == (TrackPhase.CONFIRMED, False)

    def test_misses_coast_then_end_and_a_hit_brings_back(self) -> None:
        confirmed = {"phase": TrackPhase.CONFIRMED, "looks": 40, "history": 0}
        phases = [self.judge(**confirmed, misses=k) for k in range(100)]
        assert phases[0] == (TrackPhase.CONFIRMED, False)
        assert (TrackPhase.COASTING, False) in phases
        assert phases[-1][1]
        assert self.judge(phase=TrackPhase.COASTING, misses=0, looks=40) == (TrackPhase.CONFIRMED, False)

    def test_silence_and_ignorance_end_every_track(self) -> None:
        for phase in TrackPhase:
            assert self.judge(phase=phase, silence=1e4, looks=40, history=0xFF)[1]
            assert self.judge(phase=phase, silence=np.inf, identified=True)[1]
            assert self.judge(phase=phase, position_sd=1e6)[1]
            assert self.judge(phase=phase, position_sd=np.nan)[1]

    def test_a_start_knows_the_place_and_a_second_the_speed(self) -> None:
        z, r = np.array([[5.0, 6.0]]), 4 * np.eye(2)[None]
        state, cov = self.part.start(z, r)
        assert state[0].tolist() == [5, 6, 0, 0]
        assert np.linalg.eigvalsh(cov[0]).min() > 0
        state, cov = self.part.second(state, cov, np.array([2.0]), z + np.array([20, -10]), r)
        np.testing.assert_allclose(state[0], [25, -4, 10, -5])
        np.testing.assert_allclose(cov[0][2:, 2:], 2 * np.eye(2))  # (R + R) / dt^2
        np.testing.assert_allclose(cov[0][:2, 2:], 2 * np.eye(2))  # R / dt


class ClassifyContract:
    part: ClassifyPart

    def call(self, before: int, length: float, speed: float, seen: int = 100, claimed: int = 0) -> int:
        columns = [np.array([one]) for one in (before, claimed, length, length / 2, speed, seen)]
        made = self.part(*columns)
        assert made.dtype == np.uint8
        return int(made[0])

    def test_nothing_seen_is_unknown(self) -> None:
        assert self.call(0, np.nan, 0.0, seen=0) == TargetClass.UNKNOWN

    def test_an_airliner_and_a_car(self) -> None:
        assert self.call(0, 40.0, 10.0) == TargetClass.AIRCRAFT
        assert self.call(0, 6.0, 10.0) == TargetClass.VEHICLE

    @pytest.mark.parametrize("claim", [TargetClass.AIRCRAFT, TargetClass.VEHICLE])
    def test_what_it_says_of_itself_goes_first(self, claim: TargetClass) -> None:
        assert self.call(0, 40.0, 10.0, claimed=claim) == claim
        assert self.call(0, 6.0, 10.0, claimed=claim) == claim
