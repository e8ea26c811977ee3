"""The recipe of the tracker for radar plots, at azimuth marks of its own.

A mark is a fixed direction of the antenna (`pipeline.tables.marks`). At each mark, and not where a block of sweeps
happens to end, the tracks whose whole gate has passed are decided; so any cut of a turn into blocks gives the same
bits.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pipeline.airport.model import SurfaceKind
from pipeline.contracts.associate import Expected
from pipeline.contracts.filter import Prior
from pipeline.contracts.measured import Hypotheses, Measured
from pipeline.kernels.compiled import allocating
from pipeline.tables import Source
from pipeline.tables.arrays import Array, Floats
from pipeline.tables.marks import MARKS_A_TURN
from pipeline.track.branching import branch_hypotheses, end_hypotheses
from pipeline.track.clusters import find_clusters, next_question, one_cluster
from pipeline.track.core import TENTATIVE, Core
from pipeline.track.evidence import count_misses, score_plots
from pipeline.track.judge import judge_tracks
from pipeline.track.maintenance import keep_house, next_housekeeping
from pipeline.track.resolve import Decided, reorder, resolve, together
from pipeline.track.schedule import Looks, Marks, close_looks, next_marks, plan_looks, starts_half
from pipeline.track.shape import SETTLED, Rule, shape_row, shape_rule
from pipeline.track.update import restate, start_tracks, update_tracks

WINDOW_TURNS = 0.06
"""Turns by which the time of a plot may differ from that of the look beyond what its gate covers: 22 degrees, what a
large echo near the radar takes up."""

FRAGMENT_CENTROID_SD = 0.5
"""Standard deviation of the plots of a target seen in fragments, as a fraction of half its least extent: which
fragments are seen is chance, and their centroid strays from that of the whole."""

MISS_TOLERANCE_TURNS = 0.5
"""A look older than the newest measurement by more turns says nothing of the track."""


BUILDING, APRON = int(SurfaceKind.BUILDING), int(SurfaceKind.APRON)


class Scan(NamedTuple):
    """What is decided together: looks, k of them, at the tracks of one radar, and its plots.

    predicted: what the filter expects of the looks, `expected` as associations see it. established: (k,) mask of tracks
    whose extent may hold several plots. pool: the plots.
    """

    looks: Looks
    predicted: Any
    expected: Expected
    established: Array
    pool: Array
    measured: Measured


def advance_radars(core: Core, newest: float) -> None:
    """Decide at all marks that are closed, in the order of their times. newest: UTC s of the newest sweep."""
    while any(len(one.mark) for one in core.clocks):
        marks = next_marks(core.clocks, core.azimuths, newest, core.began, next_housekeeping(core))
        if marks is None:
            return
        if starts_half(int(marks.number[0])) and marks.time[0] > next_housekeeping(core):
            keep_house(core, float(marks.time[0]))
        decide(core, marks)


def decide(core: Core, marks: Marks) -> None:
    """Associate as at each mark in turn; then update, judge and begin what was decided at all of them together.

    That is the same as one after the other: within half a turn no track is looked at twice by one radar, and nothing
    that is learnt counts before the next turn.
    """
    if marks.number[0] % MARKS_A_TURN == 0:
        core.false_plots[marks.radar].turn(int(marks.row[0]), core.azimuths[marks.radar])
    scan = _prepare(core, marks)
    decided, ended = _associate(core, marks, scan)
    if decided is not None:
        _apply(core, marks, scan, decided)
        if core.associate.branching:
            end_hypotheses(core, ended)
        _begin(core, marks, decided.left)
    core.pools[marks.radar].drop_spent()


def _prepare(core: Core, marks: Marks) -> Scan:
    """The looks that may be decided at the marks, and where the filter expects their tracks."""
    store, n, radar = core.store, core.store.n, marks.radar
    site = core.radars[radar]
    looks = plan_looks(
        site, marks, store.rows[:n], store.time[:n], store.look[:n, radar], core.associate.gate,
        core.associate.max_gate_m,
    )  # fmt: skip
    predicted, moments = core.predicted(looks.row, looks.time)
    period, k = float(marks.period[-1]), len(looks.row)
    window, established = np.empty(k), np.empty(k, np.bool_)
    _look_over(
        store.rows, looks.row, looks.guard, period / site.video.azimuths, WINDOW_TURNS * period, window, established
    )
    expected = core.expected(looks.row, looks.time, moments, window)
    pool = core.pools[radar].records
    return Scan(looks, predicted, expected, established, pool, Measured.view(pool))


def _associate(core: Core, marks: Marks, scan: Scan) -> tuple[Decided | None, Array]:
    """Who takes what, and rows of the store whose hypothesis is given up. None when nothing can be decided."""
    looks, pool, margin = scan.looks, scan.pool, core.settings.grouping.absorb_margin
    plot_row, spent = pool["row"].copy(), pool["spent"]
    if len(marks.number) == 1:
        clusters = one_cluster(len(looks.row), len(pool))
    else:
        clusters = find_clusters(
            core.associate, scan.expected, scan.established, scan.measured, plot_row, looks.due, marks.number,
            marks.row, margin,
        )  # fmt: skip
    open_looks = np.ones(len(looks.row), np.bool_)
    decided, ended = [], []
    while True:
        asked = next_question(clusters, looks.near, looks.due, open_looks, plot_row, spent, marks.number, marks.row)
        if asked is None:
            break
        answer = core.associate(scan.expected, scan.measured, asked.tracks, asked.plots)
        made = resolve(
            answer, asked, clusters, scan.expected, scan.established, pool, margin,
            core.settings.measurement.plot_centroid_sd,
        )  # fmt: skip
        core.count("absorbed", made.absorbed)
        open_looks[made.track] = False
        decided.append(made)
        ended.append(looks.row[asked.tracks[answer.ended]])
    if not decided:
        return None, looks.row[:0]
    return together(decided) if len(marks.number) > 1 else decided[0], np.concatenate(ended)


def _apply(core: Core, marks: Marks, scan: Scan, decided: Decided) -> None:
    """Update the tracks that took a plot, count the others as missed, and judge all that were looked at."""
    store, radar, settings = core.store, marks.radar, core.settings
    if not len(decided.track):
        return
    rows, time = scan.looks.row[decided.track], scan.looks.time[decided.track]
    predicted, origin, hit, squared = scan.predicted, decided.track, decided.hit, decided.squared
    at = scan.looks.at[decided.track]
    hypotheses = _spread(decided, len(scan.looks.row))
    close_looks(store.look[:, radar], rows, at, core.azimuths[radar])
    if core.associate.branching:
        rows, time, hypotheses, hit, origin = branch_hypotheses(core, rows, time, decided)
        squared = np.full(len(rows), np.nan)
        predicted, _ = core.predicted(rows, time)
    score_plots(
        settings.evidence, store, rows, radar, scan.expected.covariance, origin, scan.pool, hit, squared,
        core.false_plots[radar],
    )  # fmt: skip
    before = np.empty(len(rows))
    _loosen(store.rows, rows, hit, scan.pool, FRAGMENT_CENTROID_SD, before)
    _open_late(core, rows, hit, time)
    update_tracks(core, predicted, scan.measured, hypotheses, radar, Source.RADAR)
    _observe(core, rows, hit, scan.pool, before, float(marks.period[-1]))
    tolerance = MISS_TOLERANCE_TURNS * float(marks.period[-1])
    count_misses(store, rows, hit, radar, time, tolerance, settings.coverage.radar_ceiling)
    judge_tracks(core, rows, time)


def _open_late(core: Core, rows: Array, hit: Array, time: Floats) -> None:
    """What only reports told of may be elsewhere along its motion: the first plot says where, and not how fast."""
    if not core.reports_taken:
        return
    unsure = core.unsure_latency(rows, time)
    if not unsure.any():
        return
    late = (unsure > 0.0) & (hit >= 0)
    velocity = core.store.state[rows[late], 2:]
    more = unsure[late, None, None] ** 2 * velocity[:, :, None] * velocity[:, None, :]
    restate(core, rows[late], np.zeros((len(velocity), 2)), more)


def _observe(core: Core, rows: Array, hit: Array, pool: Array, before: Floats, period: float) -> None:
    """Extent, heading and class of tracks (k,) with the plots that they took. before: (k,) UTC s of the plot before."""
    n = len(rows)
    facts = (
        np.empty(n, np.uint8), np.empty(n, np.uint8), np.empty(n), np.empty(n), np.empty(n), np.empty(n, np.int64),
    )  # fmt: skip
    _take_plots(shape_rule(core.settings.extent), core.store.rows, rows, hit, pool, before, period, *facts)
    _put_class(core.store.rows, rows, hit, core.classify(*facts))


def _begin(core: Core, marks: Marks, left: Array) -> None:
    """Plots (n,) of the pool that belong to no track start tentative ones."""
    start, radar, n, pool = core.settings.start, marks.radar, len(left), core.pools[marks.radar]
    if not n:
        return
    kept, prior = np.empty(n, np.int64), Prior(np.empty((n, 2)), np.empty((n, 2, 2)), np.empty(n, np.bool_))
    many = _may_begin(
        pool.records, left, start.ignore_plots_on_buildings, start.speed_sd, start.apron_speed_sd, kept, *prior
    )
    if many < n:
        core.count("plot_on_building", n - many)
        prior = Prior(*(column[:many] for column in prior))
    if not many:
        return
    plots, site = pool.copies(kept[:many]), core.radars[radar]
    rows = start_tracks(core, Measured.view(plots), prior, radar, Source.RADAR, site.simulated)
    _take_extents(core.store.rows, rows, plots, radar)
    close_looks(core.store.look[:, radar], rows, plots["row"], site.video.azimuths)


@allocating
def _may_begin(
    pool: Array, left: Array, ignore_buildings: bool, speed_sd: float, apron_speed_sd: float, kept: Array,
    velocity: Floats, covariance: Floats, known: Array,
) -> int:  # fmt: skip
    """Write which plots `left` may begin a track, and what is held of its velocity; how many may.

    Two fragments of a parked aircraft must not be taken for one target that moved from one to the other: on an apron
    the velocity is taken to be known as about zero.
    """
    k = 0
    for j in left:
        surface = pool[j]["surface"]
        if ignore_buildings and surface == BUILDING and not pool[j]["long"]:
            continue
        kept[k], known[k] = j, surface == APRON
        sd = apron_speed_sd if known[k] else speed_sd
        velocity[k, 0] = velocity[k, 1] = 0.0
        covariance[k, 0, 0] = covariance[k, 1, 1] = sd * sd
        covariance[k, 0, 1] = covariance[k, 1, 0] = 0.0
        k += 1
    return k


@allocating
def _take_extents(tracks: Array, rows: Array, plots: Array, radar: int) -> None:
    """New tracks are as large as the plots that began them, and lie as those do."""
    for k in range(len(rows)):
        one, extent = tracks[rows[k]], plots[k]["extent"]
        one["radar"], one["length"], one["width"] = radar, extent[0], extent[1]
        one["axis_bearing"] = extent[2] % math.pi
        one["plot_since"] = plots[k]["time"]


def _spread(decided: Decided, n: int) -> Hypotheses:
    """The hypotheses of what was decided as those of all n looks, in their order; the others have none."""
    made = Hypotheses(
        np.empty(n + 1, np.int32), np.empty_like(decided.plot_first), np.empty_like(decided.plot),
        np.empty_like(decided.log_weight),
    )  # fmt: skip
    _fill(decided.track, decided.track_first, decided.plot_first, decided.plot, decided.log_weight, *made)
    return made


@allocating
def _fill(
    track: Array, track_first: Array, plot_first: Array, plot: Array, log_weight: Floats, out_track: Array,
    out_first: Array, out_plot: Array, out_weight: Floats,
) -> None:  # fmt: skip
    order = np.full(len(out_track) - 1, -1, np.int64)
    for k in range(len(track)):
        order[track[k]] = k
    reorder(order, track_first, plot_first, plot, log_weight, out_track, out_first, out_plot, out_weight)


@allocating
def _look_over(
    tracks: Array, rows: Array, guard: Floats, row_s: float, least_s: float, window: Floats, established: Array
) -> None:
    """Write the windows of looks, from `row_s` s for each row of their guard, and which tracks are established."""
    for k in range(len(rows)):
        one = tracks[rows[k]]
        window[k] = guard[k] * row_s + least_s
        established[k] = one["phase"] != TENTATIVE and one["extent_count"] >= SETTLED


@allocating
def _take_plots(
    rule: Rule, tracks: Array, rows: Array, hit: Array, pool: Array, before: Floats, period: float, category: Array,
    claimed: Array, length: Floats, width: Floats, speed: Floats, extents: Array,
) -> None:  # fmt: skip
    """Keep the newest plot of each track, against which its reports are held, smooth its extent with it, and write
    what classes rest on."""
    for k in range(len(rows)):
        one = tracks[rows[k]]
        if hit[k] >= 0:
            plot = pool[hit[k]]
            one["plot_since"] = min(one["plot_since"], plot["time"])
            one["plot_position"][0], one["plot_position"][1] = plot["position"][0], plot["position"][1]
            one["plot_variance"] = 0.5 * (plot["noise"][0, 0] + plot["noise"][1, 1])
            shape_row(rule, one, before[k], period, plot)
        category[k], claimed[k], extents[k] = one["category"], one["claimed"], one["extent_count"]
        length[k], width[k] = one["length"], one["width"]
        speed[k] = math.hypot(one["state"][2], one["state"][3])


@allocating
def _put_class(tracks: Array, rows: Array, plot: Array, category: Array) -> None:
    for k in range(len(rows)):
        if plot[k] >= 0:
            tracks[rows[k]]["category"] = category[k]


@allocating
def _loosen(tracks: Array, rows: Array, hit: Array, pool: Array, centroid_sd: float, before: Floats) -> None:
    """The noise of plots that targets seen in fragments took grows by that of which fragments are seen.

    before: written with UTC s of the plot before.
    """
    for k in range(len(rows)):
        one = tracks[rows[k]]
        before[k] = one["radar_time"]
        if hit[k] >= 0:
            variance = (centroid_sd * one["least_half_extent"]) ** 2
            noise = pool[hit[k]]["noise"]
            noise[0, 0] += variance
            noise[1, 1] += variance
