"""Azimuth marks: where they stand, and that their times do not depend on how a turn is cut into blocks."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.tables import MARKS_A_TURN, Plots, SectorPlots, first_mark, mark_row, marks_between, passed_marks
from pipeline.tables.arrays import Array
from pipeline.tables.marks import present_marks
from tests.pipeline.track.scene import T0, make_plots, split_scan

AZIMUTHS = st.sampled_from([1, 7, 15, 16, 17, 31, 32, 33, 45, 96, 100, 1000, 4096])


def row_of(mark: int, azimuths: int) -> int:
    """Marks stand at the last 16th of each 16th of a turn."""
    return (16 * mark + 15) * azimuths // 256


@given(st.integers(-(10**6), 10**12), AZIMUTHS)
def test_the_first_mark_at_or_after_a_row_is_the_first(row: int, azimuths: int) -> None:
    mark = first_mark(row, azimuths)
    assert mark_row(mark, azimuths) >= row > mark_row(mark - 1, azimuths)


@given(st.integers(0, 10**9), AZIMUTHS)
def test_every_turn_has_its_marks_at_the_same_rows(scan: int, azimuths: int) -> None:
    marks = marks_between(scan * azimuths, (scan + 1) * azimuths, azimuths)
    assert marks.dtype == np.int64
    assert marks.tolist() == list(range(scan * MARKS_A_TURN, (scan + 1) * MARKS_A_TURN))
    rows = mark_row(marks, azimuths)
    assert (rows - scan * azimuths).tolist() == [row_of(k, azimuths) for k in range(MARKS_A_TURN)]
    assert mark_row(int(marks[-1]), azimuths) == rows[-1]


def sweeps(azimuths: int, turns: int, share: float, seed: int, scan: int = 0) -> list[tuple[int, Array, Array]]:
    """Of each turn its first row, the rows received and their times, which have no pattern."""
    rng = np.random.default_rng(seed)
    made = []
    for turn in range(scan, scan + turns):
        row = np.flatnonzero(rng.random(azimuths) < share).astype(np.int32)
        time = 1.7e9 + 2.5 * (turn - scan + row / azimuths) + rng.uniform(0, 0.1 / azimuths, len(row))
        made.append((turn * azimuths, row, time))
    return made


def passed(turns: list[tuple[int, Array, Array]], azimuths: int, cuts: list[Array]) -> list[tuple[Array, Array]]:
    """What passed_marks gives for the turns, each cut into blocks at the given places."""
    made, expected = [], None
    for (first, row, time), at in zip(turns, cuts, strict=True):
        for block, times in zip(np.split(row, at), np.split(time, at), strict=True):
            if not len(block):
                continue
            expected = first + int(block[0]) if expected is None else expected
            made.append(passed_marks(first, block, times, expected, azimuths))
            expected = first + int(block[-1]) + 1
    return made


def octets(made: list[tuple[Array, Array]]) -> list[bytes]:
    return [np.concatenate([one[i] for one in made]).tobytes() if made else b"" for i in (0, 1)]


@given(
    AZIMUTHS,
    st.integers(1, 4),
    st.sampled_from([0.0, 0.02, 0.3, 0.9, 1.0]),
    st.one_of(st.sampled_from([1, 2, 7, 32, 4096]), st.integers(1, 99)),
    st.booleans(),
    st.integers(0, 2**32 - 1),
    st.sampled_from([0, 3, 2**21, 2**40]),
)
def test_no_cut_of_the_turns_changes_a_bit(
    azimuths: int, turns: int, share: float, blocks: int, equal: bool, seed: int, scan: int
) -> None:
    these = sweeps(azimuths, turns, share, seed, scan)
    rng = np.random.default_rng(seed)
    whole = passed(these, azimuths, [np.empty(0, int)] * turns)
    cuts = [
        np.arange(1, blocks) * len(row) // blocks if equal else np.sort(rng.integers(0, len(row) + 1, blocks))
        for _, row, _ in these
    ]
    assert octets(passed(these, azimuths, cuts)) == octets(whole)
    for mark, time in whole:
        assert (mark.dtype, time.dtype) == (np.int64, np.float64)


@given(AZIMUTHS, st.floats(0.05, 1.0), st.integers(0, 2**32 - 1))
def test_a_mark_has_the_time_of_the_first_sweep_at_its_row_or_after_it(azimuths: int, share: float, seed: int) -> None:
    these = sweeps(azimuths, 3, share, seed, scan=5)
    row = np.concatenate([first + row.astype(np.int64) for first, row, _ in these])
    time = np.concatenate([time for _, _, time in these])
    made = passed(these, azimuths, [np.empty(0, int)] * 3)
    told = {int(k): float(t) for mark, times in made for k, t in zip(mark, times, strict=True)}
    wanted = {}
    for k in range(5 * MARKS_A_TURN, 8 * MARKS_A_TURN):
        after = np.flatnonzero(row >= row_of(k, azimuths))
        if not len(row) or not len(after) or row_of(k, azimuths) < row[0]:
            continue
        at = int(after[0])
        in_long_gap = at > 0 and row[at] - row[at - 1] - 1 > azimuths and row_of(k, azimuths) < row[at]
        if not in_long_gap:
            wanted[k] = float(time[at])
    assert told == wanted


@pytest.mark.parametrize(("missing", "marks"), [(96, range(1, 17)), (97, range(17, 17))])
def test_marks_in_a_gap_longer_than_a_turn_are_left_out(missing: int, marks: range) -> None:
    row = np.array([missing + 6 - 96], np.int32)
    mark, time = passed_marks(96, row, np.array([7.5]), 6, 96)
    assert mark.tolist() == list(marks)
    assert time.tolist() == [7.5] * len(marks)


def test_a_mark_at_the_first_row_after_a_long_gap_is_not_in_the_gap() -> None:
    mark, time = passed_marks(10 * 96, np.arange(5, 12, dtype=np.int32), np.arange(7.0), 3, 96)
    assert mark.tolist() == [160, 161]
    assert time.tolist() == [0.0, 6.0]


def test_a_source_that_knows_no_marks_gives_none() -> None:
    one, other = (SectorPlots(0, 1, 2.0, 3, 4, Plots.empty(), True) for _ in range(2))
    assert (one.degraded, one.mark.shape, one.mark_time.shape) == (True, (0,), (0,))
    assert (one.mark.dtype, one.mark_time.dtype) == (np.int64, np.float64)
    assert one.mark is not other.mark


@pytest.mark.parametrize("sectors", [2, 7, 32, 4096])
def test_the_scene_of_the_tracker_tests_gives_the_same_marks_for_any_cut(sectors: int) -> None:
    plots = make_plots(T0 + 3.0, [[0.0, 900.0]], 2.0)
    whole, cut = (split_scan(plots, 3, count) for count in (1, sectors))
    assert octets([(one.mark, one.mark_time) for one in cut]) == octets([(one.mark, one.mark_time) for one in whole])
    assert whole[0].mark.tolist() == list(range(3 * MARKS_A_TURN, 4 * MARKS_A_TURN))
    assert whole[0].mark_time.tolist() == [T0 + 3 + (16 * k + 15) / 256 for k in range(MARKS_A_TURN)]


@pytest.mark.parametrize("azimuths", [96, 1000, 4096])
def test_of_the_former_32_marks_every_second_stands_where_one_does_now(azimuths: int) -> None:
    former = np.arange(64, 128)
    rows = (8 * former + 7) * azimuths // 256
    mark, time = present_marks(former, former.astype(float), 32)
    assert mark.tolist() == list(range(32, 64))
    assert [int(row) for row in mark_row(mark, azimuths)] == rows[1::2].tolist()
    assert time.tolist() == former[1::2].tolist()
    assert present_marks(mark, time, MARKS_A_TURN)[0].tolist() == mark.tolist()
    assert len(present_marks(mark, time, 24)[0]) == len(present_marks(mark, time, 8)[0]) == 0


def test_sectors_of_older_recordings_have_their_marks_renumbered() -> None:
    made = SectorPlots(
        0, 2, T0, 0, 128, make_plots([], np.empty((0, 2)), 2.0), mark=np.array([64, 65]), mark_time=T0 + np.arange(2.0)
    )
    assert made.with_present_marks() is made
    object.__setattr__(made, "marks_a_turn", 0)  # as it is read, without a call of __init__
    now = made.with_present_marks()
    assert (now.mark.tolist(), now.mark_time.tolist(), now.marks_a_turn) == ([32], [T0 + 1.0], MARKS_A_TURN)
