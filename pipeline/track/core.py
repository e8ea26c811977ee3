"""What all kinds of measurement share: the state of the tracker and what it works with."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from pipeline.contracts.associate import AssociatePart, Expected
from pipeline.contracts.classify import ClassifyPart
from pipeline.contracts.filter import FilterPart, Moments
from pipeline.contracts.lifecycle import LifecyclePart
from pipeline.kernels.compiled import allocating
from pipeline.sites import NodeSite, RadarSite
from pipeline.tables import Source, TrackPhase
from pipeline.tables.arrays import Array, Floats
from pipeline.track.false_plots import FalsePlots
from pipeline.track.latency import CORROBORATED_S, Latencies, with_latency
from pipeline.track.numbers import LAST_ASTERIX_NUMBER, TrackNumbers
from pipeline.track.plot_pool import PlotPool
from pipeline.track.radar_clock import RadarClock
from pipeline.track.settings import LARGEST_CAPACITY, TrackerSettings
from pipeline.track.shape import fill_track_extent
from pipeline.track.store import ENDED, NEVER, TrackStore

SOURCE_TIMES = {Source.RADAR: "radar_time", Source.NODE: "node_time", Source.REPORT: "report_time"}
"""The column of the store that holds when each kind of sensor last contributed."""

TIMED_WITHIN_S = 30.0
"""A radar not heard for longer does not give the time."""

TENTATIVE = int(TrackPhase.TENTATIVE)

GROUND = np.array([0, 1, 3, 4])
"""Where, in the moments of a filter in the air, those on the ground stand."""


class ZoneLookup(Protocol):
    """Where on the airport a point lies; `pipeline.airport.zones.ZoneMap` is the one there is."""

    def zone(self, east: Any, north: Any) -> Array:
        """Feature index or -1."""

    def runway(self, east: Any, north: Any) -> Array:
        """Runway index or -1."""

    def kind(self, east: Any, north: Any) -> Array:
        """SurfaceKind."""


@dataclass(slots=True)
class Core:
    """The whole state of a tracker and what it works with.

    azimuths: rows a turn of each radar. pools: plots of each radar not decided on yet. false_plots: where each radar
    makes false plots. undecided: address -> (target of the best track,
    reports in a row that chose it). latencies: of the sources of reports. reports_taken: so far. time: newest time
    taken, UTC s. began: UTC s of the first sector. judged_time, maintenance_time: UTC s at which all tracks were last
    judged, and the search for duplicates was last run.
    """

    radars: tuple[RadarSite, ...]
    nodes: tuple[NodeSite, ...]
    zones: ZoneLookup
    filter: FilterPart
    associate: AssociatePart
    lifecycle: LifecyclePart
    classify: ClassifyPart
    settings: TrackerSettings
    store: TrackStore
    numbers: TrackNumbers
    clocks: list[RadarClock]
    pools: list[PlotPool]
    false_plots: list[FalsePlots]
    counters: dict[str, int]
    azimuths: tuple[int, ...]
    undecided: dict[str, tuple[int, int]] = field(default_factory=dict)
    latencies: Latencies = field(default_factory=Latencies)
    reports_taken: int = 0
    time: float = NEVER
    began: float = NEVER
    judged_time: float = NEVER
    maintenance_time: float = NEVER

    def count(self, reason: str, number: int = 1) -> None:
        """Something was dropped or done `number` times."""
        if number:
            self.counters[reason] = self.counters.get(reason, 0) + int(number)

    def column(self, name: str) -> Array:
        """A column of the rows in use, as a view; those that have ended are among them."""
        made: Array = self.store.rows[name][: self.store.n]
        return made

    def alive(self) -> Array:
        """Rows of the tracks that have not ended."""
        return np.flatnonzero(self.column("phase") != ENDED)

    def shown(self) -> Array:
        """Rows of the tracks that are confirmed or coasting."""
        phase = self.column("phase")
        return np.flatnonzero((phase != TENTATIVE) & (phase != ENDED))

    def moments(self, predicted: Any) -> Moments:
        """What the filter expects of position and velocity on the ground."""
        return self.on_ground(self.filter.moments(predicted))

    def on_ground(self, made: Moments) -> Moments:
        """The moments of position and velocity on the ground, of those of a filter on the ground or in the air."""
        if made.mean.shape[1] == len(GROUND):
            return made
        return Moments(made.mean[:, GROUND], made.covariance[:, GROUND[:, None], GROUND])

    def predicted(self, rows: Array, time: Floats) -> tuple[Any, Moments]:
        """What the filter expects of rows (k,) at times (k,) UTC s."""
        made = self.filter.predict(self.store, rows, time, self.zones)
        return made, self.moments(made)

    def expected(
        self, rows: Array, time: Floats, moments: Moments, window: Floats, latency_sd: float = 0.0
    ) -> Expected:
        """Rows (k,) as an association sees them. window: (k,) s about `time`. latency_sd: s, of what is measured."""
        n = len(rows)
        covariance = moments.covariance
        if self.reports_taken:
            unsure = self.unsure_latency(rows, time)
            if latency_sd > 0.0:
                unsure = np.hypot(unsure, latency_sd)
            covariance = with_latency(moments.mean, covariance, unsure)
        made = Expected(
            time, moments.mean, covariance, window, np.empty((n, 3)), np.empty(n), np.empty(n, np.int64),
            np.empty(n),
        )  # fmt: skip
        _expect(self.store.rows, rows, self.settings.measurement.tentative_penalty, *made[4:])
        return made

    def unsure_latency(self, rows: Array, time: Floats) -> Floats:
        """(k,) s, standard deviation of the latency of tracks that only reports tell of; 0 for others."""
        made = np.zeros(len(rows))
        if not self.reports_taken:
            return made
        slowest = max([1.0, *(one.period for one in self.clocks)])
        _unsure(self.store.rows, rows, time, CORROBORATED_S * slowest, made)
        return made

    @property
    def timed(self) -> bool:
        """A radar gives the time, so that a time far ahead of it is a fault of who says it."""
        return any(math.isfinite(clock.newest) and clock.newest > self.time - TIMED_WITHIN_S for clock in self.clocks)

    def in_time(self, time: Floats, kind: str) -> Array:
        """Mask of times that can be taken; the others are counted by reason under `kind`."""
        finite = np.isfinite(time)
        self.count(f"{kind}_invalid", int((~finite).sum()))
        if not len(self.alive()) and not self.timed:
            self.time = NEVER  # nothing is held that time could harm: it starts anew
            return finite
        timing = self.settings.timing
        late = finite & (time < self.time - timing.max_lag)
        lead = finite & (time > self.time + timing.max_lead) if self.timed else np.zeros(len(time), np.bool_)
        self.count(f"{kind}_late", int(late.sum()))
        self.count(f"{kind}_future", int(lead.sum()))
        return finite & ~late & ~lead


@allocating
def _unsure(tracks: Array, rows: Array, time: Floats, corroborated: float, out: Floats) -> None:
    for k in range(len(rows)):
        one = tracks[rows[k]]
        out[k] = one["latency_sd"] if one["radar_time"] < time[k] - corroborated else 0.0


@allocating
def _expect(
    tracks: Array, rows: Array, tentative_penalty: float, extent: Floats, penalty: Floats, target: Array,
    log_weight: Floats,
) -> None:  # fmt: skip
    for k in range(len(rows)):
        one = tracks[rows[k]]
        fill_track_extent(one, extent[k])
        penalty[k] = tentative_penalty if one["phase"] == TENTATIVE else 0.0
        target[k], log_weight[k] = one["target"], one["log_weight"]


def clear_identity(core: Core, rows: Array) -> None:
    """Remove from the tracks `rows` what reports said of them."""
    store = core.store
    store.address[rows] = store.callsign[rows] = ""
    store.named[rows] = False
    store.claimed[rows] = store.misfit_reports[rows] = 0
    store.altitude[rows] = np.nan
    store.on_ground[rows] = True


TIME_COLUMNS = ("updated", "born", "plot_since", *SOURCE_TIMES.values())
"""The columns of the tracker's records that hold UTC s."""


