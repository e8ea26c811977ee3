"""What the tracker asks of its parts; a new filter, association, lifecycle or classification keeps to these."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Array = NDArray[Any]


@dataclass(frozen=True, slots=True, eq=False)
class Expected:
    """Tracks where they are expected, n rows, in the order of the association's answer.

    time: s to which state (n, 4) and covariance (n, 4, 4) were predicted. window: s within which a measurement must lie
    of `time`. extent: (n, 3) length m, width m, heading rad of the target (zeros where unknown). penalty: added to
    the cost of any measurement for the track, in units of -2 log likelihood (tentative tracks give way).
    """

    time: Floats
    state: Floats
    covariance: Floats
    window: Floats
    extent: Floats
    penalty: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """Measurements, m rows: time s, position (m, 2) m east and north, noise (m, 2, 2) m^2."""

    time: Floats
    position: Floats
    noise: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Assignment:
    """measurement: (n,) int32, the row taken by each track, -1 for none. distance: (n,) squared, of what was taken.

    The gated pairs, sorted by track: first (n + 1,) int32 offsets, pair (k,) int32 measurement rows, cost (k,).
    """

    measurement: Array
    distance: Floats
    first: Array
    pair: Array
    cost: Floats


class FilterPart(Protocol):
    """Estimates (east, north, v_east, v_north)."""

    def predict(self, state: Floats, covariance: Floats, dt: Floats) -> tuple[Floats, Floats]:
        """Move states by dt seconds (may be negative)."""

    def update(
        self, state: Floats, covariance: Floats, dt: Floats, position: Floats, noise: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Predict and take positions: state, covariance, normalised innovation squared."""


class AssociatePart(Protocol):
    """Decides which measurement belongs to which track."""

    @property
    def gate(self) -> float:
        """Bound of the squared distance."""

    @property
    def max_gate_m(self) -> float:
        """Bound of the distance in metres."""

    def __call__(self, tracks: Expected, measured: Measured) -> Assignment:
        """The best assignment of all tracks at once; a measurement serves one track at most."""


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


class ClassifyPart(Protocol):
    """Tells aircraft from vehicles."""

    def __call__(
        self, category: Array, claimed: Array, length: Array, width: Array, speed: Array, measurements: Array
    ) -> Array:
        """The new category (n,) uint8 of each track from its old one, what reports claim, and what radar saw."""
