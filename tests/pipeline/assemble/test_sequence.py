"""Numbers that begin anew, duplicates, and several sources in one stream."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.assemble import Assembler
from pipeline.asterix.cat240 import VideoBatch, VideoMessage
from pipeline.sites import RadarSite
from pipeline.tables import VideoFormat
from tests.pipeline.assemble.test_assemble import (
    AZIMUTHS,
    BLOCKS,
    RANGES,
    SITE,
    T0,
    WIDTH,
    arrivals,
    assembled,
    faults,
    rows,
    same,
    stream,
)  # fmt: skip

DENSE = RadarSite("smr", 0, 0, 20, VideoFormat(azimuths=2048, ranges=RANGES, range_step_m=3.0))


def anew(messages: list[VideoMessage], every: int, timed: bool = True) -> list[VideoMessage]:
    """The same messages with numbers that begin anew after `every`."""
    made = [replace(one, message=(one.message - 100) % every) for one in messages]
    return made if timed else [replace(one, time_of_day=None) for one in made]


@pytest.mark.parametrize("timed", [True, False])
@pytest.mark.parametrize(("every", "at"), [(AZIMUTHS, 0), (AZIMUTHS, 10), (50, 0), (1, 0), (97, 5), (2**16, 0)])
def test_numbers_that_begin_anew_lose_nothing(every: int, at: int, timed: bool) -> None:
    plain = stream(4, at=at)
    blocks, counters = assembled(anew(plain, every, timed), arrivals(plain))
    assert faults(counters) == ({} if timed else {"no_time": 4 * AZIMUTHS})
    assert rows(blocks).tolist() == [[at + i, i % 255 + 1] for i in range(4 * AZIMUTHS)]


def test_numbers_of_a_dense_radar_that_begin_anew_lose_nothing() -> None:
    plain = stream(3, width=32)
    arrival = arrivals(plain, width=32)
    blocks, counters = assembled(anew(plain, 2048), arrival, site=DENSE)
    assert faults(counters) == {}
    assert sum(map(len, blocks)) == 3 * 2048


def test_a_loss_where_the_numbers_begin_anew_is_a_loss() -> None:
    plain = stream(3)
    gone = {AZIMUTHS - 1, AZIMUTHS, AZIMUTHS + 5}
    kept = [one for i, one in enumerate(anew(plain, AZIMUTHS)) if i not in gone]
    blocks, counters = assembled(kept, np.delete(arrivals(plain), list(gone)))
    assert rows(blocks)[:, 0].tolist() == [i for i in range(3 * AZIMUTHS) if i not in gone]
    assert counters["duplicate"] == counters["out_of_sequence"] == counters["restart"] == 0


@pytest.mark.parametrize(("every", "first"), [(AZIMUTHS, AZIMUTHS), (50, 100)])
def test_what_is_overtaken_where_the_numbers_begin_anew_is_late_and_no_loss(every: int, first: int) -> None:
    plain = stream(3)
    messages = anew(plain, every)
    messages[first - 1], messages[first], messages[first + 1] = (
        messages[first], messages[first + 1], messages[first - 1],
    )  # fmt: skip
    _, counters = assembled(messages, arrivals(plain))
    told = faults(counters)
    assert set(told) <= {"late", "reordered"}
    assert sum(told.values()) == 1


@pytest.mark.parametrize("timed", [True, False])
def test_duplicates_are_told_from_numbers_that_begin_anew(timed: bool) -> None:
    plain = stream(3)
    again = sorted([*range(3 * AZIMUTHS), 5, 70, 71, 130])
    messages = anew(plain, AZIMUTHS, timed)
    blocks, counters = assembled([messages[i] for i in again], arrivals(plain)[again])
    assert counters["duplicate"] == 4
    assert rows(blocks)[:, 0].tolist() == list(range(3 * AZIMUTHS))


def test_the_same_number_at_another_time_or_azimuth_is_no_duplicate() -> None:
    messages = [replace(one, message=7) for one in stream(2)]
    blocks, counters = assembled(messages, arrivals(stream(2)))
    assert faults(counters) == {}
    assert len(rows(blocks)) == 2 * AZIMUTHS


@settings(deadline=None)
@given(cuts=st.lists(st.integers(0, 3 * AZIMUTHS), max_size=6), every=st.integers(1, 200))
def test_cuts_change_nothing_where_numbers_begin_anew(cuts: list[int], every: int) -> None:
    plain = stream(3)
    messages, arrival = anew(plain, every), arrivals(plain)
    whole, whole_counts = assembled(messages, arrival)
    cut, cut_counts = assembled(messages, arrival, cuts=cuts)
    assert same(whole, cut)
    assert whole_counts == cut_counts


def two_sources() -> tuple[list[VideoMessage], np.ndarray]:
    first = stream(2)
    other = [replace(one, sic=2, cells=one.cells * 0) for one in stream(2, first=130, at=20)]
    messages = [one for pair in zip(first, other, strict=True) for one in pair]
    return messages, np.repeat(arrivals(first), 2)


def test_of_two_sources_the_first_is_taken_and_both_are_told() -> None:
    messages, arrival = two_sources()
    assembler = Assembler(SITE, 0, BLOCKS)
    blocks = assembler.push(VideoBatch.of(messages), arrival) + assembler.flush()
    assert faults(assembler.counters) == {"wrong_source": 2 * AZIMUTHS}
    assert rows(blocks).tolist() == [[i, i + 1] for i in range(2 * AZIMUTHS)]
    assert assembler.refusals.several() == "SAC 0 SIC 1 and SAC 0 SIC 2"
    assert dict(assembler.refusals.sources) == {1: 2 * AZIMUTHS, 2: 2 * AZIMUTHS}


@pytest.mark.parametrize("words", [{"sic": 1}, {"sac": 0, "sic": 1}])
def test_where_one_is_chosen_there_is_nothing_to_ask(words: dict[str, int]) -> None:
    messages, arrival = two_sources()
    assembler = Assembler(SITE, 0, BLOCKS, **words)
    assembler.push(VideoBatch.of(messages), arrival)
    assert assembler.refusals.several() == ""
    assert assembler.counters["wrong_source"] == 2 * AZIMUTHS


def test_the_source_whose_cells_fit_is_taken_though_another_was_first() -> None:
    messages, arrival = two_sources()
    messages = [replace(one, cell_duration_fs=9_999_999) if one.sic == 1 else one for one in messages]
    blocks, counters = assembled(messages, arrival)
    assert counters["sweeps"] == len(rows(blocks)) == 2 * AZIMUTHS
    assert rows(blocks)[:, 0].tolist() == [20 + i for i in range(2 * AZIMUTHS)]


def test_another_source_may_follow_one_that_fell_silent() -> None:
    later = [replace(one, sic=9) for one in stream(2, t0=T0 + 6, first=5000)]
    messages = stream(1) + later
    arrival = np.concatenate([arrivals(stream(1)), arrivals(later, T0 + 6, 5000)])
    blocks, counters = assembled(messages, arrival)
    assert counters["wrong_source"] == 0
    assert len(rows(blocks)) == 3 * AZIMUTHS
    early = [replace(one, sic=9) for one in stream(1, t0=T0 + 1.5, first=5000)]
    _, counters = assembled(stream(1) + early, np.concatenate([arrivals(stream(1)), arrivals(early, T0 + 1.5, 5000)]))
    assert counters["wrong_source"] == AZIMUTHS


def test_held_messages_are_those_that_came() -> None:
    """The ring may be overwritten while the first message waits for the second."""
    wide = [replace(one, end=(one.start + 3 * WIDTH // 2) % 65536) for one in stream(1)]
    assembler = Assembler(SITE, 0, BLOCKS)
    blocks = []
    ring = VideoBatch.of(wide[:1]).octets
    for one, arrival in zip(wide, arrivals(wide), strict=True):
        ring[0] = one.cells
        blocks += assembler.push(VideoBatch(VideoBatch.of([one]).fields, ring), np.array([arrival]))
    blocks += assembler.flush()
    assert rows(blocks).tolist() == [[i, i + 1] for i in range(AZIMUTHS)]
    assert all(a.row[-1] < b.row[0] for a, b in pairwise(blocks))
