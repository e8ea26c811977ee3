"""Plots that grow out of detected cells, against brute force, for any link rule."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.kernels.growth import GrowthState, GrowthWindow, flush_grown, take_grown_block
from pipeline.kernels.links import LinkRule
from pipeline.tables import Plots, Sweeps, VideoFormat
from tests.pipeline.contracts.extract import assert_same_plots
from tests.pipeline.extract.naive_components import grown_cells, linked_components
from tests.support.video_scenes import CUTS, cut, packed, site, strip

GRID = VideoFormat(azimuths=48, ranges=200, range_step_m=3.0, beamwidth_rad=0.2)


def metric(ranges: int, rows: int = 5) -> Any:
    """(ranges, rows + 1): one range cell, and fewer azimuth rows the farther away."""
    n = np.maximum(1, rows - np.arange(ranges) // 25)
    return np.where(np.arange(rows + 1) <= n[:, None], 1, -1)


def state_of(video: VideoFormat = GRID, **limits: Any) -> GrowthState:
    rule = LinkRule.of(metric(video.ranges))
    near = GrowthWindow.of(video, rule, limits.pop("max_runs", 10**6))
    given_limits = {"min_cells": 1, "max_extent_turn": 0.5, "max_open_runs": 4096} | limits
    return GrowthState.growing(site(video), rule, near, **given_limits)


def scene(seed: int, seeds: float, growth: float, scans: int = 2, video: VideoFormat = GRID) -> tuple[Any, Any, Any]:
    rng = np.random.default_rng(seed)
    shape = (scans, video.azimuths, video.ranges)
    lower = rng.random(shape) < growth
    lower |= np.roll(lower, 1, axis=1) & (rng.random(shape) < 0.7)
    found = lower & (rng.random(shape) < seeds)
    return rng.integers(0, 256, shape, dtype=np.uint8), found, found | lower


def run(blocks: list[Sweeps], found: Any, lower: Any, state: GrowthState, flush: bool = True) -> Plots:
    made = []
    for block in blocks:
        both = packed(found[block.scan][block.row]), packed(lower[block.scan][block.row])
        made.append(take_grown_block(block, replace(both[0], growth=both[1].mask), state))
    return Plots.concatenate([*made, flush_grown(state)] if flush else made)


def summary(plots: Plots) -> list[tuple[int, ...]]:
    return sorted((int(p), *map(int, w)) for p, w in zip(plots.cells, plots.window, strict=True))


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    seeds=st.sampled_from([0.02, 0.1, 0.5]),
    growth=st.sampled_from([0.004, 0.02, 0.05]),
)
def test_equal_to_brute_force(seed: int, seeds: float, growth: float) -> None:
    amplitude, found, lower = scene(seed, seeds, growth)
    flat_found, flat_lower = (one.reshape(-1, GRID.ranges) for one in (found, lower))
    state = state_of()
    plots = run(strip(amplitude, GRID), found, lower, state)
    kept = grown_cells(flat_found, flat_lower, metric(GRID.ranges))
    components = linked_components(kept, metric(GRID.ranges))
    wanted, most = [], 0
    for one in components:
        i, j = np.array(sorted(one)).T
        most = max(most, int(np.ptp(i)) + 1)
        assert flat_found[i, j].any()
        wanted.append(
            (
                int(flat_found[i, j].sum()),
                int(i.min() % GRID.azimuths),
                int(np.ptp(i)) + 1,
                int(j.min()),
                int(np.ptp(j)) + 1,
            )
        )
    if most < state.limits[1]:
        assert summary(plots) == sorted(wanted)
        assert state.counters["plots_without_seed"] == 0


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    cuts=CUTS,
    lost=st.sampled_from([0.0, 0.3, 0.95]),
    max_runs=st.sampled_from([40, 10**6]),
)
def test_block_size_and_restart_do_not_matter(seed: int, cuts: list[int], lost: float, max_runs: int) -> None:
    amplitude, found, lower = scene(seed, 0.1, 0.03, scans=3)
    keep = np.random.default_rng(seed).random((3, GRID.azimuths)) >= lost
    blocks = strip(amplitude, GRID, keep)
    state = state_of(max_runs=max_runs)
    whole = run(blocks, found, lower, state)
    pieces = [one for block in blocks for one in cut(block, cuts)]
    other = state_of(max_runs=max_runs)
    first = run(pieces[: len(pieces) // 2], found, lower, other, flush=False)
    again = state_of(max_runs=max_runs)
    again.restore(other.save())
    second = run(pieces[len(pieces) // 2 :], found, lower, again)
    assert_same_plots(whole, Plots.concatenate([first, second]))
    assert again.counters == state.counters
    assert (state.counters["growth_rows_skipped"] > 0) == (max_runs == 40) or lost > 0


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), cuts=CUTS)
def test_nothing_comes_from_before_the_closed_row(seed: int, cuts: list[int]) -> None:
    amplitude, found, lower = scene(seed, 0.1, 0.02, scans=3)
    state = state_of()
    closed = 0
    for block in strip(amplitude, GRID):
        for piece in cut(block, cuts):
            plots = run([piece], found, lower, state, flush=False)
            row = plots.scan * GRID.azimuths + plots.azimuth / GRID.azimuth_step_rad
            assert (row >= closed - 1e-6).all()
            assert closed <= state.closed_row <= piece.scan * GRID.azimuths + int(piece.row[-1]) + 1
            closed = state.closed_row


def test_growth_joins_two_detected_cells_and_alone_is_nothing() -> None:
    found = np.zeros((1, 48, 200), bool)
    lower = np.zeros_like(found)
    found[0, 20, 100] = found[0, 20, 103] = True
    lower[0, 20, 101:106] = True
    lower[0, 20, 140:150] = True
    lower[0, 40, 100] = True
    amplitude = np.full(found.shape, 80, np.uint8)
    state = state_of()
    plots = run(strip(amplitude, GRID), found, lower, state)
    assert summary(plots) == [(2, 20, 1, 100, 5)]
    assert len(run(strip(amplitude, GRID), found, found, state_of())) == 2


@pytest.mark.parametrize("table", [[[1, 1], [1, 2]], [[1, 0], [2, 0]], [[0, 0], [0, 0]], [[2, -2], [2, -2]]])
def test_a_rule_that_does_not_fall_is_refused(table: Any) -> None:
    with pytest.raises(ValueError, match=r"reach|neighbours"):
        LinkRule.of(np.array(table))