def shift_times(core: Core, seconds: float) -> None:
    """Everything that the tracker remembers becomes later by `seconds`."""
    for name in TIME_COLUMNS:
        core.column(name)[:] += seconds
    core.store.time[: core.store.n] += seconds
    core.store.look["time"] += seconds
    core.latencies.shift(seconds)
    for clock in core.clocks:
        clock.shift(seconds)
    for pool in core.pools:
        pool.records["time"] += seconds
    core.numbers.free_at += seconds
    core.time += seconds
    core.began += seconds
    core.judged_time += seconds
    core.maintenance_time += seconds


def make_core(
    radars: Sequence[RadarSite], nodes: Sequence[NodeSite], zones: ZoneLookup, settings: TrackerSettings,
    capacity: int, filter: FilterPart, associate: AssociatePart, lifecycle: LifecyclePart, classify: ClassifyPart,
) -> Core:  # fmt: skip
    """An empty tracker state. Raises ValueError for a capacity out of bounds."""
    if not 1 <= capacity <= LARGEST_CAPACITY:
        raise ValueError(f"capacity must lie between 1 and {LARGEST_CAPACITY}")
    return Core(
        radars=tuple(radars),
        nodes=tuple(nodes),
        zones=zones,
        filter=filter,
        associate=associate,
        lifecycle=lifecycle,
        classify=classify,
        settings=settings,
        store=TrackStore(capacity, len(radars), filter.columns),
        numbers=TrackNumbers(LAST_ASTERIX_NUMBER if settings.reporting.asterix_numbers else 0),
        clocks=[RadarClock(one.video.period_s) for one in radars],
        pools=[PlotPool() for _ in radars],
        false_plots=[FalsePlots.around(one) for one in radars],
        counters={},
        azimuths=tuple(one.video.azimuths for one in radars),
    )
