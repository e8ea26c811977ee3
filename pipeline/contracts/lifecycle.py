"""What a lifecycle does: confirm, coast and end tracks by the evidence for them."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from pipeline.tables.arrays import Array, Floats


class Evidence(NamedTuple):
    """What is known of n tracks, apart for each of s sensors: first the radars, then nodes, then reports.

    phase: (n,) TrackPhase. history: (n, s) uint32, newest look in bit 0, set for a hit. looks: (n, s) int32, how many
    of its bits count. misses: (n, s) int32, looks in a row without a hit. score: (n, s) natural logarithm of how much
    better a target explains what the sensor saw than false plots do. radars: how many of the sensors are radars.
    silence: (n,) s since the last measurement. identified: (n,) named by a report that is not old. position_sd: (n,) m.
    """

    phase: Array
    history: Array
    looks: Array
    misses: Array
    score: Floats
    radars: int
    silence: Floats
    identified: Array
    position_sd: Floats


class LifecyclePart(Protocol):
    """Confirms, coasts and ends tracks."""

    def judge(self, evidence: Evidence) -> tuple[Array, Array]:
        """The new TrackPhase (n,) uint8 of each track, and the mask of tracks that end.

        A radar that has not seen a target yet says nothing by not seeing it: it may be hidden from it. One radar that
        sees it is enough.
        """
