"""The ordered statistic against its text, its calibration, its twin and scipy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.ndimage import rank_filter
from scipy.stats import binom

from pipeline.contracts.detect import Detector
from pipeline.detect.calibration import order_offset_steps
from pipeline.detect.os import GOLDEN, OrderedStatistic
from pipeline.detect.window import window_of
from pipeline.parts import PartError, build
from pipeline.tables import VideoFormat
from tests.pipeline.contracts.detect import DetectorContract
from tests.pipeline.detect.naive_detect import window_cells
from tests.support.video_scenes import busy_video, false_alarm_share, rayleigh, strip


class TestOrderedStatisticKeepsTheContract(DetectorContract):
    def make(self, **setting: Any) -> Detector:
        part: Detector = build("detect", "os", setting)
        return part


class TestOrderedStatisticOverSweepsKeepsTheContract(DetectorContract):
    def make(self, **setting: Any) -> Detector:
        part: Detector = build("detect", "os", {"sweeps": 3, "guard_sweeps": 1, "side": 9, **setting})
        return part


@pytest.mark.parametrize("rank", [0.5, 0.75, 1.0])
@pytest.mark.parametrize(("sweeps", "guard_sweeps", "guard"), [(0, 2, 2), (4, 2, 1), (3, 3, 0), (2, 0, 2)])
def test_equal_to_the_obvious_twin(rank: float, sweeps: int, guard_sweeps: int, guard: int) -> None:
    """Missing sweeps, the seam at north and both ends of the sweep included."""
    video = VideoFormat(azimuths=17, ranges=40, range_step_m=6.0, beamwidth_rad=0.1)
    part = OrderedStatistic(pfa=1e-2, rank=rank, side=6, guard=guard, sweeps=sweeps, guard_sweeps=guard_sweeps)
    frames = busy_video(video, 3)
    keep = np.random.default_rng(2).random((3, 17)) >= 0.15
    state = part.start(video)
    limits = np.full(frames.shape, -1)
    for block, kept in zip(strip(frames, video, keep), keep, strict=True):
        limits[block.scan, kept] = part.thresholds(block, state)
        part(block, state)
    for scan, row, j, inside in window_cells(window_of(part), frames, keep):
        n = len(inside)
        k = max(round(rank * n), 1)
        above = np.floor(order_offset_steps(1e-2, video.db_per_step, float(n), float(k)) + j * GOLDEN % 1)
        assert limits[scan, row, j] == min(int(np.sort(inside)[k - 1]) + above, 255), (scan, row, j)


def test_the_statistic_is_scipys() -> None:
    part = OrderedStatistic(side=16, guard=2)
    video = VideoFormat(azimuths=64, ranges=400)
    frame = rayleigh(np.random.default_rng(4), (64, 400), 25.0)
    window = np.ones((1, 37), bool)
    window[0, 16:21] = False
    level = rank_filter(frame, 23, footprint=window).astype(float)
    limits = part.thresholds(strip(frame[None], video)[0], part.start(video))
    above = limits[:, 18:-18] - level[:, 18:-18]
    offset = order_offset_steps(1e-6, 0.3125, 32.0, 24.0)
    assert set(np.unique(above)) == {np.floor(offset), np.floor(offset) + 1}
    assert above.mean() == pytest.approx(offset, abs=0.02)


def test_offset_of_the_text() -> None:
    """Rohling's product formula for n = 32, k = 24; in steps so small that rounding is their half only."""
    ratio = 10 ** ((order_offset_steps(1e-6, 0.05, 32.0, 24.0) + 0.5) * 0.05 / 10)
    n = np.arange(32, 8, -1)
    assert np.prod(n / (n + ratio)) == pytest.approx(1e-6, rel=2e-3)


SETTINGS: list[dict[str, Any]] = [{}, {"rank": 0.5}, {"sweeps": 3, "side": 8}]


@pytest.mark.parametrize("setting", SETTINGS)
@pytest.mark.parametrize("db_per_step", [0.3125, 2.0])
def test_false_alarms_are_what_was_asked_at_1e_4(setting: dict[str, Any], db_per_step: float) -> None:
    """The level rises by a step over the range, so that the rounding is met at all its fractions."""
    video = VideoFormat(azimuths=512, ranges=512, beamwidth_rad=0.01, db_per_step=db_per_step)
    part = OrderedStatistic(pfa=1e-4, **setting)
    state = part.start(video)
    rng = np.random.default_rng(20)
    power = 60.0 + np.linspace(0, db_per_step, 512) + 10 * np.log10(rng.exponential(size=(8, 512, 512)))
    frames = np.clip(np.rint(power / db_per_step), 0, 255).astype(np.uint8)
    alarms = sum(int(np.bitwise_count(part(block, state).mask).sum()) for block in strip(frames, video))
    cells = 8 * 512 * 512
    assert binom.cdf(alarms, cells, 0.85e-4) > 0.001
    assert binom.sf(alarms, cells, 1.15e-4) > 0.001


@pytest.mark.parametrize("setting", SETTINGS)
def test_false_alarms_are_what_was_asked_at_1e_6_given_the_thresholds(setting: dict[str, Any]) -> None:
    """Semi-analytic: limits as the detector sets them, the tail of the rounded Rayleigh amplitude exactly."""
    video = VideoFormat(azimuths=256, ranges=1024, beamwidth_rad=0.01)
    part = OrderedStatistic(**setting)
    rng = np.random.default_rng(21)
    mean_db = 25.0 + np.linspace(0, 0.3125, 1024)
    power = mean_db + 10 * np.log10(rng.exponential(size=(256, 1024)))
    frame = np.clip(np.rint(power / 0.3125), 0, 255).astype(np.uint8)
    limits = part.thresholds(strip(frame[None], video)[0], part.start(video))
    assert false_alarm_share(limits, mean_db) == pytest.approx(1e-6, rel=0.3)


def test_a_second_target_in_the_window_does_not_mask_the_first() -> None:
    """What the ordered statistic is for: both stay detected where the mean of powers is dragged up."""
    video = VideoFormat(azimuths=32, ranges=200)
    frame = rayleigh(np.random.default_rng(5), (1, 32, 200), 25.0)
    frame[0, 10, [100, 106, 107, 108]] = [150, 230, 230, 230]
    found = build("detect", "os", {})(strip(frame, video)[0], OrderedStatistic().start(video)).cells(200)
    assert found[10, [100, 106, 107, 108]].all()
    power = build("detect", "ca", {"domain": "power"})
    assert not power(strip(frame, video)[0], power.start(video)).cells(200)[10, 100]


@pytest.mark.parametrize(
    "setting",
    [{"pfa": 0.6}, {"rank": 0.0}, {"rank": 1.1}, {"side": 0}, {"side": 2000}, {"guard": -1}, {"sweeps": 65}],
)
def test_wrong_settings_are_refused(setting: dict[str, Any]) -> None:
    with pytest.raises(PartError):
        build("detect", "os", setting)
