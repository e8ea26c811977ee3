"""The journal of the running service: raw sweeps run detection again, parts change, the disk fills, secrets stay."""

from __future__ import annotations

import errno
import json
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import app.journal.output as output_module
from app.ingest.octets import encode_sweeps
from app.journal.reader import Record, open_journal
from app.journal.recorder import SETTINGS_FILE
from app.journal.video import VideoRecorder
from app.replay.compare import compare
from app.replay.recorded import recorded_run
from app.replay.verify import ReplayEngine, verify
from app.replay.video import VideoReplay
from app.runtime.host_clock import HostClock
from app.service import SurfaceService
from app.settings import JournalSettings, PartSettings, PartsSettings, RadarSettings, SettingsError
from pipeline.bearing.moments import Moments
from pipeline.engine_records import CHAIN, CODEC, INPUT, SNAPSHOT, SWEEPS, ChainBlock
from pipeline.inputs import Envelope, PartsChanged
from pipeline.picture import Picture, SensorState
from pipeline.tables import Plots, SectorPlots, Sweeps
from tests.app.replay.recording import airport, decoded, document, records, rewritten, settings
from tests.app.runtime.small_radar import AZIMUTHS, RANGES, T0, VIDEO, small_chain, small_site, turn
from tests.support.older_forms import with_32_marks, without_marks
from tests.support.running import until

SMALL = RadarSettings(
    id="smr-1", latitude=48.72, longitude=2.38, azimuths=AZIMUTHS, ranges=RANGES, range_step_m=VIDEO.range_step_m,
    blocks_per_scan=8, udp=None,
)  # fmt: skip
HYBRID = PartsSettings(detect=PartSettings(name="hybrid"), extract=PartSettings(name="manhattan"))
STARTED: list[SurfaceService] = []


class Recorded:
    """A service with a small radar and a journal. Its clock goes with the turns."""

    def __init__(self, folder: Path, journal: dict[str, Any] | None = None, **values: Any) -> None:
        self.folder = folder / "journal"
        self.now = T0
        chosen = JournalSettings(**{"folder": self.folder, "sweeps": True, "snapshot_every_s": 1.0, **(journal or {})})
        made = settings(radars=(SMALL,), data_dir=folder / "data", journal=chosen, **{"parts": HYBRID, **values})
        self.service = SurfaceService(made, airport(), document(), HostClock(lambda: self.now, lambda: self.now))
        self.service.prepare()
        STARTED.append(self.service)
        self.service.start()
        until(lambda: self.service.picture() is not None, "the first picture")
        self.scan = 0

    def turns(self, many: int) -> None:
        for _ in range(many):
            for block in turn(self.scan):
                self.now = float(block.time[-1])
                self.service.submit_sweeps("smr-1", encode_sweeps(block, small_site()))
                until(lambda: not len(self.worker.queue), "the block is taken")
            self.scan += 1
            until(lambda: self.sensor("smr-1").counters["sweeps"] == self.scan * AZIMUTHS, "the turn is worked on")
            picture = self.now - 0.3
            until(lambda picture=picture: self.picture().time > picture, "the picture shows it")

    @property
    def worker(self) -> Any:
        return self.service._workers["smr-1"]

    def picture(self) -> Picture:
        found = self.service.picture()
        assert found is not None
        return found

    def sensor(self, id: str) -> SensorState:
        return next(one for one in self.service.sensors() if one.id == id)

    def stop(self) -> Path:
        self.service.stop()
        return self.folder


@pytest.fixture(autouse=True)
def all_end() -> Iterator[None]:
    yield
    while STARTED:
        STARTED.pop().stop()


