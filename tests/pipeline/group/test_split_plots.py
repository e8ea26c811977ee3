"""Several plots of one target as one: centre and extent from end to end."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.group.split_plots import join_split_plots
from pipeline.tables.arrays import Array, Floats

NAN = float("nan")


def join(position: Any, cells: Any, extent: Any, direction: float, members: Any = None) -> tuple[Floats, Floats]:
    """Centre and extent of the target that all plots, or `members` of them, belong to."""
    centre, whole = np.full(2, NAN), np.full(3, NAN)
    members = np.arange(len(position), dtype=np.int32) if members is None else np.array(members, np.int32)
    join_split_plots(
        members, np.array(position, float), np.array(cells, np.int32), np.array(extent, float), direction, centre, whole
    )
    return centre, whole


def test_one_plot_along_the_direction_is_itself() -> None:
    centre, whole = join([[3.0, 4.0], [50.0, 60.0]], [10, 3], [[30.0, 8.0, 0.4], [5.0, 2.0, NAN]], 0.4, [0])
    np.testing.assert_allclose(centre, [3.0, 4.0])
    np.testing.assert_allclose(whole, [30.0, 8.0, 0.4])


@given(st.floats(0, 2 * np.pi), st.floats(1, 40), st.floats(1, 40))
def test_nose_and_tail_reach_from_end_to_end(direction: float, ahead: float, back: float) -> None:
    along, across = np.array([np.sin(direction), np.cos(direction)]), np.array([np.cos(direction), -np.sin(direction)])
    position = np.array([100.0, -200.0]) + np.array([ahead * along, -back * along + 2.0 * across])
    centre, whole = join(position, [8, 8], [[6.0, 4.0, direction], [6.0, 4.0, direction]], direction)
    assert whole[0] == pytest.approx(ahead + back + 6.0)
    assert whole[1] == pytest.approx(2.0 + 4.0)
    assert whole[2] == pytest.approx(direction % np.pi)
    np.testing.assert_allclose(centre, position.mean(axis=0))


def test_the_centre_is_weighed_by_cells_and_the_plots_of_others_are_left_alone() -> None:
    position = [[0.0, 0.0], [500.0, 500.0], [0.0, 12.0]]
    extent = [[4.0, 4.0, 0.0], [20.0, 9.0, 1.5], [4.0, 4.0, NAN]]
    centre, whole = join(position, [3, 7, 1], extent, 0.0, [0, 2])
    np.testing.assert_allclose(centre, [0.0, 3.0])
    np.testing.assert_allclose(whole, [16.0, 4.0, 0.0])


def test_a_plot_without_cells_counts_as_one_of_one() -> None:
    centre, _ = join([[0.0, 0.0], [0.0, 12.0]], [0, 2], [[4.0, 4.0, 0.0]] * 2, 0.0)
    np.testing.assert_allclose(centre, [0.0, 8.0])


def test_a_plot_across_the_direction_lends_its_width_to_the_length() -> None:
    _, whole = join([[0.0, 0.0], [0.0, 20.0]], [1, 1], [[10.0, 2.0, 0.0], [10.0, 2.0, np.pi / 2]], 0.0)
    np.testing.assert_allclose(whole, [5.0 + 20.0 + 1.0, 10.0, 0.0], atol=1e-9)


def slow_twin(
    members: Array, position: Floats, cells: Array, extent: Floats, direction: float
) -> tuple[Floats, Floats]:
    """The same with whole columns: the ends of each plot in the axes of the target."""
    weight = np.maximum(cells[members], 1)
    axes = np.array([[np.sin(direction), np.cos(direction)], [np.cos(direction), -np.sin(direction)]])
    place = position[members] @ axes.T
    turn = np.nan_to_num(extent[members, 2]) - direction
    lean = np.abs(np.stack([np.cos(turn), np.sin(turn)], axis=1))
    half = 0.5 * np.maximum(extent[members, :1] * lean, extent[members, 1:2] * lean[:, ::-1])
    ends = (place + half).max(axis=0) - (place - half).min(axis=0)
    return np.average(position[members], axis=0, weights=weight), np.array([*ends, direction % np.pi])


@settings(deadline=None, derandomize=True, max_examples=100)
@given(st.integers(0, 2**32 - 1), st.integers(1, 6))
def test_any_plots_are_joined_as_by_the_slow_twin(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    position, cells = rng.uniform(-50, 50, (n, 2)), rng.integers(0, 40, n).astype(np.int32)
    extent = np.column_stack([rng.uniform(0, 40, (n, 2)), rng.uniform(-7, 7, n)])
    extent[rng.random(n) < 0.3, 2] = NAN
    direction = float(rng.uniform(-7, 7))
    members = rng.permutation(n)[: rng.integers(1, n + 1)].astype(np.int32)
    centre, whole = join(position, cells, extent, direction, members)
    expected = slow_twin(members, position, cells, extent, direction)
    np.testing.assert_allclose(centre, expected[0], atol=1e-9)
    np.testing.assert_allclose(whole, expected[1], atol=1e-9)
