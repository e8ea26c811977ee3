"""The tracker: radar plots, node events and target reports in, one table of tracks out."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from pipeline.airport.model import Airport
from pipeline.contracts.associate import AssociatePart
from pipeline.contracts.classify import ClassifyPart
from pipeline.contracts.filter import FilterPart
from pipeline.contracts.lifecycle import LifecyclePart
from pipeline.sites import NodeSite, RadarSite
from pipeline.tables import NodeEvents, Plots, SectorPlots, TargetReports, Tracks
from pipeline.tables.marks import mark_row, marks_between
from pipeline.track.core import Core, ZoneLookup, make_core, shift_times
from pipeline.track.maintenance import MAINTENANCE_INTERVAL_S, keep_house
from pipeline.track.node_update import take_node_events
from pipeline.track.plot_pool import PlotPool
from pipeline.track.report_update import take_target_reports
from pipeline.track.reported import reported_tracks
from pipeline.track.sector import take_sector
from pipeline.track.settings import TrackerSettings

_SAVED = (
    "numbers", "clocks", "false_plots", "undecided", "latencies", "reports_taken", "time", "began", "judged_time",
    "maintenance_time",
)  # fmt: skip
"""Attributes of `Core` that are saved besides the store, the pools and the counters."""


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
        return take_sector(self._core, sector)

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
        elif time < core.time and core.store.n:
            core.count("time_backwards")
        else:
            core.time = time
            keep_house(core, time)

    def shift(self, seconds: float) -> None:
        """The clock that all times come from was set: everything remembered becomes later by `seconds`."""
        shift_times(self._core, seconds)

    def tracks(self, time: float | None = None) -> Tracks:
        """The confirmed and coasting tracks that are shown, in order of birth.

        Each stands at the time of its last measurement, coasting ones at the tracker's time; with `time`, all at it.
        Tracks by radar alone that never moved and stand off the pavement are left out unless the settings want them.
        """
        return reported_tracks(self._core, time)

    def save(self) -> dict[str, Any]:
        """The whole state, as copies of arrays and plain values, for `restore` of a tracker of the same make."""
        core = self._core
        pools = [pool.save() for pool in core.pools]
        own = {"store": core.store.save(), "pools": pools, "counters": dict(core.counters)}
        return {**own, **{name: copy.deepcopy(getattr(core, name)) for name in _SAVED}}

    def restore(self, saved: dict[str, Any]) -> None:
        """Go on from what `save` gave. Raises ValueError when it belongs to a tracker of other radars or capacity."""
        core = self._core
        if len(saved["clocks"]) != len(core.radars):
            raise ValueError("the saved tracks do not fit this tracker")
        core.store.restore(saved["store"])
        core.pools = [PlotPool.of(columns) for columns in saved["pools"]]
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
            for turn in range(WARM_TURNS if site else 0):
                for sector in _made_up_turn(core.radars[0], turn):
                    self.sector(sector)
            for second in range(3):
                self.target_reports(_made_up_report(second))
                self.tracks()
            if core.nodes:
                self.node_events(NodeEvents.build(1, time=WARM_TIME + WARM_TURNS, node=0, speed=5.0))
            self.tracks()
            self.tracks(WARM_TIME + WARM_TURNS)
            keep_house(spare, WARM_TIME + WARM_TURNS + MAINTENANCE_INTERVAL_S)
        finally:
            self._core = own


WARM_TURNS = 12
"""Turns of the made-up input: as many as it takes until targets are confirmed, and what was seen once is forgotten."""

WARM_TIME = 1e9
"""UTC s at which the made-up input begins."""

WARM_SECTORS = 32
"""Sectors of a made-up turn, so that plots wait for those of the next sector; the last turns come whole, so that
several marks are decided together."""


def _made_up_report(second: int) -> TargetReports:
    """Reports of two moving targets side by side with an address, which no radar sees, and of one without."""
    return TargetReports.build(
        3, time=WARM_TIME + WARM_TURNS + 0.1 * second, address=["abcdef", "abcdee", ""], east=2.0 * second,
        north=[0.0, 30.0, 900.0], speed=20.0, course=1.5,
    )  # fmt: skip


def _made_up_turn(site: RadarSite, turn: int) -> Iterator[SectorPlots]:
    """One turn of a radar, for warm-up: two targets, a split one, one that appears late, and one that is seen once."""
    a = site.video.azimuths
    late, once = turn >= WARM_TURNS - 3, turn == 2
    distance = np.array([300.0, 310.0, 600.0] + [900.0] * late + [1200.0] * once)
    azimuth = np.array([1.0, 1.0, 1.25] + [3.0] * late + [4.0] * once)
    begun = WARM_TIME + turn * site.video.period_s
    plots = Plots.build(
        len(distance),
        time=begun + azimuth / (2 * np.pi) * site.video.period_s,
        east=site.east + distance * np.sin(azimuth),
        north=site.north + distance * np.cos(azimuth),
        covariance=9.0 * np.eye(2),
        range=distance,
        azimuth=azimuth,
        range_extent=30.0,
        azimuth_extent=0.05,
        length=np.where(distance == distance[0], 30.0, 8.0),
        width=4.0,
        cells=10,
        mean_amplitude=50.0,
        peak_amplitude=90.0,
        bearing=1.0,
        bearing_sd=0.1,
    )
    own = azimuth / (2 * np.pi) * a
    sectors = WARM_SECTORS if turn < WARM_TURNS - 2 else 1
    ends = [a * k // sectors for k in range(sectors + 1)]
    for low, high in pairwise(ends):
        first, last = turn * a + low, turn * a + high
        mark = marks_between(first, last, a)
        passed = WARM_TIME + mark_row(mark, a) / a * site.video.period_s
        time = WARM_TIME + last / a * site.video.period_s
        yield SectorPlots(0, turn, time, first, last, plots[(own >= low) & (own < high)], mark=mark, mark_time=passed)
