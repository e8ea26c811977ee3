"""Radar plots: which track takes which plot as the antenna turns, what a split target becomes, what starts a track."""

from __future__ import annotations

import math

import numpy as np

from pipeline.airport.model import SurfaceKind
from pipeline.contracts.associate import Expected, Measured
from pipeline.kernels.compiled import allocating
from pipeline.tables import Plots, SectorPlots, Source, TrackPhase
from pipeline.tables.arrays import Array, Floats
from pipeline.track.core import Core, start, take
from pipeline.track.look import Looks, RadarClock, plan_looks
from pipeline.track.shape import oriented_noise, plot_extents, reshape

PAVED = np.isin(np.arange(256), (SurfaceKind.RUNWAY, SurfaceKind.TAXIWAY, SurfaceKind.APRON, SurfaceKind.ROAD))
"""(256,) by SurfaceKind: where targets are at home and false plots are few."""

NO_PLOTS = Plots.empty()

SETTLED = 3
"""Extents seen before a track's own extent may absorb plots."""


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
    stale = rows < sector.closed_to - 2 * site.video.azimuths
    core.count("plot_stale", int(stale.sum()))
    if stale.any():
        plots, rows = plots[~stale], rows[~stale]
    wait = _decide(core, sector, plots, rows)
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
    if core.table.n and sector.time < core.time - core.settings.max_lag:
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
        sane &= (cov[:, 0, 0] + cov[:, 1, 1] < 1e6) & (np.hypot(plots.east, plots.north) < 1e6)
    core.count("plot_invalid", int((~sane).sum()))
    period = core.clocks[sector.radar].period
    late = sane & (plots.time < sector.time - core.settings.max_lag - period)
    future = sane & (plots.time > sector.time + 0.5 * period)
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


def _decide(core: Core, sector: SectorPlots, plots: Plots, plot_rows: Array) -> Array:
    """Associate and start; the mask of plots that have to wait for the antenna to close more."""
    table, n, radar = core.table, core.table.n, sector.radar
    site, clock = core.radars[radar], core.clocks[radar]
    shape = plot_extents(plots)
    size = core.extents()
    looks = plan_looks(
        site, clock, table.time[:n], table.state[:n], table.covariance[:n], size, table.looked[radar, :n],
        core.associate.gate, core.associate.max_gate_m,
    )  # fmt: skip
    farthest = max(sector.closed_to, int(plot_rows.max()) if len(plot_rows) else 0)
    near = np.flatnonzero(looks.covered & (looks.row - looks.guard <= farthest))
    if not len(near) and not len(plots):
        return _nothing(core, radar, looks)
    state, covariance = core.filter.predict(
        table.state[near], table.covariance[near], looks.time[near] - table.time[near]
    )
    expected = Expected(
        time=looks.time[near],
        state=state,
        covariance=covariance,
        window=(looks.guard[near] / site.video.azimuths + 0.06) * clock.period,
        extent=size[near],
        penalty=np.where(table.phase[near] == TrackPhase.TENTATIVE, core.settings.tentative_penalty, 0.0),
    )
    position = np.stack([plots.east, plots.north], axis=1)
    noise = oriented_noise(plots.covariance, shape, core.settings.wander)
    answer = core.associate(expected, Measured(plots.time, position, plots.covariance))
    due = looks.due[near]
    contested = np.zeros(len(plots), np.bool_)
    contested[answer.pair[np.repeat(~due, np.diff(answer.first))]] = True
    taken = answer.measurement[due].copy()
    used = np.zeros(len(plots), np.bool_)
    used[taken[taken >= 0]] = True
    wait = ~used & (contested | (plot_rows >= sector.closed_to))
    left = np.flatnonzero(~used & ~wait)
    owner = owners(core, near, expected, plots.time[left], position[left], noise[left], shape[left])
    core.count("absorbed", int((owner >= 0).sum()))
    owning = np.full(len(left), -1, np.int64)
    owning[owner >= 0] = near[owner[owner >= 0]]
    _rescue(near[due], taken, left, owning)
    _score(core, sector.radar, near[due], taken, answer.distance[due], covariance[due], plots)
    _hit(core, near[due], taken, plots, position, noise, shape, left, owning)
    _miss(core, near[due][taken < 0], looks)
    table.looked[radar, near[due]] = looks.row[near[due]]
    _nothing(core, radar, looks)
    _begin(core, sector, plots[left[owner < 0]], plot_rows[left[owner < 0]], position[left[owner < 0]])
    return wait


def _nothing(core: Core, radar: int, looks: Looks) -> Array:
    """Tracks that the radar cannot see count as looked at; no plot waits."""
    out = ~looks.covered & looks.due
    core.table.looked[radar, : core.table.n][out] = looks.row[out]
    return np.zeros(0, np.bool_)


