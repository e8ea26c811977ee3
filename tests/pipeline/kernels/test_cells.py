"""Places in cells, against a search of all."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.kernels.cells import sort_into_cells, span


@settings(deadline=None, derandomize=True, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(1, 60), st.floats(0.5, 300.0), st.floats(0.1, 400.0))
def test_what_lies_within_a_square_is_in_the_cells_that_it_touches(seed: int, n: int, cell: float, half: float) -> None:
    rng = np.random.default_rng(seed)
    position = rng.normal(0.0, 200.0, (n + 5, 2))
    plots = rng.permutation(n + 5)[:n].astype(np.int32)
    start, order, (west, south, side, columns, rows) = sort_into_cells(position, plots, cell)
    assert sorted(order.tolist()) == sorted(plots.tolist())
    assert (start[0], start[-1], len(start)) == (0, n, columns * rows + 1)
    assert side >= cell
    centre = rng.normal(0.0, 250.0, 2)
    x_from, x_to = span(centre[0] - half - west, centre[0] + half - west, side, int(columns))
    y_from, y_to = span(centre[1] - half - south, centre[1] + half - south, side, int(rows))
    found = {
        int(j)
        for y in range(y_from, y_to)
        for j in order[start[y * int(columns) + x_from] : start[y * int(columns) + x_to] if x_to > x_from else 0]
    }
    inside = {int(j) for j in plots if (np.abs(position[j] - centre) <= half).all()}
    assert inside <= found
    for j in found:  # and the cells that it touches reach no farther than one cell beyond it
        assert (np.abs(position[j] - centre) <= half + side).all()


def test_one_place_far_away_does_not_make_many_cells() -> None:
    position = np.concatenate([np.random.default_rng(1).uniform(0, 100, (50, 2)), [[1e6, 1e6]]])
    start, _, _ = sort_into_cells(position, np.arange(51), 10.0)
    assert len(start) < 4 * 51 + 50


@pytest.mark.parametrize(
    ("low", "high", "cells"), [(-5.0, -1.0, (0, 0)), (-5.0, 1.0, (0, 1)), (25.0, 31.0, (2, 3)), (31.0, 40.0, (0, 0))]
)
def test_an_interval_touches_cells_of_the_grid_only(low: float, high: float, cells: tuple[int, int]) -> None:
    assert span(low, high, 10.0, 3) == cells
