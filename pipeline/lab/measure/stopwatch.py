"""Times a piece of work turn about with reading a frame once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.kernels.compiled import allocating


@dataclass(frozen=True)
class BenchRow:
    """One line of the bench. median_s, least_s: seconds a turn. ratio: median to the median of reading the frame once,
    timed turn about.

    peer: somebody else's library on the same input. note: what it does, or how its result compares. most_ratio,
    most_s: what is wanted of ratio and of median_s, where something is.
    """

    name: str
    median_s: float
    least_s: float
    ratio: float
    peer: bool = False
    note: str = ""
    most_ratio: float | None = None
    most_s: float | None = None

    @property
    def wanted(self) -> str:
        """The bound in words; empty where there is none."""
        if self.most_ratio is not None:
            return f"<= {self.most_ratio:g}x"
        return "" if self.most_s is None else f"<= {self.most_s * 1e3:g} ms"

    @property
    def met(self) -> bool:
        """Whether what is wanted was reached."""
        return (self.most_ratio is None or self.ratio <= self.most_ratio) and (
            self.most_s is None or self.median_s <= self.most_s
        )


@dataclass(frozen=True, eq=False)
class Stopwatch:
    """Times work turn about with reading a frame once, so that both meet the same moments of a busy machine."""

    clock: Callable[[], float]
    repeats: int
    frames: NDArray[np.uint8]

    def row(self, name: str, prepare: Callable[[int], Any], work: Callable[[Any], Any], **more: Any) -> BenchRow:
        """Time `work` on what `prepare` makes of the turn's number (not timed), after three turns of warming up. more:
        the other fields of the row."""
        times = np.empty((self.repeats, 2))
        for turn in range(-3, self.repeats):
            given = prepare(turn + 3)
            begin = self.clock()
            work(given)
            middle = self.clock()
            read_once(self.frames[(turn + 2) % len(self.frames)])  # not the frame that was just worked on
            times[turn] = middle - begin, self.clock() - middle
        median, floor = np.median(times, axis=0)
        return BenchRow(name, float(median), float(times[:, 0].min()), float(median / floor), **more)


@allocating
def read_once(frame: Any) -> int:
    """The sum of all bytes: the least that any work on a frame can take."""
    total = 0
    for value in frame.ravel():
        total += value
    return total
