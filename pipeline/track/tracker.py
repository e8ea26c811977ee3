"""The tracker: radar plots, node events and target reports in, one table of tracks out."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from pipeline.airport.model import Airport, SurfaceKind
from pipeline.contracts.associate import AssociatePart
from pipeline.contracts.classify import ClassifyPart
from pipeline.contracts.filter import FilterPart
from pipeline.contracts.lifecycle import LifecyclePart
from pipeline.sites import NodeSite, RadarSite
from pipeline.tables import NodeEvents, Plots, SectorPlots, TargetReports, TrackPhase, Tracks
from pipeline.tables.arrays import Array
from pipeline.track.core import SOURCE_TIMES, Core, ZoneLookup, make_core, shift_times, update_lifecycle
from pipeline.track.maintenance import maintain_tracks
from pipeline.track.node_update import take_node_events
from pipeline.track.radar_update import PAVED, SETTLED, take_sector
from pipeline.track.report_update import take_target_reports
from pipeline.track.settings import TrackerSettings
from pipeline.track.table import NEVER

_SAME = (
    "id", "number", "phase", "updated", "born", "hits", "misses", "altitude", "on_ground", "category", "address",
    "callsign",
)  # fmt: skip
"""Columns that the table of tracks handed out has as they are in the track table."""

_SAVED = ("numbers", "clocks", "waiting", "false_plots", "undecided", "time", "lifecycle_time", "maintenance_time")
"""Attributes of `Core` that are saved besides the track table and the counters."""


class Tracker:
    """One central table of tracks; not safe for several threads. Bad input is dropped and counted, never raised.

    airport, radars, nodes: where things are; the `radar` and `node` of tables are indices into these.
    filter, associate, lifecycle, classify: parts (see `pipeline.contracts`). capacity: tracks at most,
    tentative ones included, up to LARGEST_CAPACITY. zones: where on the airport a point lies; made from the airport
    when not given.
    counters: what was dropped or done, by reason; numbers only grow.
    Raises ValueError for a capacity out of bounds.
    """

    def __init__(
        self,
        airport: Airport,
        radars: Sequence[RadarSite],
        nodes: Sequence[NodeSite],
        *,
        filter: FilterPart,
        associate: AssociatePart,
        lifecycle: LifecyclePart,
        classify: ClassifyPart,
        capacity: int = 2048,
        settings: TrackerSettings | None = None,
        zones: ZoneLookup | None = None,
    ) -> None:
        if zones is None:
            from pipeline.airport.zones import ZoneMap

            zones = ZoneMap.build(airport)
        settings = settings or TrackerSettings()
        self._core = make_core(radars, nodes, zones, settings, capacity, filter, associate, lifecycle, classify)
        self.counters = self._core.counters

    @property
    def time(self) -> float:
        """UTC s of the newest that was taken; minus infinity before."""
        return self._core.time

    def sector(self, sector: SectorPlots) -> bool:
        """Take the plots of one sector: a whole turn or any part of one. False, counted, when it cannot be taken."""
        taken = take_sector(self._core, sector)
        maintain_tracks(self._core)
        return taken

    def node_events(self, events: NodeEvents) -> NodeEvents:
        """Take node events: they confirm, pull or start tracks near the node. Gives those that were taken."""
        return take_node_events(self._core, events)

    def target_reports(self, reports: TargetReports) -> int:
        """Take target reports: they name, pull or start tracks. How many were in time and in reach."""
        return take_target_reports(self._core, reports)

    def advance(self, time: float) -> None:
        """Let time pass: tracks coast and end although the sensors are silent. Time that runs back is counted."""
        core = self._core
        if not math.isfinite(time):
            core.count("time_invalid")
        elif time < core.time and core.table.n:
            core.count("time_backwards")
        else:
            core.time = time
            core.lifecycle_time = min(core.lifecycle_time, time - 1.0)
            maintain_tracks(core)

    def shift(self, seconds: float) -> None:
        """The clock that all times come from was set: everything remembered becomes later by `seconds`."""
        shift_times(self._core, seconds)

    def tracks(self, time: float | None = None) -> Tracks:
        """The confirmed and coasting tracks that are shown, in order of birth.

        Each stands at the time of its last measurement, coasting ones at the tracker's time; with `time`, all at it.
        Tracks by radar alone that never moved and stand off the pavement are left out unless the settings want them.
        """
        core, table, n = self._core, self._core.table, self._core.table.n
        rows = np.flatnonzero((table.phase[:n] != TrackPhase.TENTATIVE) & (table.id[:n] > 0))
        ahead = np.where(table.phase[rows] == TrackPhase.COASTING, np.maximum(core.time - table.time[rows], 0.0), 0.0)
        if time is not None:
            ahead = time - table.time[rows]
        state, covariance = core.filter.predict(table.state[rows], table.covariance[rows], ahead)
        seen = self._reportable(rows, state)
        rows, ahead, state, covariance = rows[seen], ahead[seen], state[seen], covariance[seen]
        sources = np.zeros(len(rows), np.uint8)
        for source, name in SOURCE_TIMES.items():
            sources |= np.where(
                getattr(table, name)[rows] >= core.time - core.settings.reporting.source_memory, source, 0
            ).astype("u1")
        return Tracks.build(
            len(rows),
            **{name: getattr(table, name)[rows] for name in _SAME},
            time=table.time[rows] + ahead,
            state=state,
            covariance=covariance,
            length=np.where(table.extent_count[rows] > 0, table.length[rows], np.nan),
            width=np.where(table.extent_count[rows] > 0, table.width[rows], np.nan),
            heading=np.where(table.extent_count[rows] > 0, table.heading[rows], _course(state)),
            sources=sources,
            simulated=table.simulated[rows],
            zone=core.zones.zone(state[:, 0], state[:, 1]),
            runway=core.zones.runway(state[:, 0], state[:, 1]),
        )

    def _reportable(self, rows: Array, state: Array) -> Array:
        core, table = self._core, self._core.table
        kind = core.zones.kind(state[:, 0], state[:, 1])
        known = (table.address[rows] != "") | (table.node_time[rows] > NEVER) | (table.report_time[rows] > NEVER)
        # a track that its radar has lost does not go on through a building
        lost = ~known & (table.phase[rows] == TrackPhase.COASTING) & (kind == SurfaceKind.BUILDING)
        if core.settings.reporting.fixed_off_pavement:
            return np.asarray(~lost)
        large = (table.length[rows] >= core.settings.extent.aircraft_length) & (table.extent_count[rows] >= SETTLED)
        return np.asarray((known | table.moved[rows] | large | PAVED[kind]) & ~lost)

    def save(self) -> dict[str, Any]:
        """The whole state, as copies of arrays and plain values, for `restore` of a tracker of the same make."""
        core = self._core
        own = {"table": core.table.save(), "counters": dict(core.counters)}
        return {**own, **{name: copy.deepcopy(getattr(core, name)) for name in _SAVED}}

    def restore(self, saved: dict[str, Any]) -> None:
        """Go on from what `save` gave. Raises ValueError when it belongs to a tracker of other radars or capacity."""
        core = self._core
        if len(saved["clocks"]) != len(core.radars):
            raise ValueError("the saved tracks do not fit this tracker")
        core.table.restore(saved["table"])
        core.counters.clear()
        core.counters.update(saved["counters"])
        for name in _SAVED:
            setattr(core, name, copy.deepcopy(saved[name]))

    def warm(self) -> None:
        """Compile all kernels by working on made-up input; the tracker's own state stays as it is."""
        core = self._core
        site = core.radars[0] if core.radars else None
        spare: Core = make_core(
            core.radars, core.nodes, core.zones, core.settings, 16, core.filter, core.associate, core.lifecycle,
            core.classify,
        )  # fmt: skip
        own, self._core = self._core, spare
        try:
            for turn in range(8 if site else 0):
                self.sector(_made_up_sector(core.radars[0], turn))
            at = {"time": 1e9 + 8.0}
            self.target_reports(
                TargetReports.build(1, **at, address="abcdef", east=0.0, north=0.0, speed=1.0, course=0.0)
            )
            if core.nodes:
                self.node_events(NodeEvents.build(1, **at, node=0, speed=5.0))
            self.tracks()
            update_lifecycle(spare)
        finally:
            self._core = own


