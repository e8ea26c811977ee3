"""Times a piece of work turn about with reading a frame once."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.kernels.compiled import allocating
from pipeline.tables.arrays import Floats


@dataclass(frozen=True)
class BenchRow:
    """One line of the bench. median_s, least_s: seconds a turn. ratio: median to the median of reading the frame once,
    timed turn about. least: the least turn to the least reading.

    peer: somebody else's library on the same input. note: what it does, or how its result compares. most_ratio,
    most_s: what is wanted of ratio and of median_s, where something is.
    """

    name: str
    median_s: float
    least_s: float
    ratio: float
    least: float = math.nan
    peer: bool = False
    note: str = ""
    most_ratio: float | None = None
    most_s: float | None = None

    @classmethod
    def of(cls, name: str, times: Floats, floor: Floats, **more: Any) -> BenchRow:
        """The row of these turns. times, floor: (turns,) s for the work and for reading the frame once."""
        median, least = float(np.median(times)), float(times.min())
        return cls(name, median, least, median / float(np.median(floor)), least / float(floor.min()), **more)

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

    def document(self) -> dict[str, Any]:
        """The row as JSON has it: `ratio`, `least` and `wanted` (at most; None without a bound) in the same unit, times
        reading the frame once."""
        wanted = [self.most_ratio] if self.most_ratio is not None else []
        wanted += [self.most_s * self.ratio / self.median_s] if self.most_s is not None else []
        return {
            "name": self.name,
            "ratio": self.ratio,
            "least": self.least,
            "wanted": min(wanted, default=None),
            "note": self.note,
        }


class Work(NamedTuple):
    """What is timed: `work` on what `prepare` makes of the turn's number, which is not timed."""

    name: str
    prepare: Callable[[int], Any]
    work: Callable[[Any], Any]


@dataclass(frozen=True, eq=False)
class Stopwatch:
    """Times work turn about with reading a frame once, so that both meet the same moments of a busy machine."""

    clock: Callable[[], float]
    repeats: int
    frames: NDArray[np.uint8]

    def row(self, name: str, prepare: Callable[[int], Any], work: Callable[[Any], Any], **more: Any) -> BenchRow:
        """Time one piece of work, after three turns of warming up. more: the other fields of the row."""
        times, floor = self.turn_about([Work(name, prepare, work)], 3)
        return BenchRow.of(name, times[:, 0], floor[:, 0], **more)

    def turn_about(self, works: Sequence[Work], settle: int) -> tuple[Floats, Floats]:
        """Time several pieces of work, each once a turn, after `settle` turns that do not count.

        Gives s of each work and of reading a frame right after it, both (repeats, works).
        """
        times, floor = np.empty((2, settle + self.repeats, len(works)))
        for turn in range(settle + self.repeats):
            for k, (_, prepare, work) in enumerate(works):
                given = prepare(turn)
                begin = self.clock()
                work(given)
                middle = self.clock()
                read_once(self.frames[(turn + 2) % len(self.frames)])  # not the frame that was just worked on
                times[turn, k], floor[turn, k] = middle - begin, self.clock() - middle
        return times[settle:], floor[settle:]


@allocating
def read_once(frame: Any) -> int:
    """The sum of all bytes: the least that any work on a frame can take."""
    total = 0
    for value in frame.ravel():
        total += value
    return total
