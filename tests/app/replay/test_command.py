"""`airside replay` on journals: what it prints, its exit status, and one clear sentence for whatever is wrong."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from app.cli import app
from app.journal.reader import Record, open_journal
from pipeline.engine_records import CODEC, OUTPUT
from tests.app.replay.recording import decoded, eventful, record, rewritten

WIDE = {"COLUMNS": "400"}


@pytest.fixture(scope="module")
def day(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("day"), eventful(scans=24))


def replay(*words: Any) -> tuple[int, str, str]:
    """Exit status, what was printed, what was complained of."""
    done = CliRunner().invoke(app, ["replay", *map(str, words)], env=WIDE)
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    return done.exit_code, done.stdout, done.stderr


def test_identical_is_said_with_what_was_compared(day: Path) -> None:
    status, told, wrong = replay(day, "--headless", "--verify")
    assert (status, wrong) == (0, "")
    lines = told.strip().splitlines()
    assert lines[-1] == "identical"
    assert f"{len(eventful(scans=24))} inputs, 2023-11-14T22:13:20.225Z to 2023-11-14T22:13:44." in told
    assert "columns compared)" in told
    assert ", 1 run, 0 gaps" in told
    assert "versions" not in told
    assert replay(day.parent, "--headless", "--verify")[0] == 0, "the folder is the same journal"


def test_a_difference_is_said_with_its_place_and_status_1(day: Path, tmp_path: Path) -> None:
    def change(one: Record) -> bytes:
        made = decoded(one)
        if one.topic != OUTPUT or not made.changes or one.sequence < 200:
            return one.data
        return CODEC.encode(replace(made, changes=made.changes[:-1]))

    status, told, _ = replay(rewritten(day, tmp_path / "a.mcap", change), "--headless", "--verify")
    assert status == 1
    last = told.strip().splitlines()[-1]
    assert last.startswith("not identical: input ")
    assert "changes" in last


def test_a_part_is_verified_and_nothing_in_it_is_no_success(day: Path) -> None:
    status, told, _ = replay(day, "--headless", "--verify", "--from", "+12", "--until", "2023-11-14T22:13:40Z")
    assert status == 0
    assert "2023-11-14T22:13:39" in told
    status, told, _ = replay(day, "--headless", "--verify", "--from", "+12", "--until", "+1")
    assert status == 1
    assert told.strip().endswith("nothing to compare")


def test_a_file_that_was_cut_off_is_said(day: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(day.read_bytes()[:-40])
    status, told, _ = replay(cut, "--headless", "--verify")
    assert status == 0
    assert "was cut off" in told
    assert "octets left out" in told


def test_other_versions_are_said(day: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.replay.command.versions", lambda: {"python": "3.99", "numpy": "0"})
    told = replay(day, "--headless", "--verify")[1]
    assert "not the same versions: " in told
    assert "then, 3.99 now" in told


def no_journal(folder: Path, day: Path) -> list[Any]:
    return [folder / "nothing.mcap", "--headless", "--verify"]


def empty_folder(folder: Path, day: Path) -> list[Any]:
    return [folder, "--headless", "--verify"]


def text_file(folder: Path, day: Path) -> list[Any]:
    (folder / "a.mcap").write_text("no journal")
    return [folder / "a.mcap", "--headless", "--verify"]


def empty_file(folder: Path, day: Path) -> list[Any]:
    (folder / "a.mcap").write_bytes(b"")
    return [folder / "a.mcap", "--headless", "--verify"]


def only_a_head(folder: Path, day: Path) -> list[Any]:
    (folder / "a.mcap").write_bytes(day.read_bytes()[:200])
    return [folder / "a.mcap", "--headless", "--verify"]


def damaged(folder: Path, day: Path) -> list[Any]:
    octets = bytearray(day.read_bytes())
    octets[len(octets) // 2] ^= 1
    (folder / "a.mcap").write_bytes(octets)
    return [folder / "a.mcap", "--headless", "--verify"]


def without_settings(folder: Path, day: Path) -> list[Any]:
    return [rewritten(day, folder / "a.mcap", lambda one: one.data, ("settings.json",)), "--headless", "--verify"]


def without_map(folder: Path, day: Path) -> list[Any]:
    return [rewritten(day, folder / "a.mcap", lambda one: one.data, ("airport.geojson",)), "--headless"]


def without_snapshot(folder: Path, day: Path) -> list[Any]:
    path = rewritten(day, folder / "a.mcap", lambda one: None if one.topic == "snapshot" else one.data)
    return [path, "--headless", "--verify"]


WRONG = [
    (no_journal, "nothing.mcap: cannot be read"),
    (empty_folder, "no journal files (airside-*.mcap) in this folder"),
    (text_file, "a.mcap: no journal: it does not begin like an MCAP file"),
    (empty_file, "a.mcap: no journal: it does not begin like an MCAP file"),
    (only_a_head, "a.mcap: holds no record"),
    (damaged, "a.mcap: damaged at octet"),
    (without_settings, "a.mcap: the attachment 'settings.json' is missing"),
    (without_map, "a.mcap: the attachment 'airport.geojson' is missing"),
    (without_snapshot, "a.mcap: no snapshot in it, so that nothing can be replayed"),
    (lambda folder, day: [day, "--verify"], "--verify goes with --headless, and not with --set"),
    (lambda folder, day: [day, "--speed", "0.05"], "the speed must lie between 0.1 and 64"),
    (
        lambda folder, day: [day, "--headless", "--verify", "--set", "parts.lifecycle=m_of_n"],
        "--verify goes with --headless, and not with --set",
    ),
    (lambda folder, day: [day, "--headless", "--verify", "--from", "yesterday"], "'yesterday' is no time"),
    (lambda folder, day: [day, "--headless", "--verify", "--from", "2020-01-01"], "no snapshot at or before"),
    (lambda folder, day: [folder / "turns.npz", "--verify"], "are for journals (.mcap)"),
]


@pytest.mark.parametrize(("make", "words"), WRONG)
def test_what_is_wrong_is_said_in_one_sentence(tmp_path: Path, day: Path, make: Any, words: str) -> None:
    status, _, wrong = replay(*make(tmp_path, day))
    assert status == 2
    assert words in wrong
    assert len(wrong.strip().splitlines()) == 1, wrong
    assert wrong.startswith("airside: ")


def test_other_settings_print_a_table_and_the_alerts_that_differ(day: Path) -> None:
    status, told, wrong = replay(day, "--headless", "--set", 'parts.alert=["hold_entry"]')
    assert (status, wrong) == (0, "")
    assert "recorded" in told
    assert "tracks in a picture" in told
    lines = told.splitlines()
    alone = [one for one in lines if one.startswith("only recorded: 2023-11-14T22:13:")]
    assert any("closed_runway 06/24" in one for one in alone)
    assert not any(one.startswith("only replayed") for one in lines)


def test_another_lifecycle_changes_the_tracks(day: Path) -> None:
    status, told, _ = replay(day, "--headless", "--set", "parts.lifecycle=m_of_n")
    assert status == 0
    row = next(one for one in told.splitlines() if "tracks in a picture" in one)
    recorded, replayed = [float(one) for one in row.replace("│", " ").split() if one[0].isdigit()]
    assert recorded != replayed
    assert "pictures, parts.lifecycle=m_of_n" in told


def test_the_same_settings_change_nothing(day: Path) -> None:
    for words in ([], ["--set", "parts.lifecycle.name=score"], ["--set", "parts.filter=kalman"]):
        status, told, _ = replay(day, "--headless", *words)
        assert status == 0
        assert "the same alerts" in told
        row = next(one for one in told.splitlines() if "tracks that the other has not" in one)
        assert [float(one) for one in row.replace("│", " ").split() if one[0].isdigit()] == [0.0, 0.0]


@pytest.mark.parametrize(
    ("orders", "words"),
    [
        (["parts.detect=hybrid"], "works on the raw sweeps of the radar, and these were not recorded"),
        (["parts.detect.name=hybrid"], "works on the raw sweeps of the radar"),
        (["parts.extract.min_cells=3"], "works on the raw sweeps of the radar"),
        (["parts.lifecycle=m_off_n"], "m_of_n"),
        (["parts.lifecycle.confirm_hit=3"], "parts.lifecycle"),
        (["parts.lifecycle=m_of_n", "parts.lifecycle.nothing=4"], "nothing"),
        (["parts.filter.max_speed=fast"], "parts.filter"),
        (["parts.nothing=1"], "only these change it: parts.associate"),
        (["port=80"], "only these change it"),
        (["parts=1"], "only these change it"),
        (["parts.lifecycle"], "wants KEY=VALUE"),
        (["=m_of_n"], "wants KEY=VALUE"),
        ([""], "wants KEY=VALUE"),
        (["parts.lifecycle."], "wants KEY=VALUE"),
        (["parts.lifecycle.=3"], "parts.lifecycle."),
        (["parts.lifecycle.a.b=3"], "parts.lifecycle.a.b"),
        (["parts.alert.name=hold_entry"], "parts.alert=[...] sets them as a whole"),
        (["parts.lifecycle=3"], "lifecycle"),
        (["parts.lifecycle="], "parts.lifecycle"),
        (["parts.alert=[3]"], "alert"),
    ],
)
def test_orders_that_change_nothing_are_refused_by_name(day: Path, orders: list[str], words: str) -> None:
    status, _, wrong = replay(day, "--headless", *(word for one in orders for word in ("--set", one)))
    assert status == 2, wrong
    assert words in wrong
    assert len(wrong.strip().splitlines()) == 1, wrong


def test_a_setting_of_a_part_is_changed_alone_or_after_its_part(day: Path) -> None:
    assert replay(day, "--headless", "--set", "parts.lifecycle=m_of_n", "--set", "parts.lifecycle.m=3")[0] == 0
    assert replay(day, "--headless", "--set", "parts.lifecycle.name=m_of_n")[0] == 0


def test_info_says_what_there_is_to_replay(day: Path) -> None:
    done = CliRunner().invoke(app, ["journal", "info", str(day), "--check"], env=WIDE)
    assert done.exit_code == 0
    assert "all checksums are right" in done.stdout
    count = sum(one.topic == "input" for one in open_journal(day).records())
    assert any(one.split()[:2] == ["input", str(count)] for one in done.stdout.splitlines())
