"""What a filter does: it keeps what is known of the motion of each track, and gives others the moments of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np

from pipeline.contracts.measured import Hypotheses, Measured
from pipeline.tables.arrays import Array, Floats


class Column(NamedTuple):
    """A column that a part keeps for each track: numpy dtype, shape of one row, and the value of a new row."""

    dtype: str
    shape: tuple[int, ...] = ()
    fill: Any = 0


def record_of(columns: Mapping[str, Column]) -> np.dtype[Any]:
    """The dtype of one row of a part's columns."""
    return np.dtype([(name, one.dtype, one.shape) for name, one in columns.items()], align=True)


class Store(Protocol):
    """What a filter sees of the table of tracks. time: (capacity,) UTC s to which its columns belong; it sets them.

    filter: (capacity,) records of the filter's own columns, which nobody else writes.
    """

    time: Array
    filter: Array


class Ground(Protocol):
    """The map as a filter needs it; `pipeline.airport.zones.ZoneMap` is the one there is."""

    def kind(self, east: Any, north: Any) -> Array:
        """SurfaceKind at each place."""

    def runway(self, east: Any, north: Any) -> Array:
        """Runway index or -1."""


class Prior(NamedTuple):
    """What is held of the velocity of a new track before its second measurement.

    velocity: (n, 2) m/s. covariance: (n, 2, 2) m^2/s^2. known: (n,) the velocity rests on something; where not, the
    first two positions give it.
    """

    velocity: Floats
    covariance: Floats
    known: Array


class Moments(NamedTuple):
    """All that others may read of a filter.

    mean: (n, 2 d) position m, then rates m/s; d = 2 on the ground (east, north), 3 in the air (and up).
    covariance: (n, 2 d, 2 d).
    """

    mean: Floats
    covariance: Floats


class Predicted(Protocol):
    """What a filter expects of tracks; made once a step and handed on. Its further fields are the filter's own.

    rows: (n,) rows of the store. time: (n,) UTC s to which each was predicted.
    """

    @property
    def rows(self) -> Array:
        """(n,) rows of the store."""

    @property
    def time(self) -> Floats:
        """(n,) UTC s."""


class Innovations(NamedTuple):
    """What an update found and left, by row of what was predicted.

    squared: (n,) normalised innovation squared of the position, of the last measurement of the likeliest hypothesis;
    NaN for tracks that took nothing or whose first velocity it gave. moments: of the rows at the time that they now
    have; arbitrary for tracks that took nothing.
    """

    squared: Floats
    moments: Moments


class FilterPart(Protocol):
    """Keeps and estimates the motion of tracks. Rows never mix: what is made of one does not depend on the others."""

    @property
    def columns(self) -> Mapping[str, Column]:
        """The columns of the store that it owns."""

    def start(self, store: Store, rows: Array, measured: Measured, prior: Prior) -> None:
        """Begin the rows with one measurement each, anew when they held something."""

    def predict(self, store: Store, rows: Array, time: Floats, ground: Ground | None = None) -> Any:
        """Expect the rows at times (n,) UTC s, also before that of the store. Changes nothing. See `Predicted`."""

    def moments(self, predicted: Any) -> Moments:
        """Mean and covariance of what is expected."""

    def log_likelihood(self, predicted: Any, measured: Measured, tracks: Array, plots: Array) -> Floats:
        """(k,) ln of the density 1/m^2 of the positions `plots` (k,) rows of `measured`, were they of `tracks` (k,).

        tracks: rows of `predicted`.
        """

    def update(self, store: Store, predicted: Any, measured: Measured, hypotheses: Hypotheses) -> Innovations:
        """Take measurements: hypotheses (of each row of `predicted`) over `measured`.

        Rows without hypotheses, and those whose hypotheses are all empty, stay as they are.
        A row's time becomes that of its newest measurement; one older than the row corrects it and keeps its time.
        """

    def branch(self, store: Store, rows: Array, into: Array) -> None:
        """Copy what is known of the rows into other rows."""

    def merge(self, store: Store, into: Array, rows: Array, weight: Floats) -> None:
        """Make of each pair of rows one, in `into`: the mixture with `weight` (n,) on `rows`. 1: all of it."""
