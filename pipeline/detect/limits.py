"""The limits that a detector compares with, sweep by sweep."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.tables import Sweeps


class RowState(Protocol):
    """A state that holds the limits of the row last compared, (64 * words) uint8."""

    threshold: NDArray[np.uint8]


def limits_used(part: Any, sweeps: Sweeps, state: RowState) -> NDArray[np.uint8]:
    """(n, ranges) limits of each sweep of the block, by detecting in it sweep by sweep. `state` is used up."""
    ranges = sweeps.amplitude.shape[1]
    limits = np.empty((len(sweeps), ranges), np.uint8)
    for k in range(len(sweeps)):
        one = slice(k, k + 1)
        sweep = Sweeps(
            sweeps.radar, sweeps.scan, sweeps.row[one], sweeps.azimuth[one], sweeps.time[one], sweeps.amplitude[one]
        )
        part(sweep, state)
        limits[k] = state.threshold[:ranges]
    return limits
