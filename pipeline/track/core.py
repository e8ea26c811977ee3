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
from pipeline.track.shape import ShapeRule, extents
from pipeline.track.table import NEVER, TrackNumbers, TrackTable

SOURCE_TIMES = {Source.RADAR: "radar_time", Source.NODE: "node_time", Source.REPORT: "report_time"}


class ZoneLookup(Protocol):
    """Where on the airport a point lies; `pipeline.airport.zones.ZoneMap` is the one there is."""

    def zone(self, east: Any, north: Any) -> Array:
        """Feature index or -1."""

    def runway(self, east: Any, north: Any) -> Array:
        """Runway index or -1."""

    def kind(self, east: Any, north: Any) -> Array:
        """SurfaceKind."""


@dataclass(frozen=True)
class TrackerSettings:
    """Settings of the tracker itself; its parts have their own. Times s, lengths m, angles rad, costs -2 log units.

    max_lag: what is older than the tracker's time by more is dropped. max_lead: what is newer by more is dropped while
    a radar gives the time. wander: standard deviation of an extended target's centroid, in parts of its extent.
    absorb_margin: a plot this far outside an established extent still belongs to it. tentative_penalty: cost of a
    measurement for a tentative track. ignore_plots_on_buildings: they start no track. report_fixed_off_pavement:
    show radar-only tracks off the pavement that never moved. moved_by: how far a track must come to count as moved.
    radar_ceiling: above this height a radar's miss says nothing. source_memory: how long a contribution is shown.
    report_gate: squared distance up to which a known address may stay on its track. report_patience: reports in a row
    against it that move an identity. ambiguity: a report whose two best tracks differ by less waits report_patience.
    identity_hold: a name unheard for so long is dropped; after name_holds it no longer keeps a track that radars miss.
    report_range, report_ceiling: reports beyond are dropped.
    lane_half_width: standard deviation of a node event across its lane. merge_after: checks, one a second, after
    which two tracks of one target become one. detection: probability that a look of a radar finds a target.
    false_on_pavement, false_elsewhere: false plots a m^2 and turn, at least; elsewhere more is learnt. cell_scores:
    what a plot of one, two, ... cells adds to the score of a track, the last for all larger ones. other_sensor: what
    a node event or a report adds. most_score: it grows no further, that of young
    tracks not as far. aircraft_length: what is longer is reported off
    the pavement and starts tracks on buildings. apron_speed_sd: m/s of each component of the speed of what begins on
    an apron.
    """

    max_lag: float = 3.0
    max_lead: float = 5.0
    wander: float = 0.08
    absorb_margin: float = 4.0
    tentative_penalty: float = 6.0
    ignore_plots_on_buildings: bool = True
    report_fixed_off_pavement: bool = False
    moved_by: float = 30.0
    radar_ceiling: float = 50.0
    source_memory: float = 5.0
    report_gate: float = 25.0
    report_patience: int = 3
    ambiguity: float = 3.0
    identity_hold: float = 120.0
    name_holds: float = 10.0
    report_range: float = 40_000.0
    report_ceiling: float = 3_000.0
    lane_half_width: float = 6.0
    merge_after: int = 3
    detection: float = 0.9
    false_on_pavement: float = 1e-6
    false_elsewhere: float = 2e-5
    cell_scores: tuple[float, ...] = (-2.0, 0.5, 1.5, 2.5)
    other_sensor: float = 6.0
    most_score: float = 20.0
    aircraft_length: float = 12.0
    apron_speed_sd: float = 7.0
    shape: ShapeRule = field(default_factory=ShapeRule)


