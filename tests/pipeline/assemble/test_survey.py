"""What a stream says about its radars: azimuths, period, cells and sources, whatever the radar leaves unsaid."""

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.assemble.survey import survey
from pipeline.asterix.cat240_batch import CELLS, DURATION, END, FIELDS, FIRST_CELL, MESSAGE, SOURCE, START, TIME

T0 = 20_000 * 86400.0 + 40_000.0
FS = 20_013_846


def stream(
    azimuths: int = 2048, turns: float = 3.0, period: float = 1.0
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Fields and arrivals of a radar that says everything right."""
    count = round(azimuths * turns)
    fields = np.zeros((count, FIELDS), np.int64)
    turned = np.arange(count) / azimuths
    fields[:, MESSAGE] = np.arange(count)
    fields[:, START] = np.round(turned * 65536) % 65536
    fields[:, END] = np.round((turned + 1 / azimuths) * 65536) % 65536
    fields[:, DURATION], fields[:, CELLS], fields[:, SOURCE], fields[:, FIRST_CELL] = FS, 100, 0x0102, 5
    fields[:, TIME] = (40_000 + turned * period) * 128
    return fields, T0 + turned * period


@pytest.mark.parametrize("azimuths", [400, 2048, 2400, 3600, 4096, 8192])
@pytest.mark.parametrize("end", ["next", "beam", "start", "zero"])
def test_azimuths_come_from_the_starts(azimuths: int, end: str) -> None:
    fields, arrival = stream(azimuths, turns=1.2)
    if end != "next":
        fields[:, END] = {"beam": (fields[:, START] + 218) % 65536, "start": fields[:, START], "zero": 0}[end]
    (found,) = survey(fields, arrival)
    assert (found.azimuths, found.source, found.messages) == (azimuths, 0x0102, len(fields))
    assert (found.first_cell, found.ranges, found.durations) == (5, 100, ((FS, len(fields)),))


def test_losses_parts_and_sectors_that_are_not_sent_change_no_azimuth() -> None:
    fields, arrival = stream(3600)
    kept = np.random.default_rng(1).random(len(fields)) > 0.3
    assert survey(fields[kept], arrival[kept])[0].azimuths == 3600
    sector = (fields[:, START] < 20_000) | (fields[:, START] > 30_000)
    told = fields[sector]
    told[:, MESSAGE] = np.arange(len(told))
    assert survey(told, arrival[sector])[0].azimuths == 3600
    parts = np.repeat(fields, 3, axis=0)
    parts[:, MESSAGE] = np.arange(len(parts))
    parts[:, FIRST_CELL] += np.tile([0, 100, 200], len(fields))
    found = survey(parts, np.repeat(arrival, 3))[0]
    assert (found.azimuths, found.first_cell, found.ranges) == (3600, 5, 300)


def test_staggered_azimuths_count_by_their_mean() -> None:
    fields, arrival = stream(4096)
    fields[1::2, START] += 6
    assert survey(fields, arrival)[0].azimuths == 4096


def test_numbers_that_begin_anew_or_stand_still_change_nothing() -> None:
    fields, arrival = stream(512)
    for numbers in (fields[:, MESSAGE] % 512, np.zeros(len(fields), np.int64)):
        fields[:, MESSAGE] = numbers
        assert survey(fields, arrival)[0].azimuths == 512


def test_one_azimuth_is_told_by_its_end_or_not_at_all() -> None:
    fields, arrival = stream()
    assert survey(fields[:1], arrival[:1])[0].azimuths == 2048
    fields[:, END] = 0
    assert survey(fields[:1], arrival[:1])[0].azimuths == 0


@pytest.mark.parametrize("period", [0.5, 1.0, 2.85])
@pytest.mark.parametrize("turns", [0.7, 1.5, 5.0])
def test_the_period_comes_from_the_time_of_day(period: float, turns: float) -> None:
    fields, arrival = stream(turns=turns, period=period)
    assert survey(fields, arrival * 0)[0].period_s == pytest.approx(period, rel=0.02)
    fields[:, TIME] = -1
    assert survey(fields, arrival)[0].period_s == pytest.approx(period, rel=1e-3)


@pytest.mark.parametrize("step", [-1.0, 1.0, -86400.0, 3600.0])
def test_a_clock_that_steps_does_not_change_the_period(step: float) -> None:
    fields, arrival = stream()
    fields[3000:, TIME] += round(step * 128)
    assert survey(fields, arrival)[0].period_s == pytest.approx(1.0, rel=0.01)


def test_less_than_half_a_turn_has_no_period() -> None:
    assert np.isnan(survey(*stream(turns=0.4))[0].period_s)


def test_the_most_frequent_cell_duration_counts_and_all_are_named() -> None:
    fields, arrival = stream()
    fields[2000:, DURATION], fields[2000:, CELLS] = 2 * FS, 60
    (found,) = survey(fields, arrival)
    assert found.durations == ((2 * FS, len(fields) - 2000), (FS, 2000))
    assert (found.first_cell, found.ranges) == (5, 60)
    fields[: len(fields) // 2, DURATION] = FS
    fields[len(fields) // 2 :, DURATION] = 2 * FS
    assert survey(fields, arrival)[0].durations[0][0] in (FS, 2 * FS), "never one that no message has"


def test_sources_are_told_apart() -> None:
    fields, arrival = stream(512)
    other = fields.copy()
    other[:, START] = (other[:, START] + 25_600) % 65536
    other[:, SOURCE], other[:, CELLS] = 0x0103, 40
    both = np.stack([fields, other], 1).reshape(-1, FIELDS)[:-100]
    found = survey(both, np.repeat(arrival, 2)[:-100])
    assert [(one.source, one.azimuths, one.ranges) for one in found] == [(0x0102, 512, 100), (0x0103, 512, 40)]
    assert [one.period_s for one in found] == pytest.approx([1.0, 1.0], rel=0.01)
