"""Any cut of the turns into blocks gives the same bits: decisions belong to azimuths, not to block ends."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields

import numpy as np
import pytest

from pipeline.tables import Tracks
from tests.pipeline.track.scene import RADAR, T0, Target, line, make_tracker, marks
from tests.pipeline.track.sensors import Antenna, antenna, blocks_of, even_cut, random_cut

AZIMUTHS = 512
"""Rows a turn of most of these radars, so that a block a row is soon done."""

Cut = Callable[[int, int], Sequence[int]]

SCENE = [
    Target(line(500, 300, 10, 0), 12, 4, 0.9),
    Target(line(-2200, 120, 70, -1), 38, 30, 0.9),
    Target(line(400, -800, 0, 0), 38, 30, 0.9),
    Target(line(60, 1500, -8, 0), 6, 3, 0.9),
    Target(line(-3, 900, 1.5, -15), 6, 3, 0.9),
    Target(line(25, -12, 4, 3), 12, 4, 0.9),
    Target(line(-900, -900, 3, 3), 20, 18, 0.9, gone=9.0),
    Target(line(-700, 500, 6, -6), 8, 4, 0.9, born=6.0),
    Target(line(500, 330, 9, -2), 6, 3, 0.9),
    Target(line(-400, 800, 8, 2), 45, 6, 0.9, fragments=lambda scan: 1 + scan % 3),
    Target(line(0, 600, 7, 0), 30, 28, 0.9),
]
"""Near the radar, across north, side by side, in fragments, beginning and ending: whatever a block end can part."""

ONE = (antenna(azimuths=AZIMUTHS, false=6.0),)
TWO = (*ONE, antenna("two", 1200.0, -400.0, azimuths=AZIMUTHS, phase=0.43, false=6.0))
PERIODS = (
    antenna("half", azimuths=AZIMUTHS, period=0.5, phase=0.21, false=3.0),
    antenna("one", 1200.0, -400.0, azimuths=AZIMUTHS, phase=0.43, false=6.0),
    antenna("slow", -800.0, 600.0, azimuths=AZIMUTHS // 2, period=2.5, phase=0.37, false=6.0),
)
RADARS = {"one radar": ONE, "two radars": TWO, "three of three periods": PERIODS}
CUTS: dict[str, Cut] = {
    "2": even_cut(2), "7": even_cut(7), "32": even_cut(32), "a row": even_cut(4096), "random": random_cut(4),
}  # fmt: skip
SECONDS = 20.5
"""s after T0 up to which turns are delivered: all three of PERIODS are then closed to within 0.3 s of each other."""


Played = tuple[Tracks, dict[str, int]]


def played(antennas: Sequence[Antenna], cut: Cut, seconds: float = SECONDS, seed: int = 3) -> Played:
    """The tracks at a fixed time and the counters, after the same turns cut in such a way."""
    tracker = make_tracker(radars=[one.site for one in antennas])
    for sector in blocks_of(antennas, SCENE, -0.01, seconds, seed=seed, cut=cut):
        assert tracker.sector(sector)
    return tracker.tracks(T0 + seconds), dict(tracker.counters)


def check_same(whole: Played, other: Played) -> None:
    assert other[1] == whole[1]
    assert len(other[0]) == len(whole[0])
    for one in fields(Tracks):
        mine, theirs = np.asarray(getattr(whole[0], one.name)), np.asarray(getattr(other[0], one.name))
        assert mine.dtype == theirs.dtype
        assert mine.tobytes() == theirs.tobytes(), f"{one.name}: {mine} is not {theirs}"


@pytest.fixture(scope="module")
def whole() -> Callable[[str], Played]:
    known: dict[str, Played] = {}

    def of(name: str) -> Played:
        if name not in known:
            known[name] = played(RADARS[name], even_cut(1))
        return known[name]

    return of


@pytest.mark.parametrize("name", RADARS)
def test_the_scene_gives_tracks_that_can_differ(name: str, whole: Callable[[str], Played]) -> None:
    tracks, counters = whole(name)
    assert len(tracks) >= 8
    assert counters["confirmed"] >= 9


@pytest.mark.parametrize("cut", CUTS)
@pytest.mark.parametrize("name", RADARS)
def test_any_cut_of_the_turns_gives_the_same_bits(name: str, cut: str, whole: Callable[[str], Played]) -> None:
    check_same(whole(name), played(RADARS[name], CUTS[cut]))


def test_a_block_a_row_of_the_full_antenna_gives_the_same_bits() -> None:
    radars = (antenna(false=6.0),)
    check_same(*(played(radars, even_cut(blocks), seconds=6.2) for blocks in (1, 4096)))


@pytest.mark.parametrize("azimuths", [500, 509])
def test_so_it_does_where_the_marks_lie_between_rows(azimuths: int) -> None:
    radars = (antenna(azimuths=azimuths, false=6.0), antenna("two", 1200.0, -400.0, azimuths=azimuths, phase=0.3))
    check_same(*(played(radars, cut, seconds=12.4) for cut in (even_cut(1), even_cut(7))))
    check_same(*(played(radars, cut, seconds=12.4) for cut in (even_cut(1), random_cut(8))))


def test_radars_cut_in_different_ways_give_the_same_bits() -> None:
    """One comes as whole turns while the other comes row by row."""

    def mixed(first: Cut, second: Cut) -> Played:
        tracker = make_tracker(radars=[one.site for one in TWO])
        sectors = blocks_of(TWO, SCENE, -0.01, SECONDS, seed=3, cut=first)
        others = blocks_of(TWO, SCENE, -0.01, SECONDS, seed=3, cut=second)
        both = [one for one in sectors if one.radar == 0] + [one for one in others if one.radar == 1]
        for sector in sorted(both, key=lambda one: (one.time, one.radar)):
            assert tracker.sector(sector)
        return tracker.tracks(T0 + SECONDS), dict(tracker.counters)

    reference = mixed(even_cut(1), even_cut(1))
    check_same(reference, mixed(even_cut(1), even_cut(32)))
    check_same(reference, mixed(even_cut(4096), even_cut(1)))
    check_same(reference, mixed(random_cut(1), random_cut(2)))


def test_every_cut_tells_the_same_marks() -> None:
    """What the blocks of these tests say of marks is itself the same for every cut (where the table has marks)."""

    def told(cut: Cut) -> list[bytes]:
        columns = [marks(one.closed_from, one.closed_to) for one in blocks_of([Antenna(RADAR)], [], 0.0, 3.0, cut=cut)]
        return [np.concatenate([one[name] for one in columns]).tobytes() for name in (columns[0] or ())]

    for cut in CUTS.values():
        assert told(cut) == told(even_cut(1))
