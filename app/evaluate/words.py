"""Figures, intervals and settings in the words that all tables share."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from app.evaluate.runs import Run
from pipeline.lab.evaluate import Experiment, RecordedReports, RecordedTraffic, RecordedVideo, Row

TOLD_APART = ("title", "source", "reading", "trials")
"""Fields of an experiment that are told elsewhere than among its settings."""


def figure(value: float | None) -> str:
    """Four digits; nothing for a figure that is not there."""
    if value is None or math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0 else "-∞"
    if 1e4 <= abs(value) < 1e6:
        return f"{value:.0f}"
    return re.sub(r"e([+-])0*", lambda found: "e" + found[1].replace("+", ""), f"{value:.4g}")


def interval(row: Row) -> str:
    """The 95 % interval; nothing when the figure is exact."""
    if row.low == row.high == row.measured or math.isnan(row.low) or math.isnan(row.high):
        return "–"
    return f"{figure(row.low)} to {figure(row.high)}"


def wanted(row: Row) -> str:
    """The bound Airside asks of itself."""
    if row.wanted is None:
        return ""
    return {"higher": "≥ ", "lower": "≤ ", "near": ""}[row.better] + figure(row.wanted)


def met(row: Row) -> str:
    """Whether it keeps that bound."""
    return {True: "met", False: "NOT MET", None: ""}[row.met]


def duration(seconds: float) -> str:
    """As a person says it."""
    if seconds < 60:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


def settings_of(experiment: Experiment) -> dict[str, Any]:
    """The settings of an experiment as JSON has them."""
    kind: Any = type(experiment)
    return {one.name: plain(getattr(experiment, one.name)) for one in fields(kind) if one.name not in TOLD_APART}


def settings_line(experiment: Experiment) -> str:
    """The settings in one line."""
    return ", ".join(f"{name} = {said(value)}" for name, value in settings_of(experiment).items()) or "none"


def plain(value: Any) -> Any:
    """A value as JSON has it; numbers that are not finite become null."""
    if isinstance(value, RecordedVideo | RecordedReports | RecordedTraffic):
        return value.name
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, dict):
        return {str(key): plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(one) for one in value]
    if is_dataclass(value) and not isinstance(value, type):
        return {one.name: plain(getattr(value, one.name)) for one in fields(value)}
    return value.name if isinstance(value, Path) else str(value)


LONG = 25
"""Rows beyond which a table shows first what there is something to compare with."""


def parted(rows: Sequence[Row]) -> tuple[list[Row], list[Row]]:
    """(rows to show at once, the others): of a long table, those with a figure in the paper or a wanted bound first."""
    first = [row for row in rows if row.paper is not None or row.wanted is not None]
    if len(rows) <= LONG or not first:
        return list(rows), []
    return first, [row for row in rows if row.paper is None and row.wanted is None]


@dataclass(frozen=True)
class Count:
    """How many rows came out how."""

    rows: int
    reproduced: int
    beaten: int
    not_reproduced: int
    no_figure: int
    met: int
    not_met: int

    @property
    def told(self) -> str:
        """In one line, leaving out what there is none of."""
        with_paper = self.rows - self.no_figure
        words = [f"{self.rows} rows"]
        if with_paper:
            words.append(
                f"{with_paper} with a figure in the paper: {self.reproduced} reproduced, {self.beaten} beaten,"
                f" {self.not_reproduced} not reproduced"
            )
        if self.met + self.not_met:
            words.append(f"{self.met} of {self.met + self.not_met} wanted bounds met")
        return "; ".join(words)


def count(rows: Iterable[Row]) -> Count:
    """How many rows came out how."""
    rows = tuple(rows)
    verdicts, kept = Counter(row.verdict for row in rows), Counter(row.met for row in rows)
    return Count(
        len(rows),
        verdicts["reproduced"],
        verdicts["beaten"],
        verdicts["not reproduced"],
        verdicts["no figure in the paper"],
        kept[True],
        kept[False],
    )


def short_of(runs: Iterable[Run]) -> list[tuple[str, Row]]:
    """(experiment, row) of everything that does not reproduce or is not as good as wanted."""
    return [(run.name, row) for run in runs for row in run.rows if row.verdict == "not reproduced" or row.met is False]


def said(value: Any) -> str:
    """A setting in words."""
    if isinstance(value, list):
        return "(" + ", ".join(said(one) for one in value) + ")"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {said(one)}" for key, one in value.items()) + "}"
    return figure(value) if isinstance(value, float) else str(value)
