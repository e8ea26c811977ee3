"""End azimuths that say nothing: rows and widths come from the spacing of successive starts."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.assemble import Assembler
from pipeline.asterix.cat240 import VideoBatch, VideoMessage
from pipeline.asterix.cat240_batch import END, MESSAGE, ROW, START, TIME
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

ENDS: dict[str, Callable[[VideoMessage, int], int]] = {
    "the next start": lambda one, width: one.start + width,
    "the last count": lambda one, width: one.start + width - 1,
    "the width of the beam": lambda one, width: one.start + 1741,
    "many widths": lambda one, width: one.start + 6 * width,
    "the start": lambda one, width: one.start,
    "nothing": lambda one, width: 0,
    "full scale": lambda one, width: 65535,
    "half a turn": lambda one, width: one.start + 32768,
    "the start less a beam": lambda one, width: one.start - 700,
}


def ending(how: str, turns: float = 2, width: int = WIDTH) -> list[VideoMessage]:
    return [replace(one, end=ENDS[how](one, width) % 65536) for one in stream(turns, width=width)]


@pytest.mark.parametrize("how", ENDS)
def test_every_row_is_filled_by_its_own_message_whatever_the_end(how: str) -> None:
    blocks, counters = assembled(ending(how))
    assert faults(counters) == {}
    assert rows(blocks).tolist() == [[i, i + 1] for i in range(2 * AZIMUTHS)]
    azimuths = np.concatenate([b.azimuth for b in blocks])
    assert np.allclose(
        azimuths % (2 * np.pi), (np.arange(2 * AZIMUTHS) % AZIMUTHS + 0.5) * 2 * np.pi / AZIMUTHS, atol=1e-3
    )


@pytest.mark.parametrize("how", ENDS)
@pytest.mark.parametrize("azimuths", [512, 2048, 3600, 4096, 8192])
def test_a_radar_of_as_many_azimuths_as_the_grid_fills_it(how: str, azimuths: int) -> None:
    site = RadarSite("smr", 0, 0, 20, VideoFormat(azimuths=azimuths, ranges=RANGES, range_step_m=3.0))
    count = azimuths + 40
    turned = np.arange(count)
    start = np.round(turned * 65536 / azimuths).astype(int)
    one = stream(1)[0]
    end = [ENDS[how](replace(one, start=int(at)), 65536 // azimuths) for at in start]
    fields = np.repeat(VideoBatch.of([one]).fields, count, axis=0)
    fields[:, MESSAGE], fields[:, START], fields[:, END], fields[:, ROW] = turned, start % 65536, end, turned
    fields[:, END] %= 65536
    fields[:, TIME] = (40_000 + turned / azimuths) * 128
    octets = np.repeat((turned % 251 + 1).astype(np.uint8)[:, None], RANGES, axis=1)
    assembler = Assembler(site, 0, BLOCKS)
    blocks = assembler.push(VideoBatch(fields, octets), T0 + turned / azimuths) + assembler.flush()
    absolute = np.concatenate([b.scan * azimuths + b.row.astype(int) for b in blocks])
    values = np.concatenate([b.amplitude[:, 0] for b in blocks])
    assert absolute.tolist() == turned.tolist()
    assert values.tolist() == octets[:, 0].tolist()
    assert faults(assembler.counters) == {}


@pytest.mark.parametrize("how", [one for one in ENDS if one != "the next start"])
def test_a_coarser_radar_fills_the_rows_up_to_its_next_start(how: str) -> None:
    messages = ending(how, width=2 * WIDTH)
    blocks, counters = assembled(messages, arrivals(messages, width=2 * WIDTH))
    assert faults(counters) == {}
    assert rows(blocks).tolist() == [[i, i // 2 + 1] for i in range(2 * AZIMUTHS)]


@pytest.mark.parametrize("how", ENDS)
def test_losses_leave_only_their_own_rows_out(how: str) -> None:
    gone = {0, 7, 40, 41, 90}
    kept = [one for i, one in enumerate(ending(how)) if i not in gone]
    blocks, counters = assembled(kept)
    assert faults(counters) == {"lost": 4}  # of the first nothing can be known
    assert rows(blocks)[:, 0].tolist() == [i for i in range(2 * AZIMUTHS) if i not in gone]


def test_a_sector_that_is_not_sent_changes_no_width() -> None:
    for how in ENDS:
        kept = [replace(one, message=i) for i, one in enumerate(o for o in ending(how, 4) if not 3000 < o.start < 9000)]
        arrival = np.array([20_000 * 86400.0 + (one.time_of_day or 0) / 128 for one in kept])
        blocks, counters = assembled(kept, arrival)
        assert faults(counters) == {}
        assert set(rows(blocks)[:, 0] % AZIMUTHS) == {i for i in range(AZIMUTHS) if not 3000 < i * WIDTH < 9000}


def test_ends_that_go_wrong_in_the_middle_cost_little() -> None:
    messages = stream(2) + ending("nothing", 6)[2 * AZIMUTHS :]
    blocks, counters = assembled(messages)
    assert counters["wrong_azimuth"] <= 16
    assert len(rows(blocks)) >= 6 * AZIMUTHS - 16


@settings(deadline=None)
@given(how=st.sampled_from(sorted(ENDS)), cuts=st.lists(st.integers(0, 130), max_size=5), width=st.integers(300, 3000))
def test_cuts_change_nothing(how: str, cuts: list[int], width: int) -> None:
    messages = ending(how, width=width)
    arrival = arrivals(messages, width=width)
    whole, whole_counts = assembled(messages, arrival)
    cut, cut_counts = assembled(messages, arrival, cuts=[min(one, len(messages)) for one in cuts])
    assert same(whole, cut)
    assert whole_counts == cut_counts


def test_an_antenna_that_stands_is_not_waited_for_for_ever() -> None:
    one = ending("many widths")[0]
    messages = [replace(one, message=i, time_of_day=None) for i in range(100)]
    blocks, counters = assembled(messages, np.arange(100.0) / 64, cuts=list(range(100)))
    assert counters["taken"] + counters["merged"] > 0
    assert SITE.video.azimuths == AZIMUTHS
    assert len(blocks) >= 1
