"""What an association is given and what it answers: expected tracks and measurements in, one assignment out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from pipeline.tables.arrays import Array, Floats


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
