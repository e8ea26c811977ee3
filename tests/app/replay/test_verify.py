"""A journal run again gives the same bits, whatever happened on that day; where one bit differs, the place is told."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.journal.export import export
from app.journal.names import JournalError
from app.journal.reader import Record, open_journal
from app.replay.verify import Verification, verify
from app.settings import ROOT
from pipeline.engine_records import CODEC, INPUT, OUTPUT, SNAPSHOT, Shown
from pipeline.inputs import Envelope, SetRunway
from pipeline.tables import NodeEvents, SectorPlots, Tracks
from pipeline.track.tracker import Tracker
from tests.app.replay.recording import (
    Recording,
    clock_step,
    decoded,
    eventful,
    record,
    records,
    rewritten,
    shifted,
)
from tests.pipeline.track.scene import T0
from tests.support.engines import minute


def verified(path: Path, **words: Any) -> Verification:
    return verify(open_journal(path), **words)


@pytest.fixture(scope="module")
def day(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An eventful journal; tests only read it."""
    return record(tmp_path_factory.mktemp("day"), eventful())


def test_an_eventful_day_is_identical(day: Path) -> None:
    found = verified(day)
    assert found.difference is None
    inputs = eventful()
    assert found.inputs == len(inputs)
    assert found.pictures > len(inputs) * 0.8
    assert found.columns == found.pictures * len(Tracks.columns())
    assert found.changes > 50, "no alerts: nothing was tried"
    assert found.snapshots == 4
    assert (found.runs, found.gaps, found.failures) == (1, 0, 0)
    assert (found.first, found.last) == (inputs[0].arrival, max(one.arrival for one in inputs[-3:]))
    refused = [made.refused for one in records(day) if one.topic == OUTPUT and (made := decoded(one)).refused]
    assert len(refused) == 3, "operators were refused three times"


def test_the_clock_of_the_host_is_set_back_and_forward(tmp_path: Path) -> None:
    made = Recording(tmp_path)
    made.feed(minute(scans=10))
    for step in (-300.0, 7000.0):
        at = made.recorder._arrival + step
        made.feed(clock_step(step, at))
        made.feed(shifted(minute(scans=22), at - T0 - 10.0)[135:])
    made.close()
    found = verified(tmp_path)
    assert found.difference is None
    assert found.inputs > 250
    assert found.snapshots > 2


def test_inputs_that_the_engine_raises_on_are_passed_over_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    right = Tracker.node_events

    def wrong(self: Tracker, events: NodeEvents) -> NodeEvents:
        taken = right(self, events)  # it is half done already
        if (events.speed == 13.0).any():
            raise ZeroDivisionError
        return taken

    monkeypatch.setattr(Tracker, "node_events", wrong)
    made = Recording(tmp_path)
    envelopes = list(minute(scans=12))
    for place in (40, 100):
        arrival = envelopes[place].arrival
        envelopes.insert(place, Envelope(arrival, NodeEvents.build(1, time=arrival - 0.1, node=0, speed=13.0)))
    made.feed(envelopes)
    made.close()
    assert made.raised == 2
    found = verified(tmp_path)
    assert (found.difference, found.failures) == (None, 2)


def test_files_that_were_rotated_are_identical_together_and_each_by_itself(tmp_path: Path) -> None:
    made, envelopes = Recording(tmp_path), eventful(scans=24)
    for begin in range(0, len(envelopes), 100):
        if begin:
            made.rotate()
        made.feed(envelopes[begin : begin + 100])
    made.close()
    files = sorted(tmp_path.glob("*.mcap"))
    assert len(files) == 4
    whole = verified(tmp_path)
    assert (whole.difference, whole.inputs, whole.gaps, whole.runs) == (None, len(envelopes), 0, 1)
    alone = [verified(one) for one in files]
    assert [one.difference for one in alone] == [None] * 4
    assert sum(one.inputs for one in alone) == len(envelopes)
    assert sum(one.pictures for one in alone) == whole.pictures


def test_a_file_that_is_missing_between_two_is_a_gap(tmp_path: Path) -> None:
    made, envelopes = Recording(tmp_path), list(minute(scans=12))
    for begin in (0, 50, 100):
        if begin:
            made.rotate()
        made.feed(envelopes[begin : begin + 50])
    made.close()
    sorted(tmp_path.glob("*.mcap"))[1].unlink()
    found = verified(tmp_path)
    assert (found.difference, found.gaps, found.inputs) == (None, 1, 100)


