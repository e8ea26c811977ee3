"""What a run found, on a terminal."""

from __future__ import annotations

from collections.abc import Iterable

from rich.console import Group, RenderableType
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from app.evaluate import words
from app.evaluate.choose import needs_video
from app.evaluate.runs import Run
from pipeline.lab import evaluate

STYLES = {
    "reproduced": "green",
    "beaten": "bold green",
    "not reproduced": "red",
    "no figure in the paper": "dim",
    "met": "green",
    "NOT MET": "bold red",
    "": "",
}


def told(run: Run) -> RenderableType:
    """The table of a run, below what was run."""
    experiment = run.experiment
    head = Table.grid(padding=(0, 2))
    head.add_column(style="dim", no_wrap=True)
    head.add_column()
    for name, value in (
        ("source", experiment.source),
        ("reading", experiment.reading),
        ("settings", words.settings_line(experiment)),
        ("run", f"{run.trials} trials, seed {run.seed}{', quick' if run.quick else ''}, {words.duration(run.seconds)}"),
    ):
        head.add_row(name, Text(value))
    title = Text.from_markup(f"\n[bold]{escape(run.name)}[/bold]  {escape(experiment.title)}")
    return Group(title, head, _rows(run), Text(words.count(run.rows).told + "\n"))


def _rows(run: Run) -> Table:
    asked = any(row.wanted is not None for row in run.rows)
    table = Table()
    table.add_column("row", overflow="fold")
    for name in ("paper", "ours", "95 % interval"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("unit")
    table.add_column("verdict")
    if asked:
        table.add_column("wanted", justify="right", no_wrap=True)
        table.add_column("", no_wrap=True)
    for row in run.rows:
        cells = [
            Text(row.name),
            Text(words.figure(row.paper)),
            Text(words.figure(row.measured), style="bold"),
            Text(words.interval(row)),
            Text(row.unit),
            Text(row.verdict, style=STYLES[row.verdict]),
        ]
        if asked:
            cells += [Text(words.wanted(row)), Text(words.met(row), style=STYLES[words.met(row)])]
        table.add_row(*cells)
    return table


def summary(runs: Iterable[Run]) -> Table:
    """How many rows of each run came out how."""
    table = Table(title="All experiments", title_justify="left")
    table.add_column("experiment", no_wrap=True)
    for name in ("rows", "reproduced", "beaten", "not reproduced", "met", "NOT MET", "trials", "time"):
        table.add_column(name, justify="right")
    for run in runs:
        found = words.count(run.rows)
        cells = (found.rows, found.reproduced, found.beaten, found.not_reproduced, found.met, found.not_met, run.trials)
        table.add_row(run.name, *(str(cell or "") for cell in cells), words.duration(run.seconds))
    return table


def listed() -> Table:
    """All experiments."""
    table = Table(title="Experiments", title_justify="left", show_lines=True)
    for name in ("name", "what it measures", "source", "trials"):
        table.add_column(name, no_wrap=name == "name", justify="right" if name == "trials" else "left")
    for name, kind in evaluate.experiments().items():
        made = kind()
        title = f"{made.title} (works on a recording: --file)" if needs_video(kind) else made.title
        table.add_row(Text(name, style="bold"), Text(title), Text(made.source), str(made.trials))
    return table
