"""Extent and heading of a track from the plots it takes."""

from __future__ import annotations

import math

import numpy as np

from pipeline.kernels.compiled import allocating
from pipeline.tables import Plots
from pipeline.tables.arrays import Array, Floats
from pipeline.track.settings import ExtentSettings

LONGEST_M = 200.0
"""No plot is taken for longer or wider; what is, is clutter or several targets in one echo."""

AXIS_GAIN = 0.2
"""Fraction of the difference by which a plot turns the long axis. Tied to a one-second antenna: it is taken once a
plot."""

HEADING_GAIN = 0.5
"""Fraction of the difference by which a course turns the heading of a track. Tied to a one-second antenna, as
AXIS_GAIN."""

SUDDEN_TURN = 0.6
"""rad; a course that differs by more replaces the heading at once: it was wrong, for nothing turns so in a second. Tied
to a one-second antenna."""

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


def plot_extents(plots: Plots) -> Floats:
    """(m, 3) length, width in m and bearing in rad modulo pi (nan when unknown) of plots, filled from the polar
    extents where the extractor gave no axes.
    """
    made = np.empty((len(plots), 3))
    _plot_extents(
        plots.length, plots.width, plots.bearing, plots.range_extent, plots.azimuth_extent, plots.range, plots.azimuth,
        made,
    )  # fmt: skip
    return made


def extents(length: Array, width: Array, heading: Array, axis_bearing: Array, least_half_extent: Array) -> Floats:
    """(n, 3) length m, width m and direction rad of tracks for gating; zeros where unknown. See `TrackTable`."""
    made = np.empty((len(length), 3))
    _extents(length, width, heading, axis_bearing, least_half_extent, made)
    return made


def oriented_noise(noise: Floats, extent: Floats, centroid_sd: float) -> Floats:
    """noise (m, 2, 2) m^2 plus that of an extended target's centroid, `centroid_sd` of its length and of its width."""
    made = noise.copy()
    _add_centroid_noise(extent, centroid_sd, made)
    return made


def reshape(
    rule: ExtentSettings, rows: Array, state: Array, covariance: Array, moved: Array, plot: Floats, bearing_sd: Array,
    length: Array, width: Array, heading: Array, axis_bearing: Array, moving: Array, extent_count: Array,
) -> None:  # fmt: skip
    """Smooth extent and heading of the tracks `rows` with the plot (k, 3) each took; the columns are changed."""
    settings = np.array([
        rule.grow, rule.shrink, rule.start_speed, rule.stop_speed, rule.reverse_speed, rule.bearing_sd,
        rule.speed_sigmas,
    ])  # fmt: skip
    _reshape(
        settings, rows, state, covariance, moved, plot, bearing_sd, length, width, heading, axis_bearing, moving,
        extent_count,
    )  # fmt: skip


@allocating
def _plot_extents(
    length: Array,
    width: Array,
    bearing: Array,
    deep: Array,
    turn: Array,
    distance: Floats,
    azimuth: Floats,
    out: Floats,
) -> None:
    for k in range(len(out)):
        along, across, direction = float(length[k]), float(width[k]), float(bearing[k])
        if not (math.isfinite(along) and along > 0.0):
            a, b = float(deep[k]), float(turn[k]) * distance[k]
            a, b = (a if math.isfinite(a) else 0.0), (b if math.isfinite(b) else 0.0)
            along, across = max(a, b), min(a, b)
            direction = (azimuth[k] if a >= b else azimuth[k] + 0.5 * math.pi) % math.pi
        out[k, 0] = min(max(along, 0.0), LONGEST_M)
        out[k, 1] = min(max(across, 0.0), LONGEST_M) if math.isfinite(across) else 0.0
        out[k, 2] = direction


