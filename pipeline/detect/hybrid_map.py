"""The hybrid detector over macro-cells of any shape, drawn from the airport map."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.detect.macro_cells import MapCells
from pipeline.kernels.bits import borrowed
from pipeline.kernels.compiled import allocating
from pipeline.kernels.run_cap import detect_row
from pipeline.state import ArrayState, StateError, remembered


@dataclass(eq=False, kw_only=True)
class HybridMapState(ArrayState):
    """level, weight: log mean in steps and scans behind it, of each macro-cell; limit, growth_limit: of each, in this
    scan. sums, heard: amplitudes and radar cells of each swept in this scan. scan: the one being swept. threshold and
    growth: limits of each cell of the row."""

    cells: MapCells
    azimuths: int
    ranges: int
    offset_steps: float
    loss_steps: float
    growth_steps: float
    grows: bool
    tail: NDArray[np.uint8]
    threshold: NDArray[np.uint8]
    growth: NDArray[np.uint8]
    level: NDArray[np.float64] = remembered()
    weight: NDArray[np.float64] = remembered()
    limit: NDArray[np.uint8] = remembered()
    growth_limit: NDArray[np.uint8] = remembered()
    sums: NDArray[np.int64] = remembered()
    heard: NDArray[np.int64] = remembered()
    scan: NDArray[np.int64] = remembered()
    budget: NDArray[np.float64] = remembered()
    degraded_sweeps: NDArray[np.int64] = remembered()

    @classmethod
    def begin(cls, cells: MapCells, rule: Mapping[str, Any]) -> HybridMapState:
        """Before the first sweep. rule: the fields that do not depend on the macro-cells."""
        many = len(cells.cells)
        return cls(
            **rule,
            cells=cells,
            level=np.zeros(many),
            weight=np.zeros(many),
            limit=np.full(many, 255, np.uint8),
            growth_limit=np.full(many, 255, np.uint8),
            sums=np.zeros(many, np.int64),
            heard=np.zeros(many, np.int64),
            scan=np.array([-1]),
        )

    @property
    def counters(self) -> dict[str, int]:
        """degraded_sweeps: sweeps whose threshold was raised to stay under the cap on runs."""
        return {"degraded_sweeps": int(self.degraded_sweeps[0])}

    def refuse_untrue(self, saved: Mapping[str, NDArray[Any]]) -> None:
        """Raise StateError for levels no video has."""
        refuse_untrue_levels(saved)

    def arrays(self) -> tuple[Any, ...]:
        """What the kernel works on."""
        return (
            (self.cells.run_at, self.cells.runs, self.cells.cells),
            (self.level, self.weight, self.limit, self.growth_limit, self.sums, self.heard),
            (self.scan, self.threshold, self.growth, self.budget, self.degraded_sweeps, self.tail),
        )


def refuse_untrue_levels(saved: Mapping[str, NDArray[Any]]) -> None:
    """Raise StateError for levels that the mean of 8-bit amplitudes cannot have, and for weights below 0."""
    if not ((saved["level"] > -1) & (saved["level"] < 256) & (saved["weight"] >= 0)).all():
        raise StateError("levels or weights that cannot be true")


@allocating
def detect_in_map_cells(
    amplitude: Any,
    rows: Any,
    scan: int,
    masks: Any,
    rule: Any,
    cap: Any,
    layout: Any,
    memory: Any,
    row: Any,
) -> None:
    """Detect in a block and learn from it; a macro-cell's level changes after the scan."""
    amplitude, rows, mask, grown = borrowed(amplitude), borrowed(rows), borrowed(masks[0]), borrowed(masks[1])
    run_at, runs = borrowed(layout[0]), borrowed(layout[1])
    limit, growth_limit, sums, heard = (
        borrowed(memory[2]),
        borrowed(memory[3]),
        borrowed(memory[4]),
        borrowed(memory[5]),
    )
    current, threshold, growth = borrowed(row[0]), borrowed(row[1]), borrowed(row[2])
    budget, degraded, tail = borrowed(row[3]), borrowed(row[4]), borrowed(row[5])
    grows = rule[5]
    lower = growth if grows else growth[:0]
    for i in range(amplitude.shape[0]):
        if scan != current[0]:
            _finish_scan(rule, layout[2], memory)
            current[0] = scan
        cells = amplitude[i]
        for k in range(run_at[rows[i]], run_at[rows[i] + 1]):
            start, end, p = np.uintp(runs[k, 0]), np.uintp(runs[k, 1]), np.uintp(runs[k, 2])
            threshold[start:end] = limit[p]
            total = np.uint32(0)
            for j in range(start, end):
                total += np.uint32(cells[j])
            sums[p] += np.int64(total)
            heard[p] += np.int64(end - start)
            if grows:
                growth[start:end] = growth_limit[p]
        bits = mask[i]
        detect_row(cells, threshold, lower, bits, grown[i] if grows else bits, cap, budget, degraded, tail)


@allocating
def _finish_scan(rule: Any, full: Any, memory: Any) -> None:
    mu, loss, most, learn, grow, _ = rule
    level, weight, limit, growth_limit, sums, heard = memory
    for p in range(level.size):
        if heard[p] > 0:
            share = heard[p] / full[p]
            weight[p] = min(weight[p] + share, most)
            level[p] += (sums[p] / heard[p] - level[p]) * share / weight[p]
        sums[p] = 0
        heard[p] = 0
        if weight[p] >= learn:
            above = level[p] + mu + loss / (weight[p] * full[p])
            limit[p] = np.uint8(min(np.floor(above + 0.5), 255.0))
            growth_limit[p] = np.uint8(min(np.floor(level[p] + grow + 0.5), np.float64(limit[p])))
