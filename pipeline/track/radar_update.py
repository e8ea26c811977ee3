"""Radar plots: which track takes which plot as the antenna turns, what a split target becomes, what starts a track."""

from __future__ import annotations

import math

import numpy as np

from pipeline.airport.model import SurfaceKind
from pipeline.contracts.associate import Expected, Measured
from pipeline.group.enclosing import enclosing_tracks
from pipeline.group.split_plots import join_split_plots
from pipeline.tables import Plots, SectorPlots, Source, TrackPhase
from pipeline.tables.arrays import Array, Floats
from pipeline.track.core import Core, apply_positions, start_tracks
from pipeline.track.look import Looks, RadarClock, plan_looks
from pipeline.track.shape import oriented_noise, plot_extents, reshape

PAVED = np.isin(np.arange(256), (SurfaceKind.RUNWAY, SurfaceKind.TAXIWAY, SurfaceKind.APRON, SurfaceKind.ROAD))
"""(256,) by SurfaceKind: where targets are at home and false plots are few."""

NO_PLOTS = Plots.empty()

SETTLED = 3
"""Extents taken before a track's own extent is known well enough to absorb plots. Tied to a one-second antenna: it
counts turns."""

STALE_TURNS = 2
"""Turns that a plot may lie behind the antenna; the looks at which a track could have taken it are over by then."""

EARLY_TURNS = 0.5
"""Turns by which a plot may be newer than its sector: a large echo that is still open holds the sector's end back."""

LARGEST_VARIANCE = 1e6
"""m^2, of both axes of a plot: worse than 1 km is no position."""

FARTHEST_PLOT = 1e6
"""m from the airport in each direction: no surface radar sees so far."""

WINDOW_TURNS = 0.06
"""Turns by which the time of a plot may differ from that of the look beyond what its gate covers: 22 degrees, what a
large echo near the radar takes up."""

MEAN_SQUARED_DISTANCE = 2.0
"""The mean of a squared Mahalanobis distance in two dimensions; stands for one that is not known."""

FRAGMENT_CENTROID_SD = 0.5
"""Standard deviation of the plots of a target seen in fragments, as a fraction of half its least extent: which
fragments are seen is chance, and their centroid strays from that of the whole."""

MISS_TOLERANCE_S = 0.5
"""A look older than the newest measurement by more says nothing of the track. Tied to a one-second antenna: half its
turn."""


def take_sector(core: Core, sector: SectorPlots) -> bool:
    """Work on what one radar closed: tracks whose whole gate is closed take a plot or miss; the rest starts tracks.

    False, counted by reason, when the sector cannot be taken.
    """
    if not _acceptable(core, sector):
        return False
    site, clock = core.radars[sector.radar], core.clocks[sector.radar]
    clock.heard(sector.closed_to, sector.time, site.video.azimuths, site.video.period_s)
    core.false_plots[sector.radar].turn(sector.closed_to, site.video.azimuths)
    core.time = max(core.time, sector.time)
    core.count("sector_degraded", int(sector.degraded))
    fresh = _usable(core, sector)
    plots = Plots.concatenate([core.waiting[sector.radar], fresh]) if len(core.waiting[sector.radar]) else fresh
    if len(plots) > 1:
        plots = plots[np.lexsort((plots.north, plots.east, plots.time))]
    rows = _absolute_rows(core, sector.radar, plots)
    clock.set_by(rows, plots.time, site.video.azimuths)
    stale = rows < sector.closed_to - STALE_TURNS * site.video.azimuths
    core.count("plot_stale", int(stale.sum()))
    if stale.any():
        plots, rows = plots[~stale], rows[~stale]
    wait = _process(core, sector, plots, rows)
    core.waiting[sector.radar] = plots[wait] if wait.any() else NO_PLOTS
    return True


