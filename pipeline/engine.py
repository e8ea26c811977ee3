"""The surface engine: everything the sensors say goes in, one picture comes out. It reads no clock."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from pipeline.airport.model import Airport
from pipeline.inputs import (
    Acknowledge,
    ClockStep,
    Command,
    Envelope,
    PartsChanged,
    SensorHealth,
    SetRunway,
    Tick,
)
from pipeline.picture import Alert, AlertChange, Picture, RunwayState, Visibility
from pipeline.sites import NodeSite, RadarSite
from pipeline.tables import NodeEvents, SectorPlots, TargetReports, Tracks

MOST_AHEAD_S = 6.0
"""A measurement dated further after its own arrival is refused. More than the 5 s within which
the clock of a source is taken as it is (`pipeline.timing`), so that this is a second line of defence."""

LOOK_EVERY_S = 0.025
"""Data time between two pictures: less than a sector of a radar that turns once a second in 32 sectors (0.031 s)."""

SILENCE_S = 1.0
"""Ticks move the time when no measurement was accepted for this long; a radar's sectors come far more often."""

JITTER_S = 0.5
"""Ticks stay this far behind the host's clock, so that a measurement with less latency than this is still in time."""


class TrackerLike(Protocol):
    """What the engine needs of a tracker; `pipeline.track.tracker.Tracker` is the one there is."""

    counters: dict[str, int]

    @property
    def time(self) -> float:
        """UTC s of the newest that was taken; minus infinity before."""

    def sector(self, sector: SectorPlots) -> bool:
        """Take the plots of one sector; whether it was taken."""

    def node_events(self, events: NodeEvents) -> NodeEvents:
        """Take node events; those that were taken."""

    def target_reports(self, reports: TargetReports) -> int:
        """Take target reports; how many were taken."""

    def advance(self, time: float) -> None:
        """Let time pass without a measurement."""

    def shift(self, seconds: float) -> None:
        """All times become later by `seconds`."""

    def tracks(self) -> Tracks:
        """The tracks worth reporting."""

    def warm(self) -> None:
        """Compile every kernel."""

    def save(self) -> dict[str, Any]:
        """The whole state."""

    def restore(self, saved: dict[str, Any]) -> None:
        """Go on from a saved state."""


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

    def save(self) -> Any:
        """The whole state."""

    def restore(self, state: Any) -> None:
        """Go on from a saved state."""


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What one input led to. picture: None when it was not yet time for one. changes: of alerts, in order.

    answer: to a command. refused: why a command could not be carried out (KeyError: unknown, ValueError: not now).
    """

    picture: Picture | None = None
    changes: tuple[AlertChange, ...] = ()
    answer: Any = None
    refused: KeyError | ValueError | None = None


@dataclass(slots=True)
class EngineState:
    """What the engine remembers besides tracker and monitor. Times UTC s.

    time: the newest that was accepted. heard: arrival of the newest accepted measurement, and the time it brought.
    looked: time of the newest picture. degraded: ids of radars that are not well. new_node_events: since that picture.
    refused: rows refused because they were dated after their arrival, by reason.
    """

    time: float = 0.0
    heard: tuple[float, float] | None = None
    looked: float = -math.inf
    degraded: tuple[str, ...] = ()
    new_node_events: list[NodeEvents] = field(default_factory=list)
    refused: dict[str, int] = field(default_factory=dict)


class SurfaceEngine:
    """Holds the tracker and the alert monitor and makes pictures of them.

    airport, radars, nodes: where things are; a table's `radar` and `node` columns are indices into these.
    clock: seconds of any steady clock, injected so that stages can be timed; None: nothing is timed. most_ahead_s:
    what is dated further after its arrival is refused.
    The engine's time is the newest that it accepted; it moves on with ticks when the sensors are silent, and never
    runs back but for a ClockStep.
    """

    def __init__(
        self,
        airport: Airport,
        radars: Sequence[RadarSite],
        nodes: Sequence[NodeSite],
        tracker: TrackerLike,
        monitor: MonitorLike,
        clock: Callable[[], float] | None = None,
        most_ahead_s: float = MOST_AHEAD_S,
    ) -> None:
        self.airport = airport
        self.radars = tuple(radars)
        self.nodes = tuple(nodes)
        self.tracker = tracker
        self.monitor = monitor
        self.timings: dict[str, float] = {}
        self._clock = clock
        self._most_ahead_s = most_ahead_s
        self._state = EngineState()

    @property
    def time(self) -> float:
        """UTC s of the newest that was accepted; 0 before."""
        return self._state.time

    @property
    def sensors_degraded(self) -> bool:
        """A radar is not well, so that alerts are held at information."""
        return bool(self._state.degraded)

    @property
    def counters(self) -> dict[str, int]:
        """What was dropped or done, by reason; they only grow."""
        return {**self.tracker.counters, **self._state.refused}

    def step(self, envelope: Envelope) -> Outcome:
        """Take one input. The same inputs from the same state give the same outcomes, bit by bit."""
        body, arrival = envelope.body, envelope.arrival
        match body:
            case SectorPlots():
                self._heard(arrival, self._sector_in_time(body, arrival) and self.sector(body))
            case NodeEvents():
                self._heard(arrival, self.node_events(self._in_time(body, arrival, "node")) > 0)
            case TargetReports():
                self._heard(arrival, self.target_reports(self._in_time(body, arrival, "report")) > 0)
            case Tick():
                self._let_time_pass(arrival)
                return self._looked_at()
            case ClockStep():
                self._shift(body.seconds)
                return self._looked_at()
            case SensorHealth():
                self._state.degraded = body.degraded
                return Outcome()
            case PartsChanged():
                return Outcome()
            case Acknowledge() | SetRunway():
                return self._carry_out(body)
        due = self._state.time - self._state.looked >= LOOK_EVERY_S
        return self._looked_at() if due else Outcome()

    def sector(self, sector: SectorPlots) -> bool:
        """Take what a radar chain made of one block; whether the tracker took it."""
        taken = bool(self._timed("track", self.tracker.sector, sector))
        if taken:
            self._reached()
        return taken

    def node_events(self, events: NodeEvents) -> int:
        """Take node events; they reach the tracker at once and the alert rules with the next look. How many it took."""
        if not len(events):
            return 0
        taken: NodeEvents = self._timed("nodes", self.tracker.node_events, events)
        if len(taken):
            self._state.new_node_events.append(taken)
            self._reached()
        return len(taken)

    def target_reports(self, reports: TargetReports) -> int:
        """Take target reports; how many the tracker took."""
        if not len(reports):
            return 0
        taken = int(self._timed("reports", self.tracker.target_reports, reports))
        if taken:
            self._reached()
        return taken

    def advance(self, time: float) -> None:
        """Let time pass: tracks without measurements coast and end, whether or not a sensor still speaks."""
        if time > self._state.time:
            self._state.time = time
            self.tracker.advance(time)

    def look(self) -> tuple[Picture, tuple[AlertChange, ...]]:
        """The picture of now and the alert changes since the last look."""
        state = self._state
        tracks = self._timed("tracks", self.tracker.tracks)
        events = NodeEvents.concatenate(state.new_node_events)
        state.new_node_events.clear()
        changes = self._timed(
            "alerts",
            self.monitor.update,
            tracks,
            state.time,
            sensors_degraded=self.sensors_degraded,
            node_events=events,
        )
        state.looked = state.time
        picture = Picture(
            time=state.time,
            tracks=tracks,
            alerts=self.monitor.alerts,
            runways=self.monitor.runways,
            timings=dict(self.timings),
        )
        return picture, changes

    def save(self) -> dict[str, Any]:
        """The whole state of engine, tracker and alert monitor, as copies of arrays and plain values."""
        s = self._state
        own = EngineState(s.time, s.heard, s.looked, s.degraded, list(s.new_node_events), dict(s.refused))
        return {"engine": own, "tracker": self.tracker.save(), "monitor": self.monitor.save()}

    def restore(self, saved: dict[str, Any]) -> None:
        """Go on from what `save` gave. Raises ValueError when it belongs to another airport, radars or capacity."""
        self.tracker.restore(saved["tracker"])
        self.monitor.restore(saved["monitor"])
        s: EngineState = saved["engine"]
        self._state = EngineState(s.time, s.heard, s.looked, s.degraded, list(s.new_node_events), dict(s.refused))

    def _sector_in_time(self, sector: SectorPlots, arrival: float) -> bool:
        ahead = sector.time > arrival + self._most_ahead_s
        if ahead:
            self._refuse("sector_ahead", 1)
        return not ahead

    def _in_time(self, table: Any, arrival: float, kind: str) -> Any:
        """The rows that are not dated after their arrival; the others are counted."""
        ahead = table.time > arrival + self._most_ahead_s
        self._refuse(f"{kind}_ahead", int(ahead.sum()))
        return table[~ahead] if ahead.any() else table

    def _refuse(self, reason: str, number: int) -> None:
        if number:
            self._state.refused[reason] = self._state.refused.get(reason, 0) + number

    def _heard(self, arrival: float, accepted: bool) -> None:
        if accepted:
            self._state.heard = (arrival, self._state.time)

    def _let_time_pass(self, arrival: float) -> None:
        heard = self._state.heard
        if heard is None:  # nothing was accepted yet: the host's clock is the only time there is
            self._state.time = max(self._state.time, arrival - JITTER_S)
        elif arrival - heard[0] > SILENCE_S:
            self.advance(heard[1] + arrival - heard[0] - JITTER_S)

    def _shift(self, seconds: float) -> None:
        """All remembered times move with the host's clock, so that no track is lost or changes its age."""
        s = self._state
        self.tracker.shift(seconds)
        if s.time:
            s.time += seconds
            s.looked += seconds
        if s.heard is not None:
            s.heard = (s.heard[0] + seconds, s.heard[1] + seconds)
        s.new_node_events = [one.replace(time=one.time + seconds) for one in s.new_node_events]

    def _carry_out(self, command: Command) -> Outcome:
        try:
            if isinstance(command, Acknowledge):
                change = self.monitor.acknowledge(command.alert, command.by, self.time)
                return self._looked_at((change,), change.alert)
            state = self.monitor.set_runway(
                command.runway, open=command.open, in_use=command.in_use, visibility=command.visibility
            )
            return self._looked_at((), state)
        except (KeyError, ValueError) as error:
            return Outcome(refused=error)

    def _looked_at(self, before: tuple[AlertChange, ...] = (), answer: Any = None) -> Outcome:
        picture, changes = self.look()
        return Outcome(picture, (*before, *changes), answer)

    def _reached(self) -> None:
        self._state.time = max(self._state.time, self.tracker.time)

    def _timed(self, stage: str, work: Callable[..., Any], *words: Any, **named: Any) -> Any:
        if self._clock is None:
            return work(*words, **named)
        begin = self._clock()
        result = work(*words, **named)
        self.timings[stage] = self._clock() - begin
        return result
