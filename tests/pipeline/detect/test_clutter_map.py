"""The clutter map against its text, its calibration and its twin."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import binom

from pipeline.contracts.detect import Detector
from pipeline.detect.clutter_map import ClutterMap
from pipeline.parts import PartError, build
from pipeline.state import StateError
from pipeline.tables import VideoFormat
from tests.pipeline.contracts.detect import DetectorContract
from tests.pipeline.detect.naive_detect import clutter_map_limits
from tests.support.video_scenes import SMALL, busy_video, false_alarm_share, rayleigh, strip

MODES = ("none", "limit", "freeze", "both")


class TestClutterMapKeepsTheContract(DetectorContract):
    def make(self, **setting: Any) -> Detector:
        part: Detector = build("detect", "clutter_map", setting)
        return part


class TestClutterMapWithAntiMaskingKeepsTheContract(DetectorContract):
    def make(self, **setting: Any) -> Detector:
        part: Detector = build("detect", "clutter_map", {"anti_masking": "both", "memory": 4, **setting})
        return part


@pytest.mark.parametrize("anti_masking", MODES)
def test_equal_to_the_obvious_twin(anti_masking: Any) -> None:
    video = VideoFormat(azimuths=24, ranges=70, range_step_m=6.0)
    part = ClutterMap(pfa=1e-2, memory=5, anti_masking=anti_masking, limit_db=6.0)
    keep = np.random.default_rng(2).random((22, 24)) >= 0.1
    blocks = strip(busy_video(video, 22), video, keep)
    state = part.start(video)
    limits, level = clutter_map_limits(part, blocks, state)
    for block, wanted in zip(blocks, limits, strict=True):
        np.testing.assert_array_equal(part.thresholds(block, state), wanted)
        part(block, state)
    np.testing.assert_array_equal(state.level, level)


def test_the_level_is_the_recursive_mean() -> None:
    """Against scipy's filter, begun at the plain mean of the first scans."""
    frames = rayleigh(np.random.default_rng(3), (150, SMALL.azimuths, SMALL.ranges), 25.0)
    part = ClutterMap(memory=64)
    state = part.start(SMALL)
    for block in strip(frames, SMALL):
        part(block, state)
    start = frames[:64].mean(axis=0)
    mean, _ = lfilter([1 / 64], [1, -63 / 64], frames[64:], axis=0, zi=start[None] * 63 / 64)
    assert np.abs(state.level / 256 - mean[-1]).max() < 0.05


def test_offsets_at_every_age_are_those_the_text_gives() -> None:
    state = ClutterMap().start(VideoFormat())
    above = state.above / 256 * 0.3125
    assert above[[1, 2, 3, 4, 14, -1]] == pytest.approx([59.8, 37.3, 29.5, 25.6, 17.1, 14.1], abs=0.06)
    assert state.above[0] >= 255 * 256


@pytest.mark.parametrize("anti_masking", MODES)
def test_false_alarms_are_what_was_asked_at_1e_4(anti_masking: Any) -> None:
    video = VideoFormat(azimuths=256, ranges=512)
    part = ClutterMap(pfa=1e-4, memory=8, anti_masking=anti_masking)
    rng = np.random.default_rng(20)
    mean_db = 25.0 + np.linspace(0, 0.3125, 512)
    power = mean_db + 10 * np.log10(rng.exponential(size=(50, 256, 512)))
    blocks = strip(np.clip(np.rint(power / 0.3125), 0, 255).astype(np.uint8), video)
    state = part.start(video)
    alarms = [int(np.bitwise_count(part(block, state).mask).sum()) for block in blocks]
    for since, until in ((2, 10), (20, 50)):
        cells = (until - since) * 256 * 512
        found = sum(alarms[since:until])
        assert binom.cdf(found, cells, 0.8e-4) > 0.001
        assert binom.sf(found, cells, 1.2e-4) > 0.001


