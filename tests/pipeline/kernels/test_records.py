"""Rows of record arrays, against numpy's own copies."""

from __future__ import annotations

import numpy as np

from pipeline.kernels.records import octets_of, take
from pipeline.tables.arrays import Array

KIND = np.dtype([("a", "f8", (2,)), ("b", "?"), ("c", "i4")], align=True)


def records(n: int, seed: int) -> Array:
    made = np.zeros(n, KIND)
    rng = np.random.default_rng(seed)
    made["a"], made["b"], made["c"] = rng.normal(size=(n, 2)), rng.random(n) < 0.5, rng.integers(0, 99, n)
    return made


def same(one: Array, other: Array) -> bool:
    return len(one) == len(other) and all(np.array_equal(one[name], other[name]) for name in ("a", "b", "c"))


def test_rows_by_index_and_by_mask() -> None:
    some = records(9, 1)
    for rows in (np.array([3, 3, 0]), some["b"], np.zeros(0, np.int64)):
        made = take(some, rows)
        assert same(made, some[rows])
        made["c"] = -1
        assert (some["c"] >= 0).all()


def test_octets_are_a_view_of_whole_rows() -> None:
    some = np.zeros((4, 3), KIND)
    octets_of(some)[1] = 255
    assert octets_of(some).shape == (4, 3 * KIND.itemsize)
    assert (some["c"][1] == -1).all()
    assert (some["c"][0] == 0).all()
    assert octets_of(np.zeros((4, 0), KIND)).shape == (4, 0)
