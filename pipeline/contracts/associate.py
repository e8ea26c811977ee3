"""What an association is given and what it answers: expected tracks and measurements in, weighted hypotheses out."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from pipeline.contracts.measured import Hypotheses, Measured
from pipeline.tables.arrays import Array, Floats


class Expected(NamedTuple):
    """Tracks where they are expected, n rows.

    time: (n,) UTC s to which they were predicted. mean: (n, 4), covariance: (n, 4, 4) of position and velocity on the
    ground. window: (n,) s within which a measurement must lie of `time`. extent: (n, 3) length m, width m, direction
    rad of the target (zeros where unknown). penalty: (n,) added to the cost of any measurement for the track, in units
    of -2 log likelihood (tentative tracks give way). target: (n,) int64; rows of one target are hypotheses of it, which
    may share measurements. log_weight: (n,) of each row among those of its target.
    """

    time: Floats
    mean: Floats
    covariance: Floats
    window: Floats
    extent: Floats
    penalty: Floats
    target: Array
    log_weight: Floats


class Association(NamedTuple):
    """hypotheses: of each track asked for, in the order asked.

    first (n + 1,) int32, pair (k,) int32 rows of the measurements, cost (k,) and squared (k,) distance: the pairs
    within the gates, sorted by track. ended: (e,) int32, tracks (positions in the order asked) whose hypothesis is
    given up; only where another row of the same target goes on.
    """

    hypotheses: Hypotheses
    first: Array
    pair: Array
    cost: Floats
    squared: Floats
    ended: Array


class AssociatePart(Protocol):
    """Decides which measurement belongs to which track.

    A part whose `branching` is true keeps several hypotheses of a target: where its answer holds several for a track,
    each goes on as a row of the store of its own. The weight of each is added to that of its row, also where there is
    only one; then the weights of the rows of a target are made to sum to 1. It is asked for all rows of a target at
    once. Otherwise the filter makes one of the hypotheses of a track, by their weights.
    """

    @property
    def gate(self) -> float:
        """Bound of the squared distance."""

    @property
    def max_gate_m(self) -> float:
        """Bound of the distance in metres."""

    @property
    def branching(self) -> bool:
        """Whether several hypotheses of a track become several rows."""

    def reach(self, expected: Expected, measured: Measured) -> Floats:
        """(n,) m; no measurement farther from where a track is expected at its time can lie in the gate of the track.

        What is connected by no such distance is decided apart: the answer for some tracks and measurements is the same
        whether others out of reach of all of them are asked for together with them or not.
        """

    def __call__(self, expected: Expected, measured: Measured, tracks: Array, plots: Array) -> Association:
        """Decide among the rows `tracks` of expected and `plots` of measured (int arrays)."""
