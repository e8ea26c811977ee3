"""Refused video: told in the status while it goes on, logged once a minute, and nothing is told when all is well."""

import logging
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from app.runtime.refused_video import LOG_EVERY_S, WINDOW_S, RefusedVideo, refusal_in
from pipeline.assemble import Assembler
from pipeline.asterix.cat240 import VideoBatch, VideoMessage
from tests.pipeline.assemble.test_assemble import BLOCKS, CELL_FS, SITE, T0, stream


class Feed:
    """Messages into an assembler, and what is told of it at a time that the test says."""

    def __init__(self, **words: int) -> None:
        self.now = 100.0
        self.refused = RefusedVideo("smr", lambda: self.now)
        self.assembler = Assembler(SITE, 0, BLOCKS, **words)
        self.turn = 0

    def send(self, change: object = None, seconds: float = 1.0, octets: bytes = b"") -> str:
        """One turn of a second, each message as `change` makes it."""
        for one in stream(1, t0=T0 + self.turn, first=100 + 64 * self.turn):
            self.now += seconds / 64
            made = change(one) if callable(change) else one
            at = np.array([T0 + self.now - 100.0])
            self.assembler.push(VideoBatch.of([made]), at)
            if octets:
                ring = np.frombuffer(octets.ljust(64, b"\0"), np.uint8)[None]
                self.assembler.push_datagrams(ring, np.array([len(octets)], np.int32), at)
            self.refused.note(self.assembler.counters, self.assembler.refusals)
        self.turn += 1
        return self.refused.words()


def fewer(one: VideoMessage) -> VideoMessage:
    return replace(one, cells=one.cells[:12])


def finer(one: VideoMessage) -> VideoMessage:
    return replace(one, cell_duration_fs=CELL_FS // 2)


def test_nothing_is_told_of_a_feed_that_fits() -> None:
    feed = Feed()
    assert feed.send() == feed.send() == ""


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (fewer, "refused: cells 12, settings say 16"),
        (finer, "refused: cells of 1.5 m, settings say 3 m"),
        (lambda one: fewer(finer(one)), "refused: cells 12, settings say 16; cells of 1.5 m, settings say 3 m"),
    ],
)
def test_what_is_refused_is_told_until_it_ends(change: object, says: str) -> None:
    feed = Feed()
    assert feed.send(change) == says
    feed.now += WINDOW_S / 2
    assert feed.refused.words() == says
    feed.now += WINDOW_S
    assert feed.refused.words() == ""
    feed.send()  # closes the block that was short
    feed.now += WINDOW_S
    assert feed.send() == ""


def test_a_part_that_is_refused_is_told_as_a_part() -> None:
    feed = Feed()
    feed.send()
    mixed = feed.send(lambda one: finer(one) if one.start > 32768 else one)
    assert mixed == "refused in part: cells of 1.5 m, settings say 3 m"
    assert refusal_in(f"clock 1 s ahead; {mixed}") == mixed


def test_a_refusal_follows_a_feed_that_was_right() -> None:
    feed = Feed()
    feed.send()
    assert feed.send(fewer).startswith("refused in part: cells 12")
    for _ in range(int(WINDOW_S) + 1):
        said = feed.send(fewer)
    assert said == "refused: cells 12, settings say 16"


def test_another_source_than_the_wanted_is_told_only_where_nothing_is_taken() -> None:
    feed = Feed(sac=0, sic=1)
    assert feed.send(lambda one: replace(one, sic=7)) == "refused: SAC 0 SIC 7, settings say SAC 0 SIC 1"
    other = Feed(sac=0, sic=1)
    assert other.send(lambda one: replace(one, sic=7) if one.message % 2 else one) == ""


def test_of_several_sources_it_is_asked_which() -> None:
    feed = Feed()
    said = feed.send(lambda one: replace(one, sic=1 + one.message % 2))
    assert said == "video of SAC 0 SIC 1 and SAC 0 SIC 2 comes in, one of them is taken: set sac and sic"
    assert refusal_in(said) == ""


@pytest.mark.parametrize(
    ("octets", "says"), [(b"\x30\0\x05ab", "other categories"), (b"\xf0\0\x04\xff", "break the rules")]
)
def test_what_is_no_video_is_told(octets: bytes, says: str) -> None:
    feed = Feed(sac=0, sic=9)
    ring = np.frombuffer(octets.ljust(64, b"\0"), np.uint8)[None]
    feed.assembler.push_datagrams(ring, np.array([len(octets)], np.int32), np.array([T0]))
    feed.refused.note(feed.assembler.counters, feed.assembler.refusals)
    assert feed.refused.words().startswith("refused: ")
    assert says in feed.refused.words()


def test_the_log_tells_once_a_minute_and_counts(caplog: pytest.LogCaptureFixture) -> None:
    feed = Feed()
    with caplog.at_level(logging.WARNING):
        for _ in range(int(2.5 * LOG_EVERY_S)):
            feed.send(finer)
    told = [one.getMessage() for one in caplog.records]
    assert len(told) == 3
    assert all("refused: cells of 1.5 m, settings say 3 m" in one for one in told)
    counts = Counter(int(one.split()[2]) for one in told)
    assert sum(count * many for count, many in counts.items()) == pytest.approx(120 * 64, abs=130)
