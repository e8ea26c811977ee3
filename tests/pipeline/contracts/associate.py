"""What every association has to keep to; the test of a new one inherits the suite and sets `part`."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pipeline.contracts.associate import AssociatePart, Association, Expected
from pipeline.contracts.measured import Measured
from tests.pipeline.contracts.rows import plots_at, spread

SEEDS = range(5)


def expected_at(mean: Any, sd: float = 3.0, **columns: Any) -> Expected:
    """Small tracks at time 10, each a target of its own."""
    place = np.asarray(mean, float).reshape(-1, 4)
    n = len(place)
    given: dict[str, Any] = {
        "time": np.full(n, 10.0), "mean": place, "covariance": np.tile(sd**2 * np.eye(4), (n, 1, 1)),
        "window": np.full(n, 1.5), "extent": np.zeros((n, 3)), "penalty": np.zeros(n),
        "target": np.arange(n, dtype=np.int64), "log_weight": np.zeros(n),
    }  # fmt: skip
    return Expected(**(given | columns))


def expected(rng: np.random.Generator, n: int, half: float = 200.0) -> Expected:
    """Tracks of all sizes and motions over a square of 2 `half`."""
    mean = np.concatenate([rng.uniform(-half, half, (n, 2)), rng.normal(0, 8, (n, 2))], axis=1)
    extent = np.stack([rng.uniform(0, 60, n), rng.uniform(0, 20, n), rng.uniform(0, 6, n)], axis=1)
    return expected_at(mean, time=rng.uniform(10, 11, n), covariance=20 * spread(rng, n, 4), extent=extent)


def measured(rng: np.random.Generator, m: int, half: float = 200.0) -> Measured:
    return Measured.of(rng.uniform(10, 11, m), rng.uniform(-half, half, (m, 2)), 5 * spread(rng, m, 2))


def all_of(rows: Any) -> np.ndarray:
    return np.arange(len(rows[0]))


def taken_by(answer: Association) -> list[dict[tuple[int, ...], float]]:
    """The sets of plots of each track with their weights."""
    one = answer.hypotheses
    each = range(len(one.track_first) - 1)
    return [{tuple(plots.tolist()): float(np.exp(weight)) for plots, weight in one.of_track(k)} for k in each]


def shares(answer: Association, tracks: Expected, asked: np.ndarray) -> dict[tuple[int, int], float]:
    """The probability with which each target took each plot, given that each target is one of its hypotheses."""
    total: dict[int, float] = {}
    made: dict[tuple[int, int], float] = {}
    for position, sets in enumerate(taken_by(answer)):
        if position in answer.ended:
            continue
        target, prior = int(tracks.target[asked[position]]), float(np.exp(tracks.log_weight[asked[position]]))
        for plots, weight in sets.items():
            total[target] = total.get(target, 0.0) + prior * weight
            for plot in plots:
                made[target, plot] = made.get((target, plot), 0.0) + prior * weight
    return {key: value / total[key[0]] for key, value in made.items()}


class AssociateContract:
    part: AssociatePart

    def ask(self, tracks: Expected, plots: Measured, asked: Any = None, among: Any = None) -> Association:
        chosen = all_of(tracks) if asked is None else np.asarray(asked)
        return self.part(tracks, plots, chosen, all_of(plots) if among is None else np.asarray(among))

    def likeliest(self, answer: Association) -> list[int]:
        """The plot of the likeliest hypothesis of each track, -1 for none."""
        made = []
        for sets in taken_by(answer):
            best = max(sets, key=sets.__getitem__)
            made.append(best[0] if best else -1)
        return made

    @pytest.mark.parametrize(("n", "m"), [(0, 0), (0, 3), (3, 0)])
    def test_nothing_to_assign(self, n: int, m: int) -> None:
        rng = np.random.default_rng(0)
        answer = self.ask(expected(rng, n), measured(rng, m))
        assert taken_by(answer) == [{(): 1.0}] * n
        assert answer.first.tolist() == [0] * (n + 1)
        assert len(answer.pair) == len(answer.cost) == len(answer.squared) == len(answer.ended) == 0

    @pytest.mark.parametrize("seed", SEEDS)
    def test_every_hypothesis_comes_from_the_gate(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        tracks, plots = expected(rng, 40), measured(rng, 50)
        answer = self.ask(tracks, plots)
        for i, sets in enumerate(taken_by(answer)):
            pairs = answer.pair[answer.first[i] : answer.first[i + 1]]
            assert len(sets) > 0
            assert {plot for one in sets for plot in one} <= set(pairs.tolist())
            assert len(set(pairs.tolist())) == len(pairs)
            dt = plots.time[pairs] - tracks.time[i]
            off = plots.position[pairs] - tracks.mean[i, :2] - dt[:, None] * tracks.mean[i, 2:]
            assert (np.abs(dt) <= tracks.window[i]).all()
            assert (np.hypot(*off.T) <= self.part.max_gate_m).all()
        assert answer.squared.max() <= self.part.gate
        assert len(answer.cost) == len(answer.pair) == answer.first[-1]

    @pytest.mark.parametrize("seed", SEEDS)
    def test_a_plot_serves_one_target(self, seed: int) -> None:
        """As far as it is shared at all, the probabilities with which targets took it sum to 1 at most."""
        rng = np.random.default_rng(seed)
        tracks, plots = expected(rng, 40), measured(rng, 50)
        answer = self.ask(tracks, plots)
        used = np.zeros(50)
        for (_, plot), share in shares(answer, tracks, np.arange(40)).items():
            used[plot] += share
        assert used.max() <= 1.0 + 1e-9
        assert used.sum() > 5
        if not self.part.branching:
            np.testing.assert_allclose([sum(sets.values()) for sets in taken_by(answer)], 1.0)

    @pytest.mark.parametrize("seed", SEEDS)
    def test_the_order_of_measurements_and_tracks_does_not_matter(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        tracks, plots = expected(rng, 40), measured(rng, 50)
        p, q = rng.permutation(40), rng.permutation(50)
        first = taken_by(self.ask(tracks, plots))
        asked = taken_by(self.ask(tracks, plots, p, q))
        tables = taken_by(self.ask(Expected(*(column[p] for column in tracks)), plots.rows(q)))
        for k in range(40):
            assert asked[k] == pytest.approx(first[p[k]])
            assert {tuple(int(q[j]) for j in one): w for one, w in tables[k].items()} == pytest.approx(first[p[k]])

    def test_tracks_and_plots_that_are_not_asked_for_play_no_part(self) -> None:
        rng = np.random.default_rng(7)
        tracks, plots = expected(rng, 60), measured(rng, 80)
        asked, among = rng.permutation(60)[:25], rng.permutation(80)[:40]
        whole = self.ask(tracks, plots, asked, among)
        alone = self.ask(Expected(*(column[asked] for column in tracks)), plots.rows(among))
        assert among[alone.pair].tolist() == whole.pair.tolist()
        assert alone.first.tolist() == whole.first.tolist()
        np.testing.assert_array_equal(alone.cost, whole.cost)
        back = [{tuple(int(among[j]) for j in one): w for one, w in sets.items()} for sets in taken_by(alone)]
        assert back == taken_by(whole)
        assert sum(plots != () for sets in back for plots in sets) > 5

    @pytest.mark.parametrize("seed", SEEDS)
    def test_no_pair_is_out_of_reach(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        tracks, plots = expected(rng, 40), measured(rng, 300)
        answer, reach = self.ask(tracks, plots), self.part.reach(tracks, plots)
        of = np.repeat(np.arange(40), np.diff(answer.first))
        dt = plots.time[answer.pair] - tracks.time[of]
        off = plots.position[answer.pair] - tracks.mean[of, :2] - dt[:, None] * tracks.mean[of, 2:]
        assert (np.hypot(*off.T) <= reach[of] + 1e-9).all()
        assert (reach <= self.part.max_gate_m).all()
        assert len(of) > 20

    @pytest.mark.parametrize("seed", SEEDS)
    def test_what_is_out_of_reach_of_each_other_is_decided_apart(self, seed: int) -> None:
        """Two crowds far from each other, asked about together and each for itself."""
        rng = np.random.default_rng(seed)
        tracks, plots = expected(rng, 40, 60.0), measured(rng, 50, 60.0)
        tracks.mean[20:, :2] += 5000.0
        plots.position[25:] += 5000.0
        both = taken_by(self.ask(tracks, plots))
        one = taken_by(self.ask(tracks, plots, np.arange(20), np.arange(25)))
        other = taken_by(self.ask(tracks, plots, np.arange(20, 40), np.arange(25, 50)))
        assert both == one + other
        assert sum(plots != () for sets in one for plots in sets) > 3

    def test_what_is_given_stays_as_it_is(self) -> None:
        rng = np.random.default_rng(8)
        given = expected(rng, 30), measured(rng, 30)
        kept = [[column.copy() for column in one] for one in given]
        self.ask(*given)
        for one, before in zip(given, kept, strict=True):
            assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(one, before, strict=True))

    def test_out_of_the_window_is_out_of_the_gate(self) -> None:
        tracks = expected_at([[5.0, 5, 3, -2]])
        for late, held in ((1.4, 1), (1.6, 0), (-1.6, 0)):
            plots = plots_at(10.0 + late, tracks.mean[:, :2] + late * tracks.mean[:, 2:])
            answer = self.ask(tracks, plots)
            assert len(answer.pair) == held
            assert self.likeliest(answer) == [held - 1]

    def test_the_gate_is_bounded_in_metres(self) -> None:
        tracks = expected_at([[0.0, 0, 0, 0]], sd=1e4)
        plots = plots_at(10.0, [[self.part.max_gate_m - 1.0, 0], [0, self.part.max_gate_m + 1.0]])
        assert self.ask(tracks, plots).pair.tolist() == [0]

    def test_a_target_takes_the_plot_at_its_place(self) -> None:
        tracks = expected_at([[0.0, 0, 5, 0], [100, 0, 0, 0]])
        plots = plots_at(10.2, [[101.0, 1], [1.0, -1]])
        assert self.likeliest(self.ask(tracks, plots)) == [1, 0]

    def test_a_penalty_makes_a_track_give_way(self) -> None:
        tracks = expected_at(np.zeros((2, 4)), penalty=np.array([6.0, 0.0]))
        assert self.likeliest(self.ask(tracks, plots_at(10.0, [0.0, 1.0]))) == [-1, 0]

    @pytest.mark.parametrize("seed", SEEDS)
    def test_rows_of_one_target(self, seed: int) -> None:
        """Two rows each of ten targets: no plot serves two targets, and of each target a row goes on."""
        rng = np.random.default_rng(seed)
        base = expected(rng, 10, 60.0)
        twice = Expected(*(np.repeat(column, 2, axis=0) for column in base))
        mean = twice.mean + np.tile([[0.0, 0, 0, 0], [9, -6, 1, 1]], (10, 1))
        tracks = twice._replace(mean=mean, log_weight=np.log(np.tile([0.7, 0.3], 10)))
        answer = self.ask(tracks, measured(rng, 25, 60.0))
        used: dict[int, float] = {}
        for (_, plot), share in shares(answer, tracks, np.arange(20)).items():
            used[plot] = used.get(plot, 0.0) + share
        assert max(used.values()) <= 1.0 + 1e-9
        assert len(set(answer.ended.tolist())) == len(answer.ended)
        assert set(np.delete(tracks.target, answer.ended).tolist()) == set(range(10))

    def test_a_target_that_is_alone_is_never_given_up(self) -> None:
        tracks = expected_at([[0.0, 0, 0, 0]], log_weight=np.array([-50.0]))
        for plots in (plots_at([], []), plots_at(10.0, [8.0, 0]), plots_at(10.0, [[1.0, 0], [-1, 0]])):
            assert len(self.ask(tracks, plots).ended) == 0
