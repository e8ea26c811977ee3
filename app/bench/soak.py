"""Hours of the demonstration as fast as the machine can, to see whether memory stays flat.

The same minute of radar video comes again and again, with the time going on: tracks are born and end at every seam.
Everything that remembers is there: chain, tracker, alerts, store and feed.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.airports import load_airport
from app.assembly import node_site, radar_chain, radar_site, surface_engine
from app.demo import demo_settings
from app.demo.scene import demo_world
from app.live.hub import Hub
from app.service import SurfaceService
from app.settings import Settings, load
from app.store.store import Store
from pipeline.lab.measure.picture_quality import QualityRow
from pipeline.lab.simulate.reports import ReportSimulator
from pipeline.lab.simulate.video import VideoSimulator
from pipeline.tables import Sweeps

BLOCKS = 32


@dataclass(frozen=True, slots=True)
class Soak:
    """Resident memory by the minute of simulated time, and how much faster than the clock it went."""

    minutes: int
    speed: float
    resident_mib: tuple[float, ...]

    @property
    def growth_mib(self) -> float:
        """From a tenth of the way (all is warm) to the end."""
        return self.resident_mib[-1] - self.resident_mib[len(self.resident_mib) // 10]

    def rows(self) -> list[QualityRow]:
        """The figures; none has a bound."""
        return [
            QualityRow("simulated time over real time", self.speed, "times", note=f"{self.minutes} minutes"),
            QualityRow("memory at the end", self.resident_mib[-1], "MiB"),
            QualityRow("growth of memory since a tenth of the way", self.growth_mib, "MiB"),
        ]


def soak(minutes: int, folder: Path, progress: Callable[[int], None], turns: int = 60) -> Soak:
    """Run `minutes` of simulated time. folder: takes the database. progress: hears the minutes done."""
    settings = demo_settings(load()).model_copy(update={"data_dir": folder})
    start = time.time()
    airport, document = load_airport(settings.airport)
    sites = tuple(radar_site(one, airport) for one in settings.radars)
    nodes = tuple(node_site(one, airport) for one in settings.nodes)
    chain = radar_chain(sites[0], 0, settings, airport)
    engine = surface_engine(settings, airport, sites, nodes)
    store = Store(settings.database, settings, airport)
    hub = Hub(SurfaceService(settings, airport, document), settings)
    world = demo_world(settings, start)
    reports = ReportSimulator(settings.demo.seed)
    video = _video(settings, turns, start)
    store.start()
    resident, begun = [], time.monotonic()
    for scan in range(minutes * 60):
        for block in _blocks(video[scan % turns], scan, start):
            engine.sector(chain.process(block))
        loop = scan % turns
        taken = reports.reports(start + loop, start + loop + 1, world.truth)
        engine.target_reports(taken.replace(time=taken.time + (scan - loop)))
        picture, changes = engine.look()
        store.record(picture, changes)
        hub.publish(picture, changes)
        if scan % 60 == 59:
            resident.append(_resident_mib())
            progress(scan // 60 + 1)
    took = time.monotonic() - begun
    store.stop()
    return Soak(minutes, minutes * 60 / took, tuple(resident))


def _video(settings: Settings, turns: int, start: float) -> list[np.ndarray]:
    world = demo_world(settings, start)
    site = radar_site(settings.radars[0], world.airport)
    simulator = VideoSimulator(world.airport, site, settings.demo.seed, start=start)
    return [simulator.sweeps(scan, 0, site.video.azimuths, world.truth) for scan in range(turns)]


def _blocks(amplitude: np.ndarray, scan: int, start: float) -> Iterator[Sweeps]:
    azimuths = len(amplitude)
    row = np.arange(azimuths, dtype=np.int32)
    time_of = start + scan + (row + 0.5) / azimuths
    azimuth = (row + 0.5) * 2 * np.pi / azimuths
    height = azimuths // BLOCKS
    for first in range(0, azimuths, height):
        cut = slice(first, first + height)
        last = first + height >= azimuths
        yield Sweeps(0, scan, row[cut], azimuth[cut], time_of[cut], amplitude[cut], last)


def _resident_mib() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20
