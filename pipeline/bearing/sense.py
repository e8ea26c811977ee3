"""Which end of an axis is the nose: motion tells."""

from __future__ import annotations

import math

from pipeline.contracts.bearing import NO_BEARING, Bearing, Expected

NOSE_SD = math.radians(40)
"""An expected heading less sure than this does not tell the nose from the tail."""


def tells_the_nose(expected: Expected | None) -> bool:
    """The expectation is sure enough to tell the nose from the tail."""
    return expected is not None and math.isfinite(expected.heading) and expected.sd < NOSE_SD


def pointed(axis: float, sd: float, expected: Expected | None, limit: float, type: str = "") -> Bearing:
    """The axis (rad) as a bearing, in the sense of the expected heading unless it lies across it; none when it is less
    sure than `limit` (rad)."""
    if not (math.isfinite(axis) and sd <= limit):
        return NO_BEARING
    if expected is not None and tells_the_nose(expected):
        along = math.cos(axis - expected.heading)
        if abs(along) > math.cos(math.pi / 4):
            return Bearing((axis if along > 0 else axis + math.pi) % (2 * math.pi), sd, nose_known=True, type=type)
    return Bearing(axis % math.pi, sd, type=type)
