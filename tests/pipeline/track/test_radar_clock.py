"""The antenna's period and time as a radar's sectors tell them, with azimuth marks and without."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.tables import MARKS_A_TURN, SectorPlots, mark_row, marks_between
from pipeline.tables.arrays import Array
from pipeline.track.radar_clock import NO_MARK, RadarClock
from tests.pipeline.track.scene import T0, A, make_plots, make_tracker

NOTHING = make_plots([], np.empty((0, 2)), 2.0)


def hear(
    clock: RadarClock, closed_to: int, time: float, mark: Array | None = None, mark_time: Array | None = None,
    nominal: float = 1.0,
) -> None:  # fmt: skip
    """A sector without plots, that goes on where the one before ended."""
    marks = {} if mark is None else {"mark": np.asarray(mark), "mark_time": np.asarray(mark_time, float)}
    sector = SectorPlots(0, closed_to // A, time, clock.closed_to, closed_to, NOTHING, **marks)
    clock.heard(sector, A, nominal)


def turning(
    period: float, turns: float, parts: int = 8, nominal: float = 1.0, marked: bool = False, first: int = 0
) -> RadarClock:
    """The clock of a radar that has turned so often, told in `parts` sectors a turn, the first turn being `first`."""
    clock = RadarClock(nominal, closed_to=first * A)
    for sector in range(1, round(turns * parts) + 1):
        low, high = (first * A + k * A // parts for k in (sector - 1, sector))
        mark = marks_between(low, high, A)
        marks = (mark, T0 + (mark_row(mark, A) / A - first) * period) if marked else ()
        hear(clock, high, T0 + sector * period / parts, *marks, nominal=nominal)
    return clock


@pytest.mark.parametrize("period", [0.4, 0.8, 1.3, 2.5])
@pytest.mark.parametrize("parts", [1, 8, 64])
@pytest.mark.parametrize("marked", [False, True])
def test_the_period_is_learnt_when_it_is_not_the_nominal_one(period: float, parts: int, marked: bool) -> None:
    clock = turning(period, 25, parts, marked=marked)
    assert clock.period == pytest.approx(period, rel=0.01)
    assert clock.newest == pytest.approx(T0 + 25 * period)
    if not marked:
        assert clock.time == pytest.approx(T0 + 25 * period)


@pytest.mark.parametrize("period", [0.8, 1.3])
def test_the_antenna_is_where_the_newest_mark_says(period: float) -> None:
    """UTC s at an absolute row, whatever the newest sector's own time and row are."""
    clock = turning(period, 25, 8, marked=True)
    clock.time = clock.newest = T0 + 1e5
    time, learnt, row = clock.antenna(A)
    assert (time, row) == (T0 + (24 + 255 / 256) * period, 24 * A + 255 * A // 256)
    assert learnt == pytest.approx(period, rel=0.01)


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
    hear(clock, 3 * A, T0 + 2.0 + 1.4)
    assert clock.period == pytest.approx(1.1)
    hear(clock, 3 * A + A // 2, T0 + 3.4 + 0.95)  # half a turn at 1.9 s a turn
    assert clock.period == pytest.approx(1.2)
    hear(clock, 7 * A + A // 2, T0 + 4.35 + 4 * 1.6)
    assert clock.period == pytest.approx(1.6)


@pytest.mark.parametrize(
    ("rows", "taught"),
    [(A // 64 - 1, False), (A // 64, True), (A, True), (4 * A, True), (4 * A + 1, False)],
    ids=["too short to time", "shortest", "a turn", "longest", "feed interrupted"],
)
def test_only_sectors_of_a_64th_of_a_turn_to_four_turns_teach_the_period(rows: int, taught: bool) -> None:
    clock = turning(1.0, 2, 1)
    hear(clock, 2 * A + rows, T0 + 2.0 + 1.5 * rows / A)
    assert (clock.period > 1.0) == taught


@pytest.mark.parametrize(
    ("turn", "taught"), [(0.2, False), (0.25, True), (3.9, True), (4.0, True), (4.1, False), (0.0, False)]
)
@pytest.mark.parametrize("nominal", [1.0, 2.5])
def test_a_period_four_times_off_the_nominal_one_is_a_fault_of_its_times(
    turn: float, taught: bool, nominal: float
) -> None:
    clock = RadarClock(nominal)
    hear(clock, 2 * A, 0.0, nominal=nominal)
    hear(clock, 3 * A, turn * nominal, nominal=nominal)
    assert (clock.period != nominal) == taught


def test_a_clock_that_has_heard_nothing_learns_no_period_from_its_first_sector() -> None:
    clock = turning(1.3, 1, 1)
    assert (clock.period, clock.closed_to, clock.time, clock.newest) == (1.0, A, T0 + 1.3, T0 + 1.3)


def test_the_closed_row_keeps_its_own_time_while_an_open_echo_holds_it_back() -> None:
    """It goes on by the rows that were closed, not by what the newest sweep is ahead, which may be half a turn."""
    clock = turning(1.0, 4, 8)
    hear(clock, 4 * A + A // 8, T0 + 4.125 + 0.3)
    assert clock.time == pytest.approx(T0 + 4.125, abs=0.05)
    assert clock.newest == T0 + 4.425


def test_after_an_interruption_the_closed_row_has_the_time_of_the_newest_sweep() -> None:
    clock = turning(1.0, 4, 8)
    hear(clock, 4 * A + A // 8, T0 + 60.0)
    assert clock.time == T0 + 60.0


def test_the_closed_row_is_never_later_than_the_newest_sweep() -> None:
    clock = turning(1.0, 4, 8)
    hear(clock, 5 * A, T0 + 4.9)
    assert clock.time == T0 + 4.9


def marked_clock(period: float = 1.0) -> RadarClock:
    """After two turns of nominal length with their marks, 0 .. 31."""
    return turning(period, 2, 1, nominal=period, marked=True)


def test_marks_wait_with_the_period_as_learnt_up_to_each() -> None:
    clock = turning(1.3, 2, 4, marked=True)
    assert clock.mark.tolist() == list(range(32))
    assert clock.mark_time.tolist() == [T0 + (16 * k + 15) / 256 * 1.3 for k in range(32)]
    assert clock.mark_period[0] == 1.0
    assert (np.diff(clock.mark_period) > 0).all()
    assert clock.mark_period[-1] == clock.period < 1.3


@pytest.mark.parametrize("parts", [1, 3, 32, 40, 64, 4096])
def test_what_is_learnt_from_marks_does_not_depend_on_the_cut(parts: int) -> None:
    whole, cut = turning(1.3, 3, 2, marked=True), turning(1.3, 3, parts, marked=True)
    for name in ("mark", "mark_time", "mark_period"):
        assert getattr(whole, name).tobytes() == getattr(cut, name).tobytes()
    assert (whole.period, whole.last_mark, whole.last_mark_time) == (cut.period, cut.last_mark, cut.last_mark_time)
    assert whole.antenna(A) == cut.antenna(A)


def test_a_turn_told_by_marks_counts_a_quarter_as_well() -> None:
    clock = turning(1.4, 1, 32, marked=True)
    assert clock.period == pytest.approx(1.0 + 0.4 * (1 - (1 - 0.25 / MARKS_A_TURN) ** (MARKS_A_TURN - 1)))


def test_of_marks_with_equal_times_the_first_counts_and_the_period_stays() -> None:
    """Sweeps were missing: the marks 32, 33 and 34 have the time of the first sweep after them."""
    clock = marked_clock()
    after = T0 + 2 + (16 * 2 + 15) / 256
    hear(clock, 2 * A + A // 4, T0 + 2.25, [32, 33, 34, 35], [after, after, after, after + 1 / 16])
    assert clock.mark.tolist() == [*range(33), 35]
    assert clock.mark_time[-2:].tolist() == [after, after + 1 / 16]
    assert clock.period == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("wrong", [T0 + 2.2, T0 + 1e6, np.nan, np.inf])
def test_marks_from_after_the_newest_sweep_are_dropped(wrong: float) -> None:
    clock = marked_clock()
    hear(clock, 2 * A + A // 8, T0 + 2.125, [32, 33], [T0 + 2 + 15 / 256, wrong])
    assert clock.mark.tolist() == list(range(33))
    assert clock.last_mark == 32
    assert clock.period == pytest.approx(1.0)


@pytest.mark.parametrize(("mark", "time"), [(20, T0 + 2.1), (31, T0 + 2.1), (32, T0 + 1.5)])
def test_marks_that_run_back_are_dropped(mark: int, time: float) -> None:
    clock = marked_clock()
    hear(clock, 2 * A + A // 8, T0 + 2.125, [mark], [time])
    assert clock.mark.tolist() == list(range(32))
    assert (clock.last_mark, clock.last_mark_time) == (31, T0 + 1 + 255 / 256)


@pytest.mark.parametrize(
    ("closed_to", "ahead", "taken"),
    [(240, 1.0, True), (239, 1.0, False), (240, 1.0625, False), (240, 100.0, False), (240, 1e9, False)],
)
def test_a_mark_more_than_a_turn_beyond_the_closed_row_is_dropped(closed_to: int, ahead: float, taken: bool) -> None:
    """Mark 32 stands at row 240 of turn 2. A number far ahead would make all right ones run back from then on."""
    clock = marked_clock()
    wrong = 32 + round(ahead * MARKS_A_TURN)
    hear(clock, 2 * A + closed_to, T0 + 2.1, [wrong], [T0 + 2.1])
    assert (clock.mark[-1] == wrong) == taken
    if taken:
        return
    assert (clock.last_mark, clock.last_mark_time, clock.period) == (31, T0 + 1 + 255 / 256, 1.0)
    hear(clock, 2 * A + 256, T0 + 2.125, [32], [T0 + 2 + 15 / 256])
    hear(clock, 2 * A + 512, T0 + 2.25, [33], [T0 + 2 + 31 / 256])
    assert clock.mark.tolist() == list(range(34))
    assert clock.period == 1.0


def test_the_first_mark_of_a_radar_is_dropped_too_when_it_is_far_beyond_the_closed_row() -> None:
    clock = RadarClock(1.0)
    hear(clock, 256, T0, [10**6, 1], [T0 - 0.05, T0 - 0.01])
    assert (clock.mark.tolist(), clock.last_mark, clock.last_mark_time) == ([1], 1, T0 - 0.01)


@pytest.mark.parametrize("seconds", [0.03, 0.3, 3.0])
def test_a_sector_between_two_marks_changes_neither_period_nor_clock(seconds: float) -> None:
    """However long it took: marks alone teach a radar that has told any. Nor do plots or the closed row say more."""
    clock, before = marked_clock(), marked_clock()
    sector = SectorPlots(0, 2, T0 + 2.0 + seconds, 2 * A, 2 * A + A // 32, NOTHING)
    clock.heard(sector, A, 1.0)
    clock.infer_marks(sector, A)
    clock.set_by(np.array([2 * A + 50]), np.array([T0 + 2.0 + seconds]), A)
    assert (clock.period, clock.time, clock.antenna(A)) == (before.period, before.time, before.antenna(A))
    assert (clock.last_mark, clock.last_mark_time) == (before.last_mark, before.last_mark_time)
    for name in ("mark", "mark_time", "mark_period"):
        assert getattr(clock, name).tobytes() == getattr(before, name).tobytes()
    assert (clock.closed_to, clock.newest) == (2 * A + A // 32, T0 + 2.0 + seconds)


def test_plots_set_the_clock_of_a_radar_that_has_told_no_marks() -> None:
    clock = turning(1.0, 2, 8)
    clock.set_by(np.array([2 * A - A // 4]), np.array([T0 + 1.7]), A)
    assert clock.time == pytest.approx(T0 + 1.95, abs=1e-6)


@pytest.mark.parametrize(("turns", "taught"), [(3.0, True), (4.0, True), (4.5, False), (60.0, False)])
def test_a_gap_in_the_marks_of_more_than_four_turns_teaches_no_period(turns: float, taught: bool) -> None:
    clock = marked_clock()
    number, time = 31 + round(turns * MARKS_A_TURN), T0 + 1 + 255 / 256 + turns * 1.5
    hear(clock, int(mark_row(number, A)) + 1, time, [number], [time])
    assert clock.mark[-1] == number
    assert (clock.period > 1.1) == taught


def test_the_marks_of_a_sector_without_any_follow_from_its_closed_row() -> None:
    clock = RadarClock(1.0)
    for turn in (1, 2):
        sector = SectorPlots(0, turn - 1, T0 + turn, clock.closed_to, turn * A, NOTHING)
        clock.heard(sector, A, 1.0)
        clock.infer_marks(sector, A)
    assert clock.mark.tolist() == list(range(32))
    np.testing.assert_allclose(clock.mark_time, T0 + (16 * np.arange(32) + 15) / 256, atol=1e-6)
    assert clock.ready(A) == 32
    marked = marked_clock()
    marked.infer_marks(SectorPlots(0, 2, T0 + 2.1, 2 * A, 2 * A + 400, NOTHING), A)
    assert marked.mark.tolist() == list(range(32))  # a radar that tells marks tells all of them


@pytest.mark.parametrize("rows", [100, 128, 240, 241, 256, 257, 500])
def test_marks_that_follow_from_closed_rows_come_once_each_however_a_turn_is_cut(rows: int) -> None:
    clock, closed = RadarClock(1.0), 0
    while closed < 2 * A:
        closed = min(closed + rows, 2 * A)
        sector = SectorPlots(0, closed // A, T0 + closed / A, clock.closed_to, closed, NOTHING)
        clock.heard(sector, A, 1.0)
        clock.infer_marks(sector, A)
    assert clock.mark.tolist() == list(range(32))


def test_a_mark_is_ready_when_its_row_is_closed_and_spent_once() -> None:
    clock = marked_clock()
    hear(clock, 2 * A + 239, T0 + 2.2, [32], [T0 + 2 + 15 / 256])  # an open echo holds the closed row back
    assert (len(clock.mark), clock.ready(A)) == (33, 32)
    hear(clock, 2 * A + 240, T0 + 2.3)
    assert clock.ready(A) == 33
    clock.spend(28)
    assert (clock.mark.tolist(), clock.mark_time[0]) == (list(range(28, 33)), T0 + 1 + 207 / 256)
    assert (clock.decided, clock.decided_time, clock.ready(A)) == (27, T0 + 1 + 191 / 256, 5)
    assert clock.decided_row(A) == mark_row(27, A)
    assert RadarClock(1.0).ready(A) == 0


def test_the_longest_wait_between_deliveries_is_a_turn_and_is_forgotten() -> None:
    clock = turning(1.0, 4, 4)
    assert clock.step > 0.9  # before the first delivery nothing is known
    for k in range(1, 32 * 400):
        hear(clock, 4 * A + k * A // 32, T0 + 4.0 + k / 32)
    assert clock.step == pytest.approx(1 / 32, rel=0.1)
    hear(clock, 500 * A, T0 + 500.0)
    assert clock.step == 1.0  # and not the 96 s of the interruption


def test_a_clock_that_is_set_moves_all_its_times() -> None:
    clock, other = marked_clock(), marked_clock()
    for one in (clock, other):
        one.spend(20)
    clock.shift(100.0)
    for name in ("time", "newest", "last_mark_time", "decided_time"):
        assert getattr(clock, name) == getattr(other, name) + 100.0
    np.testing.assert_array_equal(clock.mark_time, other.mark_time + 100.0)
    assert (clock.mark.tolist(), clock.period, clock.closed_to) == (other.mark.tolist(), 1.0, 2 * A)
    assert RadarClock(1.0).last_mark == NO_MARK


@pytest.mark.parametrize(
    ("marked", "known"), [(True, {"time", "newest", "last_mark_time"}), (False, {"newest", "time"})]
)
def test_all_times_are_shifted_with_the_clock_they_come_from(marked: bool, known: set[str]) -> None:
    clock = turning(1.0, 2, 32, marked=marked)
    clock.mark_time, clock.decided_time = np.array([T0, T0 + 1.0]), T0 - 1.0
    names = ("time", "newest", "last_mark_time", "decided_time", "mark_time")
    before = {name: np.array(getattr(clock, name)) for name in names}
    assert {name for name in names if np.isfinite(before[name]).all()} == known | {"decided_time", "mark_time"}
    clock.shift(7.0)
    for name in names:
        np.testing.assert_array_equal(getattr(clock, name), before[name] + 7.0)
