"""What all kinds of measurement share: the state of the tracker, taking a measurement, starting and ending tracks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from pipeline.contracts.associate import AssociatePart
from pipeline.contracts.classify import ClassifyPart
from pipeline.contracts.filter import FilterPart
from pipeline.contracts.lifecycle import LifecyclePart
from pipeline.sites import NodeSite, RadarSite
from pipeline.tables import Plots, Source, TrackPhase
from pipeline.tables.arrays import Array, Floats
from pipeline.track.false_plots import FalsePlots
from pipeline.track.look import RadarClock
from pipeline.track.numbers import LAST_ASTERIX_NUMBER, TrackNumbers
from pipeline.track.settings import LARGEST_CAPACITY, TrackerSettings
from pipeline.track.shape import extents
from pipeline.track.table import NEVER, TrackTable

SOURCE_TIMES = {Source.RADAR: "radar_time", Source.NODE: "node_time", Source.REPORT: "report_time"}
"""The column of the track table that holds when each kind of sensor last contributed."""

CENTROID_JUMP = 0.5
"""Fraction of its extent by which the centroid of a standing target may jump: from its middle to one end."""

FIRST_SCORE = 0.5
"""Fraction of `other_sensor` that a track begun by a node event or a report has for each hit counted beforehand, so
that it takes a second measurement to confirm it."""

FALSE_PLOT_SHARE = 0.5
"""Fraction of its plots that a track which came to nothing leaves as false plots, at its first and at its last
place."""


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

    waiting: plots of each radar not decided on yet. false_plots: where each radar makes false plots.
    undecided: address -> (uid of the best track, reports in a row that chose it). time: newest time taken, UTC s.
    lifecycle_time, maintenance_time: UTC s at which `update_lifecycle` and the search for duplicates were last run.
    """

    radars: tuple[RadarSite, ...]
    nodes: tuple[NodeSite, ...]
    zones: ZoneLookup
    filter: FilterPart
    associate: AssociatePart
    lifecycle: LifecyclePart
    classify: ClassifyPart
    settings: TrackerSettings
    table: TrackTable
    numbers: TrackNumbers
    clocks: list[RadarClock]
    waiting: list[Plots]
    false_plots: list[FalsePlots]
    counters: dict[str, int]
    undecided: dict[str, tuple[int, int]] = field(default_factory=dict)
    time: float = NEVER
    lifecycle_time: float = NEVER
    maintenance_time: float = NEVER

    def count(self, reason: str, number: int = 1) -> None:
        """Something was dropped or done `number` times."""
        if number:
            self.counters[reason] = self.counters.get(reason, 0) + int(number)

    def column(self, name: str) -> Array:
        """A column of the living rows, as a view."""
        made: Array = getattr(self.table, name)[: self.table.n]
        return made

    def extents(self, rows: Array | slice = slice(None)) -> Floats:
        """(k, 3) length, width, direction of tracks for gating; zeros where unknown, those seen in fragments whole."""
        names = ("length", "width", "heading", "axis_bearing", "least_half_extent")
        return extents(*(self.column(name)[rows] for name in names))

    @property
    def timed(self) -> bool:
        """A radar gives the time, so that a time far ahead of it is a fault of who says it."""
        return any(math.isfinite(clock.time) and clock.time > self.time - 30.0 for clock in self.clocks)

    def in_time(self, time: Floats, kind: str) -> Array:
        """Mask of times that can be taken; the others are counted by reason under `kind`."""
        finite = np.isfinite(time)
        self.count(f"{kind}_invalid", int((~finite).sum()))
        if self.table.n == 0 and not self.timed:
            self.time = NEVER  # nothing is held that time could harm: it starts anew
            return finite
        timing = self.settings.timing
        late = finite & (time < self.time - timing.max_lag)
        lead = finite & (time > self.time + timing.max_lead) if self.timed else np.zeros(len(time), np.bool_)
        self.count(f"{kind}_late", int(late.sum()))
        self.count(f"{kind}_future", int(lead.sum()))
        return finite & ~late & ~lead


