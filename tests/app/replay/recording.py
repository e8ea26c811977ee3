"""Journals for the tests of replaying: traffic through the recorder, as the surface thread of a service hands it on."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from app.assembly import node_site, radar_site, surface_engine
from app.journal.output import JournalOutput
from app.journal.reader import Record, open_journal
from app.journal.recorder import JournalRecorder, attachments
from app.journal.writer import JournalLimits, JournalWriter
from app.settings import JournalSettings, NodeSettings, RadarSettings, RunwaySettings, Settings
from pipeline.airport.geojson import airport_from_geojson
from pipeline.airport.model import Airport
from pipeline.engine import SurfaceEngine
from pipeline.engine_records import CODEC
from pipeline.inputs import Acknowledge, ClockStep, Envelope, SensorHealth, SetRunway
from pipeline.picture import SensorState
from tests.pipeline.track.scene import T0
from tests.support.engines import minute
from tests.support.running import until
from tests.support.small_airport import FRAME, as_document, small_airport

RADAR = RadarSettings(id="smr", latitude=FRAME.latitude, longitude=FRAME.longitude, range_step_m=4.0, udp=None)
NODE = NodeSettings(id="N1", latitude=48.71826, longitude=2.35969, heading_deg=149.0, hold="hold-w1")
LIMITS = JournalLimits(max_file_bytes=10**9, max_file_age_s=1e9, max_total_bytes=10**10, snapshot_every_s=10.0)
SENSOR = SensorState("smr", "radar", "ok", T0)


def settings(**values: Any) -> Settings:
    """Those of the service that is recorded."""
    runway = RunwaySettings(id="06/24", in_use="06")
    return Settings(**{"radars": (RADAR,), "nodes": (NODE,), "runways": (runway,), "view3d": False, **values})


@lru_cache(1)
def document() -> dict[str, Any]:
    """The map."""
    return as_document(small_airport())


@lru_cache(1)
def airport() -> Airport:
    """The map as every service reads it."""
    return airport_from_geojson(document())


def engine_of(chosen: Settings) -> SurfaceEngine:
    """The engine of a service with these settings; it measures its own time, as that of a service does."""
    radars = tuple(radar_site(one, airport()) for one in chosen.radars)
    nodes = tuple(node_site(one, airport()) for one in chosen.nodes)
    return surface_engine(chosen, airport(), radars, nodes, first_alert=41, clock=time.perf_counter)


class Recording:
    """A recorder and an engine. Time of the journal goes with the arrivals, so that snapshots come when they would."""

    def __init__(self, folder: Path, limits: JournalLimits = LIMITS, begin: float = T0, **values: Any) -> None:
        self.settings = settings(**values)
        self.engine = engine_of(self.settings)
        self.now = begin
        self.raised = 0
        self.recorder = JournalRecorder(self.settings, document(), JournalSettings(folder=folder))
        self.recorder.writer.close()
        self.writer = self.recorder.writer = JournalWriter(
            folder, attachments(self.settings, document()), limits, clock=lambda: self.now, utc=lambda: begin
        )

    def feed(self, envelopes: Iterable[Envelope]) -> None:
        """As `SurfaceWorker` does it."""
        for one in envelopes:
            self.now = max(self.now, one.arrival)
            self.recorder.before(one, self.engine.save)
            try:
                outcome = self.engine.step(one)
            except Exception:
                self.raised += 1
                continue
            self.recorder.after(outcome)
            if outcome.picture is not None:
                self.recorder.sensors((SENSOR,))

    def rotate(self) -> None:
        """The next input begins another file."""
        taken = self.writer.snapshots_taken
        until(lambda: self.writer.state().counters.snapshots == taken, "the snapshots are written")
        self.writer._rotation_due = True
        self.now += 2.0
        assert self.writer.wants_snapshot

    def overflow(self, envelopes: Iterable[Envelope]) -> None:
        """These find the queue full."""
        taken, limits = self.writer.snapshots_taken, self.writer._limits
        until(lambda: self.writer.state().counters.snapshots == taken, "the snapshots are written")
        self.writer._limits = replace(limits, queue_records=0)
        self.feed(envelopes)
        self.writer._limits = limits
        self.now += 2.0
        assert self.writer.state().status == "degraded"

    def close(self) -> None:
        """Finish the file."""
        assert self.recorder.close()
        assert self.writer.state().status != "stopped", self.writer.state().detail


def record(folder: Path, envelopes: Iterable[Envelope], **values: Any) -> Path:
    """A journal of these inputs: its one file."""
    made = Recording(folder, **values)
    made.feed(envelopes)
    made.close()
    (file,) = folder.glob("*.mcap")
    return file


def eventful(scans: int = 40) -> list[Envelope]:
    """Traffic, with operators' commands (some refused), radars that are not well, and inputs that are no good."""
    envelopes = list(minute(scans=scans))
    bodies = {
        60: SetRunway("06/24", open=False),
        90: SetRunway("nowhere", open=True),
        110: SetRunway("06/24", open=True, visibility="low"),
        120: Acknowledge(41, "tower"),
        130: Acknowledge(4711, "tower"),
        150: SensorHealth(("smr",)),
        170: SensorHealth(()),
        200: SetRunway("06/24", in_use="33"),
    }
    for place, body in sorted(bodies.items(), reverse=True):
        if place >= len(envelopes):
            continue
        envelopes.insert(place, Envelope(envelopes[place].arrival, body))
    return envelopes


def shifted(envelopes: Iterable[Envelope], seconds: float) -> list[Envelope]:
    """The same, but so much later by all clocks."""

    def later(body: Any) -> Any:
        if hasattr(body, "plots"):
            mark_time = body.mark_time + seconds
            return replace(body, time=body.time + seconds, plots=later(body.plots), mark_time=mark_time)
        return body.replace(time=body.time + seconds) if hasattr(body, "columns") else body

    return [Envelope(one.arrival + seconds, later(one.body)) for one in envelopes]


def clock_step(seconds: float, at: float) -> list[Envelope]:
    """The host's clock is set, noticed at arrival `at` by the new clock."""
    return [Envelope(at, ClockStep(seconds))]


def records(path: Path) -> list[Record]:
    """All records of a journal."""
    return list(open_journal(path).records())


def rewritten(path: Path, target: Path, change: Callable[[Record], bytes | None], leave: Sequence[str] = ()) -> Path:
    """The same file, whole and with right sums, but with other records. change: the octets of each, None to leave it
    out. leave: attachments that are left out."""
    journal = open_journal(path)
    (file,) = journal.files
    output = JournalOutput(target)
    run = file.runs[0]
    kept = {name: data for name, data in file.attachments().items() if name not in leave}
    output.begin_run(run["run"], int(run["file"]), kept, T0)
    for one in journal.records():
        data = change(one)
        if data is not None:
            output.add(one.topic, one.sequence, one.time, data)
    output.finish()
    return target


def decoded(record: Record) -> Any:
    """What is in a record."""
    with contextlib.suppress(ValueError):
        return CODEC.decode(record.data)
    return None
