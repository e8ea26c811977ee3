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
from pipeline.contracts.measured import Hypotheses, Measured
from pipeline.kernels.compiled import allocating
from pipeline.kernels.records import take
from pipeline.tables import Source
from pipeline.tables.arrays import Array, Floats
from pipeline.tables.marks import MARKS_A_TURN
from pipeline.track.branching import branch_hypotheses, end_hypotheses
from pipeline.track.core import TENTATIVE, Core
from pipeline.track.evidence import count_misses, score_plots
from pipeline.track.judge import judge_tracks
from pipeline.track.maintenance import keep_house, next_housekeeping
from pipeline.track.resolve import Decided, resolve
from pipeline.track.schedule import Looks, Marks, close_looks, next_marks, plan_looks
from pipeline.track.shape import SETTLED, reshape
from pipeline.track.update import restate, start_tracks, unknown_velocity, update_tracks

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
    while True:
        marks = next_marks(core.clocks, core.azimuths, newest, core.began, next_housekeeping(core))
        if marks is None:
            return
        if marks.time[0] > next_housekeeping(core):
            keep_house(core, float(marks.time[0]))
        decide(core, marks)


def decide(core: Core, marks: Marks) -> None:
    """Associate at each mark in turn; then update, judge and begin what was decided at all of them together.

    That is the same as one after the other: within half a turn no track is looked at twice by one radar, and nothing
    that is learnt counts before the next turn.
    """
    if marks.number[0] % MARKS_A_TURN == 0:
        core.false_plots[marks.radar].turn(int(marks.row[0]), core.azimuths[marks.radar])
    scan = _prepare(core, marks)
    decided, left, ended = [], [], []
    open_looks = np.ones(len(scan.looks.row), np.bool_)
    for number, row in zip(marks.number.tolist(), marks.row.tolist(), strict=True):
        answered = _associate(core, scan, open_looks, number, row)
        if answered is not None:
            decided.append(answered[0])
            left.append(answered[0].left)
            ended.append(answered[1])
    if decided:
        _apply(core, marks, scan, _together(decided))
        if core.associate.branching:
            end_hypotheses(core, np.concatenate(ended))
        _begin(core, marks, take(scan.pool, left[0] if len(left) == 1 else np.concatenate(left)))
    core.pools[marks.radar] = take(scan.pool, ~scan.pool["spent"]) if len(scan.pool) else scan.pool


def _prepare(core: Core, marks: Marks) -> Scan:
    """The looks that may be decided at the marks, and where the filter expects their tracks."""
    store, n, radar = core.store, core.store.n, marks.radar
    site = core.radars[radar]
    looks = plan_looks(
        site, marks, store.rows[:n], store.time[:n], store.look[:n, radar], core.associate.gate,
        core.associate.max_gate_m,
    )  # fmt: skip
    predicted, moments = core.predicted(looks.row, looks.time)
    period = float(marks.period[-1])
    window = looks.guard * (period / site.video.azimuths) + WINDOW_TURNS * period
    expected = core.expected(looks.row, looks.time, moments, window)
    established = (store.phase[looks.row] != TENTATIVE) & (store.extent_count[looks.row] >= SETTLED)
    pool = core.pools[radar]
    return Scan(looks, predicted, expected, established, pool, Measured.view(pool))


def _associate(core: Core, scan: Scan, open_looks: Array, number: int, row: int) -> tuple[Decided, Array] | None:
    """At the mark `number`, at the absolute `row`: who takes what, and rows of the store whose hypothesis is given up.

    None when nothing can be decided.
    """
    n, m = len(scan.looks.row), len(scan.pool)
    tracks, plots, due = np.empty(n, np.int64), np.empty(m, np.int32), np.empty(n, np.bool_)
    n, m = _at_mark(scan.looks.near, scan.looks.due, open_looks, scan.pool, number, row, tracks, plots, due)
    if not n and not m:
        return None
    tracks, plots = tracks[:n], plots[:m]
    answer = core.associate(scan.expected, scan.measured, tracks, plots)
    made = resolve(
        answer, tracks, due, plots, scan.expected, scan.established, scan.pool,
        core.settings.grouping.absorb_margin, core.settings.measurement.plot_centroid_sd,
    )  # fmt: skip
    core.count("absorbed", made.absorbed)
    open_looks[made.track] = False
    return made, scan.looks.row[tracks[answer.ended]]