def two_runs(folder: Path) -> tuple[float, float]:
    """The service is restarted with other settings after 12 turns. Times of the begin of both runs."""
    first = Recording(folder)
    first.feed(minute(scans=12))
    first.close()
    later = T0 + 100.0
    second = Recording(folder, begin=later, parts={"lifecycle": "m_of_n"})
    second.feed(shifted(eventful(scans=12), 100.0))
    second.close()
    return T0, later


def test_two_runs_with_other_settings_in_one_folder(tmp_path: Path) -> None:
    two_runs(tmp_path)
    found = verified(tmp_path)
    assert (found.difference, found.runs, found.gaps) == (None, 2, 0)
    assert found.inputs == len(list(minute(scans=12))) + len(eventful(scans=12))
    only = verified(tmp_path, since=T0 + 100.3)
    assert (only.difference, only.runs, only.inputs) == (None, 1, len(eventful(scans=12)))


@pytest.mark.parametrize(("since", "until"), [(0.3, None), (14.0, 30.0), (25.0, None), (None, 8.0), (39.5, 39.9)])
def test_a_part_of_the_day(day: Path, since: float | None, until: float | None) -> None:
    found = verified(day, since=None if since is None else T0 + since, until=None if until is None else T0 + until)
    assert found.difference is None
    assert found.pictures > 10
    snapshots = [one.time for one in records(day) if one.topic == SNAPSHOT]
    begin = snapshots[0] if since is None else max(one for one in snapshots if one <= T0 + since)
    end = T0 + (1000.0 if until is None else until)
    assert found.inputs == sum(begin <= one.arrival <= end for one in eventful())
    assert found.last is not None
    assert found.last <= end


def test_before_the_first_snapshot_nothing_can_be_replayed(day: Path) -> None:
    with pytest.raises(JournalError, match="no snapshot at or before"):
        verified(day, since=T0 - 5.0)


def test_an_exported_piece_is_identical_alone(day: Path, tmp_path: Path) -> None:
    piece = tmp_path / "incident.mcap"
    done = export(open_journal(day), T0 + 17.0, T0 + 28.0, piece)
    found = verified(piece)
    assert (found.difference, found.gaps) == (None, 0)
    assert found.inputs == sum(done.start <= one.arrival <= T0 + 28.0 for one in eventful()) > 100
    assert found.changes > 10


def test_an_exported_piece_over_a_restart_is_identical(tmp_path: Path) -> None:
    two_runs(tmp_path)
    piece = tmp_path / "piece.mcap"
    done = export(open_journal(tmp_path), T0 + 11.0, T0 + 106.0, piece)
    assert len(done.runs) == 2
    found = verified(piece)
    assert (found.difference, found.runs) == (None, 2)
    assert found.changes > 0


def test_a_gap_in_the_middle_is_passed_over_and_told(tmp_path: Path) -> None:
    made, envelopes = Recording(tmp_path), eventful(scans=24)
    made.feed(envelopes[:120])
    made.overflow(envelopes[120:180])
    made.feed(envelopes[180:])
    made.close()
    found = verified(tmp_path)
    assert (found.difference, found.gaps) == (None, 1)
    assert found.inputs == len(envelopes) - 60
    assert found.changes > 10


@pytest.mark.parametrize("part", [0.35, 0.6, 0.85])
def test_a_file_that_was_cut_off_is_identical_as_far_as_it_goes(tmp_path: Path, part: float) -> None:
    made = Recording(tmp_path / "whole")
    made.feed(eventful(scans=16))
    made.close()
    (file,) = (tmp_path / "whole").glob("*.mcap")
    octets = chunked_anew(file, tmp_path / "chunked.mcap").read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(octets[: int(len(octets) * part)])
    assert open_journal(cut).files[0].cut_off is not None
    found, whole = verified(cut), verified(file)
    assert found.difference is None
    assert 20 < found.inputs < whole.inputs


def chunked_anew(path: Path, target: Path) -> Path:
    """The same records in many chunks, which end between an input and what came of it, too."""
    from app.journal.output import JournalOutput

    (file,) = open_journal(path).files
    output = JournalOutput(target, chunk_bytes=10**9)
    output.begin_run(file.runs[0]["run"], 1, file.attachments(), T0)
    for number, one in enumerate(file.records()):
        output.add(one.topic, one.sequence, one.time, one.data)
        if number % 7 == 6:
            output.close_chunk()
    output.finish()
    return target


