"""CAT240: golden vectors, an independent codec as oracle, round trips, and octets that mean nothing."""

import gzip
import zlib
from collections import Counter
from collections.abc import Callable

import asterix.generated as oracle
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.asterix import cat240_batch as batch_module
from pipeline.asterix.cat240 import (
    MAX_DATAGRAM,
    DecodeError,
    SummaryMessage,
    VideoBatch,
    VideoMessage,
    decode,
    decode_batch,
    encode_message,
    encode_summary,
    encode_sweeps,
    read_datagram,
)

VIDEO = bytes.fromhex("f0002be7c800090200000001071c072d0000000002625a0000040008000008020102030405060708587840")
SUMMARY = bytes.fromhex("f0000cd000090104534d5231")
CELL_S = 2e-8


def one_video(datagram: bytes) -> VideoMessage:
    (message,) = decode(datagram)
    assert isinstance(message, VideoMessage)
    return message


def rows_of(datagrams: list[bytes]) -> tuple[np.ndarray, np.ndarray]:
    width = max(MAX_DATAGRAM, *(len(one) for one in datagrams))
    ring = np.zeros((len(datagrams), width), np.uint8)
    for row, one in zip(ring, datagrams, strict=True):
        row[: len(one)] = np.frombuffer(one, np.uint8)
    return ring, np.array([len(one) for one in datagrams], np.int32)


def test_the_golden_video_message() -> None:
    message = one_video(VIDEO)
    assert (message.sac, message.sic, message.message) == (0, 9, 1)
    assert (message.start, message.end) == (0x71C, 0x72D)
    assert message.start * 360 / 65536 == pytest.approx(10.0, abs=0.01)
    assert message.cell_duration_fs == 40_000_000
    assert message.time_of_day == 45296.5 * 128
    assert message.cells.tolist() == [1, 2, 3, 4, 5, 6, 7, 8]


def test_the_golden_summary_message() -> None:
    assert decode(SUMMARY) == [SummaryMessage(0, 9, "SMR1", None)]
    assert encode_summary("SMR1", sic=9) == SUMMARY


def test_encoding_gives_the_golden_video_message() -> None:
    azimuth = np.array([0x71C, 0x72D]) * (2 * np.pi / 65536)
    datagrams, lengths = encode_sweeps(
        np.arange(1, 9, dtype=np.uint8)[None], azimuth[:1], azimuth[1:], np.array([45296.5]), 1,
        sac=0, sic=9, cell_duration_s=4e-8,
    )  # fmt: skip
    assert datagrams[0, : lengths[0]].tobytes() == VIDEO


def test_a_golden_message_of_another_category_is_told_apart() -> None:
    with pytest.raises(DecodeError) as caught:
        decode(bytes.fromhex("0a0010f200140181085878400369fc97"))
    assert caught.value.reason == "wrong_category"


def parsed_by_oracle(datagram: bytes) -> object:
    raw = oracle.RawDatablock.parse(oracle.Bits.from_bytes(datagram))
    assert not isinstance(raw, ValueError)
    (block,) = raw if isinstance(raw, list) else [raw]
    result = oracle.Cat_240_1_3.cv_uap.parse(block.get_raw_records())
    assert not isinstance(result, ValueError), result
    (record,) = result
    return record


@pytest.mark.parametrize("ranges", [5, 1020, 1024, 1408])
def test_an_independent_codec_reads_what_is_encoded(ranges: int) -> None:
    amplitude = np.random.default_rng(ranges).integers(0, 256, (1, ranges), dtype=np.uint8)
    datagrams, lengths = encode_sweeps(
        amplitude, np.array([1.0]), np.array([1.0015]), np.array([86399.0]), 2**32 - 1,
        sac=3, sic=250, cell_duration_s=CELL_S, start_cell=7,
    )  # fmt: skip
    record = parsed_by_oracle(datagrams[0, : lengths[0]].tobytes())

    def raw(item: str) -> int:
        return int(record.get_item(item).as_uint())  # type: ignore[attr-defined]

    ours = one_video(datagrams[0, : lengths[0]].tobytes())
    assert raw("020") == ours.message == 2**32 - 1
    assert raw("010") == 3 << 8 | 250
    header = ours.start << 80 | ours.end << 64 | ours.first_cell << 32 | ours.cell_duration_fs
    assert raw("041") == header
    assert (ours.first_cell, ours.cell_duration_fs) == (7, 20_000_000)
    assert raw("048") == 4
    assert raw("049") == ranges << 24 | ranges
    assert raw("140") == ours.time_of_day == 86399 * 128
    assert np.array_equal(ours.cells, amplitude[0])