def _acceptable(core: Core, sector: SectorPlots) -> bool:
    if not 0 <= sector.radar < len(core.radars):
        core.count("sector_unknown_radar")
        return False
    clock = core.clocks[sector.radar]
    if not math.isfinite(sector.time):
        core.count("sector_invalid")
        return False
    if core.table.n and sector.time < core.time - core.settings.timing.max_lag:
        core.count("sector_late")
        return False
    if sector.closed_to < clock.closed_to or sector.time < clock.newest:
        if core.table.n and sector.time <= clock.newest:
            core.count("sector_late")
            return False
        _restart(core, sector)
    if core.table.n == 0:
        core.time = sector.time  # nothing is held that time could harm: it starts anew
    return True


def _restart(core: Core, sector: SectorPlots) -> None:
    """The radar counts its rows anew."""
    core.count("radar_restarted")
    core.clocks[sector.radar] = RadarClock(core.radars[sector.radar].video.period_s)
    core.waiting[sector.radar] = Plots.empty()
    core.table.looked[sector.radar] = sector.closed_from - core.radars[sector.radar].video.azimuths // 2


def _usable(core: Core, sector: SectorPlots) -> Plots:
    """The plots of a sector without those that cannot be true."""
    plots = sector.plots
    if not len(plots):
        return plots
    cov = plots.covariance
    sane = np.isfinite(plots.time) & np.isfinite(plots.east) & np.isfinite(plots.north) & np.isfinite(plots.azimuth)
    sane &= np.isfinite(plots.range) & np.isfinite(cov).all(axis=(1, 2))
    with np.errstate(invalid="ignore", over="ignore"):
        sane &= (cov[:, 0, 0] > 0) & (cov[:, 0, 0] * cov[:, 1, 1] > cov[:, 0, 1] * cov[:, 1, 0])
        sane &= cov[:, 0, 0] + cov[:, 1, 1] < LARGEST_VARIANCE
        sane &= np.hypot(plots.east, plots.north) < FARTHEST_PLOT
    core.count("plot_invalid", int((~sane).sum()))
    period = core.clocks[sector.radar].period
    late = sane & (plots.time < sector.time - core.settings.timing.max_lag - period)
    future = sane & (plots.time > sector.time + EARLY_TURNS * period)
    core.count("plot_late", int(late.sum()))
    core.count("plot_future", int(future.sum()))
    good = sane & ~late & ~future
    return plots if good.all() else plots[good]


def _absolute_rows(core: Core, radar: int, plots: Plots) -> Array:
    """Absolute row of each plot's azimuth, on the turn that its time belongs to."""
    clock, azimuths = core.clocks[radar], core.radars[radar].video.azimuths
    own = (plots.azimuth % (2 * math.pi) / (2 * math.pi) * azimuths).astype(np.int64) % azimuths
    about = clock.closed_to - (clock.time - plots.time) / clock.period * azimuths
    return np.asarray(own + np.rint((about - own) / azimuths).astype(np.int64) * azimuths)


