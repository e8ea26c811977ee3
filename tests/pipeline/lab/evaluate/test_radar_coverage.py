"""The experiment on targets that only one of several radars sees."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pipeline.lab.evaluate import Trial, experiments
from pipeline.lab.evaluate.radar_coverage import CASES, Follower, Found, RadarCoverage, first_plots
from pipeline.lab.simulate.several_radars import EPOCH, Targets
from pipeline.tables import TrackPhase, Tracks
from tests.pipeline.lab.evaluate.checks import VERDICTS

SHORT = RadarCoverage(trials=1, periods_s=((1.0, 0.5, 2.5),), each=2, seconds=10.0, limit_s=8.0)
TARGETS = 6


@pytest.fixture(scope="module")
def result() -> Trial:
    return SHORT.trial(np.random.default_rng([3, 0]), 0, lambda: 0.0)


def tracks(*rows: tuple[int, float, TrackPhase]) -> Tracks:
    """Of number, east and phase."""
    state = np.zeros((len(rows), 4))
    state[:, 0] = [east for _, east, _ in rows]
    given: dict[str, Any] = {
        "covariance": np.eye(4),
        "id": np.array([number for number, _, _ in rows]), "phase": np.array([int(phase) for _, _, phase in rows]),
    }  # fmt: skip
    return Tracks.build(len(rows), time=EPOCH, updated=EPOCH, born=EPOCH, state=state, **given)


def test_it_is_found_by_its_name() -> None:
    assert experiments()["radar-coverage"] is RadarCoverage


@pytest.mark.parametrize("seed", range(3))
def test_only_the_first_radar_has_plots_of_the_targets(seed: int) -> None:
    experiment = RadarCoverage(seconds=10.0)
    for periods in experiment.periods_s:
        antennas, targets, clear, blocked = experiment.scene(np.random.default_rng(seed), periods)
        assert [one.site.video.period_s for one in antennas] == list(periods)
        assert set(clear[0].target) == set(blocked[0].target) == set(range(-1, len(targets.start)))
        np.testing.assert_array_equal(clear[0].plots.time, blocked[0].plots.time)
        for before, after in zip(clear[1:], blocked[1:], strict=True):
            assert set(range(len(targets.start))) <= set(before.target)
            assert set(after.target) == {-1}
            assert (after.target == -1).sum() == (before.target == -1).sum()


def test_the_first_plot_is_that_of_any_radar_and_false_plots_are_nobodys() -> None:
    _, targets, clear, blocked = SHORT.scene(np.random.default_rng(4), SHORT.periods_s[0])
    alone, together = first_plots(blocked, len(targets.start)), first_plots(clear, len(targets.start))
    assert ((alone > EPOCH) & (alone < EPOCH + 4.0)).all()
    np.testing.assert_array_equal(alone, first_plots(clear[:1], len(targets.start)))
    assert (together <= alone).all()
    assert (together < alone).any()
    assert np.isinf(first_plots(blocked[1:], len(targets.start))).all()


def test_a_trial_depends_on_chance_only(result: Trial) -> None:
    again = SHORT.trial(np.random.default_rng([3, 0]), 5, lambda: 1.0)
    for name in Found._fields:
        assert result[name].shape == (1, 2, len(CASES), TARGETS)
        np.testing.assert_array_equal(again[name], result[name])


def test_one_radar_alone_confirms_and_holds_its_targets(result: Trial) -> None:
    found = Found(**{name: result[name][0, :, 0] for name in Found._fields})
    assert ((found.confirmed_s > 0.5) & (found.confirmed_s < 8.0)).all()
    assert (found.coasting >= 0).all()
    assert (found.absent == 0).all()
    assert not found.lost.any()
    assert not found.numbers.any()


def test_two_radars_that_see_confirm_sooner_than_one(result: Trial) -> None:
    after = result["confirmed_s"][0]
    assert (np.median(after[:, 3], axis=1) < np.median(after[:, 0], axis=1)).all()


def test_a_follower_tells_what_became_of_the_targets() -> None:
    targets = Targets(np.array([[0.0, 0.0], [500.0, 0.0]]), np.array([[10.0, 0.0], [0.0, 0.0]]))
    follower = Follower(targets, np.array([EPOCH + 0.5, EPOCH + 0.5]))
    seen, coasting = TrackPhase.CONFIRMED, TrackPhase.COASTING
    looks = (
        tracks((9, 300.0, seen)),  # near nobody
        tracks((1, 22.0, seen)),
        tracks((1, 30.0, coasting)),
        tracks((1, 40.0, seen)),
        tracks(),
        tracks((9, 90.0, seen), (2, 61.0, seen)),
        tracks((2, 70.0, seen)),
    )
    for k, one in enumerate(looks):
        follower.look(one, EPOCH + 1.0 + k)
    found = follower.found()
    np.testing.assert_allclose(found.confirmed_s, [1.5, np.inf])
    np.testing.assert_allclose(found.coasting, [0.2, np.nan])
    np.testing.assert_allclose(found.absent, [0.2, np.nan])
    np.testing.assert_array_equal(found.lost, [1.0, 0.0])
    np.testing.assert_array_equal(found.numbers, [1.0, 0.0])


def test_a_track_that_strays_for_less_than_a_second_is_not_lost() -> None:
    follower = Follower(Targets(np.zeros((1, 2)), np.zeros((1, 2))), np.array([EPOCH]))
    seen = TrackPhase.CONFIRMED
    for k, east in enumerate((0.0, 20.0, 20.0, 0.0, 20.0, 20.0, 0.0)):
        follower.look(tracks((1, east, seen)), EPOCH + 0.4 * k)
    found = follower.found()
    assert not found.lost.any()
    np.testing.assert_allclose(found.absent, [4 / 6], atol=1e-6)
    np.testing.assert_array_equal(found.numbers, [0.0])


def test_rows_are_what_was_found_and_bounds_follow_from_one_radar(result: Trial) -> None:
    rows = {one.name: one for one in SHORT.rows([result, result])}
    assert len(rows) == 2 * len(CASES) * 7
    for one in rows.values():
        assert one.verdict in VERDICTS
        assert math.isnan(one.measured) or one.low <= one.measured <= one.high
        assert (one.wanted is None) == (", 1 radar: " in one.name)
    score = "score, periods 1, 0.5 and 2.5 s"
    alone = rows[f"{score}, 1 radar: time to confirmation, median"]
    assert alone.measured == np.median(result["confirmed_s"][0, 1, 0])
    assert rows[f"{score}, 2 radars, one sees: time to confirmation, median"].wanted == alone.measured + 0.1
    longest = rows[f"{score}, 1 radar: time to confirmation, longest"].measured
    assert longest == result["confirmed_s"][0, 1, 0].max()
    assert rows[f"{score}, 3 radars, all see: time to confirmation, longest"].wanted == longest + 1.0
    assert rows[f"{score}, 1 radar: confirmed within 8 s"].measured == 100.0
    assert rows[f"{score}, 3 radars, one sees: confirmed within 8 s"].wanted == 99.0
    assert rows[f"{score}, 3 radars, one sees: changes of track number"].wanted == 0.01
    coasting = rows[f"{score}, 2 radars, one sees: coasting"]
    assert coasting.measured == pytest.approx(100.0 * np.nanmean(result["coasting"][0, 1, 1]))
    assert coasting.wanted == pytest.approx(100.0 * np.nanmean(result["coasting"][0, 1, 0]) + 1.0)


def test_the_bound_on_the_longest_time_is_a_turn_of_the_first_radar(result: Trial) -> None:
    slow = replace(SHORT, periods_s=((2.5, 1.0, 0.5),))
    rows = {one.name: one for one in slow.rows([result])}
    name = "score, periods 2.5, 1 and 0.5 s, {}: time to confirmation, longest"
    assert rows[name.format("2 radars, one sees")].wanted == rows[name.format("1 radar")].measured + 2.5


def test_targets_that_are_never_confirmed_are_told_and_meet_no_bound(result: Trial) -> None:
    never = {name: np.array(values) for name, values in result.items()}
    never["confirmed_s"][:, :, 1] = np.inf
    never["coasting"][:, :, 1] = never["absent"][:, :, 1] = np.nan
    never["lost"][:, :, 1] = never["numbers"][:, :, 1] = 0.0
    rows = [one for one in SHORT.rows([never]) if "2 radars, one sees" in one.name]
    assert len(rows) == 2 * 7
    assert all(one.met is False for one in rows)
    assert rows[0].measured == 0.0
    assert rows[1].measured == math.inf
    assert math.isnan(rows[3].measured)


def test_figures_tell_how_many_are_confirmed_after_how_long(result: Trial) -> None:
    figures = SHORT.figures([result])
    assert len(figures) == 2
    for figure, after in zip(figures, result["confirmed_s"][0], strict=True):
        assert [one.label for one in figure.lines] == [one.name for one in CASES]
        for line, its in zip(figure.lines, after, strict=True):
            assert line.y[0] == 0.0
            assert line.y[-1] == pytest.approx(100.0 * (its <= 8.0).mean())


def test_quick_is_short() -> None:
    quick = RadarCoverage().quick()
    assert quick.trials * len(quick.periods_s) == 1
    assert quick.limit_s < quick.seconds <= 20.0
