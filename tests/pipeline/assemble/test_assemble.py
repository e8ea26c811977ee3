"""The assembler: loss, repeats, disorder, midnight and restarts are counted and never make a wrong picture."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.assemble import Assembler
from pipeline.asterix.cat240 import VideoBatch, VideoMessage, encode_message, encode_sweeps
from pipeline.sites import RadarSite
from pipeline.tables import Sweeps, VideoFormat

AZIMUTHS, RANGES, BLOCKS = 64, 16, 8
WIDTH = 65536 // AZIMUTHS
SITE = RadarSite("smr", 0, 0, 20, VideoFormat(azimuths=AZIMUTHS, ranges=RANGES, range_step_m=3.0))
CELL_FS = round(2e15 * 3.0 / 299_792_458)
DAY = 86400.0
T0 = 20_000 * DAY + 40_000.0


def stream(
    turns: float = 2, *, t0: float = T0, first: int = 100, at: int = 0, width: int = WIDTH
) -> list[VideoMessage]:
    """Messages of a turning antenna; cells tell which message they are from."""
    many = []
    for i in range(round(turns * 65536 / width)):
        start = (at + i) * width
        seconds = t0 + i * width / 65536
        many.append(
            VideoMessage(
                0,
                1,
                (first + i) % 2**32,
                start % 65536,
                (start + width) % 65536,
                0,
                CELL_FS,
                8,
                round(seconds % DAY * 128) % (86400 * 128),
                np.full(RANGES, (i % 255) + 1, np.uint8),
            )
        )
    return many


def arrivals(messages: list[VideoMessage], t0: float = T0, first: int = 100, width: int = WIDTH) -> np.ndarray:
    return np.array([t0 + ((one.message - first) % 2**32) * width / 65536 + 0.01 for one in messages])


def assembled(
    messages: list[VideoMessage], arrival: np.ndarray | None = None, *, site: RadarSite = SITE, cuts: list[int] = [],  # noqa: B006
    **words: int,
) -> tuple[list[Sweeps], dict[str, int]]:  # fmt: skip
    assembler = Assembler(site, 0, BLOCKS, **words)
    times = arrivals(messages) if arrival is None else arrival
    edges = [0, *sorted(cuts), len(messages)]
    blocks: list[Sweeps] = []
    for low, high in pairwise(edges):
        blocks += assembler.push(VideoBatch.of(messages[low:high]), times[low:high])
    return blocks + assembler.flush(), assembler.counters


def rows(blocks: list[Sweeps]) -> np.ndarray:
    """(absolute row, value of the first cell) of all sweeps."""
    return np.concatenate(
        [np.stack([b.scan * AZIMUTHS + b.row.astype(int), b.amplitude[:, 0].astype(int)], 1) for b in blocks]
    )


def faults(counters: dict[str, int]) -> dict[str, int]:
    return {name: count for name, count in counters.items() if count and name not in ("taken", "sweeps")}


def same(a: list[Sweeps], b: list[Sweeps]) -> bool:
    return len(a) == len(b) and all(
        (x.scan, x.last) == (y.scan, y.last) and all(
            np.array_equal(getattr(x, name), getattr(y, name)) for name in ("row", "azimuth", "time", "amplitude")
        ) for x, y in zip(a, b, strict=True)
    )  # fmt: skip


def test_a_clean_stream_fills_every_row() -> None:
    blocks, counters = assembled(stream(2))
    assert faults(counters) == {}
    assert rows(blocks).tolist() == [[i, i + 1] for i in range(2 * AZIMUTHS)]
    assert [len(b) for b in blocks] == [AZIMUTHS // BLOCKS] * 2 * BLOCKS
    assert [b.last for b in blocks] == ([False] * (BLOCKS - 1) + [True]) * 2
    first = blocks[0]
    assert np.allclose(first.azimuth, (first.row + 0.5) * 2 * np.pi / AZIMUTHS)
    times = np.concatenate([b.time for b in blocks])
    assert np.allclose(times, T0 + np.arange(2 * AZIMUTHS) / AZIMUTHS, atol=1 / 128)


def test_a_block_is_handed_on_with_its_last_row() -> None:
    assembler = Assembler(SITE, 0, BLOCKS)
    messages = stream(1)
    per_block = AZIMUTHS // BLOCKS
    assert assembler.push(VideoBatch.of(messages[: per_block - 1]), arrivals(messages)[: per_block - 1]) == []
    (block,) = assembler.push(VideoBatch.of(messages[per_block - 1 : per_block]), arrivals(messages)[7:8])
    assert len(block) == per_block


@settings(deadline=None)
@given(data=st.data(), seed=st.integers(0, 10_000))
def test_cutting_the_stream_anywhere_changes_nothing(data: st.DataObject, seed: int) -> None:
    rng = np.random.default_rng(seed)
    messages = stream(3)
    messages = [one for one in messages if rng.random() > 0.1]
    for _ in range(6):
        i, j = rng.integers(0, len(messages), 2)
        messages.insert(int(i), messages[int(j)])
    cuts = data.draw(st.lists(st.integers(0, len(messages)), max_size=8))
    whole, whole_counts = assembled(messages)
    cut, cut_counts = assembled(messages, cuts=cuts)
    assert same(whole, cut)
    assert whole_counts == cut_counts


@settings(deadline=None)
@given(lost=st.sets(st.integers(1, 2 * AZIMUTHS - 2), max_size=40))
def test_lost_messages_are_counted_and_leave_their_rows_out(lost: set[int]) -> None:
    messages = [one for i, one in enumerate(stream(2)) if i not in lost]
    blocks, counters = assembled(messages)
    assert faults(counters) == ({"lost": len(lost)} if lost else {})
    kept = [i for i in range(2 * AZIMUTHS) if i not in lost]
    assert rows(blocks).tolist() == [[i, i + 1] for i in kept]


@settings(deadline=None)
@given(again=st.lists(st.tuples(st.integers(0, 127), st.integers(0, 30)), max_size=20, unique_by=lambda pair: pair[0]))
def test_duplicates_are_counted_and_change_nothing(again: list[tuple[int, int]]) -> None:
    messages = stream(2)
    order = sorted([(i, 0, i) for i in range(len(messages))] + [(min(i + d, 127), 1, i) for i, d in again])
    blocks, counters = assembled([messages[i] for _, _, i in order])
    assert faults(counters) == ({"duplicate": len(again)} if again else {})
    assert same(blocks, assembled(messages)[0])


def test_a_message_overtaken_within_its_block_is_put_in_its_place() -> None:
    messages = stream(1)
    messages[3], messages[4] = messages[4], messages[3]
    blocks, counters = assembled(messages)
    assert faults(counters) == {"reordered": 1}
    assert rows(blocks).tolist() == [[i, i + 1] for i in range(AZIMUTHS)]


def test_a_message_after_its_block_is_counted_late() -> None:
    messages = stream(1)
    messages.insert(20, messages.pop(5))
    blocks, counters = assembled(messages)
    assert faults(counters) == {"late": 1}
    assert rows(blocks).tolist() == [[i, i + 1] for i in range(AZIMUTHS) if i != 5]


@pytest.mark.parametrize("offset", [-0.3, 0.0, 0.3])
@pytest.mark.parametrize("before", [0.2, 0.5, 1.3])
def test_midnight_passes_without_a_step(offset: float, before: float) -> None:
    # offset: how far the radar's clock and ours disagree; the day comes from ours
    t0 = 20_001 * DAY - before
    messages = stream(2, t0=t0)
    blocks, counters = assembled(messages, arrivals(messages, t0 + offset))
    assert faults(counters) == {}
    times = np.concatenate([b.time for b in blocks])
    assert np.allclose(times, t0 + np.arange(2 * AZIMUTHS) / AZIMUTHS, atol=1 / 128)


def test_north_offset_turns_the_rows() -> None:
    site = replace(SITE, north_offset=2 * np.pi * 5 / AZIMUTHS)
    blocks, counters = assembled(stream(1), site=site)
    assert faults(counters) == {}
    assert rows(blocks)[:, 0].tolist() == [i + 5 for i in range(AZIMUTHS)]
    assert [b.scan for b in blocks][-1] == 1
    for block in blocks:
        assert np.allclose(block.azimuth, (block.row + 0.5) * 2 * np.pi / AZIMUTHS)


@pytest.mark.parametrize("again", [0, 150, 2**31, 2**32 - 40])
@pytest.mark.parametrize("at", [3, 40])
def test_a_restarted_radar_goes_on(again: int, at: int) -> None:
    messages = stream(2) + stream(4, t0=T0 + 2 + at / AZIMUTHS, first=again, at=at)
    arrival = T0 + np.array([*range(128), *(128 + at + i for i in range(256))]) / AZIMUTHS + 0.01
    blocks, counters = assembled(messages, arrival)
    assert counters["restart"] <= 1
    lost = faults(counters)
    assert lost.keys() <= {"restart", "out_of_sequence", "late", "reordered", "lost", "duplicate"}
    found = rows(blocks)
    assert bool(np.all(np.diff(found[:, 0]) > 0))
    # from one turn after the restart on everything is there again
    end = found[:, 0].max()
    assert end % AZIMUTHS == (at - 1) % AZIMUTHS
    assert np.array_equal(found[-3 * AZIMUTHS :, 0], np.arange(end - 3 * AZIMUTHS + 1, end + 1))


def test_a_numbering_that_wraps_is_no_restart() -> None:
    messages = stream(2, first=2**32 - 50)
    blocks, counters = assembled(messages, arrivals(messages, first=2**32 - 50))
    assert faults(counters) == {}
    assert len(rows(blocks)) == 2 * AZIMUTHS


def test_a_stray_number_is_not_believed() -> None:
    messages = stream(2)
    messages[30] = replace(messages[30], message=2**31 + 77)
    blocks, counters = assembled(messages, arrivals(stream(2)))
    assert faults(counters) == {"out_of_sequence": 1, "lost": 1}
    assert len(rows(blocks)) == 2 * AZIMUTHS - 1


def test_cells_that_change_in_mid_scan_are_dropped_and_counted() -> None:
    fewer = [replace(one, cells=one.cells[:12]) if 20 <= i < 30 else one for i, one in enumerate(stream(1))]
    more = [replace(one, cells=np.zeros(17, np.uint8)) if 20 <= i < 30 else one for i, one in enumerate(stream(1))]
    for messages in (fewer, more):
        blocks, counters = assembled(messages)
        assert faults(counters) == {"wrong_cell_count": 10}
        assert rows(blocks)[:, 0].tolist() == [i for i in range(AZIMUTHS) if not 20 <= i < 30]


def test_cells_of_another_size_are_dropped_and_counted() -> None:
    messages = [replace(one, cell_duration_fs=2 * CELL_FS) if i >= 60 else one for i, one in enumerate(stream(1))]
    blocks, counters = assembled(messages)
    assert faults(counters) == {"wrong_geometry": 4}
    assert len(rows(blocks)) == 60


def test_a_sweep_in_parts_is_joined() -> None:
    rng = np.random.default_rng(3)
    site = replace(SITE, video=replace(SITE.video, ranges=3000, first_range_m=30.0))
    amplitude = rng.integers(0, 256, (AZIMUTHS, 3000), dtype=np.uint8)
    start = np.arange(AZIMUTHS) * 2 * np.pi / AZIMUTHS
    datagrams, lengths = encode_sweeps(
        amplitude, start, start + 2 * np.pi / AZIMUTHS, (T0 + np.arange(AZIMUTHS) / AZIMUTHS) % DAY, 7,
        sac=0, sic=1, cell_duration_s=CELL_FS * 1e-15, start_cell=10,
    )  # fmt: skip
    arrival = T0 + np.arange(len(lengths)) / len(lengths)
    assembler = Assembler(site, 0, BLOCKS)
    blocks = assembler.push_datagrams(datagrams, lengths, arrival)
    assert faults(assembler.counters) == {}
    assert np.array_equal(np.concatenate([b.amplitude for b in blocks]), amplitude)
    lossy = Assembler(site, 0, BLOCKS)
    keep = np.arange(len(lengths)) != 4
    blocks = lossy.push_datagrams(datagrams[keep], lengths[keep], arrival[keep])
    assert faults(lossy.counters) == {"lost": 1, "incomplete": 1}
    assert np.array_equal(np.concatenate([b.amplitude for b in blocks]), np.delete(amplitude, 1, 0))


def test_a_coarser_radar_fills_the_rows_it_covers() -> None:
    messages = stream(2, width=2 * WIDTH)
    blocks, counters = assembled(messages, arrivals(messages, width=2 * WIDTH))
    assert faults(counters) == {}
    assert rows(blocks).tolist() == [[i, i // 2 + 1] for i in range(2 * AZIMUTHS)]


def test_a_finer_radar_gives_the_greatest_cell() -> None:
    messages = stream(1, width=WIDTH // 2)
    blocks, counters = assembled(messages, arrivals(messages, width=WIDTH // 2))
    assert rows(blocks).tolist() == [[i, 2 * i + 2] for i in range(AZIMUTHS)]
    assert faults(counters) == {"merged": AZIMUTHS}


@settings(deadline=None)
@given(width=st.integers(600, 3000), offset=st.floats(-4, 4))
def test_any_tiling_of_the_turn_covers_every_row_once(width: int, offset: float) -> None:
    site = replace(SITE, north_offset=offset)
    count = 2 * 65536 // width
    messages = [
        replace(one, start=(i * width) % 65536, end=((i + 1) * width) % 65536)
        for i, one in enumerate(stream(2, width=width))
    ][:count]
    blocks, _ = assembled(messages, arrivals(messages, width=width), site=site)
    found = rows(blocks)[:, 0]
    assert bool(np.all(np.diff(found) == 1))
    assert len(found) >= (count - 1) * width * AZIMUTHS // 65536 - 1


def test_an_azimuth_that_jumps_back_is_dropped_and_counted() -> None:
    messages = stream(2)
    messages[50] = replace(messages[50], start=40 * WIDTH, end=41 * WIDTH)
    blocks, counters = assembled(messages)
    assert faults(counters) == {"azimuth_backwards": 1}
    assert rows(blocks)[:, 0].tolist() == [i for i in range(2 * AZIMUTHS) if i != 50]


def test_a_sweep_of_half_a_turn_is_not_believed() -> None:
    messages = stream(1)
    messages[9] = replace(messages[9], end=(messages[9].start + 32768) % 65536)
    assert faults(assembled(messages)[1]) == {"wrong_azimuth": 1}


@pytest.mark.parametrize(("step", "reason"), [(-5.0, "time_backwards"), (600.0, "time_jump")])
def test_a_time_that_steps_once_is_counted_on_by_the_rotation(step: float, reason: str) -> None:
    messages = stream(2)
    wrong = messages[50].time_of_day or 0
    messages[50] = replace(messages[50], time_of_day=round(wrong + step * 128))
    blocks, counters = assembled(messages)
    assert faults(counters) == {reason: 1}
    times = np.concatenate([b.time for b in blocks])
    assert bool(np.all(np.diff(times) >= 0))
    assert np.allclose(times, T0 + np.arange(2 * AZIMUTHS) / AZIMUTHS, atol=2 / 128)


@pytest.mark.parametrize(("step", "reason"), [(-5.0, "time_backwards"), (600.0, "time_jump"), (-1.0, "time_backwards")])
def test_a_clock_that_was_set_is_followed_without_loss(step: float, reason: str) -> None:
    messages = stream(2) + stream(3, t0=T0 + 2 + step, first=228)
    blocks, counters = assembled(messages)
    assert faults(counters) == {reason: 31, "clock_step": 1}
    assert rows(blocks)[:, 0].tolist() == list(range(5 * AZIMUTHS))
    assert blocks[-1].time[-1] == pytest.approx(T0 + 5 + step, abs=0.05)
    times = np.concatenate([b.time for b in blocks])
    assert int(np.count_nonzero(np.abs(np.diff(times)) > 0.5)) == 1, "one step, where it is believed"


def leap(shown: str) -> list[VideoMessage]:
    """Four turns of a second over a leap second at the end of their second, as radars show it."""
    midnight = 20_001 * DAY
    messages = stream(4, t0=midnight - 2)
    table: dict[str, Callable[[float], float]] = {
        "23:59:60": lambda t: t if t < 2 else t - 2 + DAY if t < 3 else t - 3,
        "23:59:59 twice": lambda t: t if t < 2 else t - 3 + DAY if t < 3 else t - 3,
        "0:00:00 twice": lambda t: t if t < 2 else t - 2 if t < 3 else t - 3,
    }
    counts = table[shown]
    made = []
    for i, one in enumerate(messages):
        t = i / AZIMUTHS
        seconds = DAY - 2 + t if t < 2 else counts(t)
        made.append(replace(one, time_of_day=round(seconds * 128) if seconds < DAY + 1 else None))
    return made


@pytest.mark.parametrize("shown", ["23:59:60", "23:59:59 twice", "0:00:00 twice"])
def test_a_leap_second_loses_nothing(shown: str) -> None:
    messages = leap(shown)
    blocks, counters = assembled(messages, arrivals(messages, 20_001 * DAY - 2))
    assert rows(blocks)[:, 0].tolist() == list(range(4 * AZIMUTHS))
    assert faults(counters) == {"time_backwards": 31, "clock_step": 1}
    times = np.concatenate([b.time for b in blocks])
    assert times[-1] == pytest.approx(20_001 * DAY + 1, abs=0.05)


def test_a_block_says_when_its_newest_sweep_arrived() -> None:
    messages = stream(2)
    arrival = arrivals(messages)
    blocks, _ = assembled(messages, arrival, cuts=[13, 50, 99])
    height = AZIMUTHS // BLOCKS
    assert [b.arrival for b in blocks] == arrival[height - 1 :: height].tolist()


def test_a_radar_without_time_gets_that_of_arrival() -> None:
    messages = [replace(one, time_of_day=None) for one in stream(1)]
    blocks, counters = assembled(messages)
    assert faults(counters) == {"no_time": AZIMUTHS}
    assert np.array_equal(np.concatenate([b.time for b in blocks]), arrivals(messages))


@pytest.mark.parametrize(("silence", "scans"), [(0.5, [0, 1]), (0.9, [0, 1, 2]), (30.3, [0, 1, 2])])
def test_after_a_silence_the_turn_is_found_again(silence: float, scans: list[int]) -> None:
    gone = round(silence * AZIMUTHS)
    half = AZIMUTHS // 2
    messages = stream(half / AZIMUTHS)
    messages += stream(1, t0=T0 + (half + gone) / AZIMUTHS, first=100 + half + gone, at=half + gone)
    blocks, counters = assembled(messages)
    assert faults(counters) == {"lost": gone}
    assert sorted({b.scan for b in blocks}) == scans
    assert len(rows(blocks)) == half + AZIMUTHS


def test_only_the_wanted_source_is_taken() -> None:
    messages = [replace(one, sic=2, message=7) if i % 3 == 0 else one for i, one in enumerate(stream(1))]
    blocks, counters = assembled(messages, arrivals(stream(1)), sac=0, sic=1)
    assert counters["wrong_source"] == 22
    assert counters["taken"] == 42
    assert {int(v) for v in rows(blocks)[:, 1]} == {i + 1 for i in range(AZIMUTHS) if i % 3}


def test_a_recording_played_in_a_loop_is_not_all_duplicates() -> None:
    messages = stream(2) * 4
    arrival = T0 + np.arange(len(messages)) / AZIMUTHS
    blocks, counters = assembled([replace(one, time_of_day=None) for one in messages], arrival)
    assert counters["duplicate"] <= 3 * 32
    assert len(rows(blocks)) >= 4 * 2 * AZIMUTHS - 3 * AZIMUTHS


def test_unreadable_datagrams_are_counted_by_reason() -> None:
    good = encode_message(bytes(16), 16, message=1, start=0, end=WIDTH, cell_duration=CELL_FS)
    compressed = bytearray(good)
    compressed[24] = 0x80
    datagrams = [good, b"\x0a" + good[1:], good[:-2], bytes(compressed)]
    ring = np.zeros((4, 64), np.uint8)
    for row, one in zip(ring, datagrams, strict=True):
        row[: len(one)] = np.frombuffer(one, np.uint8)
    assembler = Assembler(SITE, 0, BLOCKS)
    assembler.push_datagrams(ring, np.array([len(one) for one in datagrams], np.int32), np.full(4, T0))
    assert faults(assembler.counters) == {"malformed": 1, "wrong_category": 1, "compressed": 1, "no_time": 1}


def test_blocks_that_were_handed_on_do_not_change() -> None:
    assembler = Assembler(SITE, 0, BLOCKS)
    messages = stream(2)
    blocks = assembler.push(VideoBatch.of(messages), arrivals(messages))
    kept = [block.amplitude.copy() for block in blocks]
    more = stream(2, t0=T0 + 2, first=228)
    assembler.push(VideoBatch.of(more), arrivals(more))
    assert all(np.array_equal(block.amplitude, one) for block, one in zip(blocks, kept, strict=True))


@settings(deadline=None, max_examples=60)
@given(
    st.lists(
        st.tuples(
            st.integers(0, 2**32 - 1) | st.integers(100, 120), st.integers(0, 65535), st.integers(0, 65535),
            st.integers(0, 2**32 - 1) | st.just(0), st.integers(1, 20), st.none() | st.integers(0, 86400 * 128 - 1),
            st.floats(0, 4e9),
        ),
        max_size=40,
    )
)  # fmt: skip
def test_any_messages_give_well_formed_blocks(given: list[tuple[int, int, int, int, int, int | None, float]]) -> None:
    messages = [
        VideoMessage(0, 1, i, a, b, first, CELL_FS, 8, time, np.zeros(n, np.uint8))
        for i, a, b, first, n, time, _ in given
    ]
    blocks, counters = assembled(messages, np.array([one[-1] for one in given]))
    assert min(counters.values()) >= 0
    if blocks:
        assert bool(np.all(np.diff(rows(blocks)[:, 0]) > 0))
        assert bool(np.isfinite(np.concatenate([b.time for b in blocks])).all())
