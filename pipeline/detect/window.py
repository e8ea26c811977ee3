"""The cells about the cell under test that a detector without memory judges it by, and what such detectors share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.detect.checks import check_whole
from pipeline.kernels.run_cap import CapSettings
from pipeline.state import ArrayState, remembered
from pipeline.tables import VideoFormat

BEYOND = 600.0
"""Steps above any level that no amplitude reaches."""

NEVER = -(2**62)
"""A row that no sweep looks back to."""

MOST_CELLS, MOST_SWEEPS = 1024, 64
"""The largest window: its tables grow with the square of the sweeps."""


@dataclass(frozen=True)
class Window:
    """side: cells on either side beyond `guard` cells. sweeps: how many rows the window reaches back (0: its own sweep
    only); of the nearest `guard_sweeps` rows only the cells beyond the guard cells belong to it. Raises ValueError for
    one that is out of bounds, with its name."""

    side: int
    guard: int
    sweeps: int
    guard_sweeps: int

    def __post_init__(self) -> None:
        check_whole(1, MOST_CELLS, side=self.side)
        check_whole(0, MOST_CELLS, guard=self.guard)
        check_whole(0, MOST_SWEEPS, sweeps=self.sweeps, guard_sweeps=self.guard_sweeps)

    @property
    def near(self) -> int:
        """Rows back of which the guard cells are left out."""
        return min(self.guard_sweeps, self.sweeps)

    def counts(self, ranges: int) -> NDArray[np.int64]:
        """(near + 1, sweeps - near + 1, ranges) cells of the window, by how many near and how many further sweeps were
        received. The window is cut off at the first and the last range cell."""
        cell = np.arange(ranges)

        def within(reach: int) -> NDArray[np.int64]:
            return np.minimum(cell + reach, ranges - 1) - np.maximum(cell - reach, 0) + 1

        whole = within(self.side + self.guard)
        beside = whole - within(self.guard)
        near = np.arange(1, self.near + 2)[:, None, None]
        further = np.arange(self.sweeps - self.near + 1)[None, :, None]
        return np.asarray(near * beside + further * whole)

    def independent(self, video: VideoFormat) -> NDArray[np.float64]:
        """(near + 1, sweeps - near + 1, ranges) independent cells of those: sweeps closer than the beam is wide tell
        the same again, but none tells less than one does."""
        rows = np.add.outer(np.arange(1, self.near + 2), np.arange(self.sweeps - self.near + 1))
        share = np.minimum(np.maximum(1 / rows, video.azimuth_step_rad / video.beamwidth_rad), 1.0)
        return np.asarray(self.counts(video.ranges) * share[:, :, None])


@dataclass(eq=False, kw_only=True)
class WindowState(ArrayState):
    """count, above, growth_above: (near + 1, further + 1, ranges) cells of the window and steps from their level to the
    limits. ring, ring_row: the last sweeps and their rows (scan * azimuths + row). threshold, growth: limits of the
    sweep last seen, growth empty when no growth is asked for."""

    azimuths: int
    count: NDArray[np.int64]
    above: NDArray[np.float64]
    growth_above: NDArray[np.float64]
    stack: NDArray[np.uint8]
    tail: NDArray[np.uint8]
    threshold: NDArray[np.uint8]
    growth: NDArray[np.uint8]
    ring: NDArray[np.uint8] = remembered()
    ring_row: NDArray[np.int64] = remembered()
    budget: NDArray[np.float64] = remembered()
    degraded_sweeps: NDArray[np.int64] = remembered()

    @property
    def counters(self) -> dict[str, int]:
        """degraded_sweeps: sweeps whose threshold was raised to stay under the cap on runs."""
        return {"degraded_sweeps": int(self.degraded_sweeps[0])}


def window_fields(
    window: Window,
    video: VideoFormat,
    max_runs: int,
    growth_db: float | None,
    above: Callable[[float], NDArray[np.float64]],
    pfa: float,
    growth_pfa: float,
) -> dict[str, Any]:
    """The fields of a WindowState. above: steps from level to limit, shaped as `Window.counts`, for a probability."""
    limits = above(pfa)
    return {
        "azimuths": video.azimuths,
        "count": window.counts(video.ranges),
        "above": limits,
        "growth_above": limits if growth_db is None else np.minimum(above(growth_pfa), limits),
        "stack": np.zeros((1 + window.sweeps, video.ranges), np.uint8),
        "tail": np.zeros(64, np.uint8),
        "ring": np.zeros((window.sweeps, video.ranges), np.uint8),
        "ring_row": np.full(window.sweeps, NEVER, np.int64),
        "threshold": np.full(64 * video.words, 255, np.uint8),
        "growth": np.full(0 if growth_db is None else 64 * video.words, 255, np.uint8),
        "budget": np.array([CapSettings.of(max_runs, video.azimuths).depth]),
        "degraded_sweeps": np.zeros(1, np.int64),
    }
