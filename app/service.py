"""The running service: what `app.contract.Service` promises, made of the threads of `app.runtime`."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any, Literal

from app.assembly import (
    FRONT_END,
    build_parts,
    chain_of,
    check_parts,
    node_site,
    radar_heard_at,
    radar_site,
    surface_engine,
)
from app.contract import (
    FrontEnd,
    PictureListener,
    Readiness,
    Refused,
    ReplayControl,
    Submitted,
    UnknownId,
    Video,
)
from app.ingest.octets import OctetIntake
from app.ingest.udp import VideoReceiver
from app.journal.recorder import JournalRecorder
from app.journal.video import VideoRecorder
from app.journal.writer import JournalWriter
from app.runtime.clocks import FeedTimes, RadarTimes
from app.runtime.compile_apart import CompilerApart
from app.runtime.feeds import Feed
from app.runtime.front_end import FrontEndSwitch
from app.runtime.host_clock import HostClock
from app.runtime.radar_worker import RadarWorker
from app.runtime.runway_memory import RunwayMemory
from app.runtime.state_keeper import StateKeeper
from app.runtime.surface_worker import SurfaceWorker
from app.settings import Settings
from pipeline.airport.model import Airport
from pipeline.airport.surfaces import surface_of_radar
from pipeline.chain import RadarChain
from pipeline.inputs import Acknowledge, Command, PartsChanged, SetRunway
from pipeline.picture import Alert, AlertChange, Picture, RunwayState, SensorState, Visibility
from pipeline.sites import RadarSite
from pipeline.tables import NodeEvents, Sweeps, TargetReports
from pipeline.track.expected_headings import expected_headings

log = logging.getLogger(__name__)


class SurfaceService:
    """One airport, running. Made cold; `prepare` warms it, `start` starts its threads, `stop` ends them.

    clock: of the time of arrival. Raises SettingsError when the settings name a part or a setting of one that does not
    exist.
    """

    def __init__(
        self, settings: Settings, airport: Airport, airport_geojson: dict[str, Any], clock: HostClock | None = None
    ) -> None:
        check_parts(settings)
        self.clock = clock if clock is not None else HostClock()
        self.settings = settings
        self.airport = airport
        self.airport_geojson = airport_geojson
        self.radars = tuple(radar_site(one, airport) for one in settings.radars)
        self.nodes = tuple(node_site(one, airport) for one in settings.nodes)
        self.replay: ReplayControl | None = None
        self.checks = {"database": False, "warm": False, "picture": False}
        self.extra_counters: dict[str, Callable[[], dict[str, int]]] = {}
        self.extra_sensors: list[Callable[[], SensorState | None]] = []
        self.keep_node_events: Callable[[NodeEvents], None] = lambda events: None
        self._workers: dict[str, RadarWorker] = {}
        self._switches: dict[str, FrontEndSwitch] = {}
        self._compiler = CompilerApart()
        self._keeper = StateKeeper(
            settings.data_dir / "state",
            _scene(settings),
            settings.storage.state_interval_s,
            settings.storage.state_max_age_s,
        )
        self._runways = RunwayMemory(settings.data_dir / "state", airport.icao, settings.mode)
        self._runway_orders = threading.Lock()
        self._receivers: dict[str, VideoReceiver] = {}
        self._surface: SurfaceWorker | None = None
        self._journal: JournalRecorder | None = None
        self._octets = {
            site.id: OctetIntake(site, index, radar.blocks_per_scan)
            for index, (site, radar) in enumerate(zip(self.radars, settings.radars, strict=True))
        }
        self._octets_lock = threading.Lock()
        self._radar_times = {
            site.id: RadarTimes(site, radar.clock, self.clock)
            for site, radar in zip(self.radars, settings.radars, strict=True)
        }
        event_times = FeedTimes("event", settings.clocks.nodes, [one.id for one in self.nodes])
        self._nodes = Feed("nodes", "node", event_times, all(node.simulated for node in self.nodes))
        self._reports = Feed("reports", "report", FeedTimes("report", settings.clocks.reports))

    def prepare(self, first_alert: int = 1, resume: bool = True) -> None:
        """Build the chains and the engine and compile every kernel. Raises SettingsError.

        resume: the detectors take up what they had learned before a restart, and the runways how they were set.
        """
        engine = surface_engine(
            self.settings, self.airport, self.radars, self.nodes, first_alert=first_alert, clock=time.perf_counter
        )
        engine.tracker.warm()
        if resume:
            self._runways.take_up([one.id for one in self.airport.runways], engine.monitor.set_runway)
        if self.settings.journal.folder is not None:
            self._journal = JournalRecorder(self.settings, self.airport_geojson, self.settings.journal)
            self.extra_sensors.append(self._journal.state)
        self._surface = SurfaceWorker(
            engine,
            self.sensors,
            self.settings.limits.rows_queued,
            self._stage_timings,
            self._expect,
            clock=self.clock,
            recorder=self._journal,
            impaired=self._impaired,
        )
        for index, (site, radar) in enumerate(zip(self.radars, self.settings.radars, strict=True)):
            ground = surface_of_radar(self.airport, site)
            chain = chain_of(site, index, build_parts(self.settings, FRONT_END), ground, time.perf_counter)
            chain.warm()
            if resume:
                self._keeper.take_up(chain)
            record = self._video_recorder()
            worker = RadarWorker(site, chain, self.settings.limits.blocks_queued, self._surface.offer, record)
            self._switches[site.id] = FrontEndSwitch(
                worker, index, ground, self._compiler, partial(self._parts_changed, site.id)
            )
            self._workers[site.id] = worker
            if radar.udp is not None:
                deliver = self._taker(worker)
                self._receivers[site.id] = VideoReceiver(
                    site, index, radar_heard_at(radar, self.settings.udp_address), deliver, self.clock
                )
        self.checks["warm"] = True

    def start(self) -> None:
        """Open the sockets and start the threads. Raises OSError when a port is taken."""
        surface = self._running
        surface.listen(self._look_at_picture)
        surface.start()
        for worker in self._workers.values():
            worker.start()
        for receiver in self._receivers.values():
            receiver.start()
        self._keeper.start(list(self._workers.values()))

    def stop(self) -> None:
        """Close the sockets, work off what waits, end the threads."""
        self._compiler.stop()
        for receiver in self._receivers.values():
            receiver.stop()
        for worker in self._workers.values():
            worker.stop()
        self._keeper.stop()
        if self._surface is not None:
            self._surface.stop()
        if self._journal is not None and not self._journal.close():
            log.error("the end of the journal could not be written in time")

    @property
    def journal(self) -> JournalWriter | None:
        """The journal; None when none is written, and before `prepare`."""
        return None if self._journal is None else self._journal.writer

    def video_port(self, radar: str) -> int:
        """The UDP port that a radar's datagrams go to. Raises UnknownId."""
        if radar not in self._receivers:
            raise UnknownId(radar)
        return self._receivers[radar].port

    def readiness(self) -> Readiness:
        """Which start-up checks are passed, and whether the threads still live."""
        threads = self._surface is not None and self._surface.alive and all(w.alive for w in self._workers.values())
        return Readiness({**self.checks, "threads": threads})

    def picture(self) -> Picture | None:
        """The newest picture."""
        return self._surface.newest if self._surface is not None else None

    def listen(self, listener: PictureListener) -> Callable[[], None]:
        """Call `listener` with every new picture."""
        return self._running.listen(listener)

    def sensors(self) -> tuple[SensorState, ...]:
        """The health of every radar, the pavement nodes, the target reports, the tracker and what else was added."""
        radars = tuple(self._radar_state(site) for site in self.radars)
        others = [self._nodes.state()] if self.nodes else []
        if self._reports.ever_tried:
            others.append(self._reports.state())
        others.append(self._surface_state())
        more = (one() for one in (self._runways.state, *self.extra_sensors))
        return (*radars, *others, *(one for one in more if one is not None))

    def video(self, radar: str) -> Video:
        """The newest turn of a radar."""
        if radar not in self._octets:
            raise UnknownId(radar)
        worker = self._workers.get(radar)
        if worker is None or worker.last_time is None:
            raise Refused(f"radar {radar} has not been heard yet")
        return Video(worker.site, worker.chain.newest, worker.last_time)

    def front_end(self, radar: str) -> FrontEnd:
        """What works on a radar's video."""
        return self._switch(radar).state()

    def choose_parts(self, radar: str, wanted: Mapping[str, Mapping[str, Any]]) -> FrontEnd:
        """Have other parts work on a radar's video."""
        return self._switch(radar).choose(wanted)

    def acknowledge(self, alert: int, by: str) -> Alert:
        """Acknowledge a live alert."""
        acknowledged: Alert = self._carried_out(Acknowledge(alert, by), alert)
        return acknowledged

    def set_runway(
        self, runway: str, *, open: bool | None, in_use: str | None, visibility: Visibility | None
    ) -> RunwayState:
        """Set how a runway is used; it is so after a restart, too."""
        with self._runway_orders:
            try:
                state: RunwayState = self._carried_out(SetRunway(runway, open, in_use, visibility), runway)
            except Refused:
                self._runways.in_doubt = True
                raise
            self._runways.note([state])
        return state

    def _video_recorder(self) -> Callable[[RadarChain, Sweeps], None]:
        """What records the raw sweeps of one radar; nothing does where they are not wanted."""
        if self._journal is None or not self.settings.journal.sweeps:
            return lambda _chain, _block: None
        return VideoRecorder(self._journal.writer, self.clock.now).before

    def _parts_changed(self, radar: str, parts: dict[str, Any]) -> None:
        """Note it in the journal; the engine does nothing with it."""
        self._running.offer(PartsChanged(radar, parts))

    def _carried_out(self, command: Command, id: int | str) -> Any:
        """The engine's answer to a command about `id`. Raises UnknownId, Refused."""
        try:
            return self._running.ask(command)
        except KeyError as error:
            raise UnknownId(id) from error
        except ValueError as error:
            raise Refused(str(error)) from error

    def submit_sweeps(self, radar: str, body: bytes) -> dict[str, int]:
        """Take sweeps in octet form, as if they had come by datagram."""
        if radar not in self._octets:
            raise UnknownId(radar)
        worker = self._workers.get(radar)
        if worker is None:
            raise Refused("the service is still starting")
        arrival = self.clock.now()
        take = self._taker(worker)
        with self._octets_lock:
            blocks, counted = self._octets[radar].take(body)
            for block in blocks:
                take(replace(block, arrival=arrival))
        return counted

    def submit_node_events(self, events: NodeEvents) -> Submitted:
        """Take node events, and have them stored."""
        good, submitted = self._nodes.submit(events, self.clock.now(), self._running.offer)
        if len(good):
            self.keep_node_events(good)
        return submitted

    def submit_target_reports(self, reports: TargetReports) -> Submitted:
        """Take target reports."""
        return self._reports.submit(reports, self.clock.now(), self._running.offer)[1]

    def note_bad_rows(self, feed: Literal["nodes", "reports"], counts: Mapping[str, int]) -> None:
        """Count rows that could not be read, by reason."""
        (self._nodes if feed == "nodes" else self._reports).note_bad(counts)

    @property
    def _running(self) -> SurfaceWorker:
        if self._surface is None:
            raise Refused("the service is still starting")
        return self._surface

    def _switch(self, radar: str) -> FrontEndSwitch:
        if radar not in self._octets:
            raise UnknownId(radar)
        switch = self._switches.get(radar)
        if switch is None or not self.checks["warm"]:
            raise Refused("the service is still starting")
        return switch

    def _taker(self, worker: RadarWorker) -> Callable[[Sweeps], None]:
        """What takes a radar's blocks: their times are corrected on the way to the worker."""
        times = self._radar_times[worker.site.id]
        return lambda block: worker.put(times.correct(block))

    def _impaired(self, _sensors: tuple[SensorState, ...]) -> tuple[str, ...]:
        """Sensors without which the picture is not whole, so that alerts are held at information.

        A radar whose clock is corrected is not one of them: its picture is whole. Without a radar the picture rests on
        the reports.
        """
        silent = tuple(
            id for id, worker in self._workers.items() if worker.status != "ok" or self._radar_times[id].late
        )
        if not self.radars and self._reports.silent:
            return (*silent, "reports")
        return silent

    def _look_at_picture(self, picture: Picture, _changes: tuple[AlertChange, ...]) -> None:
        self.checks["picture"] = True
        self._runways.note_changed(picture.runways)

    def _expect(self, picture: Picture) -> None:
        """Tell every radar how the tracks that move point, for the bearings of its next plots."""
        if not self._workers:
            return
        coming = expected_headings(picture.tracks, picture.time)
        for worker in list(self._workers.values()):
            worker.expect(coming.east, coming.north, coming.heading, coming.sd)

    def _stage_timings(self) -> dict[str, float]:
        return {
            f"{id}.{stage}": seconds
            for id, worker in self._workers.items()
            for stage, seconds in worker.chain.timings.copy().items()
        }

    def _radar_state(self, site: RadarSite) -> SensorState:
        worker, receiver = self._workers.get(site.id), self._receivers.get(site.id)
        counters = dict(receiver.counters()) if receiver is not None else {}
        if worker is None:
            return SensorState(site.id, "radar", "waiting", None, site.simulated, counters=counters)
        counters.update(worker.counters())
        counters.update(self._keeper.counters(site.id))
        switch = self._switches[site.id]
        times = self._radar_times[site.id]
        clock = times.words()
        refused = receiver.refused.words() if receiver is not None else ""
        left_out = receiver.refused.left_out() if receiver is not None else ""
        told = (clock, worker.cuts.words(), switch.learning, refused, left_out)
        detail = "; ".join(words for words in told if words)
        status = worker.status
        if (status == "ok" and (clock or refused)) or (status == "waiting" and refused):
            status = "degraded"
        state = SensorState(site.id, "radar", status, worker.last_time, site.simulated, detail, counters, switch.names)
        return times.shown(state)

    def _surface_state(self) -> SensorState:
        surface = self._surface
        if surface is None:
            return SensorState("surface", "tracker", "waiting", None)
        held_now, held_ever = surface.engine.monitor.held_back
        counters = {
            **surface.engine.counters,
            "alerts_held_back": held_ever,
            "queue_refused": surface.inbox.refused,
            "failures": surface.failures,
        }
        for more in self.extra_counters.values():
            counters.update(more())
        newest = surface.newest
        detail = f"{held_now} conflicts find no room among the alerts" if held_now else ""
        status = "degraded" if held_now else "ok"
        return SensorState("surface", "tracker", status, newest.time if newest else None, False, detail, counters)


def _scene(settings: Settings) -> str:
    """What video a state comes from, besides its radar: the demonstration's ground is another with every seed."""
    if settings.mode != "demo":
        return settings.mode
    demo = settings.demo
    return f"demo of {demo.traffic}, seed {demo.seed}, {demo.synthetic_targets} synthetic, rain {demo.rain}"