@dataclass(slots=True)
class Core:
    """The whole state of a tracker and what it works with. waiting: plots of each radar not decided on yet.
    false_plots: where each radar makes false plots.

    undecided: address -> (uid of the best track, reports in a row that chose it). time: newest time taken, UTC s.
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
    judged: float = NEVER
    checked: float = NEVER

    def count(self, reason: str, number: int = 1) -> None:
        """Something was dropped or done `number` times."""
        if number:
            self.counters[reason] = self.counters.get(reason, 0) + int(number)

    def column(self, name: str) -> Array:
        """A column of the living rows, as a view."""
        made: Array = getattr(self.table, name)[: self.table.n]
        return made

    def extents(self, rows: Array | slice = slice(None)) -> Floats:
        """(k, 3) length, width, direction of tracks for gating; zeros where unknown, those seen in parts whole."""
        return extents(*(self.column(name)[rows] for name in ("length", "width", "heading", "axis", "body")))

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
        late = finite & (time < self.time - self.settings.max_lag)
        lead = finite & (time > self.time + self.settings.max_lead) if self.timed else np.zeros(len(time), np.bool_)
        self.count(f"{kind}_late", int(late.sum()))
        self.count(f"{kind}_future", int(lead.sum()))
        return finite & ~late & ~lead


def take(core: Core, rows: Array, time: Floats, position: Floats, noise: Floats, source: Source) -> None:
    """Tracks `rows` (k,), each once, take a position (k, 2) with noise (k, 2, 2) at time (k,)."""
    if not len(rows):
        return
    table = core.table
    dt = time - table.time[rows]
    second = table.one_point[rows] & (dt >= 0.3)
    first = ~second
    for chosen, work in ((second, core.lifecycle.second), (first, core.filter.update)):
        k = rows[chosen]
        if len(k):
            made = work(table.state[k], table.covariance[k], dt[chosen], position[chosen], noise[chosen])
            table.state[k], table.covariance[k] = made[0], made[1]
    table.one_point[rows[second]] = False
    table.time[rows] = np.maximum(table.time[rows], time)
    table.updated[rows] = np.maximum(table.updated[rows], time)
    table.hits[rows] += 1
    table.misses[rows] = 0
    table.history[rows] = (table.history[rows] << np.uint32(1)) | np.uint32(1)
    table.looks[rows] += 1
    if source != Source.RADAR:
        table.score[rows] = np.minimum(table.score[rows] + core.settings.other_sensor, core.settings.most_score)
    heard = getattr(table, SOURCE_TIMES[source])
    heard[rows] = np.maximum(heard[rows], time)
    way = np.hypot(*(table.state[rows, :2] - table.birthplace[rows]).T)
    size = np.fmax(np.nan_to_num(table.length[rows]), 2.0 * table.body[rows])
    table.moved[rows] |= way > core.settings.moved_by + 0.5 * size


def start(
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
    table.score[made] = 0.0 if source == Source.RADAR else (1 + head_start) * core.settings.other_sensor / 2
    table.simulated[made] = np.broadcast_to(simulated, (len(time),))[:k]
    for number, clock in enumerate(core.clocks):
        table.looked[number, made] = clock.closed_to - core.radars[number].video.azimuths // 2
    return made


def judge(core: Core) -> None:
    """Let the lifecycle part look at every track: phases change, numbers are given, tracks end."""
    table, n = core.table, core.table.n
    if n == 0:
        return
    silence = np.maximum(core.time - table.updated[:n], 0.0)
    cov, ahead = table.covariance[:n], np.maximum(core.time - table.time[:n], 0.0)
    variance = cov[:, 0, 0] + cov[:, 1, 1] + 2 * ahead * (cov[:, 0, 2] + cov[:, 1, 3])
    variance += ahead**2 * (cov[:, 2, 2] + cov[:, 3, 3])
    spread = np.sqrt(np.maximum(variance, 0.0) / 2)
    # a velocity that nobody has measured yet says nothing about how well a track is held
    spread[table.one_point[:n]] = 0.0
    bad = ~np.isfinite(table.state[:n]).all(axis=1) | ~np.isfinite(variance)
    core.count("state_invalid", int(bad.sum()))
    phase, ended = core.lifecycle.judge(
        table.phase[:n],
        table.history[:n],
        table.looks[:n],
        table.misses[:n],
        silence,
        (table.address[:n] != "") & (table.report_time[:n] >= core.time - core.settings.name_holds),
        spread,
        table.score[:n],
    )
    ended |= bad
    _learn(core, ended & (phase == TrackPhase.TENTATIVE))
    table.phase[:n] = phase
    for row in np.flatnonzero((phase != TrackPhase.TENTATIVE) & (table.id[:n] == 0) & ~ended):
        table.id[row] = core.numbers.take(core.time)
        core.count("confirmed")
        core.count("no_number", int(table.id[row] == 0))
    end(core, ended)


def _learn(core: Core, ended: Array) -> None:
    """Tracks that came to nothing were false plots: where they began and where they ended."""
    table, n = core.table, core.table.n
    alone = ended & (np.maximum(table.node_time[:n], table.report_time[:n]) == NEVER)
    rows = np.flatnonzero(alone & ~(table.length[:n] > core.settings.aircraft_length))
    if len(rows):
        each = 0.5 * table.hits[rows]
        for number, falses in enumerate(core.false_plots):
            mine = table.radar[rows] == number
            falses.learn(table.birthplace[rows[mine]], each[mine])
            falses.learn(table.state[rows[mine], :2], each[mine])


def end(core: Core, ended: Array) -> None:
    """End the tracks of the mask (n,)."""
    if ended.any():
        numbers = core.column("id")[ended]
        core.count("ended", int((numbers > 0).sum()))
        core.numbers.give_back(numbers[numbers > 0], core.time)
        core.table.keep(~ended)


def strip_identity(core: Core, rows: Array) -> None:
    """These tracks lose what reports said of them."""
    table = core.table
    table.address[rows] = table.callsign[rows] = ""
    table.claimed[rows] = table.doubt[rows] = 0
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
    core.judged += seconds
    core.checked += seconds


def make_core(
    radars: Sequence[RadarSite], nodes: Sequence[NodeSite], zones: ZoneLookup, settings: TrackerSettings,
    capacity: int, filter: FilterPart, associate: AssociatePart, lifecycle: LifecyclePart, classify: ClassifyPart,
) -> Core:  # fmt: skip
    """An empty tracker state. Raises ValueError for a capacity that the track numbers cannot serve."""
    if not 1 <= capacity <= TrackNumbers.LAST:
        raise ValueError(f"capacity must lie between 1 and {TrackNumbers.LAST}")
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
        numbers=TrackNumbers(),
        clocks=[RadarClock(one.video.period_s) for one in radars],
        waiting=[Plots.empty() for _ in radars],
        false_plots=[FalsePlots.around(one) for one in radars],
        counters={},
    )