def apply_positions(core: Core, rows: Array, time: Floats, position: Floats, noise: Floats, source: Source) -> None:
    """Update the tracks `rows` (k,), each once, by a position (k, 2) m with noise (k, 2, 2) m^2 at time (k,) UTC s."""
    if not len(rows):
        return
    table = core.table
    dt = time - table.time[rows]
    second = table.velocity_unknown[rows] & (dt >= core.settings.start.second_point_after)
    for chosen, work in ((second, core.lifecycle.second), (~second, core.filter.update)):
        k = rows[chosen]
        if len(k):
            made = work(table.state[k], table.covariance[k], dt[chosen], position[chosen], noise[chosen])
            table.state[k], table.covariance[k] = made[0], made[1]
    table.velocity_unknown[rows[second]] = False
    table.time[rows] = np.maximum(table.time[rows], time)
    table.updated[rows] = np.maximum(table.updated[rows], time)
    table.hits[rows] += 1
    table.misses[rows] = 0
    table.history[rows] = (table.history[rows] << np.uint32(1)) | np.uint32(1)
    table.looks[rows] += 1
    if source != Source.RADAR:
        evidence = core.settings.evidence
        table.score[rows] = np.minimum(table.score[rows] + evidence.other_sensor, evidence.max_score)
    heard = getattr(table, SOURCE_TIMES[source])
    heard[rows] = np.maximum(heard[rows], time)
    distance = np.hypot(*(table.state[rows, :2] - table.birthplace[rows]).T)
    size = np.fmax(np.nan_to_num(table.length[rows]), 2.0 * table.least_half_extent[rows])
    table.moved[rows] |= distance > core.settings.reporting.moved_by + CENTROID_JUMP * size


def start_tracks(
    core: Core, time: Floats, position: Floats, noise: Floats, source: Source, simulated: Array | bool,
    head_start: int = 0,
) -> slice:  # fmt: skip
    """New tentative tracks, fewer than asked when the table is full. head_start: looks counted as hits beforehand."""
    table = core.table
    made = table.append(len(time))
    k = made.stop - made.start
    core.count("no_room", len(time) - k)
    if k == 0:
        return made
    table.state[made], table.covariance[made] = core.lifecycle.start(position[:k], noise[:k])
    table.time[made] = table.updated[made] = table.born[made] = time[:k]
    getattr(table, SOURCE_TIMES[source])[made] = time[:k]
    table.birthplace[made] = position[:k]
    table.hits[made] = 1
    table.looks[made] = 1 + head_start
    table.history[made] = (1 << (1 + head_start)) - 1
    first_score = (1 + head_start) * core.settings.evidence.other_sensor * FIRST_SCORE
    table.score[made] = 0.0 if source == Source.RADAR else first_score
    table.simulated[made] = np.broadcast_to(simulated, (len(time),))[:k]
    for number, clock in enumerate(core.clocks):
        # as if looked at half a turn ago: the look at which they were found is over, the next is due
        table.looked[number, made] = clock.closed_to - core.radars[number].video.azimuths // 2
    return made


