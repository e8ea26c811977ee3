"""What the journal costs: the demonstration's world with so many moving targets, with the journal and without it."""

from __future__ import annotations

import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.airports import load_airport
from app.assembly import node_site, radar_chain, radar_site, surface_engine
from app.demo.scene import demo_settings, demo_world
from app.journal.recorder import JournalRecorder
from app.settings import DemoSettings, JournalSettings, Settings
from pipeline.engine import SurfaceEngine
from pipeline.inputs import Envelope, Tick
from pipeline.lab.measure.picture_quality import QualityRow
from pipeline.lab.simulate.nodes import NodeSimulator
from pipeline.lab.simulate.reports import ReportSimulator
from pipeline.lab.simulate.video import VideoSimulator
from pipeline.picture import SensorState
from pipeline.tables import Sweeps

START = 1_700_000_000.0
"""UTC s at which the simulated world begins; any time does, but the same makes the same inputs."""

SETTLE_S = 30
"""Turns before the measurement: the detector learns, and tracks are confirmed."""

BLOCKS = 32
"""Sectors a turn, as a service cuts it."""

LATENCY_S = 0.05
"""From the last sweep of a sector to its arrival."""

MOST_SHARE, MOST_MB_S = 0.03, 1.0
"""What is wanted: of a core, and on disk without raw sweeps."""


@dataclass(frozen=True)
class JournalCost:
    """One run at the pace of the clock. without_us, with_us: processor time of the surface thread for one picture,
    without and with the journal. surface, writer: shares of a core, of what the journal adds to the surface thread and
    of the writer's thread. mb_s: on disk. dropped: records that found no room."""

    seconds: float
    targets: int
    tracks: float
    pictures: int
    without_us: float
    with_us: float
    surface: float
    writer: float
    mb_s: float
    dropped: int

    @property
    def share(self) -> float:
        """Of a core, in both threads together."""
        return self.surface + self.writer

    def rows(self) -> list[QualityRow]:
        """The figures, with the bounds that the journal has to keep."""
        return [
            QualityRow("surface thread, a picture, without", self.without_us, "us"),
            QualityRow("surface thread, a picture, with the journal", self.with_us, "us"),
            QualityRow("added to the surface thread", 100 * self.surface, "% of a core"),
            QualityRow("the writer's thread", 100 * self.writer, "% of a core"),
            QualityRow("both", 100 * self.share, "% of a core", 100 * MOST_SHARE),
            QualityRow("on disk", self.mb_s, "MB/s", MOST_MB_S),
            QualityRow("records dropped", self.dropped, "", 0),
        ]


@dataclass
class _Side:
    """An engine, and the processor time that it took."""

    engine: SurfaceEngine
    recorder: JournalRecorder | None = None
    spent: float = 0.0
    pictures: int = 0
    tracks: int = 0

    def step(self, envelope: Envelope) -> None:
        begin = time.thread_time()
        if self.recorder is not None:
            self.recorder.before(envelope, self.engine.save)
        outcome = self.engine.step(envelope)
        if self.recorder is not None:
            self.recorder.after(outcome)
            if outcome.picture is not None:
                self.recorder.sensors((SensorState("smr", "radar", "ok", envelope.arrival),))
        self.spent += time.thread_time() - begin
        if outcome.picture is not None:
            self.pictures += 1
            self.tracks += len(outcome.picture.tracks)


