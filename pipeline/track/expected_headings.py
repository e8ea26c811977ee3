"""What moving tracks say of how targets point, for the bearings of the next plots."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.tables import TrackPhase, Tracks
from pipeline.tables.arrays import Floats

MOVING = 2.0
"""m/s: above it a target moves the way it points."""

DRIFT = 0.05
"""rad: an aircraft's nose and its way differ by this much, in turns and wind."""

AHEAD = 2.0
"""s: a track is not moved further than this to the time of the picture."""


@dataclass(frozen=True, eq=False)
class ExpectedHeadings:
    """One row a track. east, north: m at the time asked for. heading: rad from true north. sd: rad."""

    east: Floats
    north: Floats
    heading: Floats
    sd: Floats


def expected_headings(tracks: Tracks, time: float) -> ExpectedHeadings:
    """Of the confirmed tracks that move, at `time` (UTC s): the direction of the velocity, and how sure that is.

    The standard deviation is that of the velocity across its direction over the speed, with DRIFT.
    """
    speed = np.hypot(tracks.state[:, 2], tracks.state[:, 3])
    with np.errstate(invalid="ignore"):
        moving = tracks[(tracks.phase == TrackPhase.CONFIRMED) & (speed > MOVING) & np.isfinite(speed)]
    east, north, v_east, v_north = moving.state.T.astype(np.float64)
    speed = np.hypot(v_east, v_north)
    across = np.stack([v_north, -v_east], axis=1) / speed[:, None]
    variance = np.einsum("ni,nij,nj->n", across, moving.covariance[:, 2:, 2:], across)
    ahead = np.clip(time - moving.time, -AHEAD, AHEAD)
    return ExpectedHeadings(
        east=east + v_east * ahead,
        north=north + v_north * ahead,
        heading=np.arctan2(v_east, v_north) % (2 * np.pi),
        sd=np.sqrt(np.maximum(variance, 0.0) / speed**2 + DRIFT**2),
    )
