"""The antenna's period and time as a radar's sectors tell them, and when its beam has passed the gate of a track."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.sites import RadarSite
from pipeline.tables import SectorPlots, VideoFormat
from pipeline.track.look import Looks, RadarClock, plan_looks
from tests.pipeline.track.scene import T0, A, make_plots, make_tracker

GATE, MAX_GATE_M = 13.8, 150.0
SITE = RadarSite("smr", 200.0, -100.0, 22.0, VideoFormat(range_step_m=4.0, beamwidth_rad=0.02))


def turning(period: float, turns: float, parts: int = 8, nominal: float = 1.0) -> RadarClock:
    """The clock of a radar that has turned so often, told in `parts` sectors a turn."""
    clock = RadarClock(nominal)
    for sector in range(1, round(turns * parts) + 1):
        clock.heard(sector * A // parts, T0 + sector * period / parts, A, nominal)
    return clock


@pytest.mark.parametrize("period", [0.4, 0.8, 1.3, 2.5])
@pytest.mark.parametrize("parts", [1, 8, 64])
def test_the_period_is_learnt_when_it_is_not_the_nominal_one(period: float, parts: int) -> None:
    clock = turning(period, 25, parts)
    assert clock.period == pytest.approx(period, rel=0.01)
    assert clock.time == pytest.approx(T0 + 25 * period)


@pytest.mark.parametrize("period", [0.8, 1.3])
def test_the_tracker_learns_the_period_from_its_sectors(period: float) -> None:
    tracker = make_tracker()
    for sector in range(8 * 20):
        low, high = sector * A // 8, (sector + 1) * A // 8
        plots = make_plots([], np.empty((0, 2)), 2.0)
        tracker.sector(SectorPlots(0, sector // 8, T0 + high / A * period, low, high, plots))
    assert tracker.save()["clocks"][0].period == pytest.approx(period, rel=0.01)


def test_a_new_measurement_of_the_period_counts_a_quarter_a_turn() -> None:
    clock = turning(1.0, 2, 1)
    clock.heard(3 * A, T0 + 2.0 + 1.4, A, 1.0)
    assert clock.period == pytest.approx(1.1)
    clock.heard(3 * A + A // 2, T0 + 3.4 + 0.95, A, 1.0)  # half a turn at 1.9 s a turn
    assert clock.period == pytest.approx(1.2)
    clock.heard(7 * A + A // 2, T0 + 4.35 + 4 * 1.6, A, 1.0)
    assert clock.period == pytest.approx(1.6)


@pytest.mark.parametrize(
    ("rows", "taught"),
    [(A // 64 - 1, False), (A // 64, True), (A, True), (4 * A, True), (4 * A + 1, False)],
    ids=["too short to time", "shortest", "a turn", "longest", "feed interrupted"],
)
def test_only_sectors_of_a_64th_of_a_turn_to_four_turns_teach_the_period(rows: int, taught: bool) -> None:
    clock = turning(1.0, 2, 1)
    clock.heard(2 * A + rows, T0 + 2.0 + 1.5 * rows / A, A, 1.0)
    assert (clock.period > 1.0) == taught


@pytest.mark.parametrize(
    ("turn", "taught"), [(0.2, False), (0.25, True), (3.9, True), (4.0, True), (4.1, False), (0.0, False)]
)
@pytest.mark.parametrize("nominal", [1.0, 2.5])
def test_a_period_four_times_off_the_nominal_one_is_a_fault_of_its_times(
    turn: float, taught: bool, nominal: float
) -> None:
    clock = RadarClock(nominal)
    clock.heard(2 * A, 0.0, A, nominal)
    clock.heard(3 * A, turn * nominal, A, nominal)
    assert (clock.period != nominal) == taught


def test_a_clock_that_has_heard_nothing_learns_no_period_from_its_first_sector() -> None:
    clock = turning(1.3, 1, 1)
    assert (clock.period, clock.closed_to, clock.time, clock.newest) == (1.0, A, T0 + 1.3, T0 + 1.3)


def test_the_closed_row_keeps_its_own_time_while_an_open_echo_holds_it_back() -> None:
    """It goes on by the rows that were closed, not by what the newest sweep is ahead, which may be half a turn."""
    clock = turning(1.0, 4, 8)
    clock.heard(4 * A + A // 8, T0 + 4.125 + 0.3, A, 1.0)
    assert clock.time == pytest.approx(T0 + 4.125, abs=0.05)
    assert clock.newest == T0 + 4.425


def test_after_an_interruption_the_closed_row_has_the_time_of_the_newest_sweep() -> None:
    clock = turning(1.0, 4, 8)
    clock.heard(4 * A + A // 8, T0 + 60.0, A, 1.0)
    assert clock.time == T0 + 60.0


def test_the_closed_row_is_never_later_than_the_newest_sweep() -> None:
    clock = turning(1.0, 4, 8)
    clock.heard(5 * A, T0 + 4.9, A, 1.0)
    assert clock.time == T0 + 4.9


def look(
    clock: RadarClock, state: np.ndarray, covariance: np.ndarray, *, time: float = T0 + 4.0, length: float = 0.0,
    looked: int = 4 * A, site: RadarSite = SITE,
) -> Looks:  # fmt: skip
    """The look of one radar at one track that stands at `state` relative to the radar at `time`."""
    at = state + np.array([site.east, site.north, 0.0, 0.0])
    return plan_looks(
        site, clock, np.array([time]), at[None], covariance[None], np.array([[length, 0.0]]), np.array([looked]),
        GATE, MAX_GATE_M,
    )  # fmt: skip


def guard_m(plan: Looks, distance: float) -> float:
    """m to one side that the guard of a look covers, without the row by which azimuths are rounded."""
    return float(plan.guard[0] - 1.0) / A * 2 * math.pi * distance


def expected_guard_m(covariance: np.ndarray, ahead: float, distance: float, length: float, site: RadarSite) -> float:
    """What a gate covers: moved track, random acceleration, beam, cell, centroid; half the target and two cells."""
    move = np.eye(4) + ahead * np.eye(4, k=2)
    variance = np.trace((move @ covariance @ move.T)[:2, :2]) + 4.0 * abs(ahead) ** 3
    variance += (distance * site.video.beamwidth_rad) ** 2 + site.video.range_step_m**2 + 0.1 * length**2
    return min(math.sqrt(GATE * variance), MAX_GATE_M) + 0.5 * length + 2 * site.video.range_step_m


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    st.lists(st.floats(-2.0, 2.0), min_size=16, max_size=16),
    st.floats(0.1, 2.9),
    st.floats(300.0, 2500.0),
    st.floats(0.0, 40.0),
)
def test_a_guard_covers_what_the_gate_can_hold(root: list[float], ahead: float, distance: float, length: float) -> None:
    """Standing due south, so that the beam passes half a turn after north; the covariance is any there can be."""
    half = np.array(root).reshape(4, 4)
    covariance = half @ half.T
    clock = turning(1.0, 5)
    state = np.array([0.0, -distance, 0.0, 0.0])
    plan = look(clock, state, covariance, time=T0 + 4.5 - ahead, looked=3 * A + A // 2)
    assert plan.row[0] == 4 * A + A // 2
    assert plan.time[0] == pytest.approx(T0 + 4.5, abs=1e-3)
    most = 0.25 * distance
    assert guard_m(plan, distance) == pytest.approx(
        min(expected_guard_m(covariance, ahead, distance, 0.0, SITE), most), rel=2e-3
    )
    long = look(clock, state, covariance, time=T0 + 4.5 - ahead, looked=3 * A + A // 2, length=length)
    assert guard_m(long, distance) == pytest.approx(
        min(expected_guard_m(covariance, ahead, distance, length, SITE), most), rel=2e-3
    )


def test_a_track_far_away_is_waited_for_as_long_as_the_beam_is_wide_there() -> None:
    """What is known to a metre and stands is felt 40 m wide at 2 km by a beam of 0.02 rad, 10 m at 500 m."""
    clock, sure = turning(1.0, 5), np.diag([0.01, 0.01, 1e-4, 1e-4])
    wide = [
        guard_m(look(clock, np.array([0.0, -d, 0.0, 0.0]), sure, time=T0 + 4.5, looked=3 * A + A // 2), d)
        for d in (500.0, 2000.0)
    ]
    assert wide[1] > math.sqrt(GATE) * 40.0
    assert wide[0] < math.sqrt(GATE) * 12.0 + 8.0


@pytest.mark.parametrize("period", [0.5, 1.0, 2.5])
def test_a_look_is_when_the_beam_passes_where_the_track_will_be(period: float) -> None:
    """Due south of the radar and 60 m/s to the west: the beam, which turns clockwise, meets it later than due south."""
    clock = turning(period, 30, nominal=period)
    begin = T0 + 29 * period
    plan = look(clock, np.array([0.0, -800.0, -60.0, 0.0]), np.eye(4), time=begin, looked=28 * A + A // 2)
    ahead = plan.time[0] - begin
    azimuth = math.atan2(-60.0 * ahead, -800.0) % (2 * math.pi)
    assert ahead == pytest.approx(period * azimuth / (2 * math.pi), abs=0.002 * period)
    assert plan.row[0] == pytest.approx(29 * A + azimuth / (2 * math.pi) * A, abs=0.002 * A)
    assert azimuth > math.pi + 0.015 * period


def test_a_look_is_due_once_the_whole_guard_has_been_closed() -> None:
    state, sure = np.array([0.0, -800.0, 0.0, 0.0]), np.eye(4)
    for closed in range(4 * A + A // 2 - 200, 4 * A + A // 2 + 400, 16):
        clock = turning(1.0, 4)
        clock.heard(closed, T0 + closed / A, A, 1.0)
        plan = look(clock, state, sure, time=T0 + 3.5, looked=3 * A + A // 2)
        assert plan.row[0] == 4 * A + A // 2
        assert plan.due[0] == (closed >= plan.row[0] + plan.guard[0])
        assert plan.covered[0]


def test_what_was_looked_at_in_this_half_turn_is_looked_at_in_the_next_turn() -> None:
    plan = look(turning(1.0, 5), np.array([0.0, -800.0, 0.0, 0.0]), np.eye(4), looked=4 * A + A // 2 + 1)
    assert (plan.row[0], plan.due[0], plan.covered[0]) == (5 * A + A // 2 + 1, False, False)


@pytest.mark.parametrize("silent", [1, 2, 3, 10])
def test_turns_left_out_are_one_look(silent: int) -> None:
    """The feed was silent for some turns: the look is the last one that is over, not the first that was missed."""
    clock, closed = turning(1.0, 4), 5 + silent
    clock.heard(closed * A, T0 + closed, A, 1.0)
    plan = look(clock, np.array([0.0, -800.0, 0.0, 0.0]), 0.01 * np.eye(4), time=T0 + 3.5, looked=3 * A + A // 2)
    assert (plan.row[0], plan.due[0]) == ((closed - 1) * A + A // 2, True)
    assert plan.time[0] == pytest.approx(T0 + closed - 0.5, abs=1e-3)


def test_after_an_interruption_the_beam_is_expected_where_the_target_has_moved_to() -> None:
    """20 m/s to the west for eleven seconds, 800 m south of the radar."""
    clock = turning(1.0, 4)
    clock.heard(15 * A, T0 + 15.0, A, 1.0)
    moving = np.array([0.0, -800.0, -20.0, 0.0])
    plan = look(clock, moving, 0.01 * np.eye(4), time=T0 + 3.5, looked=3 * A + A // 2)
    azimuth = math.atan2(-20.0 * (plan.time[0] - T0 - 3.5), -800.0) % (2 * math.pi)
    assert plan.row[0] == pytest.approx(14 * A + azimuth / (2 * math.pi) * A, abs=0.002 * A)
    assert azimuth > math.pi + 0.25


@pytest.mark.parametrize(
    ("distance", "covered"), [(90.0, False), (110.0, True), (400.0, True), (460.0, True), (480.0, False)]
)
def test_a_radar_covers_its_own_ranges(distance: float, covered: bool) -> None:
    video = VideoFormat(ranges=91, first_range_m=104.0, range_step_m=4.0)
    site = RadarSite("short", 200.0, -100.0, 22.0, video)
    state = np.array([0.0, -distance, 0.0, 0.0])
    plan = look(turning(1.0, 5), state, np.eye(4), looked=3 * A + A // 2, site=site)
    assert plan.covered[0] == covered