def update_lifecycle(core: Core) -> None:
    """Have the lifecycle part decide on every track: phases change, numbers are given, tracks end."""
    table, n = core.table, core.table.n
    if n == 0:
        return
    silence = np.maximum(core.time - table.updated[:n], 0.0)
    cov, ahead = table.covariance[:n], np.maximum(core.time - table.time[:n], 0.0)
    variance = cov[:, 0, 0] + cov[:, 1, 1] + 2 * ahead * (cov[:, 0, 2] + cov[:, 1, 3])
    variance += ahead**2 * (cov[:, 2, 2] + cov[:, 3, 3])
    spread = np.sqrt(np.maximum(variance, 0.0) / 2)
    # a velocity not measured yet says nothing about how well the position is known
    spread[table.velocity_unknown[:n]] = 0.0
    bad = ~np.isfinite(table.state[:n]).all(axis=1) | ~np.isfinite(variance)
    core.count("state_invalid", int(bad.sum()))
    phase, ended = core.lifecycle.judge(
        table.phase[:n],
        table.history[:n],
        table.looks[:n],
        table.misses[:n],
        silence,
        (table.address[:n] != "") & (table.report_time[:n] >= core.time - core.settings.identity.protect_for),
        spread,
        table.score[:n],
    )
    ended |= bad
    _learn_false_plots(core, ended & (phase == TrackPhase.TENTATIVE))
    table.phase[:n] = phase
    _number_tracks(core, (phase != TrackPhase.TENTATIVE) & ~ended)
    end_tracks(core, ended)


def _number_tracks(core: Core, shown: Array) -> None:
    """Give the tracks of the mask (n,) that have none an id and, where numbers are given, a number.

    A track for which no number was left is counted once and takes the first that becomes free.
    """
    table, n = core.table, core.table.n
    fresh = np.flatnonzero(shown & (table.id[:n] == 0))
    core.count("confirmed", len(fresh))
    table.id[fresh] = core.numbers.new_ids(len(fresh))
    rows = np.flatnonzero(shown & (table.number[:n] == 0))
    if core.numbers.last and len(rows):
        table.number[rows] = core.numbers.take(len(rows), core.time)
        core.count("no_number", int((table.number[fresh] == 0).sum()))


def _learn_false_plots(core: Core, ended: Array) -> None:
    """Tracks that came to nothing were false plots: where they began and where they ended."""
    table, n = core.table, core.table.n
    alone = ended & (np.maximum(table.node_time[:n], table.report_time[:n]) == NEVER)
    rows = np.flatnonzero(alone & ~(table.length[:n] > core.settings.extent.aircraft_length))
    if len(rows):
        each = FALSE_PLOT_SHARE * table.hits[rows]
        for number, false_plots in enumerate(core.false_plots):
            mine = table.radar[rows] == number
            false_plots.learn(table.birthplace[rows[mine]], each[mine])
            false_plots.learn(table.state[rows[mine], :2], each[mine])


def end_tracks(core: Core, ended: Array) -> None:
    """End the tracks of the mask (n,)."""
    if ended.any():
        core.count("ended", int((core.column("id")[ended] > 0).sum()))
        core.numbers.give_back(core.column("number")[ended], core.time)
        core.table.keep(~ended)


def clear_identity(core: Core, rows: Array) -> None:
    """Remove from the tracks `rows` what reports said of them."""
    table = core.table
    table.address[rows] = table.callsign[rows] = ""
    table.claimed[rows] = table.misfit_reports[rows] = 0
    table.altitude[rows] = np.nan
    table.on_ground[rows] = True


TIME_COLUMNS = ("time", "updated", "born", *SOURCE_TIMES.values())
"""The columns of the track table that hold UTC s."""


def shift_times(core: Core, seconds: float) -> None:
    """Everything that the tracker remembers becomes later by `seconds`."""
    for name in TIME_COLUMNS:
        core.column(name)[:] += seconds
    for clock in core.clocks:
        clock.time += seconds
        clock.newest += seconds
    core.waiting = [one.replace(time=one.time + seconds) for one in core.waiting]
    core.numbers.free_at += seconds
    core.time += seconds
    core.lifecycle_time += seconds
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
        table=TrackTable(capacity, len(radars)),
        numbers=TrackNumbers(LAST_ASTERIX_NUMBER if settings.reporting.asterix_numbers else 0),
        clocks=[RadarClock(one.video.period_s) for one in radars],
        waiting=[Plots.empty() for _ in radars],
        false_plots=[FalsePlots.around(one) for one in radars],
        counters={},
    )
