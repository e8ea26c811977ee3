"""Which way round a turn of radar video lies."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

BROKEN, CLOSED = 20.0, 10.0
"""The edges of an axis against its neighbouring lines: of azimuth they are neighbours themselves (at most 6 times as
different, by the second between them), of range the nearest and the farthest cell (some 100 times), in the turns of a
marine radar. Noise alone gives 1 on both axes."""


def looks_transposed(turn: NDArray[Any]) -> bool:
    """Whether the columns of `turn` (azimuths, ranges) go round, and its rows do not.

    False where the turn does not tell, such as when there is nothing but noise at both ends of the range.
    """
    values = np.asarray(turn, np.float32)
    return _break(values) > BROKEN and _break(values.T) < CLOSED


def _break(lines: NDArray[np.float32]) -> float:
    """How different the first and the last line are, as a multiple of the mean difference of neighbouring lines."""
    usual = float(np.abs(np.diff(lines, axis=0)).mean())
    edge = float(np.abs(lines[0] - lines[-1]).mean())
    return edge / usual if usual > 0 else 0.0