def measure_journal(
    seconds: int = 60,
    targets: int = 100,
    seed: int = 1,
    step: Callable[[str], None] = lambda _: None,
    folder: Path | None = None,
) -> JournalCost:
    """Run the same inputs through an engine with a journal and one without, in turns and at the pace of the clock.

    step: hears what is being done. folder: where the journal stays; a temporary one if none. The inputs are those that
    radar video, reports and nodes of `targets` simulated targets make; they are the same for the same seed.
    """
    settings = demo_settings(Settings(demo=DemoSettings(synthetic_targets=targets, seed=seed), view3d=False))
    step(f"simulating {SETTLE_S + seconds} turns of {targets} targets")
    turns = list(_turns(settings, SETTLE_S + seconds))
    world = demo_world(settings, START)
    sites = tuple(radar_site(one, world.airport) for one in settings.radars)
    nodes = tuple(node_site(one, world.airport) for one in settings.nodes)
    sides = [_Side(surface_engine(settings, world.airport, sites, nodes, clock=time.perf_counter)) for _ in range(2)]
    for side in sides:
        side.engine.tracker.warm()
        for envelope in (one for turn in turns[:SETTLE_S] for one in turn):
            side.step(envelope)
    with tempfile.TemporaryDirectory(prefix="airside-bench-") as temporary:
        step(f"running {seconds} s at the pace of the clock")
        recorder = JournalRecorder(
            settings, load_airport(settings.airport)[1], JournalSettings(folder=folder or Path(temporary))
        )
        thread = next(one for one in threading.enumerate() if one.name == "journal" and one.ident)
        clock = time.pthread_getcpuclockid(thread.ident or 0)
        sides[1].recorder = recorder
        for side in sides:
            side.spent, side.pictures, side.tracks = 0.0, 0, 0
        before = time.clock_gettime(clock)
        _run(sides, turns[SETTLE_S:])
        writing = time.clock_gettime(clock) - before
        recorder.close()
        counters = recorder.writer.state().counters
    without, with_journal = sides
    pictures = max(without.pictures, 1)
    return JournalCost(
        seconds=seconds,
        targets=targets,
        tracks=without.tracks / pictures,
        pictures=without.pictures,
        without_us=1e6 * without.spent / pictures,
        with_us=1e6 * with_journal.spent / pictures,
        surface=(with_journal.spent - without.spent) / seconds,
        writer=writing / seconds,
        mb_s=counters.octets / 1e6 / seconds,
        dropped=counters.dropped,
    )


def _run(sides: list[_Side], turns: list[list[Envelope]]) -> None:
    begun = time.monotonic()
    first = turns[0][0].arrival
    for number, envelope in enumerate(one for turn in turns for one in turn):
        wait = begun + envelope.arrival - first - time.monotonic()
        if wait > 0:
            time.sleep(wait)
        # who is first finds the caches cold
        for side in sides if number % 2 else reversed(sides):
            side.step(envelope)
    time.sleep(2.0)  # what waits is written, as it would be in a service that goes on


def _turns(settings: Settings, many: int) -> Iterator[list[Envelope]]:
    """Of each turn what enters the engine, in order."""
    world = demo_world(settings, START)
    site = radar_site(settings.radars[0], world.airport)
    chain = radar_chain(site, 0, settings, world.airport)
    seed, azimuths, period = settings.demo.seed, site.video.azimuths, site.video.period_s
    video = VideoSimulator(world.airport, site, seed, start=START)
    nodes = NodeSimulator(tuple(node_site(one, world.airport) for one in settings.nodes), seed)
    reports = ReportSimulator(seed)
    now = START
    for scan in range(many):
        made: list[Envelope] = []
        for block in range(BLOCKS):
            first, last = azimuths * block // BLOCKS, azimuths * (block + 1) // BLOCKS
            rows = np.arange(first, last, dtype=np.int32)
            at = (START + (scan + (rows + 0.5) / azimuths) * period).astype(np.float64)
            azimuth = ((rows + 0.5) * site.video.azimuth_step_rad).astype(np.float64)
            amplitude = video.sweeps(scan, first, last, world.truth)
            sector = chain.process(Sweeps(0, scan, rows, azimuth, at, amplitude, block == BLOCKS - 1))
            arrival = float(at[-1]) + LATENCY_S
            made.append(Envelope(arrival, sector))
            if block % 8 == 7:
                since, now = now, float(at[-1])
                events, heard = nodes.events(since, now, world.truth), reports.reports(since, now, world.truth)
                made += [Envelope(arrival, one) for one in (events, heard) if len(one)]
                made.append(Envelope(arrival, Tick()))
        yield made
