"""Pairs of tracks that are one airframe seen twice: under two transponders, or by two sources that lie a second apart.

Nearness alone does not show it, as when an arrival comes down on a departure. What does is to have moved together for a
while doing the same thing; it is then remembered through braking and turning off, where the two velocities differ.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from pipeline.contracts.alert import Situation

INTERRUPTION_S = 2.0
"""A pair that has not yet moved together for long enough begins anew after so long apart."""


@dataclass
class Pair:
    """since, last: s on the monitor's clock, of when the two began to move together and of when they last did."""

    since: float
    last: float


def watch_pairs(pairs: dict[tuple[int, int], Pair], situation: Situation, clock: float) -> frozenset[tuple[int, int]]:
    """Bring `pairs` up to date, and give those (ids of tracks, the smaller first) that are one airframe."""
    s, limits = situation, situation.settings
    for doing in (s.arrival.any(axis=0), s.rolling.any(axis=0)):
        for one, other in combinations((int(row) for row in np.nonzero(doing & s.usable)[0]), 2):
            if _move_together(s, one, other):
                first, second = sorted((int(s.tracks.id[one]), int(s.tracks.id[other])))
                pairs.setdefault((first, second), Pair(clock, clock)).last = clock
    known = {ids for ids, pair in pairs.items() if pair.last - pair.since >= limits.airframe_s}
    for ids, pair in list(pairs.items()):
        if clock - pair.last > (limits.airframe_kept_s if ids in known else INTERRUPTION_S):
            del pairs[ids]
    return frozenset(known & pairs.keys())


def _move_together(s: Situation, one: int, other: int) -> bool:
    apart = float(np.hypot(*(s.position[one] - s.position[other])))
    relative = float(np.hypot(*(s.velocity[one] - s.velocity[other])))
    reach = s.settings.together_m + s.settings.airframe_lag_s * min(float(s.speed[one]), float(s.speed[other]))
    return apart < reach and relative < s.settings.together_speed