def _together(decided: list[Decided]) -> Decided:
    """What was decided at several marks as one."""
    if len(decided) == 1:
        return decided[0]
    track, hit, squared, plot, weight = (
        np.concatenate([getattr(one, name) for one in decided])
        for name in ("track", "hit", "squared", "plot", "log_weight")
    )
    track_first = _chained([one.track_first for one in decided])
    plot_first = _chained([one.plot_first for one in decided])
    return Decided(track, track_first, plot_first, plot, weight, plot[:0], hit, squared, 0)


def _chained(offsets: list[Array]) -> Array:
    """Offsets of compressed rows, one after the other."""
    made, end = [np.zeros(1, np.int32)], 0
    for one in offsets:
        made.append(one[1:] + np.int32(end))
        end += int(one[-1])
    return np.concatenate(made)


def _apply(core: Core, marks: Marks, scan: Scan, decided: Decided) -> None:
    """Update the tracks that took a plot, count the others as missed, and judge all that were looked at."""
    store, radar, settings = core.store, marks.radar, core.settings
    if not len(decided.track):
        return
    rows, time = scan.looks.row[decided.track], scan.looks.time[decided.track]
    close_looks(store.look[:, radar], rows, scan.looks.at[decided.track], core.azimuths[radar])
    predicted, origin, hit, squared = scan.predicted, decided.track, decided.hit, decided.squared
    hypotheses = _spread(decided, len(scan.looks.row))
    if core.associate.branching:
        rows, time, hypotheses, hit, origin = branch_hypotheses(core, rows, time, decided)
        squared = np.full(len(rows), np.nan)
        predicted, _ = core.predicted(rows, time)
    score_plots(
        settings.evidence, store, rows, radar, scan.expected.covariance, origin, scan.pool, hit, squared,
        core.false_plots[radar],
    )  # fmt: skip
    _loosen(store.rows, rows, hit, scan.pool, FRAGMENT_CENTROID_SD)
    _open_late(core, rows, hit, time)
    before = store.radar_time[rows]
    update_tracks(core, predicted, scan.measured, hypotheses, radar, Source.RADAR)
    _keep_plots(store.rows, rows, hit, scan.pool)
    _shape(core, scan, rows, hit, before, float(marks.period[-1]))
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


def _shape(core: Core, scan: Scan, rows: Array, plot: Array, before: Floats, period: float) -> None:
    """Extent, heading and class of tracks (k,) with the plots that they took. before: (k,) UTC s of the plot before."""
    store, measured, n = core.store, scan.measured, len(rows)
    reshape(
        core.settings.extent, store.rows, rows, before, period, measured.time, measured.extent, measured.bearing_sd,
        plot,
    )  # fmt: skip
    facts = (
        np.empty(n, np.uint8), np.empty(n, np.uint8), np.empty(n), np.empty(n), np.empty(n), np.empty(n, np.int64),
    )  # fmt: skip
    _class_facts(store.rows, rows, *facts)
    _put_class(store.rows, rows, plot, core.classify(*facts))


def _begin(core: Core, marks: Marks, plots: Array) -> None:
    """Plots that belong to no track start tentative ones."""
    surface, start, radar = plots["surface"], core.settings.start, marks.radar
    if start.ignore_plots_on_buildings and (surface == BUILDING).any():
        built = (surface == BUILDING) & ~plots["long"]
        core.count("plot_on_building", int(built.sum()))
        plots = take(plots, ~built)
        surface = plots["surface"]
    if not len(plots):
        return
    prior = unknown_velocity(core, len(plots))
    # two fragments of a parked aircraft must not be taken for one target that moved from one to the other
    apron = surface == APRON
    if apron.any():
        prior.covariance[apron] = start.apron_speed_sd**2 * np.eye(2)
        prior.known[apron] = True
    site = core.radars[radar]
    rows = start_tracks(core, Measured.view(plots), prior, radar, Source.RADAR, site.simulated)
    _take_extents(core.store.rows, rows, plots, radar)
    close_looks(core.store.look[:, radar], rows, plots["row"], site.video.azimuths)


