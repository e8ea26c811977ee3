"""The octet form of sweeps: comes back as it went, and every fault is refused by name."""

import struct
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.contract import Refused
from app.ingest.octets import OctetIntake, decode_sweeps, encode_sweeps
from pipeline.sites import RadarSite
from pipeline.tables import Sweeps, VideoFormat

SITE = RadarSite("smr", 0, 0, 20, VideoFormat(azimuths=32, ranges=10, first_range_m=15.0, range_step_m=3.0))


def block(rows: list[int], seed: int = 0, t0: float = 1.7e9) -> Sweeps:
    n = len(rows)
    cells = np.random.default_rng(seed).integers(0, 256, (n, 10), dtype=np.uint8)
    row = np.array(rows, np.int32)
    return Sweeps(3, 5, row, (row + 0.5) * 2 * np.pi / 32, t0 + np.arange(n) / 32, cells)


BODY = encode_sweeps(block([2, 3, 9, 31]), SITE)


@settings(deadline=None)
@given(st.sets(st.integers(0, 31), min_size=1), st.integers(1, 32))
def test_sweeps_come_back(rows: set[int], blocks_per_scan: int) -> None:
    sent = block(sorted(rows))
    blocks, counted = decode_sweeps(encode_sweeps(sent, SITE), SITE, 3, blocks_per_scan)
    assert counted == {"taken": len(rows)}
    for name in ("row", "azimuth", "time", "amplitude"):
        assert np.array_equal(np.concatenate([getattr(one, name) for one in blocks]), getattr(sent, name))
    assert {(one.radar, one.scan) for one in blocks} == {(3, 5)}
    assert [one.last for one in blocks] == [31 in one.row for one in blocks]
    assert all(len({int(r) * blocks_per_scan // 32 for r in one.row}) == 1 for one in blocks)


def put(at: int, form: str, value: float) -> bytes:
    octets = bytearray(BODY)
    struct.pack_into(form, octets, at, value)
    return bytes(octets)


ROW = 16 + 10


@pytest.mark.parametrize(
    ("body", "says"),
    [
        (b"", "header"),
        (BODY[:47], "header"),
        (b"JUNK" + BODY[4:], "ASWP"),
        (put(4, "<H", 2), "version 2"),
        (put(6, "<H", 0), "flags"),
        (put(6, "<H", 3), "flags"),
        (put(8, "<I", 0), "0 sweeps"),
        (put(8, "<I", 2**32 - 1), "sweeps"),
        (put(8, "<I", 5), "make"),
        (put(12, "<I", 11), "11 cells"),
        (put(12, "<I", 2**32 - 1), "cells"),
        (put(16, "<d", 0.0), "first range"),
        (put(16, "<d", float("nan")), "first range"),
        (put(24, "<d", 3.5), "step"),
        (put(24, "<d", float("inf")), "step"),
        (put(32, "<I", 64), "64 azimuths"),
        (BODY[:-1], "octets"),
        (BODY + b"\0", "octets"),
        (put(48 + 3 * ROW + 8, "<I", 32), "beyond"),
        (put(48 + ROW + 8, "<I", 2), "ascend"),
        (put(48 + ROW, "<d", float("nan")), "times"),
        (put(48 + ROW, "<d", float("inf")), "times"),
        (put(48 + ROW, "<d", -2e12), "times"),
    ],
)
def test_what_does_not_fit_is_refused(body: bytes, says: str) -> None:
    with pytest.raises(Refused, match=says):
        decode_sweeps(body, SITE, 3)


@settings(deadline=None, max_examples=300)
@given(st.binary(max_size=200), st.lists(st.tuples(st.integers(0, len(BODY) - 1), st.integers(0, 255)), max_size=5))
def test_any_octets_are_taken_or_refused(random: bytes, edits: list[tuple[int, int]]) -> None:
    octets = bytearray(BODY)
    for at, value in edits:
        octets[at] = value
    for body in (random, b"ASWP" + random, bytes(octets)):
        try:
            blocks, counted = decode_sweeps(body, SITE, 0)
        except Refused:
            continue
        assert sum(len(one) for one in blocks) == counted["taken"]


def test_another_radar_refuses_the_body() -> None:
    other = replace(SITE, video=replace(SITE.video, azimuths=64))
    with pytest.raises(Refused, match="radar smr has 10 and 64"):
        decode_sweeps(BODY, other, 0)


def test_turns_are_numbered_here_whatever_the_sender_counts() -> None:
    intake = OctetIntake(SITE, 3, 1)
    sent = [(5, [0, 1]), (5, [2, 31]), (6, [0]), (4_000_000_000, [7]), (0, [9]), (0, [9]), (1, [1])]
    scans = [intake.take(encode_sweeps(replace(block(rows), scan=scan), SITE))[0][0].scan for scan, rows in sent]
    assert scans == [0, 0, 1, 2, 3, 4, 5]
    with pytest.raises(Refused):
        intake.take(b"")
