"""Extent and heading of a track from the plots it takes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.kernels.compiled import allocating
from pipeline.tables import Plots
from pipeline.tables.arrays import Array, Floats


@dataclass(frozen=True)
class ShapeRule:
    """grow, shrink: part of a longer or shorter extent taken per plot (a target hides more easily than it grows).

    start_speed, stop_speed: m/s above and below which a course gives the heading; to start, the speed must also be
    `sure` times its own standard deviation, and the target must have come away from where it was first seen.
    reverse_speed: m/s, up to which a target may move backwards (push-back). bearing_sd: rad, plots less sure of their
    long axis do not turn the heading.
    """

    grow: float = 0.2
    shrink: float = 0.1
    start_speed: float = 2.5
    stop_speed: float = 1.2
    sure: float = 3.0
    reverse_speed: float = 4.0
    bearing_sd: float = 0.25


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


def extents(length: Array, width: Array, heading: Array, axis: Array, body: Array) -> Floats:
    """(n, 3) length, width and direction of tracks for gating; zeros where unknown. body: m, half the least size."""
    made = np.empty((len(length), 3))
    _extents(length, width, heading, axis, body, made)
    return made


def oriented_noise(noise: Floats, extent: Floats, part: float) -> Floats:
    """noise (m, 2, 2) plus the wander of an extended target's centroid: sd `part` of its length and of its width."""
    made = noise.copy()
    _wander(extent, part, made)
    return made


def reshape(
    rule: ShapeRule, rows: Array, state: Array, covariance: Array, moved: Array, plot: Floats, bearing_sd: Array,
    length: Array, width: Array, heading: Array, axis: Array, moving: Array, shapes: Array,
) -> None:  # fmt: skip
    """Smooth extent and heading of the tracks `rows` with the plot (k, 3) each took; the columns are changed."""
    settings = np.array([
        rule.grow, rule.shrink, rule.start_speed, rule.stop_speed, rule.reverse_speed, rule.bearing_sd, rule.sure
    ])  # fmt: skip
    _reshape(settings, rows, state, covariance, moved, plot, bearing_sd, length, width, heading, axis, moving, shapes)


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
        out[k, 0] = min(max(along, 0.0), 200.0)
        out[k, 1] = min(max(across, 0.0), 200.0) if math.isfinite(across) else 0.0
        out[k, 2] = direction


@allocating
def _extents(length: Floats, width: Floats, heading: Floats, axis: Floats, body: Floats, out: Floats) -> None:
    for k in range(len(out)):
        direction = heading[k] if math.isfinite(heading[k]) else axis[k]
        least = 2.0 * body[k]
        out[k, 0] = max(length[k] if math.isfinite(length[k]) else 0.0, least)
        out[k, 1] = max(width[k] if math.isfinite(width[k]) else 0.0, least)
        out[k, 2] = direction if math.isfinite(direction) else 0.0


@allocating
def _wander(extent: Floats, part: float, noise: Floats) -> None:
    for k in range(len(extent)):
        direction = extent[k, 2]
        along, across = (part * extent[k, 0]) ** 2, (part * extent[k, 1]) ** 2
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
    length: Floats, width: Floats, heading: Floats, axis: Floats, moving: Array, shapes: Array,
) -> None:  # fmt: skip
    for k in range(len(rows)):
        i = rows[k]
        long, short, bearing = plot[k, 0], plot[k, 1], plot[k, 2]
        sure = math.isfinite(bearing) and (not math.isfinite(bearing_sd[k]) or bearing_sd[k] <= rule[5])
        speed = math.hypot(state[i, 2], state[i, 3])
        noise = math.sqrt(0.5 * (cov[i, 2, 2] + cov[i, 3, 3]))
        moving[i] = moved[i] and speed > (rule[3] if moving[i] else max(rule[2], rule[6] * noise))
        if sure:
            if not math.isfinite(axis[i]):
                axis[i] = bearing % math.pi
            else:
                axis[i] = (axis[i] + 0.2 * _axis_difference(bearing, axis[i])) % math.pi
        if moving[i]:
            course = math.atan2(state[i, 2], state[i, 3])
            known = math.isfinite(heading[i])
            backwards = known and speed < rule[4] and math.cos(course - heading[i]) < -0.5
            aim = course + math.pi if backwards else course
            # the long axis tells the nose better than the course does, as long as they agree
            if sure and long > 1.8 * short and abs(_axis_difference(bearing, aim)) < 0.35:
                aim += 0.5 * _axis_difference(bearing, aim)
            if known:
                difference = _turn(aim, heading[i])
                aim = heading[i] + difference * (0.5 if abs(difference) < 0.6 else 1.0)
            heading[i] = aim % (2 * math.pi)
        if not long > 0.0:
            continue
        pointing = heading[i] if math.isfinite(heading[i]) else axis[i]
        if math.isfinite(bearing) and math.isfinite(pointing) and abs(_axis_difference(bearing, pointing)) > 0.785:
            long, short = short, long
        if shapes[i] == 0:
            length[i], width[i] = long, short
        else:
            length[i] += (rule[0] if long > length[i] else rule[1]) * (long - length[i])
            width[i] += (rule[0] if short > width[i] else rule[1]) * (short - width[i])
        shapes[i] += 1
