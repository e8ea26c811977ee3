"""What every extractor must do: inherit the class, say how to make the part."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.contracts.extract import Extractor
from pipeline.tables import Plots, Sweeps, VideoFormat
from tests.support.video_scenes import CUTS, INHERITED, SMALL, cut, packed, site, strip


def plots_of(part: Extractor, blocks: list[Sweeps], cells: list[Any], state: Any, flush: bool = True) -> Plots:
    made = [part(block, packed(cell), state) for block, cell in zip(blocks, cells, strict=True)]
    return Plots.concatenate(made + ([part.flush(state)] if flush else []))


def assert_same_plots(a: Plots, b: Plots) -> None:
    for name in Plots.columns():
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)


def clumps(rng: np.random.Generator, scans: int, video: VideoFormat, density: float) -> Any:
    """(scans, azimuths, ranges) booleans: single cells and small blobs."""
    shape = (scans * video.azimuths, video.ranges)
    cells = rng.random(shape) < density
    for _ in range(6 * scans):
        i, j = rng.integers(0, shape[0]), rng.integers(0, shape[1])
        cells[i : i + rng.integers(1, 12), j : j + rng.integers(1, 9)] |= rng.random() < 0.8
    return cells.reshape(scans, video.azimuths, video.ranges)


class ExtractorContract:
    """Inherit and give make()."""

    def make(self, **setting: Any) -> Extractor:
        raise NotImplementedError

    def scene(self, seed: int, density: float, lost: float) -> tuple[list[Sweeps], list[Any]]:
        rng = np.random.default_rng(seed)
        keep = rng.random((3, SMALL.azimuths)) >= lost
        amplitude = rng.integers(0, 256, (3, SMALL.azimuths, SMALL.ranges), dtype=np.uint8)
        cells = clumps(rng, 3, SMALL, density)
        return strip(amplitude, SMALL, keep), [cells[scan][keep[scan]] for scan in range(3)]

    @settings(max_examples=20, deadline=None, suppress_health_check=INHERITED)
    @given(
        cuts=CUTS,
        seed=st.integers(0, 2**32 - 1),
        density=st.sampled_from([0.002, 0.02, 0.3]),
        lost=st.sampled_from([0.0, 0.3, 0.95]),
    )
    def test_block_size_does_not_matter(self, cuts: list[int], seed: int, density: float, lost: float) -> None:
        blocks, cells = self.scene(seed, density, lost)
        part = self.make()
        whole = plots_of(part, blocks, cells, part.start(site()))
        pieces = [one for block in blocks for one in cut(block, cuts)]
        by_row = {
            (b.scan, int(r)): c for b, cc in zip(blocks, cells, strict=True) for r, c in zip(b.row, cc, strict=True)
        }
        cut_cells = [np.array([by_row[b.scan, int(r)] for r in b.row]).reshape(-1, SMALL.ranges) for b in pieces]
        state = part.start(site())
        assert_same_plots(whole, plots_of(part, pieces, cut_cells, state))
        assert whole.cells.sum() + state.counters["runs_dropped"] > 0 or not any(c.any() for c in cells)

    def test_save_and_restore_midway(self) -> None:
        blocks, cells = self.scene(11, 0.02, 0.1)
        part = self.make()
        straight = plots_of(part, blocks, cells, part.start(site()))
        state = part.start(site())
        first = plots_of(part, blocks[:1], cells[:1], state, flush=False)
        again = part.start(site())
        again.restore(state.save())
        assert_same_plots(straight, Plots.concatenate([first, plots_of(part, blocks[1:], cells[1:], again)]))

    @settings(max_examples=15, deadline=None, suppress_health_check=INHERITED)
    @given(seed=st.integers(0, 2**32 - 1), cuts=CUTS)
    def test_nothing_comes_from_before_the_closed_row(self, seed: int, cuts: list[int]) -> None:
        blocks, cells = self.scene(seed, 0.01, 0.0)
        part = self.make()
        state = part.start(site())
        closed = 0
        for block, found in zip(blocks, cells, strict=True):
            begin = 0
            for piece in cut(block, cuts):
                plots = part(piece, packed(found[begin : begin + len(piece)]), state)
                begin += len(piece)
                row = plots.scan * SMALL.azimuths + plots.azimuth / SMALL.azimuth_step_rad
                assert (row >= closed - 1e-6).all()
                assert state.closed_row >= closed
                closed = state.closed_row
                assert closed <= piece.scan * SMALL.azimuths + int(piece.row[-1]) + 1

    def test_a_target_across_north_is_one_plot_of_its_own_time(self) -> None:
        cells = np.zeros((2, SMALL.azimuths, SMALL.ranges), bool)
        cells[0, -3:, 50:53] = True
        cells[1, :2, 50:53] = True
        blocks = strip(np.full(cells.shape, 90, np.uint8), SMALL)
        part = self.make()
        plots = plots_of(part, blocks, list(cells), part.start(site()))
        assert len(plots) == 1
        centre = SMALL.azimuths - 0.5
        assert plots.time[0] == pytest.approx(1000.0 + SMALL.period_s * (centre - 0.5) / SMALL.azimuths)
        assert plots.azimuth[0] == pytest.approx(centre * SMALL.azimuth_step_rad, abs=1e-6)
        assert plots.scan[0] == 0
        assert plots.cells[0] == 15
        np.testing.assert_array_equal(plots.window[0], [SMALL.azimuths - 3, 5, 50, 3])

    def test_a_wall_around_the_turn_does_not_stay_open(self) -> None:
        cells = np.zeros((3, SMALL.azimuths, SMALL.ranges), bool)
        cells[:, :, 70:72] = True
        blocks = strip(np.full(cells.shape, 90, np.uint8), SMALL)
        part = self.make()
        state = part.start(site())
        made = [part(block, packed(cell), state) for block, cell in zip(blocks, cells, strict=True)]
        assert all(len(one) for one in made)
        assert state.counters["plots_cut_at_max_extent"] > 0
        everything = Plots.concatenate([*made, part.flush(state)])
        assert everything.cells.sum() == cells.sum()

    @pytest.mark.parametrize(("azimuths", "ranges"), [(16, 16), (17, 63), (100, 65), (2048, 1000)])
    def test_any_grid(self, azimuths: int, ranges: int) -> None:
        video = VideoFormat(azimuths=azimuths, ranges=ranges, range_step_m=7.5, beamwidth_rad=0.1)
        rng = np.random.default_rng(4)
        cells = rng.random((2, azimuths, ranges)) < 0.05
        part = self.make()
        plots = plots_of(
            part, strip(np.full(cells.shape, 9, np.uint8), video), list(cells), part.start(site(video, height=15.0))
        )
        assert plots.cells.sum() == cells.sum()
        for name in ("time", "east", "north", "covariance", "range", "azimuth", "length", "width", "mean_amplitude"):
            assert np.isfinite(getattr(plots, name)).all(), name
        assert (np.linalg.eigvalsh(plots.covariance) > 0).all()
