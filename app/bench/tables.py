"""What the benches measured, as tables on the terminal and as JSON."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from rich.table import Table

from app.output_files import json_text, write_whole
from pipeline.lab.measure.picture_quality import QualityRow
from pipeline.lab.measure.stopwatch import BenchRow

Row = BenchRow | QualityRow


def timed_table(title: str, rows: Iterable[BenchRow]) -> Table:
    """Rows that were timed beside reading the frame once."""
    table = Table(title=title, title_justify="left")
    figures = ("ms", "least", "ratio", "wanted")
    for name in ("stage", *figures, ""):
        table.add_column(name, justify="right" if name in figures else "left", no_wrap=name in figures)
    for row in rows:
        table.add_row(
            row.name,
            f"{row.median_s * 1e3:.2f}",
            f"{row.least_s * 1e3:.2f}",
            f"{row.ratio:.1f}",
            row.wanted,
            row.note,
            style="dim" if row.peer else None if row.met else "red",
        )
    return table


def figures_table(title: str, rows: Iterable[QualityRow]) -> Table:
    """Figures with their bounds, and whether these are met."""
    table = Table(title=title, title_justify="left")
    for name, side in (("figure", "left"), ("measured", "right"), ("wanted", "right"), ("", "left"), ("", "left")):
        table.add_column(name, justify="right" if side == "right" else "left", no_wrap=side == "right")
    for row in rows:
        wanted = "" if row.bound is None else f"{'>=' if row.at_least else '<='} {row.bound:g}"
        verdict = {True: "met", False: "NOT MET", None: ""}[row.met]
        style = {True: None, False: "red", None: "dim"}[row.met]
        unit = ", ".join(one for one in (row.unit, row.note) if one)
        table.add_row(row.name, f"{row.value:.4g}", wanted, unit, verdict, style=style)
    return table


def write_rows(path: Path, rows: Sequence[Row]) -> None:
    """Write `{"rows": [...]}`: timed rows with name, ratio, least and wanted, others with name, value, bound and met.

    Raises OSError.
    """
    write_whole(path, json_text({"rows": [row.document() for row in rows]}))