@allocating
def _take_extents(tracks: Array, rows: Array, plots: Array, radar: int) -> None:
    """New tracks are as large as the plots that began them, and lie as those do."""
    for k in range(len(rows)):
        one, extent = tracks[rows[k]], plots[k]["extent"]
        one["radar"], one["length"], one["width"] = radar, extent[0], extent[1]
        one["axis_bearing"] = extent[2] % math.pi
        one["plot_since"] = plots[k]["time"]


@allocating
def _at_mark(
    near: Array, due: Array, open_looks: Array, pool: Array, number: int, row: int, tracks: Array, plots: Array,
    mask: Array,
) -> tuple[int, int]:  # fmt: skip
    """Write looks whose gate the mark may reach, plots before it that are not spent, and the mask of looks due.

    How many of the first two there are.
    """
    k = j = 0
    for i in range(len(near)):
        mask[i] = False
        if open_looks[i] and near[i] <= number:
            tracks[k] = i
            k += 1
            mask[i] = due[i] <= number
    for i in range(len(pool)):
        if pool[i]["row"] >= row:
            break
        if not pool[i]["spent"]:
            plots[j] = i
            j += 1
    return k, j


def _spread(decided: Decided, n: int) -> Hypotheses:
    """The hypotheses of what was decided as those of all n looks, in their order; the others have none."""
    made = Hypotheses(
        np.empty(n + 1, np.int32), np.empty_like(decided.plot_first), np.empty_like(decided.plot),
        np.empty_like(decided.log_weight),
    )  # fmt: skip
    _order(decided.track, decided.track_first, decided.plot_first, decided.plot, decided.log_weight, *made)
    return made


@allocating
def _order(
    track: Array, track_first: Array, plot_first: Array, plot: Array, log_weight: Floats, out_track: Array,
    out_first: Array, out_plot: Array, out_weight: Floats,
) -> None:  # fmt: skip
    n = len(out_track) - 1
    where = np.full(n, -1, np.int64)
    for k in range(len(track)):
        where[track[k]] = k
    h = p = 0
    out_track[0] = out_first[0] = 0
    for i in range(n):
        if where[i] >= 0:
            for o in range(track_first[where[i]], track_first[where[i] + 1]):
                for q in range(plot_first[o], plot_first[o + 1]):
                    out_plot[p] = plot[q]
                    p += 1
                out_weight[h] = log_weight[o]
                h += 1
                out_first[h] = p
        out_track[i + 1] = h


@allocating
def _class_facts(
    tracks: Array, rows: Array, category: Array, claimed: Array, length: Floats, width: Floats, speed: Floats,
    extents: Array,
) -> None:  # fmt: skip
    for k in range(len(rows)):
        one = tracks[rows[k]]
        category[k], claimed[k], extents[k] = one["category"], one["claimed"], one["extent_count"]
        length[k], width[k] = one["length"], one["width"]
        speed[k] = math.hypot(one["state"][2], one["state"][3])


@allocating
def _put_class(tracks: Array, rows: Array, plot: Array, category: Array) -> None:
    for k in range(len(rows)):
        if plot[k] >= 0:
            tracks[rows[k]]["category"] = category[k]


@allocating
def _keep_plots(tracks: Array, rows: Array, hit: Array, pool: Array) -> None:
    """The newest plot of each track, against which its reports are held."""
    for k in range(len(rows)):
        if hit[k] >= 0:
            plot, one = pool[hit[k]], tracks[rows[k]]
            one["plot_since"] = min(one["plot_since"], plot["time"])
            one["plot_position"][:] = plot["position"]
            one["plot_variance"] = 0.5 * (plot["noise"][0, 0] + plot["noise"][1, 1])


@allocating
def _loosen(tracks: Array, rows: Array, hit: Array, pool: Array, centroid_sd: float) -> None:
    """The noise of plots that targets seen in fragments took grows by that of which fragments are seen."""
    for k in range(len(rows)):
        if hit[k] >= 0:
            variance = (centroid_sd * tracks[rows[k]]["least_half_extent"]) ** 2
            noise = pool[hit[k]]["noise"]
            noise[0, 0] += variance
            noise[1, 1] += variance