@allocating
def _extents(
    length: Floats, width: Floats, heading: Floats, axis_bearing: Floats, least_half_extent: Floats, out: Floats
) -> None:
    for k in range(len(out)):
        direction = heading[k] if math.isfinite(heading[k]) else axis_bearing[k]
        least = 2.0 * least_half_extent[k]
        out[k, 0] = max(length[k] if math.isfinite(length[k]) else 0.0, least)
        out[k, 1] = max(width[k] if math.isfinite(width[k]) else 0.0, least)
        out[k, 2] = direction if math.isfinite(direction) else 0.0


@allocating
def _add_centroid_noise(extent: Floats, centroid_sd: float, noise: Floats) -> None:
    for k in range(len(extent)):
        direction = extent[k, 2]
        along, across = (centroid_sd * extent[k, 0]) ** 2, (centroid_sd * extent[k, 1]) ** 2
        if not math.isfinite(direction):
            direction, across = 0.0, along
        s, c = math.sin(direction), math.cos(direction)
        noise[k, 0, 0] += along * s * s + across * c * c
        noise[k, 1, 1] += along * c * c + across * s * s
        noise[k, 0, 1] += (along - across) * s * c
        noise[k, 1, 0] += (along - across) * s * c


@allocating
def _axis_difference(a: float, b: float) -> float:
    """a - b of two directions without sense, in (-pi/2, pi/2]."""
    return (a - b + 0.5 * math.pi) % math.pi - 0.5 * math.pi


@allocating
def _turn(a: float, b: float) -> float:
    """a - b of two directions, in (-pi, pi]."""
    return (a - b + math.pi) % (2 * math.pi) - math.pi


@allocating
def _reshape(
    rule: Floats, rows: Array, state: Floats, cov: Floats, moved: Array, plot: Floats, bearing_sd: Array,
    length: Floats, width: Floats, heading: Floats, axis_bearing: Floats, moving: Array, extent_count: Array,
) -> None:  # fmt: skip
    grow, shrink, start_speed, stop_speed = rule[0], rule[1], rule[2], rule[3]
    reverse_speed, most_bearing_sd, speed_sigmas = rule[4], rule[5], rule[6]
    for k in range(len(rows)):
        i = rows[k]
        long, short, bearing = plot[k, 0], plot[k, 1], plot[k, 2]
        sure = math.isfinite(bearing) and (not math.isfinite(bearing_sd[k]) or bearing_sd[k] <= most_bearing_sd)
        speed = math.hypot(state[i, 2], state[i, 3])
        noise = math.sqrt(0.5 * (cov[i, 2, 2] + cov[i, 3, 3]))
        moving[i] = moved[i] and speed > (stop_speed if moving[i] else max(start_speed, speed_sigmas * noise))
        if sure:
            if not math.isfinite(axis_bearing[i]):
                axis_bearing[i] = bearing % math.pi
            else:
                axis_bearing[i] = (axis_bearing[i] + AXIS_GAIN * _axis_difference(bearing, axis_bearing[i])) % math.pi
        if moving[i]:
            course = math.atan2(state[i, 2], state[i, 3])
            known = math.isfinite(heading[i])
            backwards = known and speed < reverse_speed and math.cos(course - heading[i]) < BACKWARDS
            aim = course + math.pi if backwards else course
            if sure and long > LONG_PLOT * short and abs(_axis_difference(bearing, aim)) < AXIS_AGREES:
                aim += AXIS_SHARE * _axis_difference(bearing, aim)
            if known:
                difference = _turn(aim, heading[i])
                aim = heading[i] + difference * (HEADING_GAIN if abs(difference) < SUDDEN_TURN else 1.0)
            heading[i] = aim % (2 * math.pi)
        if not long > 0.0:
            continue
        pointing = heading[i] if math.isfinite(heading[i]) else axis_bearing[i]
        if math.isfinite(bearing) and math.isfinite(pointing) and abs(_axis_difference(bearing, pointing)) > QUARTER:
            long, short = short, long
        if extent_count[i] == 0:
            length[i], width[i] = long, short
        else:
            length[i] += (grow if long > length[i] else shrink) * (long - length[i])
            width[i] += (grow if short > width[i] else shrink) * (short - width[i])
        extent_count[i] += 1
