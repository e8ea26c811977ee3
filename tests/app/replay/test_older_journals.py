"""Journals that an earlier version of the program wrote: they are replayed, and it is told where that begins anew."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli import app
from app.journal.names import JournalError
from app.journal.reader import Record, open_journal
from app.replay.compare import compare
from app.replay.player import JournalPlayer
from app.replay.recorded import recorded_run
from app.replay.service import ReplayService
from app.replay.verify import Verification, verify
from pipeline.engine_records import CODEC, OUTPUT, SNAPSHOT
from tests.app.replay.recording import Recording, decoded, eventful, record, records, rewritten, shifted
from tests.pipeline.track.scene import T0
from tests.support.engines import minute
from tests.support.older_forms import older_clocks, older_state, older_table, with_older_table
from tests.support.running import until

SCANS = 36


@pytest.fixture(scope="module")
def day(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A journal as this version writes it, with snapshots at 0, 10, 20 and 30 s; tests only read it."""
    return record(tmp_path_factory.mktemp("day"), eventful(scans=SCANS))


@pytest.fixture(scope="module")
def older_day(day: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same as it was when the tracker kept its tracks otherwise and ids had 32 bits."""
    return rewritten(day, tmp_path_factory.mktemp("older") / "day.mcap", as_before)


def as_before(one: Record) -> bytes:
    """A record of the day as it was then."""
    made = decoded(one)
    if one.topic == SNAPSHOT:
        return CODEC.encode(older_state(made))
    if one.topic == OUTPUT and len(made.tracks):
        return with_older_table(one.data, made.tracks, older_table(made.tracks, dtypes={"id": "<i4"}))
    return one.data


def verified(path: Path, **words: Any) -> Verification:
    return verify(open_journal(path), **words)


def test_a_run_that_begins_with_an_older_state_begins_empty_and_is_compared(day: Path, older_day: Path) -> None:
    """The engine was empty when the recording began: everything is the same, also alert numbers and commands."""
    found, now = verified(older_day), verified(day)
    assert found.difference is None
    assert (found.pictures, found.changes, found.inputs) == (now.pictures, now.changes, now.inputs)
    assert found.begun_empty == [
        "The state recorded at 2023-11-14T22:13:20.225Z does not have the form of the engine that replays it"
        " (tracker.store is missing), so that the replay begins there with an empty engine."
    ]
    assert (found.snapshots, now.snapshots) == (1, 4), "later ones are not compared"
    assert now.begun_empty == []
    one = compare(open_journal(older_day), ())
    assert [row for row in one.pictures.figures() if row.recorded != row.replayed] == []
    assert one.pictures.pictures == now.pictures
    assert one.begun_empty == tuple(found.begun_empty)


def test_what_is_shown_otherwise_now_is_told(older_day: Path, tmp_path: Path) -> None:
    def moved(record: Record) -> bytes:
        made = decoded(record)
        if record.topic != OUTPUT or record.time < T0 + 20 or not len(made.tracks):
            return record.data
        tracks = made.tracks.replace(state=made.tracks.state + np.array((100.0, 0.0, 0.0, 0.0)))
        return CODEC.encode(replace(made, tracks=tracks))

    path = rewritten(older_day, tmp_path / "moved.mcap", moved)
    difference = verified(path).difference
    assert difference is not None
    assert "tracks.state" in difference
    rows = {row.name: row for row in compare(open_journal(path), ()).pictures.figures()}
    assert rows["tracks that the other has not"].replayed > 0.1


def test_a_state_with_a_class_of_other_fields_is_of_another_form_too(day: Path, tmp_path: Path) -> None:
    path = rewritten(day, tmp_path / "a.mcap", lambda one: older_clocks() if one.topic == SNAPSHOT else one.data)
    found = compare(open_journal(path), ())
    assert len(found.begun_empty) == 1
    assert "RadarClock was written with the fields ['row', 'turn_s']" in found.begun_empty[0]
    assert [row for row in found.pictures.figures() if row.recorded != row.replayed] == []
    assert found.pictures.pictures == verified(day).pictures - 1, "an alert of another number is not acknowledged"


@pytest.mark.parametrize("since", [12.0, 25.0])
def test_from_the_middle_the_state_is_rebuilt_from_the_begin_of_the_run(
    day: Path, older_day: Path, since: float
) -> None:
    found, now = verified(older_day, since=T0 + since), verified(day, since=T0 + since)
    assert found.difference is None
    assert (found.pictures, found.first, found.last) == (now.pictures, now.first, now.last)
    assert found.inputs == len([one for one in records(day) if one.topic == "input"])
    assert [one[22:45] for one in found.begun_empty] == ["2023-11-14T22:13:20.225"]
    part = compare(open_journal(older_day), (), T0 + since)
    assert part.pictures.pictures == now.pictures
    assert part.document()["begun_empty"] == 1


def test_after_a_gap_it_begins_empty_anew(tmp_path: Path) -> None:
    made, envelopes = Recording(tmp_path / "whole"), eventful(scans=24)
    made.feed(envelopes[:120])
    made.overflow(envelopes[120:140])
    made.feed(envelopes[140:])
    made.close()
    (file,) = (tmp_path / "whole").glob("*.mcap")
    found = compare(open_journal(rewritten(file, tmp_path / "a.mcap", as_before)), ())
    assert len(found.begun_empty) == 2
    assert found.begun_empty[0] != found.begun_empty[1]


def test_a_later_run_of_this_version_is_verified_as_ever(tmp_path: Path) -> None:
    """The service was upgraded: the snapshots of the second run are compared again."""
    paths = []
    for number, begin in enumerate((0.0, 100.0)):
        made = Recording(tmp_path / str(number), begin=T0 + begin)
        made.feed(shifted(minute(scans=12), begin))
        made.close()
        paths.extend((tmp_path / str(number)).glob("*.mcap"))
    folder = tmp_path / "both"
    folder.mkdir()
    (folder / "airside-20231114T221320Z-00000001-0001.mcap").write_bytes(
        rewritten(paths[0], tmp_path / "older.mcap", as_before).read_bytes()
    )
    (folder / "airside-20231114T221500Z-00000002-0001.mcap").write_bytes(paths[1].read_bytes())
    found = verified(folder)
    assert (found.difference, found.runs, len(found.begun_empty)) == (None, 2, 1)
    assert found.snapshots == 1 + verified(paths[1]).snapshots
    assert verified(paths[1]).snapshots == 2


def cut_off(saved: Any) -> bytes:
    return CODEC.encode(saved)[:-3]


def other_runways(saved: Any) -> bytes:
    return CODEC.encode({**saved, "monitor": replace(saved["monitor"], runways=[])})


def a_radar_less(saved: Any) -> bytes:
    return CODEC.encode({**saved, "tracker": {**saved["tracker"], "clocks": []}})


@pytest.mark.parametrize("damage", [cut_off, other_runways, a_radar_less])
@pytest.mark.parametrize("since", [None, T0 + 12.0])
def test_a_state_that_cannot_be_used_for_other_reasons_is_an_error(
    day: Path, tmp_path: Path, damage: Callable[[Any], bytes], since: float | None
) -> None:
    path = rewritten(day, tmp_path / "a.mcap", lambda one: damage(decoded(one)) if one.topic == SNAPSHOT else one.data)
    with pytest.raises(JournalError, match="the snapshot at 2023-11-14T22:13:"):
        compare(open_journal(path), (), since)


def replay(*words: Any) -> tuple[int, str, str]:
    done = CliRunner().invoke(app, ["replay", *map(str, words)], env={"COLUMNS": "400"})
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    return done.exit_code, done.stdout, done.stderr


def test_the_command_says_it_in_a_sentence_and_counts_it(older_day: Path, day: Path, tmp_path: Path) -> None:
    status, told, wrong = replay(older_day, "--headless", "--json", tmp_path / "a.json")
    assert (status, wrong) == (0, "")
    sentences = [one for one in told.splitlines() if "begins there with an empty engine." in one]
    assert len(sentences) == 1
    assert "[" not in sentences[0]
    found = json.loads((tmp_path / "a.json").read_text())
    assert (found["begun_empty"], found["notes"]) == (1, sentences)
    assert found["pictures"] > 100
    assert {row["name"] for row in found["rows"]} >= {"tracks in a picture", "alerts raised"}
    status, told, _ = replay(older_day, "--headless", "--verify", "--json", tmp_path / "b.json")
    assert status == 0
    assert sentences[0] in told
    assert told.strip().endswith("identical")
    found = json.loads((tmp_path / "b.json").read_text())
    assert (found["begun_empty"], found["difference"], found["runs"]) == (1, None, 1)
    assert "empty engine" not in replay(day, "--headless", "--json", tmp_path / "c.json")[1]
    assert json.loads((tmp_path / "c.json").read_text())["begun_empty"] == 0


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--json", "a.json"), "--json goes with --headless"),
        (("--headless", "--json", "/no/where/a.json"), "folder"),
    ],
)
def test_where_json_cannot_go_is_said(day: Path, words: tuple[str, ...], told: str) -> None:
    status, _, wrong = replay(day, *words)
    assert status == 2
    assert told in wrong


def test_the_displays_seek_in_it_and_the_replay_says_how_it_began(older_day: Path) -> None:
    journal = open_journal(older_day)
    shown = [made for one in records(older_day) if one.topic == OUTPUT and (made := decoded(one)).time == made.time]
    wanted = next(one for one in shown if one.time > T0 + 25.0)
    player = JournalPlayer(journal, lambda run: run, (None, None))
    service = ReplayService(recorded_run(journal.files[0].attachments(), journal.name), player)
    player.steer(playing=False, time=T0 + 25.0)
    player.start()
    try:
        until(lambda: player.newest is not None, "the first picture")
        picture = player.newest
        assert picture is not None
        assert abs(picture.time - wanted.time) < 0.4
        before = next(one for one in shown if one.time == picture.time)
        assert picture.tracks.id.tolist() == before.tracks.id.tolist()
        state = service.sensors()[-1]
        assert state.status == "ok"
        assert "begins there with an empty engine" in state.detail
    finally:
        player.stop()