@settings(deadline=None)
@given(
    bits=st.sampled_from([1, 2, 4, 8, 16, 32]), count=st.integers(1, 600), seed=st.integers(0, 9999),
    message=st.integers(0, 2**32 - 1), start=st.integers(0, 65535), end=st.integers(0, 65535), nano=st.booleans(),
    duration=st.integers(1, 2**32 - 1), first=st.integers(0, 2**32 - 1),
    time=st.none() | st.integers(0, 86401 * 128 - 1), sac=st.integers(0, 255), sic=st.integers(0, 255),
)  # fmt: skip
def test_any_message_comes_back(
    bits: int, count: int, seed: int, message: int, start: int, end: int, nano: bool, duration: int, first: int,
    time: int | None, sac: int, sic: int,
) -> None:  # fmt: skip
    values = np.random.default_rng(seed).integers(0, 2**bits, count, dtype=np.uint64)
    lines = "".join(format(int(value), f"0{bits}b") for value in values)
    octets = bytes(int(lines[i : i + 8].ljust(8, "0"), 2) for i in range(0, len(lines), 8))
    datagram = encode_message(
        octets, count, message=message, start=start, end=end, bits=bits, start_cell=first, cell_duration=duration,
        nano=nano, time=time, sac=sac, sic=sic,
    )  # fmt: skip
    back = one_video(datagram)
    assert (back.message, back.start, back.end, back.first_cell) == (message, start, end, first)
    assert back.cell_duration_fs == duration * (1_000_000 if nano else 1)
    assert (back.time_of_day, back.sac, back.sic, back.bits) == (time, sac, sic, bits)
    scale = 255 / (2**bits - 1) if bits < 8 else 1 / 2 ** (bits - 8)
    assert np.array_equal(back.cells, np.floor(values * scale).astype(np.uint8))


@pytest.mark.parametrize(
    ("octets", "count"), [(1020, 1020), (1021, 1021), (16320, 16320), (16321, 16321), (65024, 65024)]
)
def test_every_video_item_is_read(octets: int, count: int) -> None:
    cells = bytes(i % 251 for i in range(octets))
    assert one_video(encode_message(cells, count, message=1, start=0, end=1)).cells.tobytes() == cells


def test_a_long_sweep_becomes_messages_that_follow_each_other_in_range() -> None:
    amplitude = np.random.default_rng(1).integers(0, 256, (2, 3000), dtype=np.uint8)
    azimuth = np.array([0.5, 0.6])
    datagrams, lengths = encode_sweeps(
        amplitude, azimuth, azimuth + 0.1, np.array([1.0, np.nan]), 10, sac=0, sic=1, cell_duration_s=CELL_S,
        start_cell=100,
    )  # fmt: skip
    assert lengths.max() <= MAX_DATAGRAM
    messages = [one_video(row[:size].tobytes()) for row, size in zip(datagrams, lengths, strict=True)]
    assert [one.message for one in messages] == list(range(10, 16))
    for sweep in range(2):
        parts = messages[3 * sweep : 3 * sweep + 3]
        assert np.array_equal(np.concatenate([one.cells for one in parts]), amplitude[sweep])
        ends = np.cumsum([len(one.cells) for one in parts])
        assert [one.first_cell for one in parts] == [100, 100 + ends[0], 100 + ends[1]]
        assert {one.time_of_day for one in parts} == {128 if sweep == 0 else None}


def test_several_records_and_blocks_of_one_datagram_are_all_read() -> None:
    block = b"\xf0" + (3 + 2 * (len(VIDEO) - 3)).to_bytes(2, "big") + VIDEO[3:] * 2
    found = decode(block + SUMMARY + VIDEO)
    assert [type(one) for one in found] == [VideoMessage, VideoMessage, SummaryMessage, VideoMessage]


def test_reserved_and_special_items_are_skipped() -> None:
    record = bytearray(VIDEO[3:])
    record[1] |= 0x06
    datagram = b"\xf0" + (3 + len(record) + 7).to_bytes(2, "big") + bytes(record) + b"\x04abc\x03xy"
    assert one_video(datagram).cells.tolist() == [1, 2, 3, 4, 5, 6, 7, 8]


def changed(at: int, value: int) -> bytes:
    octets = bytearray(VIDEO)
    octets[at] = value
    return bytes(octets)