def _process(core: Core, sector: SectorPlots, plots: Plots, plot_rows: Array) -> Array:
    """Associate and start; the mask of plots that have to wait for the antenna to close more."""
    table, n, radar = core.table, core.table.n, sector.radar
    site, clock = core.radars[radar], core.clocks[radar]
    extent = plot_extents(plots)
    size = core.extents()
    looks = plan_looks(
        site, clock, table.time[:n], table.state[:n], table.covariance[:n], size, table.looked[radar, :n],
        core.associate.gate, core.associate.max_gate_m,
    )  # fmt: skip
    farthest = max(sector.closed_to, int(plot_rows.max()) if len(plot_rows) else 0)
    near = np.flatnonzero(looks.covered & (looks.row - looks.guard <= farthest))
    if not len(near) and not len(plots):
        return _skip_uncovered(core, radar, looks)
    state, covariance = core.filter.predict(
        table.state[near], table.covariance[near], looks.time[near] - table.time[near]
    )
    expected = Expected(
        time=looks.time[near],
        state=state,
        covariance=covariance,
        window=(looks.guard[near] / site.video.azimuths + WINDOW_TURNS) * clock.period,
        extent=size[near],
        penalty=np.where(table.phase[near] == TrackPhase.TENTATIVE, core.settings.measurement.tentative_penalty, 0.0),
    )
    position = np.stack([plots.east, plots.north], axis=1)
    noise = oriented_noise(plots.covariance, extent, core.settings.measurement.plot_centroid_sd)
    answer = core.associate(expected, Measured(plots.time, position, plots.covariance))
    due = looks.due[near]
    contested = np.zeros(len(plots), np.bool_)
    contested[answer.pair[np.repeat(~due, np.diff(answer.first))]] = True
    taken = answer.measurement[due].copy()
    used = np.zeros(len(plots), np.bool_)
    used[taken[taken >= 0]] = True
    wait = ~used & (contested | (plot_rows >= sector.closed_to))
    left = np.flatnonzero(~used & ~wait)
    owner = owners(core, near, expected, plots.time[left], position[left], noise[left], extent[left])
    core.count("absorbed", int((owner >= 0).sum()))
    owning = np.full(len(left), -1, np.int64)
    owning[owner >= 0] = near[owner[owner >= 0]]
    _take_enclosed(near[due], taken, left, owning)
    _update_scores(core, sector.radar, near[due], taken, answer.distance[due], covariance[due], plots)
    _apply_plots(core, near[due], taken, plots, position, noise, extent, left, owning)
    _count_misses(core, near[due][taken < 0], looks)
    table.looked[radar, near[due]] = looks.row[near[due]]
    _skip_uncovered(core, radar, looks)
    _start_from_plots(core, sector, plots[left[owner < 0]], plot_rows[left[owner < 0]], position[left[owner < 0]])
    return wait


def _skip_uncovered(core: Core, radar: int, looks: Looks) -> Array:
    """Tracks that the radar cannot see count as looked at; no plot waits."""
    out = ~looks.covered & looks.due
    core.table.looked[radar, : core.table.n][out] = looks.row[out]
    return np.zeros(0, np.bool_)


def _take_enclosed(rows: Array, taken: Array, left: Array, owner: Array) -> None:
    """Tracks `rows` that took nothing although a plot lies within their extent take it; changes `taken` and `owner`."""
    if not (owner >= 0).any():
        return
    for k in np.flatnonzero(taken < 0):
        mine = np.flatnonzero(owner == rows[k])
        if len(mine):
            taken[k] = left[mine[0]]
            owner[mine[0]] = -2


def _update_scores(
    core: Core, radar: int, rows: Array, taken: Array, squared: Floats, covariance: Floats, plots: Plots
) -> None:
    """Add to the scores of the tracks `rows` (k,) what the plots `taken` (k,), -1 for none, say about them."""
    table, evidence = core.table, core.settings.evidence
    hit = taken >= 0
    table.score[rows[~hit]] += math.log(1.0 - evidence.detection)
    rows, plot = rows[hit], taken[hit]
    if not len(rows):
        return
    spread = covariance[hit, :2, :2] + plots.covariance[plot]
    place = np.stack([plots.east[plot], plots.north[plot]], axis=1)
    paved = PAVED[core.zones.kind(place[:, 0], place[:, 1])]
    learnt = core.false_plots[radar].density(place)
    false = np.where(paved, evidence.false_on_pavement, np.maximum(learnt, evidence.false_elsewhere))
    volume = 2 * math.pi * np.sqrt(spread[:, 0, 0] * spread[:, 1, 1] - spread[:, 0, 1] ** 2)
    cells = np.array(evidence.cell_scores)[np.clip(plots.cells[plot], 1, len(evidence.cell_scores)) - 1]
    # a plot taken because it lies within the extent has no distance of its own
    distance = np.where(np.isfinite(squared[hit]), squared[hit], MEAN_SQUARED_DISTANCE)
    log_likelihood_ratio = np.log(evidence.detection / (volume * false)) - 0.5 * distance + cells
    most = evidence.max_score - np.maximum(evidence.young_hits - table.hits[rows], 0) * evidence.score_per_hit
    table.score[rows] = np.minimum(table.score[rows] + log_likelihood_ratio, np.maximum(most, table.score[rows]))


