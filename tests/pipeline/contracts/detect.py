"""What every detector must do: inherit the class, say how to make the part."""

from __future__ import annotations

import pickle
from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.contracts.detect import Detector
from pipeline.detect.calibration import false_alarm_probability
from pipeline.state import StateError
from pipeline.tables import Sweeps, VideoFormat
from tests.support.video_scenes import CUTS, INHERITED, SMALL, busy_video, cut, rayleigh, strip


def mask_of(part: Detector, blocks: list[Sweeps], state: Any) -> tuple[Any, int]:
    parts = [part(block, state) for block in blocks]
    return np.concatenate([one.mask for one in parts]), sum(one.degraded for one in parts)


class DetectorContract:
    """Inherit and give make(). scans: enough for the detector to detect. growth_scans: turns after half of which its
    growth level is settled, and growth_tolerance: how near its share of clutter cells then comes. flooding: further
    settings with which noise over the whole scale is a flood."""

    scans = 5
    growth_scans = 16
    growth_tolerance = 0.05
    flooding: ClassVar[dict[str, Any]] = {}

    def make(self, **setting: Any) -> Detector:
        raise NotImplementedError

    @settings(max_examples=12, deadline=None, suppress_health_check=INHERITED)
    @given(cuts=CUTS, missing=st.integers(0, 2**32 - 1), lost=st.sampled_from([0.0, 0.2, 0.9]))
    def test_block_size_does_not_matter(self, cuts: list[int], missing: int, lost: float) -> None:
        keep = np.random.default_rng(missing).random((self.scans, SMALL.azimuths)) >= lost
        blocks = strip(busy_video(SMALL, self.scans), SMALL, keep)
        part = self.make()
        whole, _ = mask_of(part, blocks, part.start(SMALL))
        pieces, _ = mask_of(part, [one for block in blocks for one in cut(block, cuts)], part.start(SMALL))
        np.testing.assert_array_equal(whole, pieces)

    def test_sweep_by_sweep_is_the_same(self) -> None:
        part = self.make()
        blocks = strip(busy_video(SMALL, 3), SMALL)
        whole, _ = mask_of(part, blocks, part.start(SMALL))
        single, _ = mask_of(part, [one for block in blocks for one in cut(block, range(96))], part.start(SMALL))
        np.testing.assert_array_equal(whole, single)
        assert whole.any()

    @pytest.mark.parametrize(
        ("azimuths", "ranges"), [(16, 16), (17, 63), (96, 64), (100, 65), (360, 129), (2048, 1000)]
    )
    def test_any_grid(self, azimuths: int, ranges: int) -> None:
        video = VideoFormat(azimuths=azimuths, ranges=ranges, range_step_m=7.5, beamwidth_rad=0.1)
        part = self.make()
        frames = busy_video(video, 4)
        mask, _ = mask_of(part, strip(frames, video), part.start(video))
        bits = np.unpackbits(mask.view(np.uint8), axis=1, bitorder="little")
        assert mask.shape == (4 * azimuths, video.words)
        assert not bits[:, ranges:].any()
        assert np.mean(bits[:, :ranges][frames.reshape(-1, ranges) < 60]) < 1e-3

    def test_save_and_restore_midway(self) -> None:
        part = self.make()
        blocks = [one for block in strip(busy_video(SMALL, self.scans), SMALL) for one in cut(block, (7, 50))]
        straight, _ = mask_of(part, blocks, part.start(SMALL))
        state = part.start(SMALL)
        half = len(blocks) // 2
        first, _ = mask_of(part, blocks[:half], state)
        again = part.start(SMALL)
        again.restore(state.save())
        second, _ = mask_of(part, blocks[half:], again)
        np.testing.assert_array_equal(straight, np.concatenate([first, second]))
        third, _ = mask_of(part, blocks[half:], pickle.loads(pickle.dumps(state)))
        np.testing.assert_array_equal(second, third)

    def test_a_state_of_another_grid_is_refused(self) -> None:
        part = self.make()
        other = part.start(VideoFormat(azimuths=128, ranges=200))
        state = part.start(SMALL)
        before = state.save()
        with pytest.raises(StateError):
            state.restore(other.save())
        for name, array in state.save().items():
            np.testing.assert_array_equal(array, before[name])

    def test_video_without_echo_makes_no_flood(self) -> None:
        part = self.make()
        state = part.start(SMALL)
        frames = np.zeros((3, SMALL.azimuths, SMALL.ranges), np.uint8)
        frames[2, 50, 60] = 255
        mask, _ = mask_of(part, strip(frames, SMALL), state)
        assert np.bitwise_count(mask).sum() == 1

    def test_saturated_video_makes_no_flood(self) -> None:
        part = self.make()
        mask, _ = mask_of(part, strip(np.full((4, 96, 150), 255, np.uint8), SMALL), part.start(SMALL))
        assert np.bitwise_count(mask).sum() == 0

    def test_a_flood_is_bounded_seen_and_the_same_for_every_block_size(self) -> None:
        rng = np.random.default_rng(3)
        frames = rayleigh(rng, (6, SMALL.azimuths, SMALL.ranges), 20.0)
        frames[3:] = rng.integers(0, 255, (3, SMALL.azimuths, SMALL.ranges), dtype=np.uint8)
        frames[5, 40:44, 100:104] = 255
        part = self.make(max_runs=200, **self.flooding)
        blocks = strip(frames, SMALL)
        state = part.start(SMALL)
        whole, degraded = mask_of(part, blocks, state)
        padded = np.pad(np.unpackbits(whole.view(np.uint8), axis=1, bitorder="little"), ((0, 0), (1, 0)))
        runs = (np.diff(padded.astype(np.int8), axis=1) == 1).sum(axis=1).reshape(6, -1).sum(axis=1)
        assert runs.max() <= 250
        assert degraded >= 1
        assert state.counters["degraded_sweeps"] > 0
        pieces, _ = mask_of(part, [one for b in blocks for one in cut(b, range(0, 96, 5))], part.start(SMALL))
        np.testing.assert_array_equal(whole, pieces)

    def test_interference_is_bounded_and_counted(self) -> None:
        """Spokes: whole sweeps saturated, and whole sweeps of noise over all the scale."""
        rng = np.random.default_rng(4)
        frames = rayleigh(rng, (6, SMALL.azimuths, SMALL.ranges), 20.0)
        frames[5, 20:23] = 255
        frames[5, 50:60] = rng.integers(0, 256, (10, SMALL.ranges))
        part = self.make(max_runs=96, **self.flooding)
        state = part.start(SMALL)
        for block in strip(frames, SMALL):
            before = state.counters["degraded_sweeps"]
            found = part(block, state)
        cells = np.pad(found.cells(SMALL.ranges), ((0, 0), (1, 0))).astype(np.int8)
        runs = (np.diff(cells, axis=1) == 1).sum(axis=1)
        assert runs.max() <= 24
        assert runs[50:60].sum() <= 24 + 10
        assert found.degraded
        assert 1 <= state.counters["degraded_sweeps"] - before <= 20

    @settings(max_examples=6, deadline=None, suppress_health_check=INHERITED)
    @given(cuts=CUTS, missing=st.integers(0, 2**32 - 1), lost=st.sampled_from([0.0, 0.3]))
    def test_thresholds_are_what_the_call_compares_with(self, cuts: list[int], missing: int, lost: float) -> None:
        keep = np.random.default_rng(missing).random((self.scans, SMALL.azimuths)) >= lost
        part = self.make()
        state, pieces = part.start(SMALL), part.start(SMALL)
        for block in strip(busy_video(SMALL, self.scans), SMALL, keep):
            before = state.save()
            limits = part.thresholds(block, state)
            for name, array in state.save().items():
                np.testing.assert_array_equal(array, before[name])
            found = part(block, state)
            assert not found.degraded
            np.testing.assert_array_equal(found.cells(SMALL.ranges), block.amplitude > limits)
            begin = 0
            for piece in cut(block, cuts):
                np.testing.assert_array_equal(part.thresholds(piece, pieces), limits[begin : begin + len(piece)])
                part(piece, pieces)
                begin += len(piece)

    @settings(max_examples=6, deadline=None, suppress_health_check=INHERITED)
    @given(cuts=CUTS, missing=st.integers(0, 2**32 - 1), max_runs=st.sampled_from([60, 40_000]))
    def test_growth_holds_the_detected_cells_for_every_block_size(
        self, cuts: list[int], missing: int, max_runs: int
    ) -> None:
        keep = np.random.default_rng(missing).random((self.scans, SMALL.azimuths)) >= 0.1
        part = self.make(max_runs=max_runs)
        plain, state, pieces = part.start(SMALL), part.start(SMALL, growth_db=7.5), part.start(SMALL, growth_db=7.5)
        for block in strip(busy_video(SMALL, self.scans), SMALL, keep):
            alone, found = part(block, plain), part(block, state)
            assert alone.growth is None
            assert found.growth is not None
            np.testing.assert_array_equal(found.mask, alone.mask)
            assert not (found.mask & ~found.growth).any()
            grown = [part(piece, pieces).growth for piece in cut(block, cuts)]
            np.testing.assert_array_equal(found.growth, np.concatenate([one for one in grown if one is not None]))
        assert np.bitwise_count(found.growth).sum() > np.bitwise_count(found.mask).sum()

    def test_growth_lies_as_far_above_the_clutter_as_was_asked(self) -> None:
        """By the share of homogeneous Rayleigh clutter that exceeds it; the level rises by a step over the range, so
        that the rounding is met at all its fractions."""
        video = VideoFormat(azimuths=128, ranges=256, range_step_m=6.0, beamwidth_rad=0.05)
        part = self.make()
        state = part.start(video, growth_db=7.5)
        rng = np.random.default_rng(12)
        count = self.growth_scans
        power = 25.0 + np.linspace(0.0, 0.3125, 256) + 10 * np.log10(rng.exponential(size=(count, 128, 256)))
        frames = np.clip(np.rint(power / 0.3125), 0, 255).astype(np.uint8)
        grown = [part(block, state).growth for block in strip(frames, video)]
        share = np.mean([np.bitwise_count(one).sum() / (128 * 256) for one in grown[-count // 2 :] if one is not None])
        assert share == pytest.approx(false_alarm_probability(7.5, 0.3125), rel=self.growth_tolerance)

    @pytest.mark.parametrize("growth_db", [-1.0, float("nan"), float("inf")])
    def test_a_growth_that_makes_no_sense_is_refused(self, growth_db: float) -> None:
        with pytest.raises(ValueError, match="growth_db"):
            self.make().start(SMALL, growth_db=growth_db)

    def test_a_surface_of_another_shape_is_refused(self) -> None:
        with pytest.raises(ValueError, match="surface"):
            self.make().start(SMALL, np.zeros((3, 3), np.uint8))

    def test_writable_or_not_is_the_same(self) -> None:
        part = self.make()
        frames = busy_video(SMALL, 2)
        open_, _ = mask_of(part, strip(frames, SMALL), part.start(SMALL))
        blocks = strip(frames, SMALL)
        for block in blocks:
            block.amplitude.flags.writeable = False
        closed, _ = mask_of(part, blocks, part.start(SMALL))
        np.testing.assert_array_equal(open_, closed)
