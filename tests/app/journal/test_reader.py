"""Reading: whole, cut off, damaged and foreign files; several runs; seeking."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

from app.journal.info import journal_info
from app.journal.names import JournalError
from app.journal.output import JournalOutput
from app.journal.reader import JournalFile, Record, open_journal
from app.journal.walk import Walk
from pipeline.tables import NodeEvents
from pipeline.tables.codec import encode
from pipeline.values import ValueCodec
from tests.app.journal.writing import ATTACHMENTS, START, body, chunked

ROOT = Path(__file__).resolve().parents[3]


def numbers(records: list[Record]) -> list[int]:
    for one in records:
        assert one.data == body(one.topic, one.sequence)
    return [one.sequence for one in records]


def test_a_whole_file(tmp_path: Path) -> None:
    file = JournalFile(chunked(tmp_path / "a.mcap"))
    assert numbers(list(file.records())) == list(range(30))
    assert file.cut_off is None
    assert file.attachments() == ATTACHMENTS
    assert [at - START for at, _ in file.snapshots()] == [0, 10, 20]
    file.check()


def test_other_tools_read_it_and_find_the_description_of_each_channel(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    output = JournalOutput(path)
    output.begin_run("0a0b0c0d", 1, ATTACHMENTS, START)
    output.add("snapshot", 0, START, ValueCodec().encode({"a": 1}))
    output.add("node_events", 1, START + 1, encode(NodeEvents.empty()))
    output.add("node_events", 2, START + 2, b"something else")
    output.finish()
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        told = [
            (schema.name, channel.topic, message.sequence, schema.data.decode())
            for schema, channel, message in reader.iter_messages()
            if schema
        ]
        assert [one.name for one in reader.iter_attachments()] == list(ATTACHMENTS)
    assert [one[:3] for one in told] == [
        ("airside.value/1", "snapshot", 0), ("airside.table.NodeEvents/1", "node_events", 1),
        ("airside.octets/1", "node_events", 2),
    ]  # fmt: skip
    assert "a deque" not in told[0][3]
    assert "(deque)" in told[0][3]
    assert "UTC of the event" in told[1][3]
    assert [one.sequence for one in JournalFile(path).records()] == [0, 1, 2]


def test_cut_off_anywhere_it_opens_to_the_last_complete_chunk(tmp_path: Path) -> None:
    path = chunked(tmp_path / "a.mcap")
    data = path.read_bytes()
    chunk_ends = [one.mark.end for one in JournalFile(path).chunks]
    cut = tmp_path / "cut.mcap"
    seen = set()
    for size in itertools.chain(range(8, len(data) - 1, 37), chunk_ends, (end - 1 for end in chunk_ends)):
        cut.write_bytes(data[:size])
        file = JournalFile(cut)
        complete = sum(end <= size for end in chunk_ends)
        assert numbers(list(file.records())) == list(range(3 * complete))
        assert file.cut_off is not None
        assert 0 <= file.cut_off <= size
        assert journal_info(open_journal(cut)).records == 3 * complete
        seen.add(complete)
    assert seen == set(range(11))


def test_the_octets_left_out_are_told(tmp_path: Path) -> None:
    path = chunked(tmp_path / "a.mcap")
    file = JournalFile(path)
    at = file.chunks[4].mark
    path.write_bytes(path.read_bytes()[: at.at + 100])
    assert JournalFile(path).cut_off == 100
    # a journal that the machine's end left with zeros behind what was written
    path.write_bytes(path.read_bytes()[: at.at] + bytes(4096))
    cut = JournalFile(path)
    assert cut.cut_off == 4096
    assert numbers(list(cut.records())) == list(range(12))


def test_less_than_a_head_and_foreign_files_are_no_journal(tmp_path: Path) -> None:
    for number, data in enumerate([b"", b"\x89MCAP", b"PK\x03\x04" + bytes(100), bytes(1000)]):
        path = tmp_path / f"{number}.mcap"
        path.write_bytes(data)
        with pytest.raises(JournalError, match=f"{number}.mcap: no journal"):
            open_journal(path)
    with pytest.raises(JournalError, match="cannot be read"):
        open_journal(tmp_path / "none.mcap")
    (tmp_path / "empty").mkdir()
    with pytest.raises(JournalError, match="no journal files"):
        open_journal(tmp_path / "empty")


def test_a_flipped_bit_in_a_chunk_is_told_with_its_place(tmp_path: Path) -> None:
    path = chunked(tmp_path / "a.mcap")
    data = path.read_bytes()
    mark = JournalFile(path).chunks[5].mark
    for offset in (60, 200, mark.length - 5):
        damaged = bytearray(data)
        damaged[mark.at + 9 + offset] ^= 1
        path.write_bytes(damaged)
        file = JournalFile(path)
        read: list[Record] = []
        with pytest.raises(JournalError, match=rf"a\.mcap: damaged at octet {mark.at}: a chunk"):
            read.extend(file.records())
        assert numbers(read) == list(range(15))


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_any_flipped_bit_of_the_data_is_told(tmp_path: Path, draw: st.DataObject) -> None:
    whole = tmp_path / "whole.mcap"
    if not whole.exists():
        chunked(whole, records=12)
    data = bytearray(whole.read_bytes())
    end = Walk(whole).marks[-1].at
    data[draw.draw(st.integers(0, end - 1))] ^= 1 << draw.draw(st.integers(0, 7))
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data)
    with pytest.raises(JournalError):
        JournalFile(path).check()


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_any_damage_gives_an_error_of_the_journal_only(tmp_path: Path, draw: st.DataObject) -> None:
    whole = tmp_path / "whole.mcap"
    if not whole.exists():
        chunked(whole, records=12)
    data = bytearray(whole.read_bytes())
    for _ in range(draw.draw(st.integers(1, 4))):
        data[draw.draw(st.integers(8, len(data) - 1))] = draw.draw(st.integers(0, 255))
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data[: draw.draw(st.integers(8, len(data)))])
    try:
        journal = open_journal(path)
        list(journal.records())
        journal_info(journal)
        list(journal.records(START + 5))
    except JournalError:
        pass


@pytest.mark.parametrize("compression", list(CompressionType))
def test_files_packed_anew_by_other_tools_and_without_an_index(tmp_path: Path, compression: CompressionType) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=1000, compression=compression, index_types=IndexType.CHUNK)
        writer.start()
        schema = writer.register_schema("airside.octets/1", "airside", b"")
        channel = writer.register_channel("snapshot", "airside", schema)
        for number in range(10):
            writer.add_message(channel, number * 10**9, body("snapshot", number), number * 10**9, number)
        writer.finish()
    file = JournalFile(path)
    assert numbers(list(file.records())) == list(range(10))
    assert len(file.snapshots()) == 10


def test_a_writer_that_is_killed_leaves_a_file_that_opens(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.app.journal.writing_process", str(tmp_path)],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        octets = next(count for line in process.stdout if (count := int(line)) > 10_000)
    finally:
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
    (path,) = tmp_path.iterdir()
    file = JournalFile(path)
    read = list(file.records())
    assert file.cut_off is not None
    assert numbers(read) == list(range(len(read)))
    assert file.size >= octets
    assert len(file.chunks) >= 2
    assert file.size - file.cut_off >= file.chunks[-1].mark.end
    assert read[0].topic == "snapshot"
    assert file.attachments() == ATTACHMENTS


def test_runs_in_one_folder_are_told_apart(tmp_path: Path) -> None:
    chunked(tmp_path / "airside-20261127T113000Z-ffffffff-0001.mcap", 10, run="ffffffff")
    chunked(tmp_path / "airside-20261127T113010Z-00000000-0001.mcap", 10, first=20, run="00000000")
    (tmp_path / "notes.txt").write_text("x")
    journal = open_journal(tmp_path)
    read = list(journal.records())
    assert [one.run for one in read] == ["ffffffff"] * 10 + ["00000000"] * 10
    assert numbers(read) == [*range(10), *range(20, 30)]
    told = journal_info(journal)
    assert [(one["run"], one["files"], one["records"], one["versions"]) for one in told.runs] == [
        ("ffffffff", 1, 10, {"airside": "0.1.0"}), ("00000000", 1, 10, {"airside": "0.1.0"}),
    ]  # fmt: skip
    assert (told.start, told.end, told.duration_s) == (START, START + 29, 29)


def test_what_info_tells_from_the_index_is_what_is_there(tmp_path: Path) -> None:
    path = chunked(tmp_path / "a.mcap")
    told = journal_info(open_journal(path))
    read = list(open_journal(path).records())
    for topic in ("snapshot", "event"):
        sizes = [len(one.data) for one in read if one.topic == topic]
        assert told.topics[topic] == {"records": len(sizes), "octets": sum(sizes)}
    assert told.snapshots == (START, START + 10, START + 20)
    assert told.gaps == ()


@pytest.mark.parametrize(("since", "first"), [(0, 0), (9.9, 0), (10, 10), (15, 10), (20, 20), (1e6, 20)])
def test_seeking_begins_at_the_last_snapshot_before(tmp_path: Path, since: float, first: int) -> None:
    journal = open_journal(chunked(tmp_path / "a.mcap"))
    assert numbers(list(journal.records(START + since))) == list(range(first, 30))


def test_seeking_goes_over_files_and_before_the_first_it_is_refused(tmp_path: Path) -> None:
    chunked(tmp_path / "airside-20261127T113000Z-ffffffff-0001.mcap", 10)
    chunked(tmp_path / "airside-20261127T113000Z-ffffffff-0002.mcap", 10, first=10)
    journal = open_journal(tmp_path)
    assert numbers(list(journal.records(START + 9))) == list(range(20))
    assert numbers(list(journal.records(START + 12))) == list(range(10, 20))
    with pytest.raises(JournalError, match="no snapshot at or before"):
        list(journal.records(START - 1))
