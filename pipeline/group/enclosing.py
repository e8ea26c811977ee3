"""Which plots lie within the extent of a track that is established: they are further echoes of the same target."""

from __future__ import annotations

import math

from pipeline.kernels.compiled import allocating
from pipeline.tables.arrays import Floats

MARGIN_VARIANCES = 2.0
"""The margin about an extent is the root of so many times the variance in both axes together: 2 standard deviations
when they are alike."""

MARGIN_EXTENT_SHARE = 0.1
"""The margin grows over the least one by this fraction of the length at most: a poorly known track must not swallow its
surroundings."""

LONGEST_PLOT = 1.2
"""A plot longer than this many lengths of the track, and the margin, is another target's; lengths of one target vary by
less from turn to turn."""

OUTSIDE = 1.0
"""Of a place on the edge of an ellipse as long and as wide as the extent, or beyond."""


@allocating
def place_within(
    track_time: float, mean: Floats, covariance: Floats, track_extent: Floats, time: float, position: Floats,
    noise: Floats, length: float, least: float,
) -> float:  # fmt: skip
    """Where in the extent of a track a plot lies: from 0 in the middle to OUTSIDE at the edge and beyond.

    track_time: UTC s, mean: (4,), covariance: (4, 4), track_extent: (3,) length m, width m, direction rad; the track is
    moved along its velocity to the time of the plot. time: UTC s. position: (2,) m. noise: (2, 2) m^2. length: m, of
    the plot. least: m, that the extent is wider by at least; for long targets more where plot and track are less sure.
    """
    dt = time - track_time
    e, n = position[0] - mean[0] - dt * mean[2], position[1] - mean[1] - dt * mean[3]
    long, wide = track_extent[0], track_extent[1]
    far = farthest_within(track_extent, least)
    if e * e + n * n > far * far:
        return OUTSIDE
    variance = noise[0, 0] + noise[1, 1]
    unsure = math.sqrt(MARGIN_VARIANCES * (covariance[0, 0] + covariance[1, 1] + variance))
    margin = min(max(least, unsure), least + MARGIN_EXTENT_SHARE * long)
    a, b = 0.5 * long + margin, 0.5 * wide + margin
    if e * e + n * n > max(a, b) ** 2 or length > LONGEST_PLOT * long + margin:
        return OUTSIDE
    s, c = math.sin(track_extent[2]), math.cos(track_extent[2])
    along, across = e * s + n * c, e * c - n * s
    return float(min((along / a) ** 2 + (across / b) ** 2, OUTSIDE))


@allocating
def farthest_within(track_extent: Floats, least: float) -> float:
    """m from the middle of a track, beyond which nothing lies within its extent. See `place_within`."""
    long = track_extent[0]
    return float(0.5 * max(long, track_extent[1]) + least + MARGIN_EXTENT_SHARE * long)
