"""The experiment on bearings."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest

from pipeline.lab.evaluate import Trial, experiments
from pipeline.lab.evaluate.bearing import METHODS, SLOW, BearingExperiment
from tests.pipeline.bearing.scene import axis_error

FEW = BearingExperiment(trials=4, types=("B734",), ranges_m=(400.0, 1000.0), template_every=4)


def run(experiment: BearingExperiment, seed: int = 3) -> list[Trial]:
    ticks = itertools.count()
    return [
        experiment.trial(np.random.default_rng([seed, k]), k, lambda: next(ticks) * 1e-3)
        for k in range(experiment.trials)
    ]


@pytest.fixture(scope="module")
def results() -> list[Trial]:
    return run(FEW)


def test_it_is_found_by_its_name() -> None:
    assert experiments()["bearing"] is BearingExperiment


def test_a_trial_depends_on_chance_and_number_only(results: list[Trial]) -> None:
    again = FEW.trial(np.random.default_rng([3, 2]), 2, lambda: 0.0)
    for name in ("error", "scaled", "asked"):
        np.testing.assert_array_equal(again[name], results[2][name])


def test_every_method_is_asked_and_the_slow_one_sometimes(results: list[Trial]) -> None:
    slow = list(METHODS).index(SLOW)
    for k, one in enumerate(results):
        asked = np.delete(one["asked"], slow, axis=0)
        assert asked.all()
        assert one["asked"][slow].all() == (k % FEW.template_every == 0)


def test_rows_are_what_the_errors_say(results: list[Trial]) -> None:
    rows = {one.name: one for one in FEW.rows(results)}
    ml = np.stack([one["error"][-1, 0, 0] for one in results])
    assert rows["ml, B734: all-trials rms"].measured == pytest.approx(float(np.sqrt(np.mean(np.square(ml)))))
    assert rows["ml, B734: gross errors"].measured == 0
    assert rows["time a target, ml"].measured == pytest.approx(1000.0)
    assert not rows["time a target, ml"].repeatable
    assert rows["H/C, B734: core rms at the worst range"].paper == 3.0
    assert rows["ml, B734, expected heading: all-trials rms"].met
    for one in rows.values():
        assert one.low <= one.measured <= one.high


def test_methods_without_an_error_make_no_row_of_nothing() -> None:
    empty: dict[str, Any] = {
        "error": np.full((len(METHODS), 2, 1, 2), np.nan), "scaled": np.full((len(METHODS), 2, 1, 2), np.nan),
        "asked": np.zeros((len(METHODS), 2, 1, 2), bool), "seconds": np.full((len(METHODS), 1, 2), np.nan),
    }  # fmt: skip
    for one in FEW.rows([empty]):
        assert math.isnan(one.measured)
    assert FEW.figures([empty])


def test_the_example_shows_the_axes_that_were_found(results: list[Trial]) -> None:
    figures = FEW.figures(results)
    pictures = [one for figure in figures for one in figure.pictures]
    assert len(pictures) == 2 * 5
    truth = pictures[0]
    assert truth.label.startswith("truth")
    assert truth.marks is not None
    east, north = truth.marks[-1]
    assert abs(axis_error(math.atan2(east, north), float(results[0]["truth 400"][0]))) < 1e-6
    assert truth.values.shape == (64, 64)
    lines = next(figure for figure in figures if figure.lines).lines
    assert [one.label for one in lines][: len(METHODS)] == list(METHODS)


def test_quick_is_short() -> None:
    assert BearingExperiment().quick().trials <= 20
