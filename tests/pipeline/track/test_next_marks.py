"""In which order the marks of several radars are decided at, and which together."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.tables import MARKS_A_TURN, SectorPlots, mark_row, marks_between
from pipeline.track.radar_clock import RadarClock
from pipeline.track.schedule import Marks, next_marks, starts_half
from tests.pipeline.track.scene import T0, A, make_plots

NOTHING = make_plots([], np.empty((0, 2)), 2.0)


class Radar:
    """Turns evenly from `phase` s after T0 on, and delivers when it is told to."""

    def __init__(self, period: float = 1.0, phase: float = 0.0) -> None:
        self.period, self.phase = period, phase
        self.clock = RadarClock(period)

    def deliver(self, until: float) -> None:
        """All rows that the antenna has passed `until` s after T0."""
        low, high = self.clock.closed_to, int((until - self.phase) / self.period * A + 1e-6)
        if high > low:
            mark = marks_between(low, high, A)
            time = T0 + self.phase + mark_row(mark, A) / A * self.period
            newest = T0 + self.phase + high / A * self.period
            self.clock.heard(
                SectorPlots(0, high // A, newest, low, high, NOTHING, mark=mark, mark_time=time), A, self.period
            )


def batches(radars: list[Radar], began: float = 0.0, until: float = math.inf) -> list[Marks]:
    """All that can be decided now. began, until: s after T0."""
    clocks, made = [one.clock for one in radars], []
    newest = max(one.newest for one in clocks)
    while (marks := next_marks(clocks, [A] * len(clocks), newest, T0 + began, T0 + until)) is not None:
        made.append(marks)
    return made


def numbers(made: list[Marks]) -> list[list[int]]:
    return [one.number.tolist() for one in made]


def test_a_batch_ends_at_the_turn_and_at_half_a_turn() -> None:
    radar = Radar()
    radar.deliver(2.5)
    made = batches([radar])
    assert numbers(made) == [list(range(k, k + 8)) for k in range(0, 40, 8)]
    radar.deliver(2.9)
    radar.deliver(3.3)
    later = batches([radar])
    assert numbers(later) == [list(range(40, 48)), list(range(48, 52))]
    for one in (*made, *later):
        assert one.radar == 0
        assert one.row.tolist() == mark_row(one.number, A).tolist()
        np.testing.assert_allclose(one.time, T0 + one.row / A, atol=1e-6)
        np.testing.assert_allclose(one.period, 1.0)


def test_half_a_turn_is_counted_from_the_first_mark_of_the_batch() -> None:
    radar = Radar()
    radar.deliver(0.3)
    assert numbers(batches([radar])) == [list(range(4))]
    radar.deliver(1.2)
    assert numbers(batches([radar])) == [list(range(4, 12)), list(range(12, 16)), list(range(16, 19))]


@pytest.mark.parametrize(("gap", "alone"), [(8, False), (9, True), (16, True), (160, True)])
def test_the_first_mark_after_a_gap_stands_alone(gap: int, alone: bool) -> None:
    radar = Radar()
    radar.deliver(1.0)
    batches([radar])
    mark = np.arange(15 + gap, 15 + gap + 3)
    time = T0 + mark_row(mark, A) / A
    high = int(mark_row(mark[-1], A)) + 1
    radar.clock.heard(SectorPlots(0, 1, T0 + 99, A, high, NOTHING, mark=mark, mark_time=time), A, 1.0)
    assert numbers(batches([radar]))[0] == mark[: 1 if alone else 3].tolist()


def test_a_half_turn_starts_at_its_first_mark() -> None:
    assert [mark for mark in range(2 * MARKS_A_TURN) if starts_half(mark)] == [0, 8, 16, 24]
    for mark in (*range(2 * MARKS_A_TURN), *range(10**9 * MARKS_A_TURN, (10**9 + 1) * MARKS_A_TURN)):
        before, half = (2 * mark_row(one, A) // A for one in (mark - 1, mark))
        assert starts_half(mark) == (half != before)


HALF_TURN_AT = 143 / 256
"""s after T0 at which the mark 8 is passed, with which the second half of the first turn starts."""


@pytest.mark.parametrize(
    ("until", "sizes"),
    [(0.01, [4, 8]), (0.35, [4, 8]), (HALF_TURN_AT - 1e-3, [4, 8]), (HALF_TURN_AT, [8, 4]), (5.0, [8, 4])],
)
def test_a_batch_ends_at_the_half_turn_where_all_tracks_are_to_be_judged(until: float, sizes: list[int]) -> None:
    """Later marks stay with those before them until a half turn starts, and so does one at that very time."""
    radar = Radar()
    radar.deliver(0.3)
    assert numbers(batches([radar])) == [[0, 1, 2, 3]]
    radar.deliver(1.0)
    first = next_marks([radar.clock], [A], T0 + 1.0, T0, T0 + until)
    assert first is not None
    assert len(first.number) == sizes[0]
    assert [len(one.number) for one in batches([radar])] == sizes[1:]


def test_the_start_of_a_half_turn_is_decided_whatever_the_time() -> None:
    radar = Radar()
    radar.deliver(0.5)
    batches([radar])
    radar.deliver(1.0)
    assert numbers(batches([radar], until=0.01)) == [list(range(8, 16))]


@pytest.mark.parametrize("seed", range(8))
def test_however_a_radar_delivers_all_tracks_are_judged_before_the_same_mark(seed: int) -> None:
    """It is the first after that time with which a half turn starts, and stands first in its batch."""
    rng, radar, at = np.random.default_rng(seed), Radar(), 0.0
    until, made = rng.uniform(0.1, 4.0), []
    while at < 6.0:
        at += rng.uniform(0.01, 0.9)
        radar.deliver(at)
        made += numbers(batches([radar], until=until))
    assert [mark for one in made for mark in one] == list(range(radar.clock.last_mark + 1))
    judged = min(8 * half for half in range(20) if (8 * half + 15 / 16) / 16 > until)
    assert judged in [one[0] for one in made]


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(
    "turning", [((1.0, 0.0), (1.0, 0.43)), ((0.5, 0.1), (1.0, 0.0), (2.5, 0.7)), ((1.0, 0.0), (1.0, 0.0))]
)
def test_however_several_radars_deliver_their_marks_come_in_the_order_of_their_times(
    seed: int, turning: tuple[tuple[float, float], ...]
) -> None:
    rng = np.random.default_rng(seed)
    radars = [Radar(*one) for one in turning]
    due, decided = [one.phase + rng.uniform(0.01, one.period) for one in radars], []
    while min(due) < 12.0:
        radar = int(np.argmin(due))
        radars[radar].deliver(due[radar])
        due[radar] += rng.uniform(0.01, radars[radar].period)
        for marks in batches(radars, began=min(one.phase for one in radars)):
            decided += [(time, marks.radar, number) for time, number in zip(marks.time, marks.number, strict=True)]
    assert decided == sorted(decided)
    for radar, one in enumerate(radars):
        mine = [number for _, of, number in decided if of == radar]
        assert mine == list(range(len(mine)))
        assert len(mine) > 8 / one.period * MARKS_A_TURN


def test_a_mark_waits_for_another_radar_until_that_has_been_decided_up_to_its_time() -> None:
    first, second = Radar(), Radar(phase=0.01)
    first.deliver(2.0)
    second.deliver(2.0)
    batches([first, second])
    first.deliver(2.5)
    assert [(one.radar, one.number.tolist()) for one in batches([first, second])] == []
    second.deliver(2.26)
    made = batches([first, second])
    assert [(one.radar, one.number.tolist()) for one in made] == [(k % 2, [31 + k // 2]) for k in range(10)]


@pytest.mark.parametrize(("silent_for", "waits"), [(0.4, True), (1.0, True), (3.0, False)])
def test_a_radar_that_has_fallen_silent_is_not_waited_for(silent_for: float, waits: bool) -> None:
    """It delivered in whole turns, so that a turn and a half, and half a second, may pass."""
    first, second = Radar(), Radar(phase=0.01)
    for turn in range(1, 5):
        first.deliver(turn)
        second.deliver(turn + 0.01)
        batches([first, second])
    first.deliver(4.01 + silent_for)
    made = batches([first, second])
    mine = [one for one in made if one.radar == 0]
    assert (mine == []) == waits
    if not waits:
        assert mine[-1].number[-1] == first.clock.last_mark


def test_a_radar_of_small_blocks_is_waited_for_less_long_than_one_of_whole_turns() -> None:
    first, second = Radar(), Radar(phase=0.01)
    for step in range(1, 32 * 200):
        first.deliver(step / 32)
        second.deliver(step / 32 + 0.01)
        batches([first, second])
    first.deliver(step / 32 + 0.3)
    assert [one.radar for one in batches([first, second])] == [1]
    first.deliver(step / 32 + 0.8)
    assert {one.radar for one in batches([first, second])} == {0}


@pytest.mark.parametrize(("began", "newest", "waits"), [(0.0, 1.9, True), (0.0, 2.1, False), (50.0, 2.1, False)])
def test_at_the_begin_a_radar_is_waited_for_until_its_first_turn_must_have_come(
    began: float, newest: float, waits: bool
) -> None:
    """A turn and a half, and half a second; not when the first sector was dated later than what comes now."""
    first, second = Radar(), Radar()
    first.deliver(newest)
    assert (batches([first, second], began) == []) == waits


def test_without_a_closed_mark_there_is_nothing_to_decide() -> None:
    radar = Radar()
    assert batches([radar]) == []
    radar.deliver(0.058)
    assert batches([radar]) == []
    radar.deliver(0.059)
    assert numbers(batches([radar])) == [[0]]
