"""The adaptive detector: false alarm rate in homogeneous, Weibull and mixed clutter; targets that stand still stay."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit
from numpy.typing import NDArray
from scipy.stats import binom

from pipeline.contracts.detect import Detector
from pipeline.detect.adaptive import Adaptive
from pipeline.kernels.tiles import learn_tiles, tile_bits, tile_bits_lowered, tile_limits
from pipeline.parts import build
from pipeline.tables import Sweeps, VideoFormat
from tests.pipeline.contracts.detect import DetectorContract
from tests.pipeline.detect import naive_adaptive

VIDEO = VideoFormat(azimuths=256, ranges=256, range_step_m=3.0, beamwidth_rad=0.03)


class TestAdaptiveKeepsTheContract(DetectorContract):
    growth_tolerance = 0.2

    def make(self, **setting: Any) -> Detector:
        part: Detector = build("detect", "adaptive", {"learn_scans": 1, **setting})
        return part


def scan(number: int, decibels: NDArray[np.float64]) -> Sweeps:
    row = np.arange(VIDEO.azimuths, dtype=np.int32)
    amplitude = np.clip(np.rint(decibels / VIDEO.db_per_step), 0, 255).astype(np.uint8)
    return Sweeps(0, number, row, (row + 0.5) * VIDEO.azimuth_step_rad, number + row / VIDEO.azimuths, amplitude, True)


def clutter(chance: np.random.Generator, shape: float = 2.0) -> NDArray[np.float64]:
    """Log amplitude about 0 dB; shape: of the Weibull amplitude, 2 is Rayleigh."""
    size = (VIDEO.azimuths, VIDEO.ranges)
    return np.asarray(20 / shape * np.log10(chance.exponential(size=size)))


@pytest.mark.parametrize(("shape", "factor"), [(2.0, 3), (1.6, 3), (1.2, 3)])
def test_false_alarms_in_homogeneous_clutter_within_binomial_bounds(shape: float, factor: int) -> None:
    chance = np.random.default_rng(1)
    part = Adaptive(pfa=1e-4)
    state = part.start(VIDEO)
    found = cells = 0
    for number in range(120):
        mask = part(scan(number, 30 + clutter(chance, shape)), state).cells(VIDEO.ranges)
        if number >= 80:
            found, cells = found + int(mask.sum()), cells + mask.size
    low, high = binom.ppf([0.001, 0.999], cells, 1e-4)
    assert low / factor <= found <= factor * high


def test_a_border_of_ground_makes_no_line_of_false_alarms() -> None:
    chance = np.random.default_rng(2)
    surface = np.full((VIDEO.azimuths, VIDEO.ranges), 2, np.uint8)
    surface[:, 100:] = 0
    level = np.where(np.arange(VIDEO.ranges) >= 101, 44.0, 30.0)  # the map is wrong by one cell
    part = Adaptive(pfa=1e-5)
    state = part.start(VIDEO, surface)
    found = 0
    for number in range(90):
        mask = part(scan(number, level + clutter(chance)), state).cells(VIDEO.ranges)
        if number >= 60:
            found += int(mask[:, 96:106].sum())
    assert found <= 30 * 256 * 10 * 1e-4


@pytest.mark.parametrize("here_from_the_start", [True, False])
def test_a_parked_aircraft_is_never_learned_away(here_from_the_start: bool) -> None:
    chance = np.random.default_rng(3)
    part = Adaptive()
    state = part.start(VIDEO)
    seen = []
    for number in range(260):
        decibels = 30 + clutter(chance)
        if here_from_the_start or number >= 30:
            decibels[100:108, 120:130] = 52 + 20 / 2 * np.log10(chance.gamma(2.0, 0.5, (8, 10)))
        mask = part(scan(number, decibels), state).cells(VIDEO.ranges)
        if number >= 200:
            seen.append(mask[100:108, 120:130].mean())
    assert np.mean(seen) > 0.85


def test_rain_that_sets_in_makes_no_flood() -> None:
    chance = np.random.default_rng(4)
    part = Adaptive()
    state = part.start(VIDEO)
    worst = 0
    for number in range(120):
        rise = 13.0 * np.clip((number - 80) / 20, 0, 1)
        mask = part(scan(number, 30 + rise + clutter(chance)), state).cells(VIDEO.ranges)
        if number >= 80:
            worst = max(worst, int(mask.sum()))
    assert worst <= 10


def test_a_start_in_mid_turn_makes_no_flood() -> None:
    chance = np.random.default_rng(5)
    part = Adaptive()
    state = part.start(VIDEO)
    found = 0
    for number in range(60):
        turn = scan(number, 30 + clutter(chance))
        if number in (0, 20):
            keep = slice(200, None) if number == 0 else slice(0, 50)
            turn = Sweeps(0, number, turn.row[keep], turn.azimuth[keep], turn.time[keep], turn.amplitude[keep])
        found += int(part(turn, state).cells(VIDEO.ranges).sum())
    assert found <= 20


def growth_scene() -> tuple[Adaptive, list[Sweeps]]:
    chance = np.random.default_rng(6)
    turns = []
    for number in range(16):
        decibels = 30 + clutter(chance)
        decibels[100:108, 120:130] = 52.0
        if number == 15:
            decibels[100:108, 130:132] = 38.0
        turns.append(scan(number, decibels))
    return Adaptive(learn_scans=3), turns


def test_growth_holds_the_detected_cells_and_the_cells_above_its_own_margin() -> None:
    part, turns = growth_scene()
    plain, state = part.start(VIDEO), part.start(VIDEO, growth_db=7.5)
    for number, turn in enumerate(turns):
        found = part(turn, state)
        alone = part(turn, plain)
        assert found.growth is not None
        assert alone.growth is None
        np.testing.assert_array_equal(found.mask, alone.mask)
        assert not (found.mask & ~found.growth).any()
        if number < 3:
            assert not found.growth.any()
    cells = np.unpackbits(found.growth.view(np.uint8), axis=1, bitorder="little").astype(bool)
    assert cells[100:108, 120:132].all()
    assert not found.cells(VIDEO.ranges)[100:108, 130:132].any()
    above = np.exp(-(10 ** ((7.5 - 2.51) / 10)))  # of Rayleigh clutter about its log mean
    assert cells[:90].mean() == pytest.approx(above, rel=0.25)


def test_thresholds_are_those_of_the_call_and_change_nothing() -> None:
    part, turns = growth_scene()
    state = part.start(VIDEO)
    for turn in turns:
        before = state.save()
        limits = part.thresholds(turn, state)
        for name, array in state.save().items():
            np.testing.assert_array_equal(array, before[name])
        np.testing.assert_array_equal(part(turn, state).cells(VIDEO.ranges), turn.amplitude > limits)


@njit
def one_word(cells: Any, offset: Any, fine: Any, rules: Any, drops: Any, sums: Any, strict: Any, four: Any) -> Any:
    x, o, r = cells.ctypes.data, offset.ctypes.data, rules.ctypes.data
    made = np.empty(64, np.uint8)
    tile_limits(o, r, made.ctypes.data)
    above, grown = tile_bits(x, o, r), tile_bits_lowered(x, o, r, drops.ctypes.data)
    learn_tiles(x, o, fine.ctypes.data, r, sums.ctypes.data, strict, four[0], four[1])
    return made, above, grown


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), extreme=st.booleans())
def test_eight_tiles_at_a_time_are_what_one_cell_at_a_time_is(seed: int, extreme: bool) -> None:
    chance = np.random.default_rng(seed)
    reach = 128 if extreme else 40
    cells = chance.integers(0, 256, 64, dtype=np.uint8)
    offset = chance.integers(-reach, reach, 64, dtype=np.int8)
    fine = chance.integers(0, 256, 64, dtype=np.uint8)
    rules = chance.integers(-reach, reach, (8, 8), dtype=np.int8)
    rules[:, 7] = chance.integers(0, 16, 8)
    drops = np.repeat(chance.integers(0, 128, 8, dtype=np.uint8), 8)
    bits = chance.integers(0, 2, 64)
    gains, most = chance.integers(0, 256, 5, dtype=np.uint8), chance.integers(0, 128, 4, dtype=np.int8)
    words = [
        np.concatenate([one.view(np.uint8), np.zeros(8 - len(one), np.uint8)]).view(np.uint64)[0]
        for one in (gains, most)
    ]
    strict = np.packbits(bits.astype(bool), bitorder="little").view(np.uint64)[0]
    sums = np.full(8, 5 + (7 << 16) + (9 << 40), np.uint64)
    args = [one.astype(np.int64) for one in (cells, offset, fine, rules, bits)]
    expected_limits = naive_adaptive.limits(args[1], args[3])
    wanted = naive_adaptive.learn(*args, gains.tolist(), most.tolist())
    limits, above, grown = one_word(cells, offset, fine, rules, drops, sums, strict, (words[0], words[1]))
    np.testing.assert_array_equal(limits.astype(int) - 128, expected_limits)
    lower = np.maximum(expected_limits - drops, -128)
    for word, limit in ((above, expected_limits), (grown, lower)):
        found = np.unpackbits(np.array([word], np.uint64).view(np.uint8), bitorder="little")
        np.testing.assert_array_equal(found, args[0] - 128 > limit)
    np.testing.assert_array_equal(offset, wanted[0])
    np.testing.assert_array_equal(fine, wanted[1])
    got = np.stack([sums & 0xFFFF, (sums >> 16) & 0xFFFFFF, sums >> 40], axis=1).astype(np.int64) - (5, 7, 9)
    np.testing.assert_array_equal(got, wanted[2])


def test_rain_over_pavement_and_grass_raises_every_limit_by_power() -> None:
    chance = np.random.default_rng(7)
    surface = np.full((VIDEO.azimuths, VIDEO.ranges), 2, np.uint8)
    surface[:, 100:] = 0
    ground = np.where(np.arange(VIDEO.ranges) >= 100, 42.0, 30.0)
    part = Adaptive()
    state = part.start(VIDEO, surface)
    worst = 0.0
    for number in range(130):
        rain = 30.0 - 12.0 + np.clip(number - 90, 0, 24)
        mean = 10 * np.log10(10 ** (ground / 10) + (10 ** (rain / 10) if number >= 90 else 0.0))
        turn = scan(number, mean + clutter(chance))
        if number >= 95:
            limit = (part.thresholds(turn, state) + 0.5) * VIDEO.db_per_step
            worst = max(worst, float(np.exp(-(10 ** ((limit - mean) / 10))).mean()))
        part(turn, state)
    assert worst < 1e-4
