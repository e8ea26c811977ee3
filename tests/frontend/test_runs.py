"""Runs in rows of words: their ends, counts and look-ups, against numpy."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.kernels.runs import any_bit, count_set, edges_of
from tests.frontend.scenes import packed


def rows(ranges: int) -> NDArray[np.bool_]:
    """Rows of all densities, with runs that begin and end on the borders of words."""
    rng = np.random.default_rng(ranges)
    some = [rng.random(ranges) < density for density in (0.0, 0.003, 0.03, 0.3, 0.7, 0.97, 1.0) for _ in range(8)]
    for first, last in ((0, 63), (0, 64), (63, 64), (64, 127), (60, 130), (0, ranges - 1), (ranges - 1, ranges - 1)):
        one = np.zeros(ranges, bool)
        one[first : last + 1] = True
        some.append(one)
    return np.array(some)


@pytest.mark.parametrize("ranges", [17, 64, 130, 512, 700, 1024, 5000])
def test_ends_of_runs(ranges: int) -> None:
    cells = rows(ranges)
    edges = np.zeros(ranges + 66, np.int64)
    for row, bits in zip(cells, packed(cells).mask, strict=True):
        wanted = np.flatnonzero(np.diff(np.pad(row.astype(np.int8), 1)))
        np.testing.assert_array_equal(edges[: edges_of(bits, edges)], wanted)


@pytest.mark.parametrize("ranges", [64, 130, 700])
def test_bits_between_two_places(ranges: int) -> None:
    rng = np.random.default_rng(1)
    cells = rows(ranges)
    for row, bits in zip(cells, packed(cells).mask, strict=True):
        for first, last in np.sort(rng.integers(0, ranges, (12, 2)), axis=1):
            assert any_bit(bits, int(first), int(last)) == row[first : last + 1].any()
            assert count_set(bits, int(first), int(last) + 1) == row[first : last + 1].sum()
