"""What a lifecycle does: begin, confirm, coast and end tracks by the evidence for them."""

from __future__ import annotations

from typing import Protocol

from pipeline.tables.arrays import Array, Floats


class LifecyclePart(Protocol):
    """Starts, confirms, coasts and ends tracks."""

    def start(self, position: Floats, noise: Floats) -> tuple[Floats, Floats]:
        """State and covariance of tracks begun by one measurement each."""

    def second(
        self, state: Floats, covariance: Floats, dt: Floats, position: Floats, noise: Floats
    ) -> tuple[Floats, Floats]:
        """State and covariance of tracks that were begun by one measurement and now took their second."""

    def judge(
        self, phase: Array, history: Array, looks: Array, misses: Array, silence: Floats, identified: Array,
        position_sd: Floats, score: Floats,
    ) -> tuple[Array, Array]:  # fmt: skip
        """The new TrackPhase (n,) of each track, and the mask of tracks that end.

        history: (n,) uint32, newest look in bit 0, set for a hit. looks: how many bits count. misses: looks in a row
        without a hit. silence: s since the last measurement. identified: named by a report. position_sd: m.
        score: natural logarithm of how much better a target explains the plots than false plots do.
        """
