"""Several plots of one target as one: centre and extent from end to end."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.group.split_plots import join_split_plots

NAN = float("nan")


def test_a_target_of_one_plot_keeps_what_that_says() -> None:
    position, extent = np.array([[3.0, 4.0], [50.0, 60.0]]), np.array([[30.0, 8.0, 0.4], [5.0, 2.0, NAN]])
    centre, made = join_split_plots(np.arange(2), position, np.array([10, 3]), extent, np.array([1.0, 2.0]))
    np.testing.assert_array_equal(centre, position)
    np.testing.assert_array_equal(made, extent)


@given(st.floats(0, 2 * np.pi), st.floats(1, 40), st.floats(1, 40))
def test_nose_and_tail_reach_from_end_to_end(direction: float, ahead: float, back: float) -> None:
    along, across = np.array([np.sin(direction), np.cos(direction)]), np.array([np.cos(direction), -np.sin(direction)])
    position = np.array([100.0, -200.0]) + np.array([ahead * along, -back * along + 2.0 * across])
    extent = np.array([[6.0, 4.0, direction], [6.0, 4.0, direction]])
    centre, made = join_split_plots(np.zeros(2, int), position, np.array([8, 8]), extent, np.array([direction]))
    assert made[0, 0] == pytest.approx(ahead + back + 6.0)
    assert made[0, 1] == pytest.approx(2.0 + 4.0)
    assert made[0, 2] == pytest.approx(direction % np.pi)
    np.testing.assert_allclose(centre[0], position.mean(axis=0))


def test_the_centre_is_weighed_by_cells_and_the_other_target_is_left_alone() -> None:
    member = np.array([0, 1, 0])
    position = np.array([[0.0, 0.0], [500.0, 500.0], [0.0, 12.0]])
    extent = np.array([[4.0, 4.0, 0.0], [20.0, 9.0, 1.5], [4.0, 4.0, NAN]])
    centre, made = join_split_plots(member, position, np.array([3, 7, 1]), extent, np.array([0.0, 1.0]))
    np.testing.assert_allclose(centre, [[0.0, 3.0], [500.0, 500.0]])
    np.testing.assert_allclose(made, [[16.0, 4.0, 0.0], [20.0, 9.0, 1.5]])


def test_a_plot_across_the_direction_lends_its_width_to_the_length() -> None:
    extent = np.array([[10.0, 2.0, 0.0], [10.0, 2.0, np.pi / 2]])
    _, made = join_split_plots(
        np.zeros(2, int), np.array([[0.0, 0.0], [0.0, 20.0]]), np.array([1, 1]), extent, np.zeros(1)
    )
    np.testing.assert_allclose(made[0], [5.0 + 20.0 + 1.0, 10.0, 0.0])