def owners(
    core: Core, near: Array, expected: Expected, time: Floats, position: Floats, noise: Floats, extent: Floats
) -> Array:
    """For each leftover plot the established track (index in `near`) within whose extent it lies, -1 for none."""
    established = (core.table.phase[near] != TrackPhase.TENTATIVE) & (core.table.extent_count[near] >= SETTLED)
    return enclosing_tracks(expected, established, time, position, noise, extent, core.settings.grouping.absorb_margin)


def _apply_plots(
    core: Core, rows: Array, taken: Array, plots: Plots, position: Floats, noise: Floats, extent: Floats,
    left: Array, owner: Array,
) -> None:  # fmt: skip
    """Update tracks by their plots, together with what was left over inside their extent."""
    hit = taken >= 0
    rows, taken = rows[hit], taken[hit]
    if not len(rows):
        return
    extra = np.flatnonzero(np.isin(owner, rows))
    plot = np.r_[taken, left[extra]]
    position, extent = position[plot], extent[plot]
    if len(extra):
        member = np.r_[np.arange(len(rows)), np.searchsorted(rows, owner[extra])]
        position, extent = join_split_plots(member, position, plots.cells[plot], extent, core.extents(rows)[:, 2])
    table = core.table
    variance = (FRAGMENT_CENTROID_SD * table.least_half_extent[rows]) ** 2
    loose = noise[taken] + variance[:, None, None] * np.eye(2)
    apply_positions(core, rows, plots.time[taken], position, loose, Source.RADAR)
    reshape(
        core.settings.extent, rows, table.state, table.covariance, table.moved, extent, plots.bearing_sd[taken],
        table.length, table.width, table.heading, table.axis_bearing, table.moving, table.extent_count,
    )  # fmt: skip
    speed = np.hypot(table.state[rows, 2], table.state[rows, 3])
    table.category[rows] = core.classify(
        table.category[rows], table.claimed[rows], table.length[rows], table.width[rows], speed,
        table.extent_count[rows],
    )  # fmt: skip


def _count_misses(core: Core, rows: Array, looks: Looks) -> None:
    """A radar looked and found nothing, which counts for tracks that it could see: those not above its beam."""
    table = core.table
    high = ~table.on_ground[rows] | (table.altitude[rows] > core.settings.coverage.radar_ceiling)
    rows = rows[~high & (looks.time[rows] > table.updated[rows] - MISS_TOLERANCE_S)]
    table.misses[rows] += 1
    table.history[rows] = table.history[rows] << np.uint32(1)
    table.looks[rows] += 1


def _start_from_plots(core: Core, sector: SectorPlots, plots: Plots, plot_rows: Array, position: Floats) -> None:
    """Plots that belong to no track start tentative ones."""
    if not len(plots):
        return
    if core.settings.start.ignore_plots_on_buildings:
        built = core.zones.kind(plots.east, plots.north) == SurfaceKind.BUILDING
        built &= ~(plots.length >= core.settings.extent.aircraft_length)
        core.count("plot_on_building", int(built.sum()))
        if built.any():
            plots, plot_rows, position = plots[~built], plot_rows[~built], position[~built]
    extent = plot_extents(plots)
    noise = oriented_noise(plots.covariance, extent, core.settings.measurement.plot_centroid_sd)
    made = start_tracks(core, plots.time, position, noise, Source.RADAR, core.radars[sector.radar].simulated)
    k = made.stop - made.start
    # two fragments of a parked aircraft must not be taken for one target that moved from one to the other
    slow = np.arange(made.start, made.stop)[core.zones.kind(*position[:k].T) == SurfaceKind.APRON]
    core.table.covariance[slow, 2, 2] = core.table.covariance[slow, 3, 3] = core.settings.start.apron_speed_sd**2
    core.table.velocity_unknown[slow] = False
    core.table.radar[made] = sector.radar
    core.table.looked[sector.radar, made] = plot_rows[:k]
    core.table.length[made], core.table.width[made] = extent[:k, 0], extent[:k, 1]
    core.table.axis_bearing[made] = extent[:k, 2] % math.pi