@pytest.mark.parametrize("seed", ["0", "1", "4711"])
def test_another_hash_seed_gives_the_same_bits(day: Path, seed: str) -> None:
    """Nothing may depend on the order of a set of words; the variables of another service do not matter either."""
    environment = {
        **os.environ, "PYTHONHASHSEED": seed, "AIRSIDE_PARTS__LIFECYCLE__NAME": "m_of_n",
        "AIRSIDE_RADARS": "[]", "AIRSIDE_AIRPORT": "LSZH", "AIRSIDE_DATA_DIR": "/nowhere",
    }  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-m", "app", "replay", str(day), "--headless", "--verify"],
        cwd=ROOT, env=environment, capture_output=True, text=True, timeout=200, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, ""), done.stdout + done.stderr
    assert done.stdout.splitlines()[-1] == "identical"
    assert f"{len(eventful())} inputs" in done.stdout


def with_one_bit(array: np.ndarray[Any, Any], place: tuple[int, ...]) -> np.ndarray[Any, Any]:
    """The array with the least bit of one number turned over."""
    made = array.copy()
    octets = made[place[0] :][:1].view(np.uint8) if len(place) == 1 else made[place[:-1]].view(np.uint8)
    octets.reshape(-1)[made.itemsize * (place[-1] if len(place) > 1 else 0)] ^= 1
    return made


def flipped(day: Path, tmp_path: Path, topic: str, change: Callable[[Any], Any], nth: int) -> tuple[Path, Record]:
    """The journal with the nth record of a topic to which `change` applies (does not give None) changed by it."""
    hit: list[Record] = []
    seen = 0

    def one(record: Record) -> bytes:
        nonlocal seen
        if record.topic != topic or hit:
            return record.data
        made = change(decoded(record))
        seen += made is not None
        if made is None or seen <= nth:
            return record.data
        hit.append(record)
        return CODEC.encode(made)

    path = rewritten(day, tmp_path / "flipped.mcap", one)
    assert hit, "nothing was changed"
    return path, hit[0]


def test_a_copy_without_a_change_is_identical(day: Path, tmp_path: Path) -> None:
    assert verified(rewritten(day, tmp_path / "copy.mcap", lambda one: one.data)).difference is None


def test_one_bit_of_one_recorded_state_is_told_with_its_place(day: Path, tmp_path: Path) -> None:
    def flip(made: Shown) -> Shown | None:
        if len(made.tracks) < 3:
            return None
        return replace(made, tracks=made.tracks.replace(state=with_one_bit(made.tracks.state, (2, 1))))

    path, hit = flipped(day, tmp_path, OUTPUT, flip, 100)
    found = verified(path)
    assert found.difference is not None
    assert f"input {hit.sequence - 1} " in found.difference
    when = f"{hit.time % 60:06.3f}Z"
    assert when in found.difference
    assert "tracks" in found.difference
    assert "state" in found.difference
    assert "[2" in found.difference or "row 2" in found.difference, found.difference


@pytest.mark.parametrize("column", [name for name in Tracks.columns() if name not in ("state", "covariance")])
def test_one_bit_of_any_column_is_told(day: Path, tmp_path: Path, column: str) -> None:
    def flip(made: Shown) -> Shown | None:
        if len(made.tracks) < 2:
            return None
        values = getattr(made.tracks, column)
        if values.dtype == bool:
            changed = values.copy()
            changed[1] = not changed[1]
        elif values.dtype.kind == "U":
            changed = values.copy()
            changed[1] = "x"
        else:
            changed = with_one_bit(values, (1,))
        return replace(made, tracks=made.tracks.replace(**{column: changed}))

    path, _ = flipped(day, tmp_path, OUTPUT, flip, 40)
    found = verified(path, until=T0 + 12.0)
    assert found.difference is not None
    assert column in found.difference


def test_a_changed_alert_is_told(day: Path, tmp_path: Path) -> None:
    def flip(made: Shown) -> Shown | None:
        if not made.changes:
            return None
        return replace(made, changes=(replace(made.changes[0], time=np.nextafter(made.changes[0].time, 0)),))

    path, hit = flipped(day, tmp_path, OUTPUT, flip, 3)
    difference = verified(path).difference
    assert difference is not None
    assert f"input {hit.sequence - 1} " in difference
    assert "changes" in difference
    assert "time" in difference


