"""The recipe at azimuth marks: what is looked at and decided there, whichever marks are decided together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np
import pytest

from pipeline.tables import SectorPlots, Tracks
from pipeline.track import step
from pipeline.track.core import Core
from pipeline.track.schedule import Marks
from pipeline.track.tracker import Tracker
from tests.pipeline.track.scene import Target, assert_same_store, line, make_tracker
from tests.pipeline.track.sensors import Antenna, antenna, blocks_of, even_cut

SCENE = [
    Target(line(500, 300, 10, 0), 12, 4, 0.9),
    Target(line(-2200, 120, 70, -1), 38, 30, 0.9),
    Target(line(400, -800, 0, 0), 38, 30, 0.9),
    Target(line(60, 1500, -8, 0), 6, 3, 0.9),
    Target(line(25, -12, 4, 3), 12, 4, 0.9),
    Target(line(-900, -900, 3, 3), 20, 18, 0.9, gone=9.0),
    Target(line(-700, 500, 6, -6), 8, 4, 0.9, born=6.0),
    Target(line(-400, 800, 8, 2), 45, 6, 0.9, fragments=lambda scan: 1 + scan % 3),
    Target(line(-3, 900, 1.5, -15), 6, 3, 0.9),
    *(Target(line(east, north, 0, 0), 20, 18) for east in (-12, 9) for north in (-1300, -500, 450, 1200)),
]
"""Near the radar, in fragments, beginning and ending, and about north and south, where batches of marks end."""

RADARS = {
    "one": (antenna(azimuths=512, false=6.0),),
    "two": (antenna(azimuths=512, false=6.0), antenna("two", 1200.0, -400.0, azimuths=512, phase=0.43, false=6.0)),
    "fast and slow": (
        antenna(azimuths=512, period=0.5, false=3.0),
        antenna("two", 1200.0, -400.0, azimuths=512, phase=0.43, period=2.5, false=6.0),
    ),
}


def unsteady(sectors: Sequence[SectorPlots]) -> list[SectorPlots]:
    """The antenna is up to 12 ms ahead of where an even turn would have it, or behind, so that it matters which mark
    gives the time of a look."""
    made = []
    for one in sectors:
        late = 0.012 * np.sin(one.mark * 1.7) if len(one.mark) else one.mark_time
        made.append(replace(one, time=one.time + 0.015, mark_time=one.mark_time + late))
    return made


def one_by_one(core: Core, marks: Marks) -> None:
    """The marks of a batch, each by itself."""
    for k in range(len(marks.number)):
        DECIDE(core, Marks(marks.radar, *(column[k : k + 1] for column in marks[1:5])))


DECIDE = step.decide


def fed(antennas: Sequence[Antenna], cut: int, missing: range = range(0)) -> Tracker:
    """missing: s after T0 in which the first radar delivers nothing."""
    tracker = make_tracker(radars=[one.site for one in antennas])
    for sector in unsteady(blocks_of(antennas, SCENE, -0.01, 16.5, seed=3, cut=even_cut(cut))):
        if sector.radar > 0 or int(sector.time - 1_700_000_000) not in missing:
            assert tracker.sector(sector)
    return tracker


def check_same(one: Tracker, other: Tracker) -> None:
    assert_same_store(one.save()["store"], other.save()["store"])
    assert one.counters == other.counters
    for column in fields(Tracks):
        mine, theirs = (np.asarray(getattr(each.tracks(), column.name)) for each in (one, other))
        assert mine.tobytes() == theirs.tobytes(), column.name


@pytest.mark.parametrize("missing", [range(0), range(6, 8), range(6, 11)])
@pytest.mark.parametrize("radars", RADARS)
def test_marks_decided_together_give_the_bits_of_one_after_the_other(
    radars: str, missing: range, monkeypatch: pytest.MonkeyPatch
) -> None:
    together = fed(RADARS[radars], 1, missing)
    sizes: list[int] = []

    def counted(core: Core, marks: Marks) -> None:
        sizes.append(len(marks.number))
        one_by_one(core, marks)

    monkeypatch.setattr(step, "decide", counted)
    alone = fed(RADARS[radars], 1, missing)
    assert max(sizes) >= {"one": 8, "two": 2, "fast and slow": 4}[radars]
    assert len(together.tracks()) >= 6
    check_same(together, alone)


@pytest.mark.parametrize("cut", [2, 7, 32, 512])
@pytest.mark.parametrize("radars", RADARS)
def test_so_does_any_cut_of_an_unsteady_turn(radars: str, cut: int) -> None:
    """Told by what is shown: what waits and what is saved is not the same where the last blocks are others."""
    one, other = (fed(RADARS[radars], each).tracks(1_700_000_000 + 16.5) for each in (1, cut))
    for column in fields(Tracks):
        mine, theirs = (np.asarray(getattr(each, column.name)) for each in (one, other))
        assert mine.tobytes() == theirs.tobytes(), column.name