@pytest.mark.parametrize("anti_masking", MODES)
def test_false_alarms_are_what_was_asked_at_1e_6_given_the_thresholds(anti_masking: Any) -> None:
    """Semi-analytic: limits as the detector sets them, the tail of the rounded Rayleigh amplitude exactly."""
    video = VideoFormat(azimuths=64, ranges=1024)
    part = ClutterMap(memory=32, anti_masking=anti_masking)
    rng = np.random.default_rng(21)
    mean_db = 25.0 + np.linspace(0, 0.3125, 1024)
    power = mean_db + 10 * np.log10(rng.exponential(size=(100, 64, 1024)))
    blocks = strip(np.clip(np.rint(power / 0.3125), 0, 255).astype(np.uint8), video)
    state = part.start(video)
    for scan, block in enumerate(blocks):
        if scan in (15, 40, 99):
            share = false_alarm_share(part.thresholds(block, state), mean_db)
            assert share == pytest.approx(1e-6, rel=0.2), scan
        part(block, state)


def visit(part: ClutterMap, scans: int, level_db: float) -> list[int]:
    """How many of nine cells of a target that stands still from scan 80 on are detected, scan by scan."""
    video = VideoFormat(azimuths=16, ranges=64)
    frames = rayleigh(np.random.default_rng(9), (80 + scans, 16, 64), 25.0)
    frames[80:, 5:8, 30:33] = round(level_db / 0.3125)
    state = part.start(video)
    found = [part(block, state).cells(64)[5:8, 30:33].sum() for block in strip(frames, video)]
    return [int(one) for one in found[80:]]


def test_a_target_that_stays_is_masked_by_itself_unless_the_mean_is_frozen() -> None:
    """25 dB above the mean: 14.1 dB are reached when 1 - (1 - 1/64)^n is 0.43, at n = 36."""
    plain = visit(ClutterMap(), 60, 47.5)
    assert min(plain[:25]) == 9
    assert max(plain[50:]) == 0
    frozen = visit(ClutterMap(anti_masking="freeze"), 400, 47.5)
    assert min(frozen) == 9


def test_a_limited_input_is_masked_later() -> None:
    """9 dB at most go into the mean, so that it rises by 0.14 dB a scan: 25 - 14.1 dB take 78 scans, not 36."""
    limited = visit(ClutterMap(anti_masking="limit"), 200, 47.5)
    assert min(limited[:60]) == 9
    assert max(limited[150:]) == 0


def test_the_first_scan_only_learns_and_missing_sweeps_do_not_age_the_map() -> None:
    part = ClutterMap()
    state = part.start(SMALL)
    frames = busy_video(SMALL, 4)
    keep = np.ones((4, SMALL.azimuths), bool)
    keep[1:, 50:] = False
    for block in strip(frames, SMALL, keep):
        limits = part.thresholds(block, state)
        part(block, state)
    assert (limits < 255).any()
    np.testing.assert_array_equal(state.heard, np.where(np.arange(SMALL.azimuths) < 50, 4, 1))
    assert not part(strip(frames[:1], SMALL)[0], part.start(SMALL)).mask.any()


@pytest.mark.parametrize(
    "setting",
    [
        {"pfa": 0.0},
        {"memory": 0},
        {"memory": 5000},
        {"memory": 2, "learn_scans": 13},
        {"anti_masking": "some"},
        {"limit_db": 0.0},
    ],
)
def test_wrong_settings_are_refused(setting: dict[str, Any]) -> None:
    with pytest.raises(PartError):
        build("detect", "clutter_map", setting)


@pytest.mark.parametrize("setting", [{"memory": 1, "pfa": 1e-4}, {"memory": 2, "learn_scans": 12}])
def test_the_shortest_memories_detect(setting: dict[str, Any]) -> None:
    frames = rayleigh(np.random.default_rng(5), (14, SMALL.azimuths, SMALL.ranges), 25.0)
    frames[13, 4, 30] = 255
    part = ClutterMap(**setting)
    state = part.start(SMALL)
    found = [part(block, state).cells(SMALL.ranges) for block in strip(frames, SMALL)]
    assert found[13][4, 30]


def test_a_limit_beyond_full_scale_is_none() -> None:
    blocks = strip(busy_video(SMALL, 20), SMALL)
    states = []
    for part in (ClutterMap(anti_masking="limit", limit_db=1e12), ClutterMap()):
        state = part.start(SMALL)
        for block in blocks:
            part(block, state)
        states.append(state)
    np.testing.assert_array_equal(states[0].level, states[1].level)


@pytest.mark.parametrize("heard", [-1, 2**63 - 1])
def test_a_saved_state_that_cannot_be_true_is_refused(heard: int) -> None:
    state = ClutterMap().start(SMALL)
    saved = state.save()
    saved["heard"][3] = heard
    with pytest.raises(StateError):
        state.restore(saved)
