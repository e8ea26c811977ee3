"""Recorded traffic and the demonstration as inputs of the surface engine, and the alerts that come of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from pipeline.airport.model import Airport
from pipeline.airport.surfaces import surface_of_radar
from pipeline.alert.monitor import AlertMonitor
from pipeline.chain import RadarChain
from pipeline.engine import SurfaceEngine
from pipeline.inputs import Envelope, Tick
from pipeline.lab.simulate.incidents import uses
from pipeline.lab.simulate.nodes import NodeSimulator
from pipeline.lab.simulate.parked import parked
from pipeline.lab.simulate.paths import Paths
from pipeline.lab.simulate.recording import Recording, recorded_movements
from pipeline.lab.simulate.reports import ReportSimulator
from pipeline.lab.simulate.video import VideoSimulator
from pipeline.lab.simulate.world import World, in_use
from pipeline.parts import build
from pipeline.picture import AlertChange, RunwayState
from pipeline.sites import NodeSite, RadarSite
from pipeline.tables import NodeEvents, SectorPlots, Sweeps, TargetReports
from pipeline.track.tracker import Tracker

RULES = ("runway_occupied", "hold_entry", "opposite_direction", "closed_runway")
FRONT_END = {
    "detector": ("detect", "adaptive"),
    "extractor": ("extract", "hysteresis"),
    "bearing": ("bearing", "moments"),
}
TRACKER = {"filter": "kalman", "associate": "gnn", "lifecycle": "score", "classify": "extent_speed"}
"""The parts that the settings have by default."""

BLOCKS = 16
"""Blocks of a simulated turn, and so pictures a turn: as many as the tracker has azimuth marks."""

STEP_S = 0.25
"""s of reports that are taken at a time where there is no radar."""

LATENCY_S = 0.1
"""s after which every input arrives."""

LOST_SHARE = 0.03
"""Share of the reports that are not received, as in the demonstration."""

SPREAD_M = 3.0
"""Standard deviation of the noise added to each coordinate of a record that was smoothed."""

PARKED = 14
"""Simulated aircraft that stand where nobody comes near, as in the demonstration: the radar sees them."""


def world_of(airport: Airport, recording: Recording, seed: int) -> World:
    """The recorded movements alone, with aircraft at their stands, in a world without vehicles and incidents."""
    movements = recorded_movements(recording)
    standing = parked(airport, movements, recording.length, PARKED, seed)
    runways = in_use(uses(movements, airport))
    return World(airport, Paths([*movements, *standing], recording.length), recording.start, runways=runways)


def make_engine(
    airport: Airport, runways: dict[str, str], radars: tuple[RadarSite, ...] = (), nodes: tuple[NodeSite, ...] = ()
) -> SurfaceEngine:
    """The engine that the default settings make. runways: id -> designator in use, of those that are."""
    tracker = Tracker(airport, radars, nodes, **{verb: build(verb, name) for verb, name in TRACKER.items()})
    used = tuple(RunwayState(one, in_use=end) for one, end in runways.items())
    monitor = AlertMonitor(airport, [build("alert", name) for name in RULES], nodes=nodes, runways=used)
    return SurfaceEngine(airport, radars, nodes, tracker, monitor)


def radar_inputs(
    world: World, site: RadarSite, nodes: tuple[NodeSite, ...], seed: int, seconds: float
) -> Iterator[Envelope]:
    """Sectors of the simulated radar, node events and target reports of the world's first seconds, in order."""
    chain = RadarChain(
        site,
        0,
        **{word: build(verb, name) for word, (verb, name) in FRONT_END.items()},
        surface=surface_of_radar(world.airport, site),
    )
    video = VideoSimulator(world.airport, site, seed, start=world.start)
    felt, heard = NodeSimulator(nodes, seed), ReportSimulator(seed, missed=LOST_SHARE)
    grid, time = site.video, world.start
    for number in range(int(seconds / grid.period_s) * BLOCKS):
        scan, block = divmod(number, BLOCKS)
        first, last = grid.azimuths * block // BLOCKS, grid.azimuths * (block + 1) // BLOCKS
        rows = np.arange(first, last, dtype=np.int32)
        at = world.start + (scan + (rows + 0.5) / grid.azimuths) * grid.period_s
        azimuth = np.asarray((rows + 0.5) * grid.azimuth_step_rad, np.float64)
        amplitude = video.sweeps(scan, first, last, world.truth)
        sector = chain.process(Sweeps(0, scan, rows, azimuth, at, amplitude, block == BLOCKS - 1))
        since, time = time, world.start + (scan + (block + 1) / BLOCKS) * grid.period_s
        arrival = time + LATENCY_S
        yield Envelope(arrival, sector)
        yield Envelope(arrival, felt.events(since, time, world.truth))
        yield Envelope(arrival, heard.reports(since, time, world.truth))


def report_inputs(reports: TargetReports, seed: int, *, smoothed: bool, seconds: float) -> Iterator[Envelope]:
    """The reports of the first seconds in order of time, some lost, a quarter of a second at a time, with ticks.

    smoothed: positions get noise. Nothing when there is no report.
    """
    chance = np.random.default_rng([seed, 43])
    reports = reports[np.argsort(reports.time, kind="stable")]
    reports = reports[chance.random(len(reports)) >= LOST_SHARE]
    if not len(reports):
        return
    if smoothed:
        noise = chance.normal(0.0, SPREAD_M, (2, len(reports)))
        reports = reports.replace(east=reports.east + noise[0], north=reports.north + noise[1], accuracy=SPREAD_M)
    begin = float(reports.time[0])
    edges = begin + np.arange(STEP_S, min(seconds, float(reports.time[-1]) - begin + 1.0) + STEP_S, STEP_S)
    first = 0
    for edge, last in zip(edges, np.searchsorted(reports.time, edges), strict=True):
        if last > first:
            yield Envelope(float(edge) + LATENCY_S, reports[first : int(last)])
        yield Envelope(float(edge) + LATENCY_S, Tick())
        first = int(last)


@dataclass(eq=False)
class Listener:
    """An engine with what it is given, and what it said. takes: kinds of inputs. told: every change of an alert."""

    engine: SurfaceEngine
    takes: tuple[type, ...] = (SectorPlots, NodeEvents, TargetReports, Tick)
    told: list[AlertChange] = field(default_factory=list)

    def hear(self, envelope: Envelope) -> None:
        """Give the engine an input, if it takes such."""
        if isinstance(envelope.body, self.takes):
            self.told += self.engine.step(envelope).changes


@dataclass(frozen=True)
class Said:
    """The alerts of a run. alarms, information: texts of those that were an alarm at least once, and of the others."""

    alarms: tuple[str, ...]
    information: tuple[str, ...]

    @staticmethod
    def of(told: Sequence[AlertChange]) -> Said:
        """From all changes. Of an alarm the first text at that stage, of information the first text."""
        first: dict[int, str] = {}
        alarms: dict[int, str] = {}
        for change in told:
            alert = change.alert
            text = f"{change.time:.1f} {alert.text}"
            first.setdefault(alert.id, text)
            if alert.stage == "alarm":
                alarms.setdefault(alert.id, text)
        return Said(tuple(alarms.values()), tuple(text for id, text in first.items() if id not in alarms))