@pytest.mark.parametrize(
    ("datagram", "reason", "says"),
    [
        (b"", "malformed", "empty"),
        (VIDEO[:2], "malformed", "header"),
        (VIDEO[:-1], "malformed", "block of 43"),
        (b"\xf0\0\3", "malformed", "block"),
        (b"\xf0\0\4\xff", "malformed", "FSPEC"),
        (changed(7, 3), "malformed", "type 3"),
        (changed(24, 0x80), "compressed", "compressed"),
        (changed(25, 0), "malformed", "RES 0"),
        (changed(25, 7), "malformed", "RES 7"),
        (changed(25, 5), "malformed", "16 bits"),
        (changed(27, 9), "malformed", "9 octets"),
        (changed(30, 9), "malformed", "9 cells"),
        (changed(28, 255), "malformed", "cells"),
        (changed(31, 200), "malformed", "cut off"),
        (changed(40, 0xFF), "malformed", "a day"),
        (changed(3, 0xEF), "malformed", "I240|cells|type|cut|FRN"),
        (changed(4, 0x88), "malformed", "one of I240/050"),
    ],
)
def test_what_is_wrong_is_said(datagram: bytes, reason: str, says: str) -> None:
    with pytest.raises(DecodeError, match=says) as caught:
        decode(datagram)
    assert caught.value.reason == reason


CAT034 = b"\x22\0\x07\xc0\x01\x01\x02"


@pytest.mark.parametrize("before", [b"", CAT034, CAT034 * 2])
@pytest.mark.parametrize(
    ("behind", "reasons"),
    [
        (b"", []),
        (CAT034, ["wrong_category"]),
        (b"\0", ["trailing"]),
        (bytes(5), ["trailing"]),
        (b"\xa5" * 4, ["trailing"]),
        (b"\xff" * 9, ["trailing"]),
        (b"\xf0\x12", ["trailing"]),
        (CAT034[:-1], ["trailing"]),
        (CAT034 + b"\0\0\0", ["wrong_category", "trailing"]),
        (VIDEO[:20], ["malformed"]),
    ],
)
def test_what_stands_around_a_block_is_counted_and_does_no_harm(
    before: bytes, behind: bytes, reasons: list[str]
) -> None:
    datagram = before + VIDEO + behind
    assert one_video(datagram).cells.tolist() == [1, 2, 3, 4, 5, 6, 7, 8]
    counters: dict[str, int] = {}
    ((batch, origin),) = decode_batch(*rows_of([datagram]), counters)
    assert cells_of(batch, 0).tolist() == [1, 2, 3, 4, 5, 6, 7, 8]
    assert np.arange(1)[origin].tolist() == [0]
    wanted = Counter(reasons) + Counter({"wrong_category": before.count(CAT034)})
    assert Counter(counters) == wanted


def test_a_block_that_cannot_be_read_does_not_harm_its_neighbours() -> None:
    bad = changed(7, 3)
    found, faults = read_datagram(VIDEO + bad + SUMMARY)
    assert [type(one) for one in found] == [VideoMessage, SummaryMessage]
    assert [fault.reason for fault in faults] == ["malformed"]
    two = b"\xf0" + (3 + 2 * (len(VIDEO) - 3)).to_bytes(2, "big")
    found, faults = read_datagram(two + bad[3:] + VIDEO[3:])
    assert ([type(one) for one in found], [fault.reason for fault in faults]) == ([VideoMessage], ["malformed"])


def test_octets_0_that_fill_up_a_block_are_counted_and_do_no_harm() -> None:
    filled = b"\xf0" + (len(VIDEO) + 5).to_bytes(2, "big") + VIDEO[3:] + bytes(5)
    found, faults = read_datagram(filled)
    assert ([type(one) for one in found], [fault.reason for fault in faults]) == ([VideoMessage], ["trailing"])


def packed(cells: bytes, how: Callable[[bytes], bytes], count: int = 0, bits: int = 8) -> bytes:
    return encode_message(how(cells), count or len(cells), message=1, start=0, end=16, bits=bits, compressed=True)


@pytest.mark.parametrize("how", [zlib.compress, gzip.compress])
@pytest.mark.parametrize("count", [1, 700, 20_000])
def test_video_compressed_by_zlib_or_gzip_is_read(how: Callable[[bytes], bytes], count: int) -> None:
    cells = np.random.default_rng(count).integers(0, 200, count, dtype=np.uint8)
    datagram = packed(cells.tobytes(), how)
    assert np.array_equal(one_video(datagram).cells, cells)
    counters: dict[str, int] = {}
    ((batch, _),) = decode_batch(*rows_of([datagram]), counters)
    assert np.array_equal(cells_of(batch, 0), cells)
    assert counters == {}


def test_compressed_cells_of_few_bits_are_stretched() -> None:
    assert one_video(packed(b"\x0f\x80", zlib.compress, count=3, bits=4)).cells.tolist() == [0, 255, 136]


