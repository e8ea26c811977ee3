"""The clock of a radar: steps, jitter, outages and old recordings; the times that come out go on near arrival."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.timing.radar_clock import AHEAD_LIMIT_S, SLEW, TOLD_S, RadarClock
from pipeline.timing.source_clock import AHEAD_S, ClockRules

NOW = 1.8e9 + 43_384.0
AZIMUTHS, BLOCKS, PERIOD = 256, 32, 1.0
HEIGHT = AZIMUTHS // BLOCKS


class Antenna:
    """Turns, and gives blocks with times of its own clock to a RadarClock. Keeps what came out."""

    def __init__(self, rules: ClockRules | None = None, *, jitter: float = 0.002, seed: int = 1) -> None:
        self.clock = RadarClock(rules or ClockRules(), PERIOD, AZIMUTHS)
        self.jitter, self.rng = jitter, np.random.default_rng(seed)
        self.block, self.row, self.arrival = 0, 0, NOW
        self.true: list[float] = []
        self.got: list[float] = []

    def turn(self, seconds: float, wrong: Callable[[float], float] | float = 0.0, *, late: float = 0.0) -> np.ndarray:
        """Turn for so long; the errors of the corrected times."""
        begin = len(self.got)
        for _ in range(round(seconds * BLOCKS / PERIOD)):
            rows = self.block * HEIGHT + np.arange(HEIGHT)
            true = NOW + (rows + 0.5) * PERIOD / AZIMUTHS
            off = wrong if isinstance(wrong, float) else np.array([wrong(one) for one in true])
            arrival = float(true[-1]) + late + self.rng.uniform(0.0, self.jitter)
            self.arrival = max(self.arrival, arrival)
            self.got += self.clock.take(true + off, rows, self.arrival).tolist()
            self.true += true.tolist()
            self.block += 1
        assert min(np.diff(self.got), default=0.0) >= 0.0, "times never run back"
        errors: np.ndarray = np.array(self.got[begin:]) - np.array(self.true[begin:])
        return errors

    @property
    def words(self) -> str:
        return self.clock.words(self.arrival)


def test_a_good_clock_is_left_alone() -> None:
    antenna = Antenna(jitter=0.3)
    assert np.array_equal(antenna.turn(40), np.zeros(40 * AZIMUTHS))
    assert (antenna.words, antenna.clock.rebased) == ("", 0)
    assert -0.3 <= (antenna.clock.offset or 1.0) <= 0.0


@pytest.mark.parametrize("step", [3600.0, -3600.0, 600.0, -43_000.0, -1.0, 1.0, -NOW])
def test_a_step_and_back_is_not_seen_in_the_times(step: float) -> None:
    antenna = Antenna()
    antenna.turn(10)
    # what latency may explain is taken as stated again, little by little
    assert np.abs(antenna.turn(8, step)).max() < (0.02 if abs(step) > 1 else 0.02 + 8 * SLEW)
    assert antenna.clock.rebased == 1
    assert "clock stepped " + ("+" if step > 0 else "-") in antenna.words
    if abs(step) > 5:
        assert ("ahead" if step > 0 else "behind") in antenna.words
        assert antenna.clock.offset == pytest.approx(step, abs=0.02)
    assert np.abs(antenna.turn(8)).max() < (0.02 if abs(step) > 1 else 0.02 + 8 * SLEW)
    assert antenna.clock.rebased == 2
    assert "ahead" not in antenna.words
    antenna.turn(TOLD_S + 1)
    assert antenna.words == ""
    assert np.abs(antenna.turn(1)).max() == pytest.approx(0.0, abs=1e-6)


def test_the_words() -> None:
    antenna = Antenna()
    antenna.turn(2)
    antenna.turn(1, 3600.0)
    hour = NOW % 86400 // 3600
    assert antenna.words == (
        f"clock 3,600 s ahead (local time?): corrected; clock stepped +3,600 s at {hour:02.0f}:03:06 UTC: corrected"
    )


@pytest.mark.parametrize("offset", [3600.0, -3600.0, -2 * 365 * 86400.0, 18.0, -NOW])
def test_a_clock_that_is_wrong_from_the_start_is_corrected_and_said(offset: float) -> None:
    antenna = Antenna()
    errors = antenna.turn(40, offset)
    assert np.abs(errors).max() < 0.02
    assert antenna.words.endswith(": corrected")
    assert np.abs(np.diff(antenna.got) - PERIOD / AZIMUTHS).max() < 0.001


def test_a_clock_0_7_s_ahead_is_corrected_without_words() -> None:
    antenna = Antenna()
    assert np.abs(antenna.turn(20, 0.7)).max() < 0.02
    assert antenna.words == ""
    assert antenna.clock.offset == pytest.approx(0.7, abs=0.01)


@pytest.mark.parametrize("drift", [50e-6, -50e-6])
def test_a_drifting_clock_never_runs_ahead(drift: float) -> None:
    antenna = Antenna(ClockRules(mode="corrected"), jitter=0.05)
    errors = antenna.turn(900, lambda true: drift * (true - NOW))
    assert np.abs(errors).max() < 0.06
    assert antenna.clock.rebased == 0


def test_jitter_hardly_moves_the_correction() -> None:
    antenna = Antenna(ClockRules(mode="corrected"), jitter=0.3)
    antenna.turn(60, 2.0)
    before = antenna.clock.correction
    antenna.turn(60, 2.0)
    assert abs(antenna.clock.correction - before) < 0.02
    assert np.abs(np.diff(antenna.got[60 * AZIMUTHS :]) - PERIOD / AZIMUTHS).max() < 0.001


@pytest.mark.parametrize("late", [0.4, 1.5])
def test_a_delay_on_the_way_is_no_step(late: float) -> None:
    antenna = Antenna()
    antenna.turn(5)
    assert np.array_equal(antenna.turn(1, late=late), np.zeros(AZIMUTHS))
    assert np.array_equal(antenna.turn(5), np.zeros(5 * AZIMUTHS))
    assert antenna.clock.rebased == 0


def test_video_that_stays_too_late_to_be_of_use_says_so_and_is_brought_near_arrival() -> None:
    antenna = Antenna()
    antenna.turn(10)
    antenna.turn(2, late=3.5)
    assert antenna.words == "video is over 3 s late"
    antenna.turn(18, late=3.5)
    assert (antenna.clock.late, antenna.words) == (False, "")
    assert antenna.arrival - antenna.got[-1] < 0.1
    assert antenna.clock.rebased == 1
    antenna.turn(4)
    assert antenna.arrival - antenna.got[-1] < 0.1
    assert np.abs(antenna.turn(1)).max() < AHEAD_LIMIT_S
    assert antenna.clock.rebased == 1


def test_video_that_comes_in_time_again_does_not_stay_ahead() -> None:
    antenna = Antenna()
    antenna.turn(10)
    antenna.turn(20, late=3.5)
    for late in (0.45, 0.0):
        antenna.turn(1, late=late)
    antenna.turn(8)
    assert np.abs(antenna.turn(1)).max() < AHEAD_S + 0.02


def test_an_outage_is_no_step() -> None:
    antenna = Antenna()
    antenna.turn(5)
    antenna.block += 100 * BLOCKS
    rows = antenna.block * HEIGHT
    antenna.clock._before = antenna.clock._before and (
        antenna.clock._before[0], rows - HEIGHT, antenna.clock._before[2]
    )  # the assembler counts one turn, however many were missed  # fmt: skip
    assert np.array_equal(antenna.turn(5), np.zeros(5 * AZIMUTHS))
    assert antenna.clock.rebased == 0


def test_a_step_during_an_outage_is_found() -> None:
    antenna = Antenna()
    antenna.turn(5)
    antenna.block += 100 * BLOCKS
    assert np.abs(antenna.turn(5, -3600.0)).max() < 0.05
    assert antenna.clock.rebased == 1


def test_a_step_within_a_block_is_found_at_its_sweep() -> None:
    antenna = Antenna()
    antenna.turn(1)
    at = NOW + 1.5 + 3.2 * PERIOD / AZIMUTHS
    assert np.abs(antenna.turn(3, lambda true: -1.0 if true > at else 0.0)).max() < 0.02 + 3 * SLEW
    assert antenna.clock.rebased == 1


def test_stamped_on_arrival_the_times_are_those_of_the_rotation() -> None:
    antenna = Antenna(ClockRules(mode="arrival"), jitter=0.0)
    assert np.abs(antenna.turn(5, -1e8)).max() < 1e-6
    assert antenna.words == ""


def test_taken_as_stated_up_to_the_greatest_offset() -> None:
    assert np.array_equal(Antenna(ClockRules(mode="taken")).turn(5, 3.0), np.full(5 * AZIMUTHS, 3.0))
    assert np.abs(Antenna(ClockRules(mode="taken")).turn(5, 6.0)).max() < 0.02


@pytest.mark.parametrize("step", [3600.0, -3600.0])
def test_when_the_clock_of_the_host_is_set_the_radar_goes_with_it(step: float) -> None:
    clock = RadarClock(ClockRules(), PERIOD, AZIMUTHS)
    for block in range(640):
        rows = block * HEIGHT + np.arange(HEIGHT)
        stated = NOW + rows * PERIOD / AZIMUTHS
        arrival = float(stated[-1]) + (step if block >= 320 else 0.0)
        time = clock.take(stated, rows, arrival)
        assert abs(time[-1] - arrival) < 0.01


def test_video_faster_than_time_stays_near_arrival() -> None:
    clock = RadarClock(ClockRules(), PERIOD, AZIMUTHS)
    before = -np.inf
    for block in range(3200):
        rows = block * HEIGHT + np.arange(HEIGHT)
        arrival = NOW + block * 0.001
        time = clock.take(NOW + rows * PERIOD / AZIMUTHS, rows, arrival)
        assert time[0] >= before
        assert time[-1] <= arrival + AHEAD_LIMIT_S + 1e-6
        before = time[-1]


@settings(deadline=None)
@given(
    st.lists(
        st.tuples(
            st.floats(-1e10, 1e10) | st.sampled_from([0.0, 1.0, -1.0, 3600.0]), st.floats(0, 5), st.integers(1, 9)
        ),
        max_size=40,
    )
)
def test_whatever_the_clock_says_times_go_on_and_not_ahead(blocks: list[tuple[float, float, int]]) -> None:
    clock = RadarClock(ClockRules(), PERIOD, AZIMUTHS)
    arrival, row, before = NOW, 0, -np.inf
    for off, passed, turned in blocks:
        arrival += passed
        row += turned
        time = clock.take(arrival + off + np.arange(4) / AZIMUTHS, row + np.arange(4), arrival)
        row += 4
        assert bool(np.isfinite(time).all())
        assert bool((np.diff(time) >= 0).all())
        assert time[0] >= before
        assert time[-1] <= arrival + AHEAD_LIMIT_S + 1e-6
        before = float(time[-1])
