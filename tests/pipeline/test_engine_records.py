"""The byte forms of a journal: sectors with their azimuth marks, and those recorded before there were any."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.engine_records import CODEC
from pipeline.inputs import Envelope
from pipeline.tables import SectorPlots
from pipeline.tables.plots import UNSTATED
from pipeline.values import first_difference
from tests.support.engines import minute
from tests.support.older_forms import with_32_marks, without_marks


def sector_envelopes() -> list[Envelope]:
    made = [one for one in minute(scans=2) if isinstance(one.body, SectorPlots)]
    assert any(len(one.body.plots) for one in made)
    assert all(len(one.body.mark) for one in made)
    return made


def test_the_marks_of_a_sector_come_back() -> None:
    for one in sector_envelopes():
        back = CODEC.decode(CODEC.encode(one))
        assert first_difference(one, back) is None
        assert back.body.mark.tobytes() == one.body.mark.tobytes()
        assert back.body.mark_time.tobytes() == one.body.mark_time.tobytes()


def test_a_sector_recorded_before_there_were_marks_is_read_without_any() -> None:
    for one in sector_envelopes():
        octets = without_marks(one)
        assert octets != CODEC.encode(one)
        back = CODEC.decode(octets)
        assert (len(back.body.mark), len(back.body.mark_time), back.body.marks_a_turn) == (0, 0, UNSTATED)
        none = replace(one.body, mark=np.empty(0, np.int64), mark_time=np.empty(0, np.float64))
        assert first_difference(replace(one, body=none), replace(back, body=back.body.with_present_marks())) is None


def test_a_sector_recorded_with_32_marks_a_turn_is_read_with_those_of_today() -> None:
    for one in sector_envelopes():
        back = CODEC.decode(with_32_marks(one))
        assert len(back.body.mark) == 2 * len(one.body.mark)
        assert first_difference(one, replace(back, body=back.body.with_present_marks())) is None
