"""Cells of another length: refused and named, or brought to the grid's."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.assemble import Assembler
from pipeline.asterix.cat240 import VideoBatch, VideoMessage
from pipeline.sites import RadarSite
from pipeline.tables import Sweeps, VideoFormat
from tests.pipeline.assemble.test_assemble import AZIMUTHS, BLOCKS, CELL_FS, arrivals, faults, stream

RANGES = 60
SITE = RadarSite("smr", 0, 0, 20, VideoFormat(azimuths=AZIMUTHS, ranges=RANGES, range_step_m=3.0))


def sent(scale: float, cells: int, first: int = 0, echo_m: float = 90.0) -> list[VideoMessage]:
    """Messages whose cells are `scale` times those of the grid, with one echo at `echo_m`."""
    made = []
    for one in stream(2):
        sweep = np.full(cells, 20, np.uint8)
        at = round(echo_m / (3.0 * scale)) - first
        if 0 <= at < cells:
            sweep[at] = 250
        made.append(replace(one, cell_duration_fs=round(CELL_FS * scale), cells=sweep, first_cell=first))
    return made


def put(messages: list[VideoMessage], resample: bool = True) -> tuple[list[Sweeps], Assembler]:
    assembler = Assembler(SITE, 0, BLOCKS, resample=resample)
    blocks = assembler.push(VideoBatch.of(messages), arrivals(messages)) + assembler.flush()
    return blocks, assembler


@pytest.mark.parametrize(("scale", "cells"), [(0.25, 240), (0.5, 120), (0.7, 90), (1.5, 40), (2.0, 30), (3.0, 20)])
def test_the_echo_stays_at_its_range(scale: float, cells: int) -> None:
    blocks, assembler = put(sent(scale, cells))
    assert faults(assembler.counters) == {}
    video = np.concatenate([b.amplitude for b in blocks])
    assert video.shape == (2 * AZIMUTHS, RANGES)
    assert (video == video[0]).all()
    found = np.flatnonzero(video[0] == 250)
    assert found.mean() * 3.0 == pytest.approx(90.0, abs=1.5 * max(scale, 1.0))
    assert len(found) == pytest.approx(max(scale, 1), abs=1)


def test_no_echo_of_finer_cells_is_lost() -> None:
    for echo in np.arange(3.0, 170.0, 0.75):
        blocks, _ = put(sent(0.25, 240, echo_m=echo)[:10])
        assert (blocks[0].amplitude == 250).sum() == len(blocks[0])


def test_what_reaches_less_far_leaves_the_rest_0_and_what_reaches_further_is_cut() -> None:
    blocks, assembler = put(sent(0.5, 60))
    assert faults(assembler.counters) == {}
    video = np.concatenate([b.amplitude for b in blocks])
    assert video.shape == (2 * AZIMUTHS, RANGES)
    assert (video[:, :30] >= 20).all()
    assert (video[:, 30:] == 0).all()
    blocks, assembler = put(sent(2.0, 60))
    assert faults(assembler.counters) == {}
    assert sum(map(len, blocks)) == 2 * AZIMUTHS


def test_two_ranges_in_turn_are_both_taken() -> None:
    own, other = sent(1.0, RANGES), sent(0.5, 60)
    mixed = [other[i] if i % 2 else own[i] for i in range(2 * AZIMUTHS)]
    blocks, assembler = put(mixed)
    assert faults(assembler.counters) == {}
    assert sum(map(len, blocks)) == 2 * AZIMUTHS
    blocks, assembler = put(mixed, resample=False)
    assert faults(assembler.counters) == {"wrong_geometry": AZIMUTHS}
    assert sum(map(len, blocks)) == AZIMUTHS
    assert dict(assembler.refusals.durations) == {round(CELL_FS / 2): AZIMUTHS}


@settings(deadline=None, max_examples=50)
@given(scale=st.floats(0.2, 4.0), cut=st.integers(1, 59))
def test_parts_make_the_same_as_the_whole(scale: float, cut: int) -> None:
    whole = sent(scale, 60)[:8]
    parts = []
    for i, one in enumerate(whole):
        for k, (low, high) in enumerate(((0, cut), (cut, 60))):
            parts.append(replace(one, message=2 * i + k, first_cell=low, cells=one.cells[low:high]))
    assembler = Assembler(SITE, 0, BLOCKS, resample=True)
    blocks = assembler.push(VideoBatch.of(parts), np.repeat(arrivals(whole), 2)) + assembler.flush()
    assert np.array_equal(
        np.concatenate([b.amplitude for b in blocks]), np.concatenate([b.amplitude for b in put(whole)[0]])
    )
