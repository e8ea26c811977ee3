"""What runs found, as a JSON document and as a page of Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from app.evaluate import words
from app.evaluate.circumstances import Circumstances
from app.evaluate.runs import Run
from pipeline.lab.evaluate import Row


def document(run: Run) -> dict[str, Any]:
    """A run as JSON has it; numbers that are not finite are null."""
    return {
        "experiment": run.name,
        "seed": run.seed,
        "trials": run.trials,
        "settings": words.settings_of(run.experiment),
        "rows": [_row(row) for row in run.rows],
    }


def markdown(runs: Sequence[Run], left_out: Sequence[str], about: Circumstances) -> str:
    """The page that is committed: a summary, what falls short, then every table."""
    lines = [
        "# Evaluation",
        "",
        "What the papers claim, beside what Airside measures. *Reproduced*: within the tolerance stated in the",
        "experiment's file. *Beaten*: better than the paper by more than that. *Not reproduced* stands here as such.",
        "*Wanted* is the bound Airside sets itself. Intervals are 95 %.",
        "",
        *(f"- {name}: {_cell(value)}" for name, value in (("Command", f"`{about.command}`"), *about.lines())),
        "",
        "## Summary",
        "",
        *_summary(runs),
    ]
    lines += ["", *(f"- {line}" for line in left_out)] if left_out else []
    short = words.short_of(runs)
    if short:
        lines += ["", "## What falls short", "", *_short(short)]
    for run in runs:
        lines += ["", *_section(run)]
    return "\n".join(lines) + "\n"


def _row(row: Row) -> dict[str, Any]:
    return {
        "name": row.name,
        "paper": words.plain(row.paper),
        "measured": words.plain(float(row.measured)),
        "ci95": [words.plain(float(row.low)), words.plain(float(row.high))],
        "unit": row.unit,
        "verdict": row.verdict,
        "wanted": words.plain(row.wanted),
        "met": None if row.met is None else bool(row.met),
    }


def _summary(runs: Sequence[Run]) -> Iterable[str]:
    head = ("experiment", "rows", "reproduced", "beaten", "not reproduced", "met", "NOT MET", "trials", "time")
    body, total = [], words.count(row for run in runs for row in run.rows)
    for run in runs:
        body.append((f"[{run.name}](#{run.name})", words.count(run.rows), str(run.trials), words.duration(run.seconds)))
    body.append(("**all**", total, "", words.duration(sum(run.seconds for run in runs))))
    cells = [
        (name, found.rows, found.reproduced, found.beaten, found.not_reproduced, found.met, found.not_met, trials, took)
        for name, found, trials, took in body
    ]
    return _table(head, [[str(cell or "") for cell in line] for line in cells], "lrrrrrrrr")


def _short(short: list[tuple[str, Row]]) -> Iterable[str]:
    head = ("experiment", "row", "paper", "wanted", "ours", "unit")
    body = [
        [name, row.name, words.figure(row.paper), words.wanted(row) or "–", words.figure(row.measured), row.unit]
        for name, row in short
    ]
    return _table(head, body, "llrrrl")


def _section(run: Run) -> Iterable[str]:
    made = run.experiment
    yield from (f"## {run.name}", "", _cell(made.title).rstrip(".") + ".", "")
    yield f"- Source: {_cell(made.source)}"
    yield f"- Reading: {_cell(made.reading)}"
    yield f"- Settings: {_cell(words.settings_line(made))}"
    yield f"- {run.trials} trials, seed {run.seed}{', quick' if run.quick else ''}, {words.duration(run.seconds)}"
    yield ""
    first, others = words.parted(run.rows)
    yield from _rows(first)
    if others:
        yield from ("", f"<details><summary>{len(others)} more rows, with nothing to compare with</summary>", "")
        yield from _rows(others)
        yield from ("", "</details>")


def _rows(rows: Sequence[Row]) -> Iterable[str]:
    asked = any(row.wanted is not None for row in rows)
    head, body = ["row", "paper", "ours", "95 % interval", "unit", "verdict"], []
    for row in rows:
        line = [row.name, words.figure(row.paper), words.figure(row.measured), words.interval(row), row.unit]
        line.append(f"**{row.verdict}**" if row.verdict == "not reproduced" else row.verdict)
        kept = words.met(row)
        body.append([*line, words.wanted(row), f"**{kept}**" if row.met is False else kept] if asked else line)
    return _table([*head, "wanted", ""] if asked else head, body, "lrrrllrl")


def _table(head: Sequence[str], body: Sequence[Sequence[str]], sides: str) -> Iterable[str]:
    yield "| " + " | ".join(head) + " |"
    yield "|" + "|".join(" ---: " if side == "r" else " --- " for side in sides[: len(head)]) + "|"
    for line in body:
        yield "| " + " | ".join(_cell(cell) for cell in line) + " |"


def _cell(text: str) -> str:
    return " ".join(text.replace("|", "\\|").replace("<", "&lt;").split())
