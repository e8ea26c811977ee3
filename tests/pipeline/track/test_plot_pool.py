"""Plots that come in are checked, become records of measurements and wait in the order of their rows."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.tables import Plots
from pipeline.track.plot_pool import (
    FUTURE,
    GOOD,
    LATE,
    POOL,
    STALE,
    PlotPool,
    add_centroid_noise,
)
from tests.pipeline.track.scene import T0, A, make_plots

CENTROID_SD, AIRCRAFT_LENGTH = 0.08, 12.0
CLOCK = (T0 + 4.25, 0.8, 5 * A)
"""The antenna is at row 5 A at that time and turns once in 0.8 s."""
BOUNDS = (T0 + 2.0, T0 + 5.0, 3.5 * A)


def pooled(plots: Plots, bounds: tuple[float, float, float] = BOUNDS) -> tuple[Any, list[int]]:
    made, found = PlotPool().take_in(plots, bounds, CLOCK, A, 1, AIRCRAFT_LENGTH)
    assert made.dtype == POOL
    assert len(made) == found[GOOD]
    assert found.sum() == len(plots)
    return made, found.tolist()


def plots_at(rng: np.random.Generator, rows: Any, **words: Any) -> Plots:
    """Plots at absolute rows, seen when the antenna was about there."""
    rows = np.asarray(rows, float)
    azimuth, distance = rows / A * 2 * np.pi, rng.uniform(200, 2000, len(rows))
    place = np.column_stack([distance * np.sin(azimuth), distance * np.cos(azimuth)])
    time = CLOCK[0] + (rows - CLOCK[2]) / A * CLOCK[1] + rng.uniform(-0.3, 0.3, len(rows))
    return make_plots(time, place, 2.0, **words)


@settings(deadline=None, derandomize=True, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(1, 20))
def test_a_plot_becomes_a_measurement_with_the_noise_that_it_states(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    rows = rng.uniform(3.6 * A, 5.5 * A, n)
    bearing = np.where(rng.random(n) < 0.3, np.nan, rng.uniform(0, np.pi, n))
    length = np.where(rng.random(n) < 0.2, 0.0, rng.uniform(5, 40, n))
    plots = plots_at(
        rng, rows, length=length, width=length / 3, bearing=bearing, bearing_sd=0.1, cells=rng.integers(1, 90, n)
    )
    made, found = pooled(plots, (-np.inf, np.inf, 0.0))
    assert found == [n, 0, 0, 0, 0]
    assert made["row"].tolist() == np.floor(rows).astype(int).tolist()
    for name in ("time", "cells"):
        np.testing.assert_array_equal(made[name], getattr(plots, name))
    for name in ("bearing", "bearing_sd"):
        np.testing.assert_array_equal(made[name], getattr(plots, name).astype(float))
    np.testing.assert_array_equal(made["position"], np.column_stack([plots.east, plots.north]))
    np.testing.assert_array_equal(made["covariance"], plots.covariance)
    assert (made["sensor"] == 1).all()
    assert (made["image"] == -1).all()
    assert not made["spent"].any()
    assert np.isnan([made[name] for name in ("speed", "course", "velocity_sd", "altitude")]).all()
    np.testing.assert_array_equal(made["long"], plots.length >= AIRCRAFT_LENGTH)
    for k in range(n):
        length_m, width_m, direction = made["extent"][k]
        if length[k] > 0.0:
            assert (length_m, width_m) == pytest.approx((length[k], length[k] / 3), rel=1e-6)
            assert direction == pytest.approx(bearing[k], rel=1e-6, nan_ok=True)
        else:  # the extractor gave no axes: 8 m of range, 0.01 rad of azimuth
            assert length_m == pytest.approx(max(8.0, 0.01 * plots.range[k]), rel=1e-6)
        np.testing.assert_array_equal(made["noise"][k], plots.covariance[k])


def noise_of(covariance: Any, extent: Any) -> Any:
    """That of the plot and of the centroid, in the axes of the echo; the longer one where these are not known."""
    long, wide, direction = extent
    wide, direction = (wide, direction) if np.isfinite(direction) else (long, 0.0)
    axes = np.array([[np.sin(direction), np.cos(direction)], [np.cos(direction), -np.sin(direction)]])
    return covariance + CENTROID_SD**2 * axes.T @ np.diag([long**2, wide**2]) @ axes


def test_the_noise_of_a_centroid_is_added_to_what_is_there() -> None:
    noise = np.array([[2.0, 0.5], [0.5, 3.0]])
    expected = noise_of(noise, (30.0, 10.0, 0.7))
    add_centroid_noise(np.array([30.0, 10.0, 0.7]), CENTROID_SD, noise)
    np.testing.assert_allclose(noise, expected)


@pytest.mark.parametrize(
    ("column", "value"),
    [(name, value) for name in ("time", "east", "north", "azimuth", "range") for value in (np.nan, np.inf, -np.inf)]
    + [("east", 1.1e6), ("north", -1.1e6)],
)
def test_what_cannot_be_true_is_left_out(column: str, value: float) -> None:
    plots = plots_at(np.random.default_rng(1), [4.2 * A, 4.4 * A, 4.6 * A])
    changed = np.array(getattr(plots, column))
    changed[1] = value
    made, found = pooled(plots.replace(**{column: changed}))
    assert found == [2, 1, 0, 0, 0]
    assert made["row"].tolist() == [int(4.2 * A), int(4.6 * A)]


@pytest.mark.parametrize(
    ("covariance", "good"),
    [
        ([[4.0, 1.0], [1.0, 4.0]], True),
        ([[0.0, 0.0], [0.0, 4.0]], False),
        ([[-4.0, 0.0], [0.0, -4.0]], False),
        ([[4.0, 4.1], [4.1, 4.0]], False),
        ([[4.0, 4.0], [4.0, 4.0]], False),
        ([[9e5, 0.0], [0.0, 9e4]], True),
        ([[9e5, 0.0], [0.0, 2e5]], False),
        ([[4.0, np.nan], [0.0, 4.0]], False),
        ([[4.0, 0.0], [np.nan, 4.0]], False),
        ([[np.inf, 0.0], [0.0, 4.0]], False),
    ],
)
def test_a_covariance_must_be_one_of_a_position(covariance: Any, good: bool) -> None:
    plots = plots_at(np.random.default_rng(1), [4.2 * A]).replace(covariance=np.array([covariance]))
    assert pooled(plots)[1] == ([1, 0, 0, 0, 0] if good else [0, 1, 0, 0, 0])


@pytest.mark.parametrize(
    ("time", "what"),
    [(T0 + 1.99, LATE), (T0 + 2.01, STALE), (T0 + 4.99, GOOD), (T0 + 5.01, FUTURE)],
)
def test_what_is_of_another_time_is_counted_as_that(time: float, what: int) -> None:
    plots = plots_at(np.random.default_rng(1), [4.2 * A]).replace(time=time)
    found = [0] * 5
    found[what] = 1
    assert pooled(plots)[1] == found


@pytest.mark.parametrize(("row", "what"), [(3.49, STALE), (3.51, GOOD)])
def test_what_lies_too_far_behind_the_antenna_is_stale(row: float, what: int) -> None:
    assert pooled(plots_at(np.random.default_rng(1), [row * A]))[1][what] == 1


def test_a_place_just_across_north_belongs_to_the_turn_nearest_to_its_time() -> None:
    plots = make_plots([CLOCK[0] + 0.001, CLOCK[0] - 0.001], [[-0.1, 900.0], [0.1, 900.0]], 2.0)
    assert pooled(plots)[0]["row"].tolist() == [5 * A - 1, 5 * A]


def some_records(rng: np.random.Generator, many: int) -> Any:
    """Records of few rows, times and places, told apart by their cells."""
    made = np.zeros(many, POOL)
    made["row"] = rng.integers(0, 6, many)
    made["time"], made["position"] = rng.integers(0, 3, many), rng.integers(0, 3, (many, 2))
    made["cells"] = np.arange(many)
    return made


def pool_of(records: Any) -> PlotPool:
    return PlotPool.of({name: records[name] for name in POOL.names or ()})


def keys_of(records: Any) -> list[tuple[float, ...]]:
    return [(one["row"], one["time"], *one["position"], one["cells"]) for one in records]


@settings(deadline=None, derandomize=True, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0, 1, 5, 100, 300]))
def test_the_pool_is_in_order_of_row_time_and_place_however_it_came(seed: int, many: int) -> None:
    records = some_records(np.random.default_rng(seed), many)
    pool = pool_of(records)
    pool.sort()
    assert keys_of(pool.records) == sorted(keys_of(records))


@settings(deadline=None, derandomize=True, max_examples=30)
@given(st.integers(0, 2**32 - 1), st.integers(0, 40))
def test_what_is_spent_is_dropped_and_copies_are_copies(seed: int, many: int) -> None:
    rng = np.random.default_rng(seed)
    records = some_records(rng, many)
    records["spent"] = rng.random(many) < 0.5
    pool, rows = pool_of(records), rng.permutation(many)[: many // 2]
    copies = pool.copies(rows)
    assert keys_of(copies) == keys_of(records[rows])
    copies["cells"] = -1
    pool.drop_spent()
    assert keys_of(pool.records) == keys_of(records[~records["spent"]])
    pool.clear()
    assert len(pool) == len(pool.records) == 0


def test_the_pool_grows_with_what_comes_and_keeps_what_waits() -> None:
    rng, pool = np.random.default_rng(1), PlotPool()
    for _ in range(4):
        before = keys_of(pool.records)
        fresh, found = pool.take_in(plots_at(rng, rng.uniform(3.6 * A, 4.4 * A, 200)), BOUNDS, CLOCK, A, 1, 12.0)
        assert len(fresh) == found[GOOD] > 150
        assert keys_of(pool.records)[: len(before)] == before
        pool.sort()
    assert len(pool) > 600
    assert keys_of(pool.records) == sorted(keys_of(pool.records))


def test_nothing_pooled_is_nothing() -> None:
    assert pooled(make_plots([], np.empty((0, 2)), 2.0))[1] == [0] * 5


def test_a_pool_is_made_of_its_columns_again() -> None:
    made, _ = pooled(plots_at(np.random.default_rng(1), [4.2 * A, 4.4 * A]))
    again = PlotPool.of(pool_of(made).save()).records
    for name in POOL.names or ():
        np.testing.assert_array_equal(again[name], made[name])