def test_compressed_video_that_does_not_fit_is_refused() -> None:
    for datagram, reason in [
        (packed(bytes(16), lambda cells: cells), "compressed"),
        (packed(bytes(16), lambda cells: zlib.compress(cells)[:-9]), "malformed"),
        (packed(bytes(16), zlib.compress, count=17), "malformed"),
    ]:
        with pytest.raises(DecodeError) as caught:
            decode(datagram)
        assert caught.value.reason == reason
    # a few octets that claim gigabytes make no more than the cells they are for
    bomb = one_video(packed(bytes(1 << 24), zlib.compress, count=40))
    assert bomb.cells.tolist() == [0] * 40


def mutations() -> st.SearchStrategy[bytes]:
    def apply(seed: tuple[bytes, list[tuple[int, int]], int]) -> bytes:
        octets = bytearray(seed[0])
        for at, value in seed[1]:
            octets[at % len(octets)] = value
        return bytes(octets[: len(octets) - seed[2]] if seed[2] else octets)

    whole = st.sampled_from([
        VIDEO, SUMMARY, VIDEO + SUMMARY, encode_message(bytes(65), 65, message=1, start=0, end=9), VIDEO + CAT034,
        CAT034 + VIDEO, VIDEO + bytes(4), packed(bytes(40), zlib.compress), VIDEO + b"\xf0\0\x03" + VIDEO,
    ])  # fmt: skip
    edits = st.lists(st.tuples(st.integers(0, 200), st.integers(0, 255)), max_size=6)
    return st.tuples(whole, edits, st.integers(0, 11)).map(apply)


@settings(max_examples=150, deadline=None)
@given(st.binary(max_size=100) | mutations())
def test_any_octets_are_read_or_refused(datagram: bytes) -> None:
    try:
        found = decode(datagram)
    except DecodeError:
        return
    assert found


@settings(max_examples=150, deadline=None)
@given(st.lists(st.binary(max_size=100) | mutations(), min_size=1, max_size=6))
def test_the_batch_decoder_reads_the_same_as_the_clear_one(datagrams: list[bytes]) -> None:
    wanted: list[tuple[int, VideoMessage]] = []
    reasons: dict[str, int] = {}
    for i, datagram in enumerate(datagrams):
        found, faults = read_datagram(datagram)
        for fault in faults:
            reasons[fault.reason] = reasons.get(fault.reason, 0) + 1
        for one in found:
            if isinstance(one, SummaryMessage):
                reasons["summary"] = reasons.get("summary", 0) + 1
            else:
                wanted.append((i, one))
    counters: dict[str, int] = {}
    ring, lengths = rows_of(datagrams)
    batches = decode_batch(ring, lengths, counters)
    assert counters == reasons
    origins = [int(i) for _, origin in batches for i in np.arange(len(datagrams))[origin]]
    assert origins == [i for i, _ in wanted]
    expected = VideoBatch.of(one for _, one in wanted)
    fields = np.concatenate([batch.fields for batch, _ in batches] or [np.zeros((0, 10), np.int64)])
    assert np.array_equal(fields[:, : batch_module.ROW], expected.fields[:, : batch_module.ROW])
    cells = [cells_of(batch, i) for batch, _ in batches for i in range(len(batch))]
    assert all(np.array_equal(a, one.cells) for a, (_, one) in zip(cells, wanted, strict=True))


def cells_of(batch: VideoBatch, i: int) -> np.ndarray:
    row, offset, count = (int(batch.fields[i, k]) for k in (batch_module.ROW, batch_module.OFFSET, batch_module.CELLS))
    return batch.octets[row, offset : offset + count]


def test_the_common_case_takes_the_fast_way(monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: object) -> object:
        raise AssertionError("the slow decoder was asked")

    monkeypatch.setattr(batch_module, "_slowly", never)
    padded = VIDEO + bytes(21)
    ring, lengths = rows_of([VIDEO, encode_message(bytes(1024), 1024, message=2, start=0, end=16, nano=True), padded])
    counters: dict[str, int] = {}
    ((batch, _),) = decode_batch(ring, lengths, counters)
    assert batch.fields[:, batch_module.MESSAGE].tolist() == [1, 2, 1]
    assert counters == {"trailing": 1}


@pytest.mark.parametrize("duration", [0.0, 1.0])
def test_cells_that_cannot_be_sent_are_refused(duration: float) -> None:
    one = np.zeros(1)
    with pytest.raises(ValueError, match="fs"):
        encode_sweeps(np.zeros((1, 8), np.uint8), one, one, one, 1, sac=0, sic=0, cell_duration_s=duration)
