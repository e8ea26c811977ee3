"""The surface engine: everything the sensors say goes in, one picture comes out. A value machine without a clock."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

from pipeline.airport.model import Airport
from pipeline.picture import Alert, AlertChange, Picture, RunwayState, Visibility
from pipeline.sites import NodeSite, RadarSite
from pipeline.tables import NodeEvents, SectorPlots, TargetReports, Tracks


class TrackerLike(Protocol):
    """What the engine needs of a tracker; `pipeline.track.tracker.Tracker` is the one there is."""

    counters: dict[str, int]

    def sector(self, sector: SectorPlots) -> None:
        """Take the plots of one sector."""

    def node_events(self, events: NodeEvents) -> None:
        """Take node events."""

    def target_reports(self, reports: TargetReports) -> None:
        """Take target reports."""

    def advance(self, time: float) -> None:
        """Let time pass without a measurement."""

    def tracks(self) -> Tracks:
        """The tracks worth reporting."""

    def warm(self) -> None:
        """Compile every kernel."""


class MonitorLike(Protocol):
    """What the engine needs of an alert monitor; `pipeline.alert.monitor.AlertMonitor` is the one there is."""

    @property
    def alerts(self) -> tuple[Alert, ...]:
        """The live alerts."""

    @property
    def runways(self) -> tuple[RunwayState, ...]:
        """How each runway is used and what is on it."""

    @property
    def held_back(self) -> tuple[int, int]:
        """(now, since start): conflicts that found no room among the live alerts."""

    def update(
        self, tracks: Tracks, time: float, *, sensors_degraded: bool = ..., node_events: NodeEvents | None = ...
    ) -> tuple[AlertChange, ...]:
        """Look at the new tracks."""

    def set_runway(
        self, id: str, *, open: bool | None = ..., in_use: str | None = ..., visibility: Visibility | None = ...
    ) -> RunwayState:
        """Set how a runway is used."""

    def acknowledge(self, id: int, by: str, time: float) -> AlertChange:
        """Acknowledge a live alert."""


class SurfaceEngine:
    """Holds the tracker and the alert monitor and makes pictures of them.

    airport, radars, nodes: where things are; a table's `radar` and `node` columns are indices into these.
    clock: seconds of any steady clock, injected so that stages can be timed; None: nothing is timed.
    Time comes with the data: the engine's time is the newest that it was given and never runs back.
    """

    def __init__(
        self,
        airport: Airport,
        radars: Sequence[RadarSite],
        nodes: Sequence[NodeSite],
        tracker: TrackerLike,
        monitor: MonitorLike,
        clock: Callable[[], float] | None = None,
    ) -> None:
        self.airport = airport
        self.radars = tuple(radars)
        self.nodes = tuple(nodes)
        self.tracker = tracker
        self.monitor = monitor
        self.time = 0.0
        self.timings: dict[str, float] = {}
        self.sensors_degraded = False
        self._clock = clock
        self._new_node_events: list[NodeEvents] = []

    def sector(self, sector: SectorPlots) -> None:
        """Take what a radar chain made of one block."""
        self._timed("track", self.tracker.sector, sector)
        self._reached(sector.time)

    def node_events(self, events: NodeEvents) -> None:
        """Take node events; they reach the tracker at once and the alert rules with the next look."""
        if not len(events):
            return
        self._timed("nodes", self.tracker.node_events, events)
        self._new_node_events.append(events)
        self._reached(float(events.time.max()))

    def target_reports(self, reports: TargetReports) -> None:
        """Take target reports."""
        if not len(reports):
            return
        self._timed("reports", self.tracker.target_reports, reports)
        self._reached(float(reports.time.max()))

    def advance(self, time: float) -> None:
        """Let time pass: tracks without measurements coast and end, whether or not a sensor still speaks."""
        if time > self.time:
            self.time = time
            self.tracker.advance(time)

    def look(self) -> tuple[Picture, tuple[AlertChange, ...]]:
        """The picture of now and the alert changes since the last look."""
        tracks = self._timed("tracks", self.tracker.tracks)
        events = NodeEvents.concatenate(self._new_node_events)
        self._new_node_events.clear()
        changes = self._timed(
            "alerts",
            self.monitor.update,
            tracks,
            self.time,
            sensors_degraded=self.sensors_degraded,
            node_events=events,
        )
        picture = Picture(
            time=self.time,
            tracks=tracks,
            alerts=self.monitor.alerts,
            runways=self.monitor.runways,
            timings=dict(self.timings),
        )
        return picture, changes

    def _reached(self, time: float) -> None:
        self.time = max(self.time, time)

    def _timed(self, stage: str, work: Callable[..., Any], *words: Any, **named: Any) -> Any:
        if self._clock is None:
            return work(*words, **named)
        begin = self._clock()
        result = work(*words, **named)
        self.timings[stage] = self._clock() - begin
        return result