def test_one_bit_of_one_input_is_told_at_the_first_picture_that_shows_it(day: Path, tmp_path: Path) -> None:
    def flip(made: Envelope) -> Envelope | None:
        body = made.body
        if not isinstance(body, SectorPlots) or made.arrival < T0 + 15 or not (body.plots.length > 30).any():
            return None
        row = int(np.flatnonzero(body.plots.length > 30)[0])
        return replace(made, body=replace(body, plots=body.plots.replace(east=with_one_bit(body.plots.east, (row,)))))

    path, hit = flipped(day, tmp_path, INPUT, flip, 0)
    found = verified(path)
    assert found.difference is not None
    assert found.last is not None
    assert hit.time <= found.last < hit.time + 2.0
    assert "tracks" in found.difference or "snapshot" in found.difference


def test_a_command_that_was_left_out_is_told(day: Path, tmp_path: Path) -> None:
    def other(made: Envelope) -> Envelope | None:
        return replace(made, body=SetRunway("06/24", open=True)) if isinstance(made.body, SetRunway) else None

    path, hit = flipped(day, tmp_path, INPUT, other, 0)
    difference = verified(path).difference
    assert difference is not None
    assert difference.startswith(f"input {hit.sequence} (SetRunway)")


def test_one_bit_of_a_snapshot_is_told(day: Path, tmp_path: Path) -> None:
    def flip(made: Any) -> Any:
        engine = made["engine"]
        return {**made, "engine": replace(engine, looked=np.nextafter(engine.looked, 0).item())}

    path, hit = flipped(day, tmp_path, SNAPSHOT, flip, 1)
    difference = verified(path).difference
    assert difference is not None
    assert difference.startswith(f"snapshot {hit.sequence} at ")
    assert "looked" in difference


def test_an_output_that_is_missing_and_one_too_many_are_told(day: Path, tmp_path: Path) -> None:
    all_of_it = records(day)
    silent = next(
        place for place, one in enumerate(all_of_it[:-1])
        if one.topic == INPUT and all_of_it[place + 1].topic == INPUT and place > 20
    )  # fmt: skip
    one_output = next(one for one in all_of_it if one.topic == OUTPUT)
    sequence = 0

    def renumbered(record: Record, more: bool) -> list[tuple[Record, bytes]]:
        made = [(record, record.data)]
        if more and record.sequence == all_of_it[silent].sequence:
            made.append((one_output, one_output.data))
        if not more and record.topic == OUTPUT and record.sequence > 300:
            made = []
        return made

    from app.journal.output import JournalOutput

    for more, word in ((True, "only the recorded engine"), (False, "only the replayed engine")):
        (file,) = open_journal(day).files
        output = JournalOutput(tmp_path / f"{more}.mcap")
        output.begin_run(file.runs[0]["run"], 1, file.attachments(), T0)
        sequence = 0
        for one in all_of_it:
            for kind, data in renumbered(one, more):
                output.add(kind.topic, sequence, one.time, data)
                sequence += 1
        output.finish()
        difference = verified(tmp_path / f"{more}.mcap").difference
        assert difference is not None
        assert word in difference


def test_a_record_of_another_kind_is_an_error_with_its_place(day: Path, tmp_path: Path) -> None:
    for topic, wanted in ((INPUT, "Envelope"), (OUTPUT, "Shown")):
        path, _ = flipped(day, tmp_path, topic, lambda made: {"a": 1}, 10)
        with pytest.raises(JournalError, match=f"the {topic} at .*: it is a dict, where a {wanted}"):
            verified(path)
        path.unlink()
    broken = rewritten(day, tmp_path / "b.mcap", lambda one: one.data[:-3] if one.topic == OUTPUT else one.data)
    with pytest.raises(JournalError, match="the output at"):
        verified(broken)


def test_a_folder_of_two_days_is_ordered_whatever_the_files_are_called_elsewhere(tmp_path: Path) -> None:
    two_runs(tmp_path)
    copies = tmp_path / "copies"
    copies.mkdir()
    for one in sorted(tmp_path.glob("*.mcap"), reverse=True):
        shutil.copy(one, copies / one.name)
    assert verified(copies).difference is None