def _rescue(rows: Array, taken: Array, left: Array, owner: Array) -> None:
    """Tracks `rows` that took nothing although a plot lies within them take it; `taken` and `owner` are changed."""
    if not (owner >= 0).any():
        return
    for k in np.flatnonzero(taken < 0):
        mine = np.flatnonzero(owner == rows[k])
        if len(mine):
            taken[k] = left[mine[0]]
            owner[mine[0]] = -2


def _score(
    core: Core, radar: int, rows: Array, taken: Array, squared: Floats, covariance: Floats, plots: Plots
) -> None:
    """The tracks `rows` (k,) took the plots `taken` (k,), -1 for none: what that says about whether they are real."""
    table, settings = core.table, core.settings
    hit = taken >= 0
    table.score[rows[~hit]] += math.log(1.0 - settings.detection)
    rows, plot = rows[hit], taken[hit]
    if not len(rows):
        return
    spread = covariance[hit, :2, :2] + plots.covariance[plot]
    place = np.stack([plots.east[plot], plots.north[plot]], axis=1)
    paved = PAVED[core.zones.kind(place[:, 0], place[:, 1])]
    learnt = core.false_plots[radar].density(place)
    false = np.where(paved, settings.false_on_pavement, np.maximum(learnt, settings.false_elsewhere))
    volume = 2 * math.pi * np.sqrt(spread[:, 0, 0] * spread[:, 1, 1] - spread[:, 0, 1] ** 2)
    cells = np.array(settings.cell_scores)[np.clip(plots.cells[plot], 1, len(settings.cell_scores)) - 1]
    # what lies anywhere within an extended track has no distance of its own
    away = np.where(np.isfinite(squared[hit]), squared[hit], 2.0)
    gained = np.log(settings.detection / (volume * false)) - 0.5 * away + cells
    # what was seen for long may be lost for long
    most = settings.most_score - np.maximum(20 - table.hits[rows], 0) * 0.4
    table.score[rows] = np.minimum(table.score[rows] + gained, np.maximum(most, table.score[rows]))


def owners(
    core: Core, near: Array, expected: Expected, time: Floats, position: Floats, noise: Floats, shape: Floats
) -> Array:
    """For each leftover plot the established track (index in `near`) within whose extent it lies, -1 for none.

    The extent is wider by the margin of the settings, and for long targets by what plot and track are unsure of.
    """
    made = np.full(len(time), -1, np.int64)
    settled = (core.table.phase[near] != TrackPhase.TENTATIVE) & (core.table.shapes[near] >= SETTLED)
    if len(time) and settled.any():
        margin = core.settings.absorb_margin
        unsure = np.trace(expected.covariance[:, :2, :2], axis1=1, axis2=2)
        slack = np.trace(noise, axis1=1, axis2=2)
        _inside(
            expected.time, expected.state, expected.extent, unsure, settled, time, position, slack, shape, margin, made
        )  # fmt: skip
    return made


def _hit(
    core: Core, rows: Array, taken: Array, plots: Plots, position: Floats, noise: Floats, shape: Floats,
    left: Array, owner: Array,
) -> None:  # fmt: skip
    """Tracks take their plots, together with what was left over inside their extent."""
    hit = taken >= 0
    rows, taken = rows[hit], taken[hit]
    if not len(rows):
        return
    position, shape = position[taken], shape[taken]
    extra = np.flatnonzero(np.isin(owner, rows))
    if len(extra):
        position, shape = _joined(core, rows, taken, plots, position, shape, left[extra], owner[extra])
    table = core.table
    # which parts are seen is chance: their centre strays from that of the whole
    loose = noise[taken] + ((0.5 * table.body[rows]) ** 2)[:, None, None] * np.eye(2)
    take(core, rows, plots.time[taken], position, loose, Source.RADAR)
    reshape(
        core.settings.shape, rows, table.state, table.covariance, table.moved, shape, plots.bearing_sd[taken],
        table.length, table.width, table.heading, table.axis, table.moving, table.shapes,
    )  # fmt: skip
    speed = np.hypot(table.state[rows, 2], table.state[rows, 3])
    table.category[rows] = core.classify(
        table.category[rows], table.claimed[rows], table.length[rows], table.width[rows], speed, table.shapes[rows]
    )


