"""The hysteresis extractor against brute force, on whole chains and on targets of known size."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.chain import RadarChain
from pipeline.contracts.extract import Extractor
from pipeline.extract.hysteresis import Hysteresis
from pipeline.kernels.growth import GrowthState
from pipeline.parts import PartError, build
from pipeline.tables import Detections, Plots, Sweeps, VideoFormat
from tests.pipeline.contracts.extract import ExtractorContract, assert_same_plots, clumps
from tests.pipeline.extract.naive_hysteresis import hysteresis_components, kept_cells
from tests.support.video_scenes import CUTS, INHERITED, SMALL, cut, packed, rayleigh, site, strip


class TestHysteresisKeepsTheContract(ExtractorContract):
    def make(self, **setting: Any) -> Extractor:
        part: Extractor = build("extract", "hysteresis", setting)
        return part


def both(seeds: Any, growth: Any) -> Detections:
    return Detections(packed(seeds).mask, growth=packed(growth).mask)


def window_of(part: Hysteresis, video: VideoFormat) -> Any:
    slant = video.first_range_m + video.range_step_m * np.arange(video.ranges)
    with np.errstate(divide="ignore"):
        rows = np.floor(part.window_m / (slant * video.azimuth_step_rad))
    return np.clip(rows, 1, min(part.most_rows, (video.azimuths - 2) // 3)).astype(int)


def scene(seed: int, shape: tuple[int, int], density: float, growth: float) -> tuple[Any, Any]:
    rng = np.random.default_rng(seed)
    seeds = rng.random(shape) < density
    return seeds, seeds | (rng.random(shape) < growth)


def summary(plots: Plots) -> list[tuple[int, ...]]:
    return sorted((int(p), *map(int, w)) for p, w in zip(plots.cells, plots.window, strict=True))


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    density=st.sampled_from([0.004, 0.02, 0.05]),
    growth=st.sampled_from([0.0, 0.07, 0.3]),
    window_m=st.sampled_from([1.0, 25.0, 70.0]),
    ranges=st.sampled_from([20, 64, 70]),
    blocks=CUTS,
)
def test_equal_to_brute_force_over_the_seam_at_north(
    seed: int, density: float, growth: float, window_m: float, ranges: int, blocks: list[int]
) -> None:
    video = VideoFormat(azimuths=30, ranges=ranges, range_step_m=10.0, beamwidth_rad=0.2)
    part = Hysteresis(window_m=window_m, max_extent_turn=0.5)
    seeds, grown = scene(seed, (60, ranges), density, growth)
    state = part.start(site(video))
    made = []
    for scan, block in enumerate(strip(np.full((2, 30, ranges), 7, np.uint8), video)):
        for piece in cut(block, blocks):
            rows = 30 * scan + piece.row
            made.append(part(piece, both(seeds[rows], grown[rows]), state))
    plots = Plots.concatenate([*made, part.flush(state)])
    window = window_of(part, video)
    components = hysteresis_components(seeds, grown, window)
    limit = state.limits[1]
    if max((max(i for i, _ in one) - min(i for i, _ in one) for one in components), default=0) < limit - 1:
        assert summary(plots) == sorted(
            (
                sum(bool(seeds[cell]) for cell in one),
                min(i for i, _ in one) % 30,
                max(i for i, _ in one) - min(i for i, _ in one) + 1,
                min(j for _, j in one),
                max(j for _, j in one) - min(j for _, j in one) + 1,
            )
            for one in components
        )
        assert plots.cells.sum() == seeds.sum()
        assert state.counters["cells_detected"] == kept_cells(seeds, grown, window).sum()


@settings(max_examples=20, deadline=None, suppress_health_check=INHERITED)
@given(cuts=CUTS, seed=st.integers(0, 2**32 - 1), lost=st.sampled_from([0.0, 0.3, 0.95]))
def test_block_size_does_not_matter_with_growth(cuts: list[int], seed: int, lost: float) -> None:
    rng = np.random.default_rng(seed)
    keep = rng.random((3, SMALL.azimuths)) >= lost
    blocks = strip(rng.integers(0, 256, (3, SMALL.azimuths, SMALL.ranges), dtype=np.uint8), SMALL, keep)
    seeds = clumps(rng, 3, SMALL, 0.005)
    grown = seeds | (rng.random(seeds.shape) < 0.08)
    part = Hysteresis(window_m=30.0)

    def plots_in(pieces: list[Sweeps]) -> tuple[Plots, GrowthState]:
        state = part.start(site())
        made = [part(one, both(seeds[one.scan, one.row], grown[one.scan, one.row]), state) for one in pieces]
        return Plots.concatenate([*made, part.flush(state)]), state

    whole, state = plots_in(blocks)
    pieces, other = plots_in([one for block in blocks for one in cut(block, cuts)])
    assert_same_plots(whole, pieces)
    assert state.counters == other.counters


def test_save_and_restore_with_rows_that_wait() -> None:
    rng = np.random.default_rng(3)
    seeds = clumps(rng, 2, SMALL, 0.01)
    grown = seeds | (rng.random(seeds.shape) < 0.1)
    blocks = strip(rng.integers(0, 256, seeds.shape, dtype=np.uint8), SMALL)
    pieces = [one for block in blocks for one in cut(block, (7, 50, 51))]
    part = Hysteresis(window_m=60.0)

    def plots_of(some: list[Sweeps], state: GrowthState) -> list[Plots]:
        return [part(one, both(seeds[one.scan, one.row], grown[one.scan, one.row]), state) for one in some]

    state = part.start(site())
    straight = Plots.concatenate([*plots_of(pieces, state), part.flush(state)])
    for k in range(1, len(pieces)):
        state = part.start(site())
        first = plots_of(pieces[:k], state)
        again = part.start(site())
        again.restore(state.save())
        assert_same_plots(straight, Plots.concatenate([*first, *plots_of(pieces[k:], again), part.flush(again)]))


def test_cells_over_the_lower_threshold_alone_are_no_plot() -> None:
    part = Hysteresis()
    nothing = np.zeros((1, SMALL.azimuths, SMALL.ranges), bool)
    block = strip(np.full(nothing.shape, 90, np.uint8), SMALL)[0]
    state = part.start(site())
    plots = Plots.concatenate([part(block, both(nothing[0], ~nothing[0]), state), part.flush(state)])
    assert len(plots) == 0
    assert state.counters["cells_detected"] == 0


def test_growth_does_not_wander_through_clutter() -> None:
    video = VideoFormat()
    cells = np.zeros((4096, 1024), bool)
    cells[1000, 33] = True  # 99 m
    part = Hysteresis()
    state = part.start(site(video))
    everything = np.ones_like(cells)
    block = strip(np.full((1, *cells.shape), 90, np.uint8), video)[0]
    plots = Plots.concatenate([part(block, both(cells, everything), state), part.flush(state)])
    assert len(plots) == 1
    assert tuple(plots.window[0]) == (1000 - 19, 39, 32, 3)


def test_a_flood_of_growth_keeps_the_detected_cells_and_is_counted() -> None:
    rng = np.random.default_rng(4)
    seeds = rng.random((2, SMALL.azimuths, SMALL.ranges)) < 0.05
    grown = rng.random(seeds.shape) < 0.4
    blocks = strip(np.full(seeds.shape, 90, np.uint8), SMALL)
    made = []
    for cuts in ([], [*range(0, 96, 7)]):
        part = Hysteresis(max_grown_runs=300)
        state = part.start(site())
        pieces = [one for block in blocks for one in cut(block, cuts)]
        plots = [part(one, both(seeds[one.scan, one.row], grown[one.scan, one.row]), state) for one in pieces]
        made.append(Plots.concatenate([*plots, part.flush(state)]))
        assert state.counters["growth_rows_skipped"] > 100
        assert made[-1].cells.sum() >= seeds.sum()
    assert_same_plots(*made)


def test_a_target_beyond_the_grid_of_fine_azimuths_is_linked_in_metres() -> None:
    """Two detected cells a window apart are one plot, a little more are two, at any range."""
    video = VideoFormat(ranges=900)
    part = Hysteresis()
    for range_m in (99.0, 300.0, 1500.0):
        rows = int(window_of(part, video)[int(range_m / 3)])
        for apart, count in ((rows, 1), (rows + 1, 2)):
            cells = np.zeros((1, 4096, 900), bool)
            cells[0, 500, int(range_m / 3)] = cells[0, 500 + apart, int(range_m / 3)] = True
            state = part.start(site(video))
            block = strip(np.full(cells.shape, 90, np.uint8), video)[0]
            plots = Plots.concatenate([part(block, both(cells[0], cells[0]), state), part.flush(state)])
            assert len(plots) == count, (range_m, apart)


@pytest.mark.parametrize("detector", ["hybrid", "adaptive"])
def test_the_chain_asks_the_detector_for_growth(detector: str) -> None:
    """A bright target with a dim part, in clutter: the dim part is in the plot of the bright one."""
    rng = np.random.default_rng(8)
    video = VideoFormat(azimuths=512, ranges=200, beamwidth_rad=0.02)
    frames = rayleigh(rng, (16, 512, 200), 20.0)
    frames[-1, 100:106, 80:84] = 170
    frames[-1, 106, 80:84] = 94  # 9.4 dB over the mean power: below the threshold, above the growth
    rows = {}
    for name in ("manhattan", "hysteresis"):
        chain = RadarChain(site(video), 0, build("detect", detector), build("extract", name))
        plots = [chain.process(block).plots for block in strip(frames, video)]
        last = Plots.concatenate([*plots, chain.flush().plots])
        here = (last.scan == 15) & (last.window[:, 0] + last.window[:, 1] > 100) & (last.window[:, 0] < 110)
        rows[name] = int(last.window[here, 1].max())
        assert last.cells[here].max() == 24
    assert rows["manhattan"] == 6
    assert rows["hysteresis"] >= 7


@pytest.mark.parametrize(
    "setting",
    [
        {"growth_db": 0.0},
        {"window_m": 0.0},
        {"window_m": float("inf")},
        {"max_open_runs": 10**8},
        {"most_rows": 0},
        {"most_rows": 65},
        {"min_cells": 0},
        {"max_grown_runs": 0},
        {"max_extent_turn": 0.0},
    ],
)
def test_wrong_settings_are_refused(setting: dict[str, Any]) -> None:
    with pytest.raises(PartError):
        build("extract", "hysteresis", setting)
