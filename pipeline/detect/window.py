"""The cells about the cell under test that a detector without memory judges it by, and what such detectors share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.detect.calibration import false_alarm_probability
from pipeline.detect.checks import check_block, check_pfa, check_start, check_whole
from pipeline.kernels.run_cap import CapSettings
from pipeline.state import ArrayState, read_only, remembered
from pipeline.tables import Detections, Sweeps, VideoFormat

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


class WindowSettings(Protocol):
    """The settings that detectors with a window have in common; `CellAveraging` says what each means."""

    @property
    def pfa(self) -> float: ...  # noqa: D102
    @property
    def side(self) -> int: ...  # noqa: D102
    @property
    def guard(self) -> int: ...  # noqa: D102
    @property
    def sweeps(self) -> int: ...  # noqa: D102
    @property
    def guard_sweeps(self) -> int: ...  # noqa: D102
    @property
    def max_runs(self) -> int: ...  # noqa: D102


def window_of(part: WindowSettings) -> Window:
    """The cells that the part judges by."""
    return Window(part.side, part.guard, part.sweeps, part.guard_sweeps)


def check_settings(part: WindowSettings) -> None:
    """Raises ValueError, with its name, for a setting that is out of bounds."""
    check_pfa(part.pfa)
    check_whole(max_runs=part.max_runs)
    window_of(part)


def window_fields(
    part: WindowSettings,
    video: VideoFormat,
    surface: NDArray[np.uint8] | None,
    growth_db: float | None,
    above: Callable[[float], NDArray[np.float64]],
) -> dict[str, Any]:
    """The fields of a WindowState before the first sweep; surface and growth_db as given to `Detector.start`.

    above: steps from level to limit, shaped as `Window.counts`, for a false alarm probability. Raises ValueError for a
    surface of the wrong shape or a growth_db that is negative or no number.
    """
    check_start(video, surface, growth_db)
    window = window_of(part)
    limits = grow = above(part.pfa)
    if growth_db is not None:
        grow = np.minimum(above(false_alarm_probability(growth_db, video.db_per_step)), limits)
    return {
        "azimuths": video.azimuths,
        "count": window.counts(video.ranges),
        "above": limits,
        "growth_above": grow,
        "stack": np.zeros((1 + window.sweeps, video.ranges), np.uint8),
        "tail": np.zeros(64, np.uint8),
        "ring": np.zeros((window.sweeps, video.ranges), np.uint8),
        "ring_row": np.full(window.sweeps, NEVER, np.int64),
        "threshold": np.full(64 * video.words, 255, np.uint8),
        "growth": np.full(0 if growth_db is None else 64 * video.words, 255, np.uint8),
        "budget": np.array([CapSettings.of(part.max_runs, video.azimuths).depth]),
        "degraded_sweeps": np.zeros(1, np.int64),
    }


def detect_block(
    kernel: Any, part: WindowSettings, sweeps: Sweeps, state: WindowState, own: tuple[Any, ...]
) -> Detections:
    """The detections of a block by the kernel of the part. Raises TableError when it is not on the grid of the state.

    The kernel is called with amplitude, absolute rows, (mask, growth mask) to fill, (guard, reach, near) of the window,
    its tables (count, above, growth_above), its memory (ring, ring_row, stack, threshold, growth), the cap on runs as
    in `run_cap.detect_row`, and what is its own.
    """
    check_block(sweeps, state.azimuths, state.stack.shape[1])
    mask = np.empty((len(sweeps), state.threshold.size // 64), np.uint64)
    growth = np.empty((len(sweeps), state.growth.size // 64), np.uint64)
    before = int(state.degraded_sweeps[0])
    cap = CapSettings.of(part.max_runs, state.azimuths)
    kernel(
        read_only(sweeps.amplitude),
        read_only(sweeps.row, np.int64) + sweeps.scan * state.azimuths,
        (mask, growth),
        (part.guard, part.side + part.guard, window_of(part).near),
        (state.count, state.above, state.growth_above),
        (state.ring, state.ring_row, state.stack, state.threshold, state.growth),
        (cap.refill, cap.depth, state.budget, state.degraded_sweeps, state.tail),
        own,
    )
    degraded = int(state.degraded_sweeps[0]) > before
    return Detections(mask, degraded, growth if state.growth.size else None)
