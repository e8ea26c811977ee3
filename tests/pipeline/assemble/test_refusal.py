"""What is refused is told in words that say what to set."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.assemble import Assembler
from pipeline.assemble.refusal import MOST_KINDS
from pipeline.asterix.cat240 import VideoBatch, VideoMessage
from pipeline.sites import RadarSite
from pipeline.tables import VideoFormat
from tests.pipeline.assemble.test_assemble import AZIMUTHS, BLOCKS, CELL_FS, arrivals, stream

SITE = RadarSite("smr", 0, 0, 20, VideoFormat(azimuths=AZIMUTHS, ranges=1024, range_step_m=3.0))


def sent(cells: int, scale: float = 1.0, first: int = 0) -> list[VideoMessage]:
    return [
        replace(one, cells=np.zeros(cells, np.uint8), cell_duration_fs=round(CELL_FS * scale), first_cell=first)
        for one in stream(1)
    ]


def told(messages: list[VideoMessage], site: RadarSite = SITE, **words: int) -> str:
    assembler = Assembler(site, 0, BLOCKS, **words)
    assert assembler.push(VideoBatch.of(messages), arrivals(messages)) + assembler.flush() == []
    return assembler.refusals.words()


@pytest.mark.parametrize(
    ("messages", "says"),
    [
        (sent(900), "cells 900, settings say 1024"),
        (sent(1100), "cells 1100, settings say 1024"),
        (sent(900, 1.5), "cells 900, settings say 1024; cells of 4.5 m, settings say 3 m"),
        (sent(1024, 0.5), "cells of 1.5 m, settings say 3 m"),
        (sent(1024, first=10), "first cell 10, settings say 0"),
    ],
)
def test_what_does_not_fit_is_told_with_what_would(messages: list[VideoMessage], says: str) -> None:
    assert told(messages) == says


def test_parts_of_a_sweep_count_together() -> None:
    parts = []
    for i, one in enumerate(sent(900)):
        for k in range(2):
            cells = one.cells[:450]
            parts.append(replace(one, message=2 * i + k, first_cell=450 * k, cells=cells, cell_duration_fs=CELL_FS * 2))
    assembler = Assembler(SITE, 0, BLOCKS)
    assembler.push(VideoBatch.of(parts), np.repeat(arrivals(stream(1)), 2))
    assert assembler.refusals.words() == "cells 900, settings say 1024; cells of 6 m, settings say 3 m"


def test_a_first_range_of_the_grid_is_taken_into_account() -> None:
    site = replace(SITE, video=replace(SITE.video, first_range_m=30.0))
    assert told(sent(1024), site) == "first cell 0, settings say 10"
    assert told(sent(900, first=10), site) == "cells 900, settings say 1024"


def test_another_source_is_told_with_the_wanted_one() -> None:
    assert told(sent(1024), sac=5, sic=7) == "SAC 0 SIC 1, settings say SAC 5 SIC 7"
    assert told(sent(1024), sic=7) == "SAC 0 SIC 1, settings say SIC 7"
    assert told(sent(1024), sac=0, sic=0) == "SAC 0 SIC 1, settings say SAC 0 SIC 0"


def test_nothing_is_told_where_everything_fits_or_is_lost() -> None:
    assembler = Assembler(SITE, 0, BLOCKS)
    messages = sent(1024)
    del messages[10:20]
    assembler.push(VideoBatch.of(messages), arrivals(messages))
    assert (assembler.refusals.words(), assembler.refusals.several()) == ("", "")


def test_any_number_of_sources_takes_no_more_room() -> None:
    assembler = Assembler(SITE, 0, BLOCKS)
    messages = [replace(one, sic=i, cell_duration_fs=CELL_FS * (i + 2)) for i, one in enumerate(sent(10))]
    assembler.push(VideoBatch.of(messages), arrivals(messages))
    assert len(assembler.refusals.sources) == MOST_KINDS
    assert len(assembler.refusals.durations) <= MOST_KINDS
