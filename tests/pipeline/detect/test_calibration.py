"""Thresholds by formula, against closed forms and draws."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.detect.calibration import (
    DB,
    LOG_MEAN_DB,
    censored_bias_db,
    estimation_loss_db,
    log_mean_offset_db,
    mean_offsets_db,
    order_offset_steps,
    power_mean_offsets_db,
    recursive_mean_offsets_db,
    threshold_offset_db,
)

FINE = 1e-4
"""Steps so small that rounding does not matter."""


@pytest.mark.parametrize("pfa", [0.3, 1e-2, 1e-4, 1e-6, 1e-8])
def test_one_cell_is_the_ratio_of_two_exponentials(pfa: float) -> None:
    closed = DB * np.log(1 / pfa - 1)
    assert log_mean_offset_db(pfa, FINE, np.ones(1), np.ones(1)) == pytest.approx(closed, abs=1e-3)
    assert power_mean_offsets_db(pfa, FINE, 1)[1] == pytest.approx(closed, abs=1e-3)
    assert (order_offset_steps(pfa, 0.1, 1.0, 1.0) + 0.5) * 0.1 == pytest.approx(closed, abs=1e-2)


@pytest.mark.parametrize("pfa", [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("db_per_step", [0.3125, 3.0])
def test_very_many_cells_are_a_known_level(pfa: float, db_per_step: float) -> None:
    known = threshold_offset_db(pfa, db_per_step)
    many = mean_offsets_db(pfa, db_per_step, 20_000)
    assert many[20_000] == pytest.approx(known, abs=0.004)
    rounding = 1 + db_per_step**2 / 12 / 5.57**2
    loss = estimation_loss_db(pfa, db_per_step) / 2_000 * rounding
    assert many[2_000] - known == pytest.approx(loss, rel=0.05)
    assert power_mean_offsets_db(pfa, FINE, 20_000)[20_000] == pytest.approx(
        threshold_offset_db(pfa, FINE) + LOG_MEAN_DB, abs=0.01
    )


@pytest.mark.parametrize(("cells", "db_per_step"), [(2, 0.3125), (5, 0.3125), (32, 0.3125), (32, 2.0)])
def test_offsets_by_drawing_the_cells(cells: int, db_per_step: float) -> None:
    """400,000 draws of the cells, each with its exact tail; 1e-3 then stands to a few per cent."""
    rng = np.random.default_rng(cells)
    shift = rng.random(400_000)  # of the level against the steps
    steps = 10 * np.log10(rng.exponential(size=(400_000, cells))) / db_per_step
    level = np.rint(steps + shift[:, None]).mean(axis=1)
    limit = np.floor(level + mean_offsets_db(1e-3, db_per_step, cells)[cells] / db_per_step + 0.5)
    found = np.exp(-(10 ** ((limit + 0.5 - shift) * db_per_step / 10))).mean()
    assert found == pytest.approx(1e-3, rel=0.08)


def test_the_recursive_mean_goes_from_the_plain_mean_to_its_memory() -> None:
    offsets = recursive_mean_offsets_db(1e-6, 0.3125, 64)
    np.testing.assert_allclose(offsets[1:65], mean_offsets_db(1e-6, 0.3125, 64)[1:])
    weights = (1 - 1 / 64) ** np.arange(2_000)
    exact = log_mean_offset_db(1e-6, 0.3125, weights / weights.sum(), np.ones(2_000))
    assert offsets[-1] == pytest.approx(exact, abs=0.003)
    assert (np.diff(offsets[1:]) <= 1e-9).all()


@pytest.mark.parametrize(("limit_db", "freeze_db"), [(9.0, np.inf), (np.inf, 8.0), (5.0, 10.0), (np.inf, np.inf)])
def test_what_is_not_learned_lowers_the_mean(limit_db: float, freeze_db: float) -> None:
    clutter = 10 * np.log10(np.random.default_rng(8).exponential(size=(4_000, 2_000))) - LOG_MEAN_DB
    level = np.zeros(2_000)
    for scan in clutter:
        change = np.minimum(scan - level, limit_db)
        level += np.where(scan > freeze_db, 0.0, change) / 200
    # 2,000 levels of about 400 cells each, remembered of 4,000: the mean is known to 0.01 dB
    assert -level.mean() == pytest.approx(censored_bias_db(limit_db, freeze_db), abs=0.03)


@pytest.mark.parametrize("pfa", [0.0, 1.0, -1e-6])
def test_probabilities_that_are_none_are_refused(pfa: float) -> None:
    with pytest.raises(ValueError, match="pfa"):
        log_mean_offset_db(pfa, 0.3125, np.ones(1), np.ones(1))
