"""Cutting out, and the commands."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli import app
from app.journal.export import export
from app.journal.names import JournalError
from app.journal.output import JournalOutput
from app.journal.reader import JournalFile, open_journal
from app.journal.times import moment
from pipeline.values import ValueCodec
from tests.app.journal.writing import ATTACHMENTS, START, chunked

run = CliRunner()


def two_runs(folder: Path) -> Path:
    folder.mkdir()
    chunked(folder / "airside-20261127T113000Z-ffffffff-0001.mcap", 10, run="ffffffff")
    chunked(folder / "airside-20261127T113000Z-ffffffff-0002.mcap", 10, first=10, run="ffffffff")
    chunked(folder / "airside-20261127T113100Z-00000000-0001.mcap", 10, first=20, run="00000000")
    return folder


def test_a_part_is_cut_out_whole(tmp_path: Path) -> None:
    journal = open_journal(two_runs(tmp_path / "journal"))
    done = export(journal, START + 12, START + 15, tmp_path / "incident.mcap")
    assert (done.records, done.start, done.end, done.runs) == (6, START + 10, START + 15, ("ffffffff",))
    cut = JournalFile(tmp_path / "incident.mcap")
    whole = [one for one in journal.records() if 10 <= one.sequence <= 15]
    assert list(cut.records()) == whole
    assert next(cut.records()).topic == "snapshot"
    assert cut.attachments() == ATTACHMENTS
    assert cut.cut_off is None
    assert cut.runs[0]["run"] == "ffffffff"
    assert dict(cut.metadata)["airside.export"]["from"] == repr(START + 12)
    cut.check()


def test_a_restart_in_between_stays_visible(tmp_path: Path) -> None:
    journal = open_journal(two_runs(tmp_path / "journal"))
    done = export(journal, START + 12, START + 25, tmp_path / "incident.mcap")
    cut = JournalFile(done.path)
    assert [one.run for one in cut.records()] == ["ffffffff"] * 10 + ["00000000"] * 6
    assert [one["run"] for one in cut.runs] == ["ffffffff", "00000000"]
    assert cut.attachments("00000000") == ATTACHMENTS
    again = export(open_journal(done.path), START + 21, START + 22, tmp_path / "again.mcap")
    assert [one.sequence for one in JournalFile(again.path).records()] == [20, 21, 22]


def test_what_cannot_be_cut_is_refused_and_leaves_nothing(tmp_path: Path) -> None:
    journal = open_journal(two_runs(tmp_path / "journal"))
    target = tmp_path / "incident.mcap"
    for since, until, told in ((-5, 3, "no snapshot"), (3, 1, "before from")):
        with pytest.raises(JournalError, match=told):
            export(journal, START + since, START + until, target)
    with pytest.raises(JournalError, match="cannot be written"):
        export(journal, START, START + 1, tmp_path / "none" / "incident.mcap")
    damaged = next(iter((tmp_path / "journal").glob("*0002.mcap")))
    data = bytearray(damaged.read_bytes())
    data[JournalFile(damaged).chunks[1].mark.at + 100] ^= 1
    damaged.write_bytes(data)
    with pytest.raises(JournalError, match="damaged at octet"):
        export(open_journal(tmp_path / "journal"), START, START + 25, target)
    assert [one.name for one in tmp_path.iterdir()] == ["journal"]
    target.write_text("mine")
    with pytest.raises(JournalError, match="there already"):
        export(journal, START, START + 1, target)
    assert target.read_text() == "mine"


@pytest.mark.parametrize(
    ("text", "time"),
    [
        ("+90", START + 90), ("1766400000.5", 1766400000.5), ("2026-11-27T11:30:00Z", 1795779000.0),
        ("2026-11-27T11:30:00", 1795779000.0), ("2026-11-27T12:30:00.250+01:00", 1795779000.25),
    ],
)  # fmt: skip
def test_moments(text: str, time: float) -> None:
    assert moment(text, START) == time


@pytest.mark.parametrize("text", ["", "now", "+", "nan", "inf", "+nan", "2026-13-01T00:00:00Z"])
def test_no_moments(text: str) -> None:
    with pytest.raises(JournalError, match="no time"):
        moment(text, START)


def test_the_commands(tmp_path: Path) -> None:
    folder = two_runs(tmp_path / "journal")
    target = tmp_path / "incident.mcap"
    done = run.invoke(app, ["journal", "export", str(folder), "--from", "+12", "--until", "+25", "-o", str(target)])
    assert done.exit_code == 0, done.output
    assert "16 records" in done.output
    assert "restarted" in done.output
    told = run.invoke(app, ["journal", "info", str(target), "--json"])
    document = json.loads(told.output)
    assert (document["records"], len(document["snapshots"])) == (16, 2)
    shown = run.invoke(app, ["journal", "info", str(folder), "--check"])
    assert shown.exit_code == 0, shown.output
    for word in (
        "run ffffffff: 2 files, 20 records",
        "3 snapshots, 0 gaps",
        "airside 0.1.0",
        "all checksums are right",
    ):
        assert word in shown.output


def test_the_command_tells_gaps_and_what_was_cut_off(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    output = JournalOutput(path)
    output.begin_run("0a0b0c0d", 1, {}, START)
    output.add("snapshot", 0, START, b"x")
    told = {"dropped": 7, "reason": "the queue was full", "first": START, "last": START + 1}
    output.add("gap", 8, START + 1, ValueCodec().encode(told))
    output.close_chunk()
    output.abandon()
    with path.open("ab") as file:
        file.write(b"\x06\xff")
    shown = run.invoke(app, ["journal", "info", str(path)])
    assert "7 records are missing: the queue was full" in shown.output
    assert "not finished: cut off or still written, 2 octets left out" in shown.output


@pytest.mark.parametrize(
    "arguments",
    [
        ["info", "none.mcap"], ["info", "wrong.mcap"],
        ["export", "a.mcap", "--from", "soon", "--until", "+1", "-o", "b.mcap"],
        ["export", "a.mcap", "--from", "0", "--until", "1", "-o", "b.mcap"],
    ],
)  # fmt: skip
def test_faults_of_the_commands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str]) -> None:
    monkeypatch.chdir(tmp_path)
    chunked(tmp_path / "a.mcap")
    (tmp_path / "wrong.mcap").write_bytes(b"something else")
    done = run.invoke(app, ["journal", *arguments])
    assert done.exit_code == 2
    assert "airside: " in done.output