def _joined(
    core: Core, rows: Array, taken: Array, plots: Plots, position: Floats, shape: Floats, extra: Array, owner: Array
) -> tuple[Floats, Floats]:
    """Plots of split targets as one: centroid by cells, extent from end to end along the track's direction."""
    where = np.searchsorted(rows, owner)
    direction = core.extents(rows)[:, 2]
    member, plot = np.r_[np.arange(len(rows)), where], np.r_[taken, extra]
    weight = np.maximum(plots.cells[plot], 1).astype(np.float64)
    points = np.stack([plots.east[plot], plots.north[plot]], axis=1)
    total = np.bincount(member, weight, len(rows))
    centre = np.stack([np.bincount(member, weight * points[:, axis], len(rows)) / total for axis in (0, 1)], axis=1)
    own = plot_extents(plots[plot])
    split = np.bincount(member, minlength=len(rows)) > 1
    made = shape.copy()
    turn = np.nan_to_num(own[:, 2]) - direction[member]
    for axis, (s, c) in enumerate(((np.sin(direction), np.cos(direction)), (np.cos(direction), -np.sin(direction)))):
        along = points[:, 0] * s[member] + points[:, 1] * c[member]
        lean = np.abs(np.cos(turn)) if axis == 0 else np.abs(np.sin(turn))
        half = 0.5 * np.maximum(own[:, 0] * lean, own[:, 1] * np.sqrt(1 - lean**2))
        low, high = np.full(len(rows), np.inf), np.full(len(rows), -np.inf)
        np.minimum.at(low, member, along - half)
        np.maximum.at(high, member, along + half)
        made[split, axis] = (high - low)[split]
    made[split, 2] = direction[split] % math.pi
    return np.where(split[:, None], centre, position), made


def _miss(core: Core, rows: Array, looks: Looks) -> None:
    """A radar looked and found nothing; of what flies above its beam it says nothing."""
    table = core.table
    high = ~table.on_ground[rows] | (table.altitude[rows] > core.settings.radar_ceiling)
    rows = rows[~high & (looks.time[rows] > table.updated[rows] - 0.5)]
    table.misses[rows] += 1
    table.history[rows] = table.history[rows] << np.uint32(1)
    table.looks[rows] += 1


def _begin(core: Core, sector: SectorPlots, plots: Plots, plot_rows: Array, position: Floats) -> None:
    """Plots that belong to nothing start tentative tracks."""
    if not len(plots):
        return
    if core.settings.ignore_plots_on_buildings:
        built = core.zones.kind(plots.east, plots.north) == SurfaceKind.BUILDING
        built &= ~(plots.length >= core.settings.aircraft_length)
        core.count("plot_on_building", int(built.sum()))
        if built.any():
            plots, plot_rows, position = plots[~built], plot_rows[~built], position[~built]
    shape = plot_extents(plots)
    noise = oriented_noise(plots.covariance, shape, core.settings.wander)
    made = start(core, plots.time, position, noise, Source.RADAR, core.radars[sector.radar].simulated)
    k = made.stop - made.start
    # nothing is fast among parked aircraft, and their parts must not be taken for something that is
    calm = np.arange(made.start, made.stop)[core.zones.kind(*position[:k].T) == SurfaceKind.APRON]
    core.table.covariance[calm, 2, 2] = core.table.covariance[calm, 3, 3] = core.settings.apron_speed_sd**2
    core.table.one_point[calm] = False
    core.table.radar[made] = sector.radar
    core.table.looked[sector.radar, made] = plot_rows[:k]
    core.table.length[made], core.table.width[made] = shape[:k, 0], shape[:k, 1]
    core.table.axis[made] = shape[:k, 2] % math.pi


@allocating
def _inside(
    track_time: Floats, state: Floats, extent: Floats, unsure: Floats, settled: Array, time: Floats, position: Floats,
    slack: Floats, shape: Floats, least: float, owner: Array,
) -> None:  # fmt: skip
    for j in range(len(time)):
        best = 1.0
        for i in range(len(track_time)):
            if not settled[i]:
                continue
            dt = time[j] - track_time[i]
            e = position[j, 0] - state[i, 0] - dt * state[i, 2]
            n = position[j, 1] - state[i, 1] - dt * state[i, 3]
            margin = min(max(least, math.sqrt(2.0 * (unsure[i] + slack[j]))), least + 0.1 * extent[i, 0])
            a, b = 0.5 * extent[i, 0] + margin, 0.5 * extent[i, 1] + margin
            if e * e + n * n > max(a, b) ** 2 or shape[j, 0] > 1.2 * extent[i, 0] + margin:
                continue
            s, c = math.sin(extent[i, 2]), math.cos(extent[i, 2])
            along, across = e * s + n * c, e * c - n * s
            ratio = (along / a) ** 2 + (across / b) ** 2
            if ratio < best:
                best, owner[j] = ratio, i
