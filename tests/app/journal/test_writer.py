"""Writing: files that begin with a snapshot, bounds, gaps, a disk that fails."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from app.journal import output as output_module
from app.journal.names import journal_files, parsed
from app.journal.output import nanoseconds, seconds
from app.journal.reader import JournalFile, open_journal
from app.journal.writer import JournalLimits, JournalWriter
from app.settings import JournalSettings
from pipeline.values import ValueCodec
from tests.app.journal.writing import ATTACHMENTS, LIMITS, NOISE, START, Hand, body, put, put_written, until


@pytest.fixture
def clock() -> Hand:
    return Hand()


def test_records_come_back_as_they_were_put(tmp_path: Path) -> None:
    writer = JournalWriter(tmp_path / "new" / "journal", ATTACHMENTS, LIMITS)
    for number in range(40):
        put(writer, "snapshot" if number % 20 == 0 else "event", number)
    assert writer.close()
    read = list(open_journal(tmp_path / "new" / "journal").records())
    assert [(one.topic, one.sequence, one.time, one.data) for one in read] == [
        (topic, number, START + number, body(topic, number))
        for number in range(40)
        for topic in ["snapshot" if number % 20 == 0 else "event"]
    ]
    state = writer.state()
    assert (state.status, state.counters.records, state.counters.snapshots, state.counters.files) == ("ok", 40, 2, 1)
    assert state.counters.octets == sum(path.stat().st_size for path in (tmp_path / "new" / "journal").iterdir())


@pytest.mark.parametrize("time", [0.1, 1_766_400_000.1, 1_766_400_000.123456789, 4e9 + 1 / 3, 0.0])
def test_a_time_comes_back_bit_for_bit(time: float) -> None:
    assert seconds(nanoseconds(time)) == time


@pytest.mark.parametrize("time", [float("nan"), float("inf"), -1.0, 1e300])
def test_a_time_that_is_none_hurts_nothing(tmp_path: Path, time: float) -> None:
    writer = JournalWriter(tmp_path, {}, LIMITS)
    writer.put("snapshot", time, lambda: b"x")
    assert writer.close()
    assert [one.data for one in open_journal(tmp_path).records()] == [b"x"]


def test_the_time_of_a_file_never_runs_back_though_the_clock_does(tmp_path: Path) -> None:
    writer = JournalWriter(tmp_path, {}, LIMITS)
    for number in (0, 50, 10, 60):
        put(writer, "snapshot" if number == 0 else "event", number)
    writer.close()
    read = list(open_journal(tmp_path).records())
    assert [one.time - START for one in read] == [0, 50, 10, 60]
    assert [one.order - START for one in read] == [0, 50, 50, 60]


def test_what_comes_before_the_first_snapshot_is_not_part_of_it(tmp_path: Path) -> None:
    writer = JournalWriter(tmp_path, {}, LIMITS)
    assert writer.wants_snapshot
    put(writer, "event", 0)
    put(writer, "snapshot", 1)
    assert not writer.wants_snapshot
    writer.close()
    assert [one.topic for one in open_journal(tmp_path).records()] == ["snapshot"]
    assert writer.state().counters.before_snapshot == 1
    assert not writer.wants_snapshot


def test_a_snapshot_is_wanted_every_minute(tmp_path: Path, clock: Hand) -> None:
    writer = JournalWriter(tmp_path, {}, LIMITS, clock=clock)
    put_written(writer, "snapshot", 0)
    clock.now += 59.0
    assert not writer.wants_snapshot
    clock.now += 1.0
    assert writer.wants_snapshot
    put_written(writer, "snapshot", 1)
    assert not writer.wants_snapshot
    writer.close()


def test_a_file_that_is_old_is_followed_by_one_that_begins_with_a_snapshot(tmp_path: Path, clock: Hand) -> None:
    writer = JournalWriter(tmp_path, ATTACHMENTS, replace(LIMITS, max_file_age_s=30.0), clock=clock)
    put_written(writer, "snapshot", 0)
    put_written(writer, "event", 1)
    clock.now += 31.0
    until(lambda: writer.wants_snapshot)
    put_written(writer, "event", 2)
    put_written(writer, "snapshot", 3)
    put_written(writer, "event", 4)
    writer.close()
    files = [JournalFile(path) for path in journal_files(tmp_path)]
    assert [[(one.topic, one.sequence) for one in file.records()] for file in files] == [
        [("snapshot", 0), ("event", 1), ("event", 2)],
        [("snapshot", 3), ("event", 4)],
    ]
    for number, file in enumerate(files, 1):
        name = parsed(file.path.name)
        assert name is not None
        assert file.runs == [{"run": writer.run, "file": str(number), "format": "1"}]
        assert (name.run, name.number) == (writer.run, number)
        assert file.attachments() == ATTACHMENTS
        assert file.cut_off is None


def noise_snapshot(writer: JournalWriter, number: int) -> None:
    records = writer.state().counters.records
    writer.put("snapshot", START + number, lambda: os.urandom(30_000))
    until(lambda: writer.state().counters.records > records)


def test_files_are_bounded_by_size_and_the_oldest_go_first(tmp_path: Path, clock: Hand) -> None:
    foreign = [tmp_path / "airside-notes.mcap", tmp_path / "other.txt", tmp_path / "airside-x-0-1.mcap"]
    for path in foreign:
        path.write_bytes(b"x" * 100_000)
    older = tmp_path / "airside-29991231T000000Z-00000001-0001.mcap"
    older.write_bytes(b"x" * 40_000)
    limits = replace(LIMITS, max_file_bytes=40_000, max_total_bytes=200_000)
    writer = JournalWriter(tmp_path, {}, limits, clock=clock)
    for number in range(20):
        until(lambda: writer.wants_snapshot)
        noise_snapshot(writer, number)
        clock.now += 61.0
    writer.close()
    files = journal_files(tmp_path)
    assert sum(path.stat().st_size for path in files) <= 200_000
    assert [path.exists() for path in foreign] == [True] * 3
    assert not older.exists()
    numbers = [name.number for name in map(parsed, (path.name for path in files)) if name]
    assert len(numbers) >= 2
    assert numbers == list(range(numbers[0], numbers[-1] + 1))
    assert numbers[-1] == writer.state().counters.files
    assert writer.state().counters.removed == 1 + numbers[0] - 1


def test_a_full_queue_leaves_a_gap_that_is_told(tmp_path: Path, clock: Hand) -> None:
    limits = replace(LIMITS, queue_bytes=20_000)
    writer = JournalWriter(tmp_path, {}, limits, clock=clock)
    put_written(writer, "snapshot", 0)
    go_on, reached = threading.Event(), threading.Event()

    def slow() -> bytes:
        reached.set()
        assert go_on.wait(20)
        return b"slow"

    writer.put("event", START + 1, slow)
    assert reached.wait(20)
    for number in range(2, 60):
        put(writer, "event", number)
    clock.now += 2.0
    assert writer.state().status == "degraded"
    assert "queue full" in writer.state().detail
    dropped = writer.state().counters.dropped
    assert 0 < dropped < 58
    assert not writer.wants_snapshot, "not before the queue has drained"
    go_on.set()
    until(lambda: writer.wants_snapshot)
    put(writer, "event", 60)
    put_written(writer, "snapshot", 61)
    assert writer.state().status == "ok"
    writer.close()
    read = list(open_journal(tmp_path).records())
    gap = next(one for one in read if one.topic == "gap")
    told = ValueCodec().decode(gap.data)
    assert told["dropped"] == dropped + 1 == writer.state().counters.dropped
    assert (told["first"], told["last"]) == (START + 60 - dropped, START + 60)
    assert [one.sequence for one in read] == [*range(60 - dropped), 60, 61]
    assert [one.topic for one in read[-2:]] == ["gap", "snapshot"]


def test_a_record_that_cannot_be_encoded_leaves_a_gap(tmp_path: Path, clock: Hand) -> None:
    def broken() -> bytes:
        raise ValueError("no byte form")

    writer = JournalWriter(tmp_path, {}, LIMITS, clock=clock)
    put(writer, "snapshot", 0)
    writer.put("event", START + 1, broken)
    put(writer, "event", 2)
    until(lambda: writer.state().counters.dropped == 2)
    assert "no byte form" in writer.state().detail
    clock.now += 2.0
    assert writer.wants_snapshot
    writer.put("snapshot", START + 3, broken)
    put(writer, "event", 4)
    assert not writer.wants_snapshot, "not again at once"
    clock.now += 2.0
    until(lambda: writer.wants_snapshot)
    put_written(writer, "snapshot", 5)
    writer.close()
    read = list(open_journal(tmp_path).records())
    assert [(one.topic, one.sequence) for one in read] == [("snapshot", 0), ("gap", 4), ("snapshot", 5)]
    assert ValueCodec().decode(read[1].data)["dropped"] == 4


def test_a_first_snapshot_that_cannot_be_encoded_begins_nothing(tmp_path: Path, clock: Hand) -> None:
    writer = JournalWriter(tmp_path, {}, LIMITS, clock=clock)
    writer.put("snapshot", START, lambda: 1 // 0)  # type: ignore[arg-type, return-value]
    put(writer, "event", 1)
    until(lambda: writer.state().counters.dropped == 2)
    assert list(tmp_path.iterdir()) == []
    clock.now += 2.0
    put_written(writer, "snapshot", 2)
    writer.close()
    assert [one.sequence for one in open_journal(tmp_path).records()] == [2]


def test_records_missing_at_the_end_are_told_at_the_end(tmp_path: Path) -> None:
    writer = JournalWriter(tmp_path, {}, LIMITS)
    put(writer, "snapshot", 0)
    writer.put("event", START + 1, lambda: 1 // 0)  # type: ignore[arg-type, return-value]
    writer.close()
    assert [one.topic for one in open_journal(tmp_path).records()] == ["snapshot", "gap"]


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EIO])
def test_a_disk_that_fails_stops_the_journal_visibly(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int
) -> None:
    heard: list[str] = []
    writer = JournalWriter(tmp_path, ATTACHMENTS, LIMITS, heard.append)
    put_written(writer, "snapshot", 0)

    def fail(_file: int, _data: bytes) -> int:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(output_module.os, "write", fail)
    put(writer, "event", 1)
    until(lambda: bool(heard))
    monkeypatch.undo()
    assert writer.state().status == "stopped"
    assert os.strerror(code) in writer.state().detail
    assert len(heard) == 1
    put(writer, "event", 2)
    assert writer.state().counters.dropped == 1
    assert not writer.wants_snapshot
    assert writer.close()
    (path,) = journal_files(tmp_path)
    assert [one.sequence for one in JournalFile(path).records()] == [0]


@pytest.fixture
def tiny_disk(tmp_path: Path) -> Iterator[Path]:
    place = tmp_path / "disk"
    place.mkdir()
    done = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=256k", "tmpfs", str(place)], capture_output=True, check=False
    ) if shutil.which("mount") else None  # fmt: skip
    if done is None or done.returncode:
        pytest.skip("a small file system cannot be mounted here; the failing write is tested without one, too")
    yield place
    subprocess.run(["umount", str(place)], check=True)


def test_a_disk_that_is_really_full(tiny_disk: Path) -> None:
    heard: list[str] = []
    writer = JournalWriter(tiny_disk, ATTACHMENTS, LIMITS, heard.append)
    written = 0
    while writer.state().status != "stopped" and written < 100:
        writer.put("snapshot", START + written, lambda: os.urandom(10_000))
        written += 1
        until(lambda count=written: writer.state().counters.records >= count or writer.state().status == "stopped")
    until(lambda: bool(heard))
    assert "No space left" in heard[0]
    assert writer.close()
    file = JournalFile(next(iter(journal_files(tiny_disk))))
    assert file.cut_off is not None
    assert [one.sequence for one in file.records()] == list(range(len(list(file.records()))))
    assert len(list(file.records())) >= written - 2


def test_a_folder_that_is_removed_stops_the_journal(tmp_path: Path) -> None:
    folder = tmp_path / "journal"
    writer = JournalWriter(folder, {}, LIMITS)
    put_written(writer, "snapshot", 0)
    shutil.rmtree(folder)
    put(writer, "event", 1)
    until(lambda: writer.state().status == "stopped")
    assert "removed" in writer.state().detail


def test_a_folder_that_cannot_be_made_is_told_at_once(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    heard: list[str] = []
    writer = JournalWriter(tmp_path / "file" / "journal", {}, LIMITS, heard.append)
    assert writer.state().status == "stopped"
    assert len(heard) == 1
    assert not writer.wants_snapshot
    assert writer.close()


def test_limits_of_the_settings() -> None:
    limits = JournalLimits.of(JournalSettings(max_file_mib=100, max_total_mib=50, max_file_age_s=60))
    assert (limits.max_file_bytes, limits.max_total_bytes, limits.max_file_age_s) == (25 * 2**20, 50 * 2**20, 60.0)
    assert JournalLimits.of(JournalSettings()) == JournalLimits()


def test_compression_is_on(tmp_path: Path) -> None:
    writer = JournalWriter(tmp_path, {}, replace(LIMITS, chunk_age_s=10.0))
    for number in range(100):
        writer.put("snapshot", START + number, lambda: NOISE)
    writer.close()
    assert journal_files(tmp_path)[0].stat().st_size < 100 * len(NOISE) / 10


def test_what_was_put_is_on_the_disk_in_two_seconds(tmp_path: Path, clock: Hand) -> None:
    writer = JournalWriter(tmp_path, {}, JournalLimits(), clock=clock)
    put(writer, "snapshot", 0)
    until(lambda: writer.state().counters.records == 1)
    (path,) = journal_files(tmp_path)
    assert list(JournalFile(path).records()) == []
    clock.now += 1.9
    until(lambda: len(list(JournalFile(path).records())) == 1)
    writer.close()


def test_the_size_that_the_caller_tells_counts(tmp_path: Path) -> None:
    writer = JournalWriter(tmp_path, {}, replace(LIMITS, queue_bytes=1_000_000))
    put_written(writer, "snapshot", 0)
    go_on, reached = threading.Event(), threading.Event()

    def slow() -> bytes:
        reached.set()
        assert go_on.wait(20)
        return b"slow"

    writer.put("sweeps", START + 1, slow)
    assert reached.wait(20)
    for number in range(2, 7):
        writer.put("sweeps", START + number, lambda: b"x", 300_000)
    assert writer.state().counters.dropped == 2
    go_on.set()
    assert writer.close()


def test_a_failing_listener_hurts_nothing(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")

    def broken(_: str) -> None:
        raise RuntimeError

    writer = JournalWriter(tmp_path / "file" / "journal", {}, LIMITS, broken)
    assert writer.close()


def test_an_empty_folder_in_the_settings_is_none() -> None:
    assert JournalSettings(folder="").folder is None  # type: ignore[arg-type]
    assert JournalSettings(folder="journal").folder == Path("journal")  # type: ignore[arg-type]