COURSE_SPEED = 2.0
"""m/s, above which the direction of motion is told as heading; below it is noise."""


def _course(state: Array) -> Array:
    """Direction of motion rad (n,), nan below COURSE_SPEED."""
    speed = np.hypot(state[:, 2], state[:, 3])
    return np.where(speed > COURSE_SPEED, np.arctan2(state[:, 2], state[:, 3]) % (2 * np.pi), np.nan)


def _made_up_sector(site: RadarSite, turn: int) -> SectorPlots:
    """One turn of a radar with two targets and a split one, for warm-up."""
    a = site.video.azimuths
    distance = np.array([300.0, 310.0, 600.0])
    azimuth = np.array([1.0, 1.0, 2.0])
    plots = Plots.build(
        3,
        time=1e9 + turn + azimuth / (2 * np.pi),
        east=site.east + distance * np.sin(azimuth),
        north=site.north + distance * np.cos(azimuth),
        covariance=9.0 * np.eye(2),
        range=distance,
        azimuth=azimuth,
        range_extent=30.0,
        azimuth_extent=0.05,
        length=np.array([30.0, 8.0, 8.0]),
        width=4.0,
        cells=10,
        mean_amplitude=50.0,
        peak_amplitude=90.0,
        bearing=1.0,
        bearing_sd=0.1,
    )
    return SectorPlots(0, turn, 1e9 + turn + 1.0, turn * a, (turn + 1) * a, plots)
