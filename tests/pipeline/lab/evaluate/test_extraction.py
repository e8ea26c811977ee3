"""The extraction experiment: what it counts as split and merged, and that plots know how wrong they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from pipeline.lab.evaluate.extraction import ALONE, MERGED, NEES, PAIRS, SPLIT, Extraction

SMALL = replace(Extraction(), trials=12, ranges_m=(400.0, 1000.0), snr_db=(22.0,))


@pytest.fixture(scope="module")
def found() -> dict[str, np.ndarray]:
    """(trials, scenes, ranges, 5) of each extractor."""
    results = [SMALL.trial(np.random.default_rng([12, k]), k, lambda: 0.0) for k in range(SMALL.trials)]
    stacked = np.stack([one["found"] for one in results])[:, :, 0]
    return {name: stacked[:, e] for e, name in enumerate(SMALL.extractors)}


def test_a_trial_depends_on_nothing_but_its_generator() -> None:
    one, other = (SMALL.trial(np.random.default_rng(3), 0, lambda: 0.0)["found"] for _ in range(2))
    np.testing.assert_array_equal(one, other)


def test_aircraft_stay_whole_and_cars_stay_two(found: dict[str, np.ndarray]) -> None:
    grown, linked = found["hysteresis"], found["manhattan"]
    aircraft = slice(0, 3)
    assert grown[:, aircraft, :, SPLIT].mean() <= 0.15
    assert linked[:, aircraft, :, SPLIT].mean() > 2 * grown[:, aircraft, :, SPLIT].mean()
    fifteen = [len(ALONE) + k for k, pair in enumerate(PAIRS) if pair[2] == 15.0]
    assert grown[:, fifteen, :, MERGED].mean() <= 0.05
    assert np.nanmin(grown[..., SPLIT]) >= 0


def test_what_is_merged_is_seen_as_merged() -> None:
    far = replace(SMALL, ranges_m=(2500.0,), snr_db=(30.0,))
    results = [far.trial(np.random.default_rng([1, k]), k, lambda: 0.0)["found"] for k in range(4)]
    merged = np.stack(results)[:, 1, 0, len(ALONE) :, 0, MERGED]
    assert merged[:, 0].mean() > 0.5


@pytest.mark.parametrize("extractor", ["hysteresis", "manhattan"])
def test_the_covariance_is_honest(found: dict[str, np.ndarray], extractor: str) -> None:
    """The sum of the errors squared over their covariances is chi-square with two degrees of freedom a plot, if the
    covariance is right. It need not be right, but within a factor of two on average, rather too large."""
    nees = 2 * found[extractor][:, :4, :, NEES]
    nees = nees[np.isfinite(nees) & (found[extractor][:, :4, :, SPLIT] == 0)]
    low, high = chi2.ppf([1e-4, 1 - 1e-4], 2 * len(nees)) / 2
    assert 0.5 * low <= nees.sum() / 2 <= 2.0 * high


def test_rows_and_figures_of_a_short_run() -> None:
    results = [SMALL.trial(np.random.default_rng([12, k]), k, lambda: 0.0) for k in range(2)]
    rows = SMALL.rows(results)
    assert len({row.name for row in rows}) == len(rows)
    assert all(row.low <= row.measured <= row.high for row in rows)
    assert {row.wanted for row in rows} >= {5.0, 15.0, 2.0, None}
    figures = SMALL.figures(results)
    assert all(one.lines or one.pictures for one in figures)
    for picture in (p for one in figures for p in one.pictures):
        left, right, bottom, top = picture.extent
        assert left < right
        assert top < bottom
        marks = picture.marks
        assert (marks[:, 0] >= left).all()
        assert (marks[:, 0] <= right).all()
        assert (marks[:, 1] >= top).all()
        assert (marks[:, 1] <= bottom).all()
