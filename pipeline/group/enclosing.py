"""Which plots lie within the extent of a track that is established: they are further echoes of the same target."""

from __future__ import annotations

import math

import numpy as np

from pipeline.contracts.associate import Expected
from pipeline.kernels.compiled import allocating
from pipeline.tables.arrays import Array, Floats

MARGIN_VARIANCES = 2.0
"""The margin about an extent is the root of so many times the variance in both axes together: 2 standard deviations
when they are alike."""

MARGIN_EXTENT_SHARE = 0.1
"""The margin grows over the least one by this fraction of the length at most: a poorly known track must not swallow its
surroundings."""

LONGEST_PLOT = 1.2
"""A plot longer than this many lengths of the track, and the margin, is another target's; lengths of one target vary by
less from turn to turn."""


def enclosing_tracks(
    tracks: Expected, established: Array, time: Floats, position: Floats, noise: Floats, extent: Floats, margin: float
) -> Array:
    """For each plot (m,) the track (n,) within whose extent it lies, nearest to its middle, or -1: (m,) int64.

    tracks: moved along their velocity to the time of each plot. established: (n,) mask of tracks that may have plots.
    time: s. position: (m, 2) m. noise: (m, 2, 2) m^2. extent: (m, 3) length m, width m, direction rad of the plots.
    margin: m, that the extent is wider by at least; for long targets more where plot and track are less sure.
    """
    made = np.full(len(time), -1, np.int64)
    if len(time) and established.any():
        track_variance = np.trace(tracks.covariance[:, :2, :2], axis1=1, axis2=2)
        variance = np.trace(noise, axis1=1, axis2=2)
        _enclosing(
            tracks.time, tracks.state, tracks.extent, track_variance, established, time, position, variance, extent,
            margin, made,
        )  # fmt: skip
    return made


@allocating
def _enclosing(
    track_time: Floats, state: Floats, track_extent: Floats, track_variance: Floats, established: Array, time: Floats,
    position: Floats, variance: Floats, extent: Floats, least: float, made: Array,
) -> None:  # fmt: skip
    for j in range(len(time)):
        best = 1.0
        for i in range(len(track_time)):
            if not established[i]:
                continue
            dt = time[j] - track_time[i]
            e = position[j, 0] - state[i, 0] - dt * state[i, 2]
            n = position[j, 1] - state[i, 1] - dt * state[i, 3]
            length, width = track_extent[i, 0], track_extent[i, 1]
            unsure = math.sqrt(MARGIN_VARIANCES * (track_variance[i] + variance[j]))
            margin = min(max(least, unsure), least + MARGIN_EXTENT_SHARE * length)
            a, b = 0.5 * length + margin, 0.5 * width + margin
            if e * e + n * n > max(a, b) ** 2 or extent[j, 0] > LONGEST_PLOT * length + margin:
                continue
            s, c = math.sin(track_extent[i, 2]), math.cos(track_extent[i, 2])
            along, across = e * s + n * c, e * c - n * s
            ratio = (along / a) ** 2 + (across / b) ** 2
            if ratio < best:
                best, made[j] = ratio, i
