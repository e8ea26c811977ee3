"""One target whose echo falls apart for good: which tracks are fragments of which, and how far the whole reaches."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pipeline.kernels.compiled import allocating
from pipeline.tables.arrays import Array, Floats

AIRCRAFT_HALF_EXTENT = 21.0
"""m, half the length and half the span of an aircraft of unknown size, and how far its fragments may lie from its
middle; rounded up from a 737-800 (half of 39.5 m)."""

LONGEST_AIRCRAFT = 75.0
"""m, to which an extent may grow over fragments; the largest airliners measure 73 to 80 m."""

LONGEST_FRAGMENT = 25.0
"""m, of a track that is a fragment of another farther away than AIRCRAFT_HALF_EXTENT: what was seen longer is a target
of its own."""

FAST = 20.0
"""m/s, above which nothing else moves within the extent of an aircraft: vehicles drive more slowly, aircraft keep more
distance."""

VELOCITY_GATE = 5.0
"""Squared difference of the velocities over the sum of their variances, above which two tracks move differently; about
the 90 % bound of two dimensions (4.6)."""

VELOCITY_VARIANCE = 1.0
"""m^2/s^2 beyond what the filter states, for its constant velocity is not the truth."""

APRON_VELOCITY_VARIANCE = 4.0
"""m^2/s^2, the same where both are on an apron: there a track that hops from fragment to fragment seems to move."""

FAST_VELOCITY_VARIANCE = 0.02
"""Of the squared speed of what is FAST, more on that: two targets cannot fly or roll so close together, and new tracks
have wild velocities."""

LEAST_DISTANCE = 1.0
"""m; a distance less is taken for this much where it divides."""


class Tracks(NamedTuple):
    """Tracks of which some may be fragments of others, n rows, all at one time.

    state: (n, 4). covariance: (n, 4, 4). extent: (n, 3) length m, width m, direction rad. longest_side: (n,) m, as
    seen, without what was assumed. named: bears an address. aircraft: is classified as one. on_apron: is off runways
    and taxiways. standing: never moved, has no address, and is on_apron. rank: of two, the one of lower rank is the
    fragment; the older goes on when they are equal.
    """

    state: Floats
    covariance: Floats
    extent: Floats
    longest_side: Floats
    named: Array
    aircraft: Array
    on_apron: Array
    standing: Array
    rank: Floats


def find_fragments(tracks: Tracks, margin: float) -> Array:
    """For each track (n,) the row of the one that it is a fragment of, or -1: (n,) int64.

    Tracks without an address, that stay within the extent of an aircraft, or within one of each other while both stand.
    margin: m, how far outside the extent a fragment may lie.
    """
    made = np.full(len(tracks.rank), -1, np.int64)
    _fragments(np.argsort(tracks.state[:, 0], kind="stable"), *tracks, margin, made)
    return made


class Grown(NamedTuple):
    """length, width: m. shift: fraction of the way to the fragment by which the centre moves, so that the far edges
    of both stay where they are.
    """

    length: float
    width: float
    shift: float


def grow_extent(whole: Floats, fragment: Floats, away: Floats, direction: float) -> Grown:
    """The extent of `whole` (length, width, in m) grown over that of `fragment`, `away` (east, north) m from it.

    direction: rad, along which the length of the whole lies. Neither side exceeds LONGEST_AIRCRAFT.
    """
    along = abs(away[0] * math.sin(direction) + away[1] * math.cos(direction))
    across = abs(away[0] * math.cos(direction) - away[1] * math.sin(direction))
    grown = [
        min(max(own, own / 2 + apart + other / 2), LONGEST_AIRCRAFT)
        for own, other, apart in ((whole[0], fragment[0], along), (whole[1], fragment[1], across))
    ]
    side, apart = (0, along) if along >= across else (1, across)
    shift = 0.5 * (grown[side] - whole[side]) / max(apart, LEAST_DISTANCE)
    return Grown(grown[0], grown[1], min(shift, 1.0))


@allocating
def _fragments(
    order: Array, state: Floats, cov: Floats, extent: Floats, longest_side: Floats, named: Array, aircraft: Array,
    on_apron: Array, standing: Array, rank: Floats, margin: float, whole: Array,
) -> None:  # fmt: skip
    """order: rows by east."""
    for a in range(len(order)):
        for b in range(a + 1, len(order)):
            i, j = order[a], order[b]
            e, n = state[j, 0] - state[i, 0], state[j, 1] - state[i, 1]
            if e > 0.5 * LONGEST_AIRCRAFT + margin:
                break
            if (rank[j], -j) > (rank[i], -i):
                i, j = j, i
            if named[j] or not (aircraft[i] or (standing[i] and standing[j])):
                continue
            reach = max(0.5 * max(extent[i, 0], extent[i, 1]), AIRCRAFT_HALF_EXTENT) + margin
            apart = math.sqrt(e * e + n * n)
            if apart > reach or (longest_side[j] > LONGEST_FRAGMENT and apart > AIRCRAFT_HALF_EXTENT):
                continue
            difference = (state[i, 2] - state[j, 2]) ** 2 + (state[i, 3] - state[j, 3]) ** 2
            variance = cov[i, 2, 2] + cov[i, 3, 3] + cov[j, 2, 2] + cov[j, 3, 3]
            slack = APRON_VELOCITY_VARIANCE if on_apron[i] and on_apron[j] else VELOCITY_VARIANCE
            speed_squared = state[i, 2] ** 2 + state[i, 3] ** 2
            if speed_squared > FAST**2:
                slack += FAST_VELOCITY_VARIANCE * speed_squared
            if difference > VELOCITY_GATE * (variance + slack):
                continue
            if whole[j] < 0 or (rank[i], -i) > (rank[whole[j]], -whole[j]):
                whole[j] = i
