"""What is remembered of the components that are still open."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.kernels.links import LinkRule
from pipeline.kernels.plot_shape import GIVEN, TURN_FIELDS, Geometry, PlotColumns
from pipeline.kernels.runs import FREE, RUN
from pipeline.sites import RadarSite
from pipeline.state import ArrayState, StateError, remembered

NEWEST, LATEST, RETIRED, HEAD, TAIL, DROPPED, CUT, SMALL, SEEDLESS, CELLS, TAKEN, NUMBERS = range(12)
"""Places in `ComponentState.numbers`: newest row, newest row with runs, row up to which all are retired, first free
place and oldest open run of the pool, and counts; TAKEN: steps of the present block that are done."""

MOST_OPEN_RUNS = 1 << 20
"""More would be a gigabyte where a part is changed and its state saved."""

NEVER = -(2**60)
"""A row long before the first."""

MOVE = 512
"""Delivered runs at the beginning of the pool that are worth moving the others down for."""


@dataclass(eq=False, kw_only=True)
class ComponentState(ArrayState):
    """The open components. closed_row: see `pipeline.extract`.

    limits: fewest cells of a plot, most rows of a plot, most runs in the rows of open plots. latest: (2, ranges)
    absolute row and run of the newest cell at each range.
    """

    azimuths: int
    rule: LinkRule
    geometry: Geometry
    limits: tuple[int, int, int]
    room: NDArray[np.int64]
    radar: NDArray[np.int64] = remembered()
    runs: NDArray[Any] = remembered()
    window: NDArray[np.int64] = remembered()
    latest: NDArray[np.int64] = remembered()
    numbers: NDArray[np.int64] = remembered()
    turn: NDArray[np.float64] = remembered()

    @classmethod
    def of(
        cls, site: RadarSite, rule: LinkRule, *, min_cells: int, max_extent_turn: float, max_open_runs: int, **more: Any
    ) -> ComponentState:
        """A state in which nothing is open.

        max_extent_turn: part of a turn that a plot may cover. more: fields of a subclass. Raises ValueError when the
        rule reaches over a third of a turn.
        """
        video = site.video
        if rule.rows > max(1, (video.azimuths - 2) // 3):
            raise ValueError(f"a link over {rule.rows} rows is too far for a turn of {video.azimuths}")
        slots = 1 << rule.rows.bit_length()
        window = np.zeros((slots, 3), np.int64)
        window[:, 0] = -1
        turn = np.zeros((video.azimuths, TURN_FIELDS))
        turn[:, GIVEN] = np.nan
        numbers = np.zeros(NUMBERS, np.int64)
        numbers[NEWEST] = numbers[LATEST] = numbers[RETIRED] = -1
        return cls(
            azimuths=video.azimuths,
            rule=rule,
            geometry=Geometry.of(site),
            limits=(min_cells, max(rule.rows + 1, int(video.azimuths * max_extent_turn)), max_open_runs),
            room=np.zeros(1, np.int64),
            radar=np.zeros(1, np.int64),
            runs=np.zeros(2 * max_open_runs + MOVE, RUN),
            window=window,
            latest=np.full((2, video.ranges), NEVER, np.int64),
            numbers=numbers,
            turn=turn,
            **more,
        )

    @property
    def closed_row(self) -> int:
        """First absolute row that an open plot, or one still to come, may have."""
        newest, head, tail = (int(self.numbers[at]) for at in (NEWEST, HEAD, TAIL))
        if head == tail:
            return newest + 1
        return newest - (newest - int(self.runs[tail]["row"])) % self.azimuths

    @property
    def counters(self) -> dict[str, int]:
        """Cells in plots, and what was left out or cut, by reason."""
        n = self.numbers
        return {
            "cells_detected": int(n[CELLS]),
            "plots_below_min_cells": int(n[SMALL]),
            "plots_without_seed": int(n[SEEDLESS]),
            "plots_cut_at_max_extent": int(n[CUT]),
            "runs_dropped": int(n[DROPPED]),
        }

    def refuse_untrue(self, saved: Mapping[str, NDArray[Any]]) -> None:
        """Raise StateError when an index lies outside, or when lists of runs do not close."""
        newest, latest, retired, head, tail = (
            int(saved["numbers"][at]) for at in (NEWEST, LATEST, RETIRED, HEAD, TAIL)
        )
        slots, ranges = len(self.window), len(self.rule.ring_of_cell)
        true = 0 <= tail <= head <= len(self.runs) and all(-1 <= one < 2**48 for one in (newest, latest))
        true = true and (head == tail or latest - retired <= 2 * slots)
        window = saved["window"][saved["window"][:, 0] >= 0]
        true = true and bool(((window[:, 1] >= 0) & (window[:, 1] <= window[:, 2]) & (window[:, 2] <= head)).all())
        if true:
            at = np.arange(tail, head)
            runs = saved["runs"][tail:head]
            true = bool(((runs["start"] >= 0) & (runs["start"] < runs["end"]) & (runs["end"] <= ranges)).all())
            for name, many in (("row", self.azimuths), ("last", self.azimuths), ("ring", len(self.rule.ring_stop))):
                true = true and bool(((runs[name] >= 0) & (runs[name] < many)).all())
            still = runs["parent"] != FREE
            at, runs = at[still], runs[still]
            true = true and bool(((tail <= runs["parent"]) & (runs["parent"] <= at)).all())
            true = true and np.array_equal(np.sort(runs["next"]), at)
        if true:
            row, run = saved["latest"]
            near = np.flatnonzero(row > retired)
            run = run[near]
            true = bool(((row <= latest) & ((row <= retired) | (saved["latest"][1] >= tail))).all())
            true = true and bool((run < head).all())
            if true:
                runs = saved["runs"][run]
                true = bool(((runs["start"] <= near) & (near < runs["end"])).all())
        if not true:
            raise StateError("the saved runs cannot be true")

    @property
    def pool(self) -> tuple[NDArray[Any], ...]:
        """What the kernels change."""
        return self.runs, self.window, self.latest, self.numbers, self.turn

    @property
    def scale(self) -> tuple[Any, ...]:
        """What the kernels read of the geometry."""
        one = self.geometry
        return one.constants, one.ground, one.sums, one.loudness

    def columns(self) -> PlotColumns:
        """Room for the plots of a block like the last one, and for all that is open."""
        still_open = int(self.numbers[HEAD] - self.numbers[TAIL])
        return PlotColumns.room_for(max(256, still_open + 64, int(self.room[0]) * 5 // 4))
