"""Extent and heading of a track from the plots it takes."""

from __future__ import annotations

import math

import numpy as np

from pipeline.kernels.compiled import allocating
from pipeline.tables.arrays import Array, Floats
from pipeline.track.settings import ExtentSettings

SETTLED = 3
"""Extents taken before a track's own extent is known well enough to absorb plots."""

LONGEST_M = 200.0
"""No plot is taken for longer or wider; what is, is clutter or several targets in one echo."""

AXIS_GAIN = 0.2
"""Fraction a second, of the difference, by which plots turn the long axis."""

HEADING_GAIN = 0.5
"""Fraction a second, of the difference, by which a course turns the heading of a track."""

MOST_SINCE_S = 1.0
"""s since the plot before that count at most: the plots of a slower radar are no more exact."""

SUDDEN_TURN = 0.6
"""rad; a course that differs by more replaces the heading at once: it was wrong, or the target turned between two slow
looks. An aircraft on the ground turns by less than 0.4 a second."""

BACKWARDS = -0.5
"""Cosine of the angle between course and heading, below which a slow target moves backwards: more than 120 degrees."""

LONG_PLOT = 1.8
"""Length over width of a plot, above which its long axis gives the heading better than the course does."""

AXIS_AGREES = 0.35
"""rad, up to which long axis and course agree (20 degrees); beyond it the axis may be that of the wings."""

AXIS_SHARE = 0.5
"""Fraction by which a long axis that agrees corrects the course."""

QUARTER = 0.785
"""rad (45 degrees); a plot whose long axis lies farther from the track's has length and width exchanged."""


def extents(rows: Array) -> Floats:
    """(n, 3) length m, width m and direction rad for gating, of the tracks of records (n,) of the store.

    Zeros where unknown; those seen in fragments whole.
    """
    made = np.empty((len(rows), 3))
    _extents(rows, made)
    return made


Rule = tuple[float, float, float, float, float, float, float, float, float]


def shape_rule(settings: ExtentSettings) -> Rule:
    """The settings of `shape_row`: logarithms of what is left of a difference after a second, and bounds."""
    return (
        math.log1p(-settings.grow), math.log1p(-settings.shrink), math.log1p(-AXIS_GAIN), math.log1p(-HEADING_GAIN),
        settings.start_speed, settings.stop_speed, settings.reverse_speed, settings.bearing_sd, settings.speed_sigmas,
    )  # fmt: skip


@allocating
def fill_extent(
    length: float, width: float, bearing: float, deep: float, turn: float, distance: float, azimuth: float, out: Floats
) -> None:
    """Length, width in m and direction in rad modulo pi (nan when unknown) of a plot, into out (3,).

    From the polar extents, `deep` m and `turn` rad, where the extractor gave no axes.
    """
    along, across, direction = float(length), float(width), float(bearing)
    if not (math.isfinite(along) and along > 0.0):
        a, b = float(deep), float(turn) * distance
        a, b = (a if math.isfinite(a) else 0.0), (b if math.isfinite(b) else 0.0)
        along, across = max(a, b), min(a, b)
        direction = (azimuth if a >= b else azimuth + 0.5 * math.pi) % math.pi
    out[0] = min(max(along, 0.0), LONGEST_M)
    out[1] = min(max(across, 0.0), LONGEST_M) if math.isfinite(across) else 0.0
    out[2] = direction


@allocating
def _extents(rows: Array, out: Floats) -> None:
    for k in range(len(out)):
        fill_track_extent(rows[k], out[k])


@allocating
def fill_track_extent(track: Array, out: Floats) -> None:
    """Length m, width m and direction rad of one track for gating, into out (3,). See `extents`."""
    direction = track["heading"] if math.isfinite(track["heading"]) else track["axis_bearing"]
    least = 2.0 * track["least_half_extent"]
    out[0] = max(track["length"] if math.isfinite(track["length"]) else 0.0, least)
    out[1] = max(track["width"] if math.isfinite(track["width"]) else 0.0, least)
    out[2] = direction if math.isfinite(direction) else 0.0


@allocating
def _axis_difference(a: float, b: float) -> float:
    """a - b of two directions without sense, in (-pi/2, pi/2]."""
    return (a - b + 0.5 * math.pi) % math.pi - 0.5 * math.pi


@allocating
def _turn(a: float, b: float) -> float:
    """a - b of two directions, in (-pi, pi]."""
    return (a - b + math.pi) % (2 * math.pi) - math.pi


@allocating
def shape_row(rule: Rule, one: Array, before: float, period: float, plot: Array) -> None:
    """Smooth extent and heading of a track, a record of the store, with the plot that it took, one of a pool.

    rule: see `shape_rule`. before: UTC s of the plot before, minus infinity for none: then `period` s count.
    """
    log_grow, log_shrink, log_axis, log_heading = rule[0], rule[1], rule[2], rule[3]
    start_speed, stop_speed, reverse_speed, most_bearing_sd, speed_sigmas = rule[4], rule[5], rule[6], rule[7], rule[8]
    long, short, bearing = float(plot["extent"][0]), float(plot["extent"][1]), float(plot["extent"][2])
    since = plot["time"] - before if math.isfinite(before) else period
    dt = min(max(since, 0.0), MOST_SINCE_S)
    bearing_sd = plot["bearing_sd"]
    sure = math.isfinite(bearing) and (not math.isfinite(bearing_sd) or bearing_sd <= most_bearing_sd)
    x, p = one["state"], one["covariance"]
    axis, heading = float(one["axis_bearing"]), float(one["heading"])
    speed = math.hypot(x[2], x[3])
    noise = math.sqrt(0.5 * (p[2, 2] + p[3, 3]))
    least = stop_speed if one["moving"] else max(start_speed, speed_sigmas * noise)
    one["moving"] = one["moved"] and speed > least
    if sure:
        if not math.isfinite(axis):
            axis = bearing % math.pi
        else:
            axis = (axis - math.expm1(log_axis * dt) * _axis_difference(bearing, axis)) % math.pi
        one["axis_bearing"] = axis
    if one["moving"]:
        course = math.atan2(x[2], x[3])
        known = math.isfinite(heading)
        backwards = known and speed < reverse_speed and math.cos(course - heading) < BACKWARDS
        aim = course + math.pi if backwards else course
        if sure and long > LONG_PLOT * short and abs(_axis_difference(bearing, aim)) < AXIS_AGREES:
            aim += AXIS_SHARE * _axis_difference(bearing, aim)
        if known:
            difference = _turn(aim, heading)
            aim = heading + difference * (-math.expm1(log_heading * dt) if abs(difference) < SUDDEN_TURN else 1.0)
        heading = aim % (2 * math.pi)
        one["heading"] = heading
    if not long > 0.0:
        return
    pointing = heading if math.isfinite(heading) else axis
    if math.isfinite(bearing) and math.isfinite(pointing) and abs(_axis_difference(bearing, pointing)) > QUARTER:
        long, short = short, long
    if one["extent_count"] == 0:
        one["length"], one["width"] = long, short
    else:
        longer, wider = long - one["length"], short - one["width"]
        one["length"] -= math.expm1((log_grow if longer > 0.0 else log_shrink) * dt) * longer
        one["width"] -= math.expm1((log_grow if wider > 0.0 else log_shrink) * dt) * wider
    one["extent_count"] += 1
