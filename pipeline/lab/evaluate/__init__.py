"""Experiments: each file measures one thing the papers claim, and this is what all of them keep to.

An experiment is a frozen dataclass of settings, named by its file (`cfar_table1.py` is `cfar-table1`) and given as
`EXPERIMENT`. It is arithmetic only: whoever runs it (`app.evaluate`) deals the trials out to processes, times,
draws and writes. Helper modules without `EXPERIMENT` are no experiments.

* `quick()` gives the short version that runs in CI; the fields of both are printed with the results.
* `trial(chance, number, clock)` does one trial and gives named arrays; it depends on nothing but the settings, the
  random generator it is handed and its number, so that any order on any number of processes gives the same figures.
* `rows(results)` makes the table, `figures(results)` the plots, from the results of all trials in order.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Literal, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from pipeline.airport.model import Airport
from pipeline.lab.simulate.recording import Recording
from pipeline.sites import RadarSite
from pipeline.tables import TargetReports

Trial = Mapping[str, NDArray[Any]]
"""What one trial found, by name."""

Verdict = Literal["reproduced", "beaten", "not reproduced", "no figure in the paper"]


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the table.

    paper: the paper's figure; None when it has none. measured: ours; low, high: its 95 % interval. tolerance: how far
    off still counts as reproduced. better: which way is better, for "beaten" ("near": no way is). wanted: the bound
    Airside asks of itself, in the sense of `better`; None when there is none. repeatable: False for times.
    """

    name: str
    measured: float
    low: float
    high: float
    unit: str
    paper: float | None = None
    tolerance: float = 0.0
    better: Literal["higher", "lower", "near"] = "near"
    wanted: float | None = None
    repeatable: bool = True

    @property
    def verdict(self) -> Verdict:
        """How ours stands to the paper's."""
        if self.paper is None:
            return "no figure in the paper"
        gain = {"higher": self.measured - self.paper, "lower": self.paper - self.measured, "near": 0.0}[self.better]
        if gain > self.tolerance:
            return "beaten"
        return "reproduced" if abs(self.measured - self.paper) <= self.tolerance else "not reproduced"

    @property
    def met(self) -> bool | None:
        """Whether ours is as good as wanted; None when nothing is."""
        if self.wanted is None or self.better == "near":
            return None
        return self.measured >= self.wanted if self.better == "higher" else self.measured <= self.wanted


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """One line or set of points of a figure. low, high: band about it."""

    label: str
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    low: NDArray[np.float64] | None = None
    high: NDArray[np.float64] | None = None
    style: Literal["line", "points", "paper", "bound"] = "line"


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """An image of a figure. values: (rows, columns); extent: left, right, bottom, top in the units of the axes.

    marks: (n, 2) points drawn over it.
    """

    label: str
    values: NDArray[Any]
    extent: tuple[float, float, float, float] | None = None
    unit: str = ""
    marks: NDArray[np.float64] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Figure:
    """A plot of the report: lines over one pair of axes, or pictures side by side."""

    title: str
    x: str
    y: str
    lines: tuple[Line, ...] = ()
    pictures: tuple[Picture, ...] = ()
    log_x: bool = False
    log_y: bool = False
    note: str = ""


class Experiment(Protocol):
    """An experiment: settings in its fields, see the module for the rules.

    title: one line. source: paper, section, table. reading: what was assumed where the paper is silent. trials: how
    many a run has unless told otherwise.
    """

    title: str
    source: str
    reading: str
    trials: int

    def quick(self) -> Self:
        """The short version."""

    def trial(self, chance: np.random.Generator, number: int, clock: Callable[[], float]) -> Trial:
        """One trial. clock: seconds of a steady clock, for experiments that time."""

    def rows(self, results: Sequence[Trial]) -> tuple[Row, ...]:
        """The table."""

    def figures(self, results: Sequence[Trial]) -> tuple[Figure, ...]:
        """The plots."""


@dataclass(frozen=True, slots=True, eq=False)
class RecordedVideo:
    """Recorded radar video handed to an experiment that works on a file (its field `video`; None without a file).

    scans: (turns, azimuths, ranges) unsigned integers of `bits` significant bits. time: (turns) s.
    """

    scans: NDArray[Any]
    time: NDArray[np.float64]
    bits: int
    range_step_m: float = 3.0
    first_range_m: float = 0.0
    name: str = field(default="")


@dataclass(frozen=True, slots=True, eq=False)
class RecordedReports:
    """Recorded target reports handed to an experiment that works on some (its field `reports`).

    smoothed: the recording was smoothed, so that its positions have less noise than those of a sensor.
    """

    reports: TargetReports
    smoothed: bool = False
    name: str = field(default="")


@dataclass(frozen=True, slots=True, eq=False)
class RecordedTraffic:
    """Recorded movements at an airport, handed to an experiment that works on some (its field `traffic`).

    recording: the movements, cleaned. reports: the same as they were received; None when only the movements are known.
    radar: the one that is simulated there.
    """

    airport: Airport
    radar: RadarSite
    recording: Recording
    reports: TargetReports | None = None
    name: str = field(default="")


@cache
def experiments() -> dict[str, type[Any]]:
    """All experiments by name."""
    found: dict[str, type[Any]] = {}
    for module in pkgutil.iter_modules(__path__):
        made = getattr(importlib.import_module(f"{__name__}.{module.name}"), "EXPERIMENT", None)
        if made is not None:
            found[module.name.replace("_", "-")] = made
    return found
