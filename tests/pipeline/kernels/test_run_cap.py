"""The bit kernels against numpy, and the cap on runs."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit
from numpy.typing import NDArray

from pipeline.kernels.bits import bits_of_row, compare_and_add_four, compare_twice_and_add_four, count_runs
from pipeline.kernels.run_cap import detect_row, fit_row


def unpacked(words: NDArray[np.uint64]) -> NDArray[np.int8]:
    return np.unpackbits(words.view(np.uint8), bitorder="little").astype(np.int8)


def runs_of(cells: NDArray[Any]) -> int:
    return int((np.diff(cells.astype(np.int8), prepend=0) == 1).sum())


def padded(cells: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.concatenate([cells, np.zeros(-len(cells) % 64, np.uint8)])


@settings(max_examples=60, deadline=None)
@given(words=st.integers(1, 40), seed=st.integers(0, 2**32 - 1), density=st.sampled_from([0.01, 0.5, 0.99, 1.0]))
def test_runs_are_counted_across_words(words: int, seed: int, density: float) -> None:
    cells = np.random.default_rng(seed).random(64 * words) < density
    mask = np.packbits(cells, bitorder="little").view(np.uint64)
    assert count_runs(mask) == runs_of(cells)


@settings(max_examples=40, deadline=None)
@given(ranges=st.integers(1, 400), seed=st.integers(0, 2**32 - 1))
def test_bits_of_a_row(ranges: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    cells, limits = rng.integers(0, 256, (2, ranges), dtype=np.uint8)
    padded_limits = padded(limits)
    bits, tail = np.zeros(len(padded_limits) // 64, np.uint64), np.zeros(64, np.uint8)
    assert _bits_of_row(cells, padded_limits, bits, tail) == (cells > limits).any()
    np.testing.assert_array_equal(unpacked(bits)[:ranges], cells > limits)
    assert not unpacked(bits)[ranges:].any()


def test_four_rows_at_a_time() -> None:
    rng = np.random.default_rng(1)
    cells = rng.integers(0, 256, (4, 64), dtype=np.uint8)
    cells[:, :8] = 255
    limits = rng.integers(0, 256, 64, dtype=np.uint8)
    sums = rng.integers(0, 65535 - 4 * 510, 32, dtype=np.uint16)
    bits, total = np.zeros((4, 1), np.uint64), sums.copy()
    _four(cells, limits, total, bits)
    np.testing.assert_array_equal(np.stack([unpacked(one) for one in bits]), cells > limits)
    np.testing.assert_array_equal(total, sums + cells.reshape(4, 32, 2).astype(int).sum(axis=(0, 2)))
    lower, twice, grown, again = limits // 2, np.zeros_like(bits), np.zeros_like(bits), sums.copy()
    _four_twice(cells, limits, again, twice, lower, grown)
    np.testing.assert_array_equal(twice, bits)
    np.testing.assert_array_equal(again, total)
    np.testing.assert_array_equal(np.stack([unpacked(one) for one in grown]), cells > lower)


@settings(max_examples=60, deadline=None)
@given(ranges=st.integers(1, 300), seed=st.integers(0, 2**32 - 1), budget=st.floats(0, 20))
def test_a_row_that_does_not_fit_is_raised_until_it_does_and_no_further(ranges: int, seed: int, budget: float) -> None:
    rng = np.random.default_rng(seed)
    cells = rng.integers(0, 256, ranges, dtype=np.uint8)
    limits = rng.integers(0, 120, ranges, dtype=np.uint8)
    if runs_of(cells > limits) <= budget:
        return
    padded_limits = padded(limits)
    bits, left = np.zeros(len(padded_limits) // 64, np.uint64), np.array([budget])
    _fit(cells, padded_limits, bits, left, np.zeros(64, np.uint8))
    found = unpacked(bits)[:ranges].astype(bool)
    assert runs_of(found) <= budget
    assert left[0] == budget - runs_of(found)
    raised = [up for up in range(1, 256) if np.array_equal(cells > np.minimum(limits.astype(int) + up, 255), found)]
    assert raised
    assert runs_of(cells > np.minimum(limits.astype(int) + raised[0] - 1, 255)) > budget


def test_the_bucket_fills_by_sweep_and_is_bounded() -> None:
    cells = np.tile(np.array([200, 0], np.uint8), 32)
    bits, grown = np.zeros(1, np.uint64), np.zeros(1, np.uint64)
    budget, degraded = np.array([5.0]), np.zeros(1, np.int64)
    limits, growth = np.full(64, 100, np.uint8), np.full(64, 50, np.uint8)
    runs, counts = [], []
    for turn in range(30):
        row = cells if turn % 10 < 2 else np.zeros(64, np.uint8)
        detect_row(row, limits, growth, bits, grown, (4.0, 40.0), budget, degraded, np.zeros(64, np.uint8))
        np.testing.assert_array_equal(grown, bits)
        runs.append(int(count_runs(bits)))
        counts.append(int(degraded[0]))
    # 32 runs a row are wanted: 5 + 4 are too few, ten sweeps later the bucket holds 40 at most
    assert runs[:2] == [0, 0]
    assert runs[10:12] == [32, 0]
    assert runs[20:22] == [32, 0]
    assert counts[-1] == 4


@njit
def _bits_of_row(cells: Any, limits: Any, bits: Any, tail: Any) -> Any:
    return bits_of_row(cells, limits.ctypes.data, bits, tail)


@njit
def _fit(cells: Any, limits: Any, bits: Any, budget: Any, tail: Any) -> None:
    fit_row(cells, limits.ctypes.data, bits, budget, tail)


@njit
def _four(cells: Any, limits: Any, sums: Any, bits: Any) -> None:
    step, words = np.uintp(64), np.uintp(8)
    compare_and_add_four(cells.ctypes.data, step, sums.ctypes.data, words, limits.ctypes.data, bits.ctypes.data)


@njit
def _four_twice(cells: Any, limits: Any, sums: Any, bits: Any, lower: Any, grown: Any) -> None:
    step, words = np.uintp(64), np.uintp(8)
    cells_at, sums_at, limits_at, lower_at = cells.ctypes.data, sums.ctypes.data, limits.ctypes.data, lower.ctypes.data
    compare_twice_and_add_four(cells_at, step, sums_at, words, limits_at, bits.ctypes.data, lower_at, grown.ctypes.data)
