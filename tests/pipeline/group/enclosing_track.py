"""Of many tracks, the one within whose extent a plot lies: the plain search that the tracker is held against."""

from __future__ import annotations

from pipeline.group.enclosing import OUTSIDE, place_within
from pipeline.tables.arrays import Array, Floats


def enclosing_track(
    tracks: Array, established: Array, track_time: Floats, mean: Floats, covariance: Floats, track_extent: Floats,
    time: float, position: Floats, noise: Floats, length: float, least: float,
) -> int:  # fmt: skip
    """The place in `tracks` of the track within whose extent a plot lies, nearest to its middle, or -1.

    tracks: (k,) rows of what follows. established: (n,) mask of tracks that may have plots. track_time: (n,) UTC s,
    mean: (n, 4), covariance: (n, 4, 4), track_extent: (n, 3) length m, width m, direction rad; each is moved along its
    velocity to the time of the plot. time: s. position: (2,) m. noise: (2, 2) m^2. length: m, of the plot. least: m,
    that the extent is wider by at least; for long targets more where plot and track are less sure.
    """
    best, made = OUTSIDE, -1
    for k in range(len(tracks)):
        i = tracks[k]
        if not established[i]:
            continue
        ratio = place_within(
            track_time[i], mean[i], covariance[i], track_extent[i], time, position, noise, length, least
        )
        if ratio < best:
            best, made = ratio, k
    return made
