"""Why messages of a radar are not taken, in words, and what else comes in on the same port."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from pipeline.assemble.state import (
    WRONG_CELL_COUNT,
    WRONG_GEOMETRY,
    WRONG_SOURCE,
    GridRules,
)
from pipeline.asterix.cat240_batch import CELLS, DURATION, FIRST_CELL, SOURCE

FS_PER_M = 2e15 / 299_792_458.0
"""Two-way femtoseconds a metre."""

MOST_KINDS = 16
"""Sources, and cell durations, that are told apart; what comes from anywhere must not fill the memory."""


def source_name(source: int) -> str:
    """SAC << 8 | SIC in words."""
    return f"SAC {source >> 8} SIC {source & 255}"


class Refusals:
    """What does not fit one radar.

    newest: of the newest message that does not fit, see `pipeline.assemble.state.REFUSED_WHY`. sources: messages of
    each source, SAC << 8 | SIC. durations: messages of each cell duration (fs) that does not fit the grid.
    """

    def __init__(self, rules: GridRules) -> None:
        self._rules = rules
        self.newest: NDArray[np.int64] = np.full(5, -1, np.int64)
        self.sources: Counter[int] = Counter()
        self.durations: Counter[int] = Counter()

    def note(self, fields: NDArray[np.int64]) -> None:
        """Count sources and cell durations of messages `fields`."""
        _count(self.sources, fields[:, SOURCE])
        wanted = (fields[:, SOURCE] & self._rules.source_mask) == self._rules.source
        reach = fields[:, FIRST_CELL] + fields[:, CELLS]
        other = np.abs(fields[:, DURATION] - self._rules.cell_fs) * reach > 0.5 * self._rules.cell_fs
        if other.any():
            _count(self.durations, fields[wanted & other, DURATION])

    def note_short(self, cells: int) -> None:
        """A row got only so many cells though nothing was lost."""
        first = self._rules.first_cell
        self.newest[:] = (WRONG_CELL_COUNT, first + cells, first, round(self._rules.cell_fs), -1)

    def forget_newest(self) -> None:
        """What was refused is told; what comes next is told anew."""
        self.newest[:] = -1

    def words(self) -> str:
        """What was refused last and what it should have been, such as "cells 900, settings say 1024"; or nothing."""
        rules, said = self._rules, []
        why, reach, first, duration, source = self.newest.tolist()
        if why == WRONG_SOURCE:
            sac, sic = rules.source_mask >> 8, rules.source_mask & 255
            wanted = [f"SAC {rules.source >> 8}"] * bool(sac) + [f"SIC {rules.source & 255}"] * bool(sic)
            return f"{source_name(source)}, settings say {' '.join(wanted)}"
        if why not in (WRONG_GEOMETRY, WRONG_CELL_COUNT):
            return ""
        cells = reach - first
        if cells != rules.ranges:
            said.append(f"cells {cells}, settings say {rules.ranges}")
        if first < rules.first_cell or reach > rules.first_cell + rules.ranges:
            said += [f"first cell {first}, settings say {rules.first_cell}"] * (first != rules.first_cell)
        if why == WRONG_GEOMETRY:
            said.append(f"cells of {duration / FS_PER_M:.4g} m, settings say {rules.cell_fs / FS_PER_M:.4g} m")
        return "; ".join(said)

    def several(self) -> str:
        """The sources that come in where none was chosen, in words; nothing when there is one, or one is chosen."""
        if self._rules.source_mask == 0xFFFF or len(self._open()) < 2:
            return ""
        return " and ".join(source_name(one) for one in self._open())

    def _open(self) -> list[int]:
        return sorted(one for one in self.sources if (one & self._rules.source_mask) == self._rules.source)


def _count(counter: Counter[int], values: NDArray[np.int64]) -> None:
    if not len(values):
        return
    first = int(values[0])
    if first in counter and bool((values == first).all()):
        counter[first] += len(values)
        return
    for value, count in zip(*(one.tolist() for one in np.unique(values, return_counts=True)), strict=True):
        if value in counter or len(counter) < MOST_KINDS:
            counter[value] += count
