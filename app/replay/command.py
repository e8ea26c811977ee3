"""The work of `airside replay` on a journal: verify it, compare it with other settings, serve it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from app.journal.names import JournalError, journal_files
from app.journal.reader import Journal, open_journal
from app.journal.recorder import versions
from app.journal.times import moment, utc_text
from app.output_files import json_text, write_whole
from app.replay.compare import compare
from app.replay.verify import Verification, verify
from pipeline.tables import Tracks

MOST_TOLD = 3
"""Sentences about one matter that are printed in full."""


def is_journal(path: Path) -> bool:
    """A journal file by its name, or a folder that holds journal files or cannot be looked into."""
    try:
        return path.suffix == ".mcap" or (path.is_dir() and bool(journal_files(path)))
    except OSError:
        return True  # opening it then says what is wrong


class JournalReplay:
    """One journal and what is asked of it. times: from, until, as a person writes them. json: file that takes what
    `verify` and `compare` find.

    Raises JournalError when it cannot be read or holds nothing.
    """

    def __init__(
        self,
        console: Console,
        path: Path,
        times: tuple[str | None, str | None],
        change: tuple[str, ...],
        json: Path | None = None,
    ) -> None:
        self.console = console
        self.journal: Journal = open_journal(path)
        start, end = self.journal.first_time(), self.journal.last_time()
        if start is None or end is None:
            raise JournalError(f"{path}: holds no record")
        self.start, self.end = start, end
        begin, until = times
        self.since = None if begin is None else moment(begin, start)
        self.until = None if until is None else moment(until, start)
        self.change = change
        self.json = json
        for file in self.journal.files:
            if file.cut_off is not None:
                console.print(
                    f"[yellow]{file.path} was cut off, or is still being written: read to its last whole chunk"
                    f" ({file.cut_off} octets left out)[/yellow]"
                )

    def verify(self) -> int:
        """Print "identical" or the first difference; exit status 0 or 1."""
        with self._progress("verifying") as hear:
            found = verify(self.journal, self.since, self.until, hear)
        self._tell(found)
        self._tell_begun_empty(found.begun_empty)
        self._write({**asdict(found), "begun_empty": len(found.begun_empty), "notes": found.begun_empty})
        if found.difference is None:
            self.console.print("[bold green]identical[/bold green]" if found.pictures else "nothing to compare")
            return 0 if found.pictures else 1
        self.console.print(f"[bold red]not identical[/bold red]: {found.difference}", highlight=False)
        return 1

    def compare(self) -> int:
        """Print what would have been different with the settings asked for; exit status 0."""
        with self._progress("replaying") as hear:
            found = compare(self.journal, self.change, self.since, self.until, hear)
        made = found.pictures
        self._tell_begun_empty(found.begun_empty)
        self._write(found.document())
        title = f"{made.pictures} pictures, {' '.join(self.change) or 'the recorded settings'}"
        table = Table(title=title, title_justify="left")
        table.add_column("")
        table.add_column("recorded", justify="right")
        table.add_column("replayed", justify="right")
        table.add_column("")
        for row in made.figures():
            table.add_row(row.name, f"{row.recorded:.4g}", f"{row.replayed:.4g}", row.unit)
        self.console.print(table)
        for title, alerts in zip(("only recorded", "only replayed"), made.alerts(), strict=True):
            for one in alerts:
                self.console.print(
                    f"{title}: {utc_text(one.time)} {one.stage} {one.rule} {one.runway} {', '.join(one.targets)}",
                    highlight=False,
                )
        if not any(made.alerts()):
            self.console.print("the same alerts")
        return 0

    def serve(self, port: int, speed: float) -> int:
        """Serve the displays with the picture of the journal, until interrupted."""
        from app.replay.serving import serve_journal

        return serve_journal(self.console, self.journal, self.change, (self.since, self.until), port, speed)

    def _tell(self, found: Verification) -> None:
        span = "" if found.first is None else f", {utc_text(found.first)} to {utc_text(found.last)}"
        self.console.print(
            f"{found.inputs} inputs{span}: {found.pictures} pictures of {len(Tracks.columns())} columns"
            f" ({found.columns} columns compared), {found.changes} alert changes, {found.snapshots} snapshots,"
            f" {found.runs} {'run' if found.runs == 1 else 'runs'}, {found.gaps} gaps"
            + (f", {found.sectors} sectors detected again" if found.sectors else ""),
            highlight=False,
        )
        if found.failures:
            self.console.print(f"{found.failures} inputs that the engine could not take, then as now")
        here = versions()
        then = found.versions.items()
        other = [f"{name} {had} then, {here.get(name)} now" for name, had in then if here.get(name) != had]
        if other:
            self.console.print(f"[yellow]not the same versions: {'; '.join(other)}[/yellow]", highlight=False)

    def _tell_begun_empty(self, sentences: Sequence[str]) -> None:
        for one in sentences[:MOST_TOLD]:
            self.console.print(f"[yellow]{escape(one)}[/yellow]", highlight=False)
        if len(sentences) > MOST_TOLD:
            self.console.print(f"[yellow]So it is at {len(sentences) - MOST_TOLD} further places.[/yellow]")

    def _write(self, found: dict[str, Any]) -> None:
        if self.json is not None:
            write_whole(self.json, json_text(found))

    @contextmanager
    def _progress(self, what: str) -> Iterator[Callable[[float], None]]:
        columns = (
            TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn(),
            TimeRemainingColumn(),
        )  # fmt: skip
        first = self.start if self.since is None else self.since
        with Progress(*columns, console=self.console, transient=True) as progress:
            task = progress.add_task(what, total=max((self.until or self.end) - first, 1e-3))
            yield lambda time: progress.update(task, completed=time - first)