@pytest.fixture(scope="module")
def day(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """12 turns with raw sweeps; after 6 of them another extractor takes over, and later another detector."""
    made = Recorded(tmp_path_factory.mktemp("sweeps"))
    made.turns(5)
    made.service.choose_parts("smr-1", {"extract": {"name": "manhattan", "min_cells": 3}})
    made.turns(3)
    made.service.choose_parts("smr-1", {"detect": {"name": "ca"}})
    made.turns(4)
    assert made.worker.successions == 2, "the parts have not changed"
    assert len(made.picture().tracks) >= 3
    return made.stop()


def test_detection_runs_again_and_is_identical_across_a_change_of_parts(day: Path) -> None:
    found = verify(open_journal(day))
    assert found.difference is None
    assert found.sectors > 60
    assert found.pictures > 60
    bodies = [made.body for one in records(day) if one.topic == INPUT and (made := decoded(one))]
    assert sum(isinstance(one, SectorPlots) and len(one.plots) > 0 for one in bodies) > 10
    changes = [one for one in bodies if isinstance(one, PartsChanged)]
    assert [one.parts["extract"]["name"] for one in changes] == ["manhattan", "manhattan"]
    assert changes[-1].parts["detect"]["name"] == "ca"


def test_a_part_of_it_is_identical_too(day: Path) -> None:
    found = verify(open_journal(day), since=T0 + 7.0, until=T0 + 11.0)
    assert found.difference is None
    assert found.sectors > 15


@pytest.mark.parametrize("older_form", [without_marks, with_32_marks])
def test_a_journal_with_no_marks_or_32_a_turn_is_compared(
    day: Path, tmp_path: Path, older_form: Callable[[Envelope], bytes]
) -> None:
    (file,) = day.glob("*.mcap")

    def older(one: Any) -> bytes:
        made = decoded(one) if one.topic == INPUT else None
        return older_form(made) if made is not None and isinstance(made.body, SectorPlots) else one.data

    assert any(len(made.body.mark) for one in records(day) if isinstance((made := decoded(one)), Envelope)
               and isinstance(made.body, SectorPlots))  # fmt: skip
    replay = ReplayEngine(open_journal(rewritten(file, tmp_path / "a.mcap", older)))
    for one in replay.replayed():
        if isinstance(one, Record) and one.topic == SNAPSHOT and replay.lost:
            replay.restore(one)
        assert replay.detection_difference is None
    assert replay.counts.sectors > 60


def test_one_mark_is_told(day: Path, tmp_path: Path) -> None:
    (file,) = day.glob("*.mcap")
    hit: list[float] = []

    def change(one: Any) -> bytes:
        made = decoded(one) if one.topic == INPUT else None
        if hit or made is None or not isinstance(made.body, SectorPlots) or not len(made.body.mark):
            return one.data
        hit.append(one.time)
        return CODEC.encode(replace(made, body=replace(made.body, mark=made.body.mark[:0])))

    found = verify(open_journal(rewritten(file, tmp_path / "a.mcap", change)))
    assert found.difference is not None
    assert found.difference.startswith("plots at 2023-11-14T22:13:2")
    assert "mark" in found.difference


def test_one_cell_of_the_video_is_told(day: Path, tmp_path: Path) -> None:
    (file,) = day.glob("*.mcap")
    hit: list[float] = []

    def change(one: Any) -> bytes:
        if one.topic != SWEEPS or hit or one.time < T0 + 4.0:
            return one.data
        made = decoded(one)
        amplitude = made.block.amplitude.copy()
        if amplitude.max() < 180:
            return one.data
        amplitude[amplitude == 180] += 8
        hit.append(one.time)
        return CODEC.encode(ChainBlock(replace(made.block, amplitude=amplitude), made.expected))

    found = verify(open_journal(rewritten(file, tmp_path / "a.mcap", change)))
    assert found.difference is not None
    assert found.difference.startswith("plots at 2023-11-14T22:13:2")
    assert "plots." in found.difference


@pytest.mark.parametrize(
    "order", ["parts.detect.name=ca", "parts.detect.pfa=1e-2", "parts.extract=hysteresis", "parts.extract.min_cells=40"]
)
def test_other_parts_of_the_chain_change_the_picture(tmp_path: Path, order: str) -> None:
    made = Recorded(tmp_path)
    made.turns(14)
    assert len(made.picture().tracks) >= 3
    journal = open_journal(made.stop())
    same = compare(journal, ()).pictures
    assert [(one.recorded, one.replayed) for one in same.figures() if one.recorded != one.replayed] == []
    other = compare(journal, (order,)).pictures
    assert other.pictures == same.pictures
    changed = {one.name for one in other.figures() if one.recorded != one.replayed}
    assert changed, "the order has no effect"
    only = compare(journal, ("parts.detect.name=hybrid",)).pictures
    assert {one.name for one in only.figures() if one.recorded != one.replayed} <= {"same target, distance, 95 %"}


def test_after_a_gap_in_the_sweeps_detection_goes_on_from_the_next_state(tmp_path: Path) -> None:
    made = Recorded(tmp_path)
    made.turns(4)
    writer = made.service.journal
    assert writer is not None
    limits = writer._limits
    writer._limits = replace(limits, queue_records=0)
    made.turns(2)
    writer._limits = limits
    until(lambda: made.sensor("journal").status == "ok", "a snapshot ends the gap")
    made.turns(4)
    found = verify(open_journal(made.stop()))
    assert (found.difference, found.gaps) == (None, 1)
    assert found.sectors > 35


@pytest.mark.parametrize("own", [frozenset(), frozenset({"extract"})])
def test_where_records_are_missing_a_recorded_chain_waits_for_its_next_state(day: Path, own: frozenset[str]) -> None:
    journal = open_journal(day)
    run = recorded_run(journal.files[0].attachments(), "day")
    taken = [one for one in journal.records() if one.topic in (CHAIN, SWEEPS)]
    video = VideoReplay(run, own)
    assert [one.topic for one in taken[:4]] == [CHAIN, SWEEPS, SWEEPS, SWEEPS]

    def sector(block: Sweeps) -> SectorPlots | None:
        time = float(block.time[-1])
        return video.sector(SectorPlots(0, block.scan, time, 0, 0, Plots.empty()))

    for one in taken[:3]:
        video.take(one)
    assert sector(decoded(taken[1]).block) is not None
    video.forget()
    assert sector(decoded(taken[2]).block) is None
    video.take(taken[3])
    assert (sector(decoded(taken[3]).block) is None) == (not own)


def test_without_sweeps_another_detector_is_refused(tmp_path: Path) -> None:
    made = Recorded(tmp_path, {"sweeps": False})
    made.turns(2)
    journal = open_journal(made.stop())
    assert not {SWEEPS, CHAIN} & journal.topics()
    with pytest.raises(SettingsError, match="these were not recorded"):
        compare(journal, ("parts.detect=ca",))
    found = verify(journal)
    assert (found.difference, found.sectors) == (None, 0)
    assert found.pictures > 10


def test_secrets_do_not_get_into_the_journal(tmp_path: Path) -> None:
    secret = "hunter2-and-more"
    made = Recorded(
        tmp_path, {"sweeps": False}, bus_url=f"nats://me:{secret}@bus:4222",
        mqtt={"url": f"mqtt://me:{secret}@broker"}, database_url=f"postgresql+psycopg://a:{secret}@db/x",
    )  # fmt: skip
    made.turns(1)
    (file,) = made.stop().glob("*.mcap")
    assert secret.encode() not in file.read_bytes()
    attached = open_journal(file).files[0].attachments()
    assert all(secret.encode() not in one for one in attached.values())
    told = json.loads(attached[SETTINGS_FILE])
    assert told["bus_url"] == "nats://***@bus:4222"
    assert verify(open_journal(file)).difference is None


def test_a_full_disk_stops_the_journal_visibly_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = Recorded(tmp_path)
    made.turns(2)
    assert (made.sensor("journal").status, made.sensor("journal").detail) == ("ok", "")

    def full(file: int, data: Any) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(output_module.os, "write", full)
    until(lambda: made.sensor("journal").status != "ok", "the journal has stopped")
    state = made.sensor("journal")
    assert state.status == "silent"
    assert "has stopped" in state.detail
    assert "No space left on device" in state.detail
    before = made.picture().time
    made.turns(10)
    assert made.picture().time > before + 9.0
    assert len(made.picture().tracks) >= 3
    shown = next(one for one in made.picture().sensors if one.id == "journal")
    assert "No space left" in shown.detail, "the displays see it"
    made.service.set_runway("06/24", open=False, in_use=None, visibility=None)
    until(lambda: not made.picture().runways[0].open, "the command is carried out")
    assert made.service._surface is not None
    assert (made.service._surface.failures, made.worker.failures) == (0, 0)
    assert made.sensor("journal").counters["dropped"] > 50
    monkeypatch.undo()
    folder = made.stop()
    found = verify(open_journal(folder))
    assert found.difference is None
    assert found.pictures > 0


def test_the_memory_of_a_block_may_be_used_again_at_once() -> None:
    """Records are encoded later, in another thread, when the receiver has long put other sweeps there."""
    waiting: list[tuple[str, Any]] = []

    class Writer:
        snapshots_taken = 1

        def put(self, topic: str, _time: float, encode: Any, size: int | None = None) -> None:
            waiting.append((topic, encode))

    recorder, chain = VideoRecorder(Writer(), time.time), small_chain(bearing=Moments())  # type: ignore[arg-type]
    block = next(turn(3))
    same = Sweeps(**{name: np.copy(value) if isinstance(value := getattr(block, name), np.ndarray) else value
                     for name in Sweeps.__dataclass_fields__})  # fmt: skip
    recorder.before(chain, block)
    chain.process(block)
    for array in (block.amplitude, block.row, block.time, block.azimuth):
        array[...] = 0
    chain.newest[...] = 0
    found = {topic: CODEC.decode(encode()) for topic, encode in waiting}
    assert found.keys() == {CHAIN, SWEEPS}
    for name in ("amplitude", "row", "time", "azimuth"):
        assert np.array_equal(getattr(found[SWEEPS].block, name), getattr(same, name)), name
