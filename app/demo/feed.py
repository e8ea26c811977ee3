"""The demonstration's feed: a thread that plays the world's part, in the world's time."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from app.contract import Refused
from app.demo.scene import demo_settings, demo_world
from app.demo.sender import DatagramSender
from app.settings import Settings, load
from pipeline.airport.model import Airport
from pipeline.asterix.cat240 import encode_sweeps
from pipeline.lab.simulate.nodes import NodeSimulator
from pipeline.lab.simulate.rain import shower
from pipeline.lab.simulate.reports import ReportSimulator
from pipeline.lab.simulate.video import SECTORS, VideoSimulator
from pipeline.lab.simulate.world import World
from pipeline.sites import NodeSite, RadarSite
from pipeline.tables import NodeEvents, TargetReports

log = logging.getLogger(__name__)

LIGHT = 299_792_458.0
SAC, SIC = 0, 1
LATE_S = 0.2
"""Video that is later than this is left out, so that the feed catches up."""
CHUNK_S = 0.25
"""Node events and reports are made for so long ahead and given out at their times."""


class Taker(Protocol):
    """What the feed needs of the service (see `app.contract.Service`)."""

    airport: Airport
    radars: tuple[RadarSite, ...]
    nodes: tuple[NodeSite, ...]

    def submit_node_events(self, events: NodeEvents) -> Any:
        """Take node events."""

    def submit_target_reports(self, reports: TargetReports) -> Any:
        """Take target reports."""


class VideoChannel:
    """Encodes the sweeps of one simulated radar as CAT240 datagrams and numbers them."""

    def __init__(self, video: VideoSimulator, world: World) -> None:
        self.video, self.world = video, world
        self.next_message = 0

    def sector(self, number: int) -> tuple[NDArray[np.uint8], NDArray[np.int32]]:
        """(datagrams, lengths) of the sector that is `number` 1/64 turns after the beginning."""
        site = self.video.site
        grid = site.video
        scan, part = divmod(number, SECTORS)
        height = -(-grid.azimuths // SECTORS)
        first, last = min(part * height, grid.azimuths), min((part + 1) * height, grid.azimuths)
        amplitude = self.video.sweeps(scan, first, last, self.world.truth)
        rows = np.arange(first, last, dtype=np.float64)
        begin: NDArray[np.float64] = rows * grid.azimuth_step_rad - site.north_offset
        times = self.video.start + (scan + (rows + 0.5) / grid.azimuths) * grid.period_s
        datagrams, lengths = encode_sweeps(
            amplitude,
            begin,
            begin + grid.azimuth_step_rad,
            np.mod(times, 86400.0),
            self.next_message,
            sac=SAC,
            sic=SIC,
            cell_duration_s=2 * grid.range_step_m / LIGHT,
            start_cell=round(grid.first_range_m / grid.range_step_m),
        )
        self.next_message = (self.next_message + len(lengths)) % 2**32
        return datagrams, lengths

    def load(self) -> None:
        """Make one sector for nobody: loading the kernels would make the first one that is sent seconds late."""
        before = self.next_message
        self.sector(0)
        self.next_message = before


class DemoFeed:
    """Sends video to the radar's port and submits events and reports, each when its time has come.

    port: where the first radar of the service listens. speed: seconds of the world in one second. When the machine does
    not keep up, video is left out and counted, not queued; events and reports are not left out.
    """

    def __init__(
        self,
        service: Taker,
        world: World,
        *,
        port: int,
        host: str = "127.0.0.1",
        seed: int = 1,
        rain: bool = False,
        reports: bool = True,
        speed: float = 1.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.service, self.world, self.speed = service, world, speed
        self._clock = clock
        self._address = (host, port)
        self._rain = rain
        self._nodes = NodeSimulator(service.nodes, seed)
        self._reports = ReportSimulator(seed) if reports else None
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._counters = dict.fromkeys(
            ("sectors_sent", "sectors_skipped", "datagrams_lost", "node_events", "target_reports", "refused"), 0
        )
        self._waiting_events: NodeEvents = NodeEvents.empty()
        self._waiting_reports: TargetReports = TargetReports.empty()
        rain_cells = shower(seed, world.start + 60.0) if rain else ()
        video = VideoSimulator(service.airport, service.radars[0], seed, start=world.start, rain=rain_cells)
        self._channel = VideoChannel(video, world)
        self._made_until = world.start

    def counters(self) -> dict[str, int]:
        """What was sent, left out and refused so far."""
        return dict(self._counters)

    def start(self) -> None:
        """Start the thread."""
        self._thread = threading.Thread(target=self._run, name="demo-feed", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread and wait for it."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(5.0)

    def _run(self) -> None:
        try:
            sender = DatagramSender(*self._address)
        except OSError:
            log.exception("the demonstration cannot send to %s:%d", *self._address)
            return
        try:
            self._play(sender)
        except Exception:
            log.exception("the demonstration's feed has died")
            self._counters["died"] = 1
        finally:
            sender.close()

    def _play(self, sender: DatagramSender) -> None:
        period = self._channel.video.site.video.period_s / SECTORS
        self._channel.load()
        # the world began when it was made: what has passed since is over
        behind = time.time() - self.world.start if self.speed == 1.0 else 0.0
        begun = self._clock() - max(behind, 0.0)
        number = max(int(behind / period), 0)
        self._made_until = self.world.start + number * period
        while not self._stop.is_set():
            due = begun + (number + 1) * period / self.speed
            wait = due - self._clock()
            if wait > 0 and self._stop.wait(wait):
                return
            late = (self._clock() - due) * self.speed
            if late > LATE_S:
                skipped = int(late / period)
                self._counters["sectors_skipped"] += skipped
                number += skipped
            sender.send(*self._channel.sector(number))
            self._counters["sectors_sent"] += 1
            self._counters["datagrams_lost"] = sender.lost
            number += 1
            self._hand_out(self.world.start + number * period)

    def _hand_out(self, now: float) -> None:
        """Submit every event and report whose time has come."""
        while self._made_until < now:
            since, until = self._made_until, self._made_until + CHUNK_S
            self._waiting_events = NodeEvents.concatenate(
                [self._waiting_events, self._nodes.events(since, until, self.world.truth)]
            )
            if self._reports is not None:
                made = self._reports.reports(since, until, self.world.truth)
                self._waiting_reports = TargetReports.concatenate([self._waiting_reports, made])
            self._made_until = until
        ready = self._waiting_events.time <= now
        if ready.any():
            events, self._waiting_events = self._waiting_events[ready], self._waiting_events[~ready]
            self._submit("node_events", len(events), lambda: self.service.submit_node_events(events))
        ready = self._waiting_reports.time <= now
        if ready.any():
            reports, self._waiting_reports = self._waiting_reports[ready], self._waiting_reports[~ready]
            self._submit("target_reports", len(reports), lambda: self.service.submit_target_reports(reports))

    def _submit(self, name: str, count: int, act: Callable[[], Any]) -> None:
        try:
            act()
            self._counters[name] += count
        except Refused:
            self._counters["refused"] += count


def demo_feed(service: Taker, settings: Settings) -> DemoFeed:
    """The feed of a service that runs on `demo_settings`; not started."""
    world = demo_world(settings, time.time())
    radar = service.radars[0]
    port = settings.radars[0].udp.port if settings.radars[0].udp is not None else settings.demo.udp_port
    listening = getattr(service, "video_port", None)
    if listening is not None:
        port = listening(radar.id)
    demo = settings.demo
    return DemoFeed(service, world, port=port, seed=demo.seed, rain=demo.rain, reports=demo.reports)


def warm() -> None:
    """Compile the simulator's kernels."""
    from app.assembly import radar_site

    settings = demo_settings(load())
    world = demo_world(settings, 0.0)
    video = VideoSimulator(world.airport, radar_site(settings.radars[0], world.airport), 1)
    VideoChannel(video, world).sector(0)
