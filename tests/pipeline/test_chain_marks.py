"""The azimuth marks of a radar chain: the same bits for any cut of the turns, across gaps, restarts and successors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.chain import RadarChain
from pipeline.detect.ca import CellAveraging
from pipeline.extract.manhattan import Manhattan
from pipeline.tables import MARKS_A_TURN, SectorPlots, Sweeps, VideoFormat, mark_row
from tests.support.video_scenes import cut, site

RANGES = 70


def video(azimuths: int) -> VideoFormat:
    return VideoFormat(azimuths=azimuths, ranges=RANGES, range_step_m=6.0, beamwidth_rad=0.13)


def chain(azimuths: int, min_cells: int = 2) -> RadarChain:
    return RadarChain(site(video(azimuths)), 1, CellAveraging(), Manhattan(min_cells=min_cells))


def turns(azimuths: int, many: int, share: float = 1.0, seed: int = 1, scan: int = 0) -> list[Sweeps]:
    """One block a turn; a share of the sweeps was received, at times without pattern."""
    rng = np.random.default_rng(seed)
    made = []
    for turn in range(many):
        row = np.flatnonzero(rng.random(azimuths) < share).astype(np.int32)
        time = 1.7e9 + 2.5 * (turn + row / azimuths) + rng.uniform(0, 0.1 / azimuths, len(row))
        amplitude = np.zeros((len(row), RANGES), np.uint8)
        made.append(Sweeps(0, scan + turn, row, (row + 0.5) * 2 * np.pi / azimuths, time, amplitude, last=True))
    return made


def pieces(these: Sequence[Sweeps], blocks: int) -> Iterator[Sweeps]:
    """Each turn in so many blocks of equal size, as far as it has the sweeps for it."""
    for one in these:
        yield from cut(one, [len(one) * k // blocks for k in range(1, blocks)] if len(one) else [])


def run(target: RadarChain, these: Sequence[Sweeps]) -> list[SectorPlots]:
    return [target.process(one) for one in these]


def octets(sectors: Sequence[SectorPlots]) -> tuple[bytes, bytes]:
    """All marks and their times, bit for bit."""
    for one in sectors:
        assert (one.mark.dtype, one.mark_time.dtype) == (np.int64, np.float64)
        assert one.mark.shape == one.mark_time.shape
    return b"".join(one.mark.tobytes() for one in sectors), b"".join(one.mark_time.tobytes() for one in sectors)


@pytest.mark.parametrize("blocks", [2, 7, 32, 4096])
@pytest.mark.parametrize("azimuths", [7, 20, 96, 100])
@pytest.mark.parametrize("share", [1.0, 0.7, 0.2])
def test_equal_blocks_give_the_marks_of_whole_turns(azimuths: int, share: float, blocks: int) -> None:
    these = turns(azimuths, 5, share)
    wanted = octets(run(chain(azimuths), these))
    assert len(wanted[0]) > 8 * MARKS_A_TURN
    assert octets(run(chain(azimuths), list(pieces(these, blocks)))) == wanted


def test_a_turn_of_4096_sweeps_in_single_sweeps_gives_the_marks_of_the_whole_one() -> None:
    these = turns(4096, 1, 0.9)
    sectors = run(chain(4096), these)
    assert octets(run(chain(4096), list(pieces(these, 4096)))) == octets(sectors)
    assert sectors[0].mark.tolist()[-15:] == list(range(1, MARKS_A_TURN))


@settings(max_examples=60, deadline=None)
@given(
    st.sampled_from([7, 31, 45, 64, 96]),
    st.sampled_from([0.0, 0.02, 0.5, 0.9, 1.0]),
    st.lists(st.lists(st.integers(0, 95), max_size=9), min_size=4, max_size=4),
    st.integers(0, 2**32 - 1),
    st.sampled_from([0, 2**26]),
)
def test_no_cut_changes_a_bit(azimuths: int, share: float, cuts: list[list[int]], seed: int, scan: int) -> None:
    these = turns(azimuths, 4, share, seed, scan)
    small = [piece for one, at in zip(these, cuts, strict=True) if len(one) for piece in cut(one, at)]
    assert octets(run(chain(azimuths), small)) == octets(run(chain(azimuths), these))


@pytest.mark.parametrize("azimuths", [20, 96, 100])
def test_where_nothing_is_missing_every_mark_has_the_time_of_the_sweep_at_its_row(azimuths: int) -> None:
    these = turns(azimuths, 3, scan=2)
    time = np.concatenate([one.time for one in these])
    sectors = run(chain(azimuths), list(pieces(these, 5)))
    marks = np.concatenate([one.mark for one in sectors])
    assert marks.tolist() == list(range(2 * MARKS_A_TURN, 5 * MARKS_A_TURN))
    rows = mark_row(marks, azimuths) - 2 * azimuths
    assert np.concatenate([one.mark_time for one in sectors]).tolist() == time[rows].tolist()
    newest = -1
    for block, one in zip(pieces(these, 5), sectors, strict=True):
        before, newest = newest, block.scan * azimuths + int(block.row[-1])
        assert ((before < mark_row(one.mark, azimuths)) & (mark_row(one.mark, azimuths) <= newest)).all()


def test_sweeps_missing_about_a_mark_leave_it_the_first_sweep_after_it() -> None:
    (one,) = turns(96, 1)
    kept = np.flatnonzero((one.row < 11) | (one.row >= 29))
    (sector,) = run(chain(96), [part(one, kept)])
    assert sector.mark.tolist() == list(range(MARKS_A_TURN))
    assert sector.mark_time[:6].tolist() == one.time[[5, 29, 29, 29, 29, 35]].tolist()


def part(block: Sweeps, rows: np.ndarray) -> Sweeps:  # type: ignore[type-arg]
    return replace(
        block, row=block.row[rows], azimuth=block.azimuth[rows], time=block.time[rows], amplitude=block.amplitude[rows]
    )


def test_marks_of_a_gap_of_more_than_a_turn_are_left_out() -> None:
    these = turns(96, 4)
    early, late = part(these[0], np.arange(20)), part(these[2], np.arange(8, 96))
    target = chain(96)
    assert target.process(early).mark.tolist() == [0, 1, 2]
    assert octets([target.process(one) for one in cut(late, [1, 40])]) == octets([part_after_gap(early, late)])
    assert part_after_gap(early, late).mark.tolist() == list(range(2 * MARKS_A_TURN + 1, 3 * MARKS_A_TURN))
    a_turn = chain(96)
    a_turn.process(early)
    within = a_turn.process(part(these[1], np.arange(20, 96)))  # exactly a turn is missing
    assert within.mark.tolist() == list(range(3, 2 * MARKS_A_TURN))
    assert set(within.mark_time[:MARKS_A_TURN].tolist()) == {these[1].time[20]}


def part_after_gap(early: Sweeps, late: Sweeps) -> SectorPlots:
    target = chain(96)
    target.process(early)
    return target.process(late)


def test_late_sweeps_an_empty_block_and_a_flush_give_no_marks() -> None:
    these = list(pieces(turns(96, 2), 4))
    target = chain(96)
    run(target, these[:6])
    assert len(target.process(these[5]).mark) == 0
    assert len(target.process(part(these[6], np.arange(0))).mark) == 0
    assert len(target.flush().mark) == 0
    twice = replace(these[6], row=np.arange(40, 64, dtype=np.int32))  # the first 8 rows were worked on before
    assert target.process(twice).mark.tolist() == [24, 25]
    fresh = chain(96)
    run(fresh, these[:6])
    assert fresh.process(these[6]).mark.tolist() == [24, 25, 26, 27]


def test_a_restart_and_a_successor_go_on_with_the_same_marks() -> None:
    these = list(pieces(turns(100, 3, 0.6), 9))
    wanted = octets(run(chain(100), these))
    for at in (1, 5, 10, 20):
        for how in ("save", "save_whole", "take_over"):
            first = chain(100)
            begun = run(first, these[:at])
            second = chain(100, 3 if how == "take_over" else 2)
            if how == "save":
                second.restore(first.save())
            elif how == "save_whole":
                second.restore_whole(first.save_whole())
            else:
                begun.append(first.flush())
                for one in these[:at]:
                    second.learn(one)
                second.take_over(first)
            assert octets([*begun, *run(second, these[at:])]) == wanted


def test_a_process_that_resumes_counts_marks_with_its_rows_anew() -> None:
    before = chain(96)
    run(before, turns(96, 3))
    target = chain(96)
    target.resume(before.save())
    assert run(target, turns(96, 1))[0].mark.tolist() == list(range(MARKS_A_TURN))
