"""`airside journal`: say what is in a journal, and cut an incident out of it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from app.journal.info import JournalInfo

journal = typer.Typer(no_args_is_help=True, help="Look at a journal, and cut a part out of it.")


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.add_typer(journal, name="journal")


@journal.command("info")
def info(
    path: Annotated[Path, typer.Argument(help="A journal file (.mcap), or the folder with all of them.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    check: Annotated[bool, typer.Option("--check", help="Read every octet and compare with the checksums.")] = False,
) -> None:
    """Say what is in a journal: files, runs, time, records, snapshots, gaps, and what was cut off."""
    import json
    from dataclasses import asdict

    from app.console import fail
    from app.journal.info import journal_info
    from app.journal.names import JournalError
    from app.journal.reader import open_journal

    try:
        opened = open_journal(path)
        if check:
            for file in opened.files:
                file.check()
        told = journal_info(opened)
    except JournalError as error:
        raise fail(str(error)) from error
    if as_json:
        typer.echo(json.dumps(asdict(told), indent=2, ensure_ascii=False))
    else:
        _print(told, check)


@journal.command("export")
def export_(
    path: Annotated[Path, typer.Argument(help="A journal file (.mcap), or the folder with all of them.")],
    since: Annotated[
        str,
        typer.Option(
            "--from", metavar="T", help="2026-11-27T11:30:00Z, epoch seconds, or +90: 90 s after the first record."
        ),
    ],
    until: Annotated[str, typer.Option("--until", metavar="T", help="In the same forms.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="The file to write, such as incident.mcap.")],
) -> None:
    """Cut a part out of a journal whole, into one file that replays by itself.

    It begins with the last snapshot at or before [bold]--from[/bold]. Example:
    [bold]airside journal export data/journal --from +90 --until +240 -o incident.mcap[/bold]
    """
    from app.console import fail
    from app.journal.export import export
    from app.journal.names import JournalError
    from app.journal.reader import open_journal
    from app.journal.times import moment, utc_text

    try:
        opened = open_journal(path)
        start = opened.first_time()
        if start is None:
            raise JournalError(f"{path}: holds no record")
        done = export(opened, moment(since, start), moment(until, start), output)
    except JournalError as error:
        raise fail(str(error)) from error
    typer.echo(f"{done.path}: {done.records} records, {utc_text(done.start)} to {utc_text(done.end)}")
    if len(done.runs) > 1:
        typer.echo(f"the service was restarted in between: runs {', '.join(done.runs)}")


def _print(told: JournalInfo, checked: bool) -> None:
    from app.journal.times import utc_text

    for file in told.files:
        span = f"{utc_text(file.start)} to {utc_text(file.end)}" if file.records else "no records"
        end = "" if file.finished else f", not finished: cut off or still written, {file.left} octets left out"
        runs = "+".join(f"{name}/{number}" for name, number in zip(file.runs, file.numbers, strict=True))
        typer.echo(f"{file.path}: run {runs or '?'}, {file.octets} octets, {file.records} records, {span}{end}")
    typer.echo(
        f"\n{utc_text(told.start)} to {utc_text(told.end)}, {told.duration_s:.1f} s, {told.octets / 1e6:.1f} MB on disk"
    )
    for run in told.runs:
        span = f"{utc_text(run.get('start'))} to {utc_text(run.get('end'))}"
        typer.echo(f"run {run['run']}: {run['files']} files, {run['records']} records, {span}")
        for name, version in (run["versions"] if isinstance(run["versions"], dict) else {}).items():
            typer.echo(f"  {name} {version}")
    for topic, counts in told.topics.items():
        typer.echo(f"{topic:24} {counts['records']:9} records {counts['octets']:13} octets")
    typer.echo(f"{len(told.snapshots)} snapshots, {len(told.gaps)} gaps")
    for gap in told.gaps:
        typer.echo(
            f"  {utc_text(gap['time'])}: {gap.get('dropped', '?')} records are missing: {gap.get('reason', '?')}"
        )
    if checked:
        typer.echo("all checksums are right")
