"""`airside evaluate`: what the papers claim beside what Airside measures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(evaluate)


def evaluate(
    name: Annotated[str | None, typer.Argument(help="An experiment (--list tells them), or all.")] = None,
    listed: Annotated[bool, typer.Option("--list", help="List the experiments.")] = False,
    trials: Annotated[int | None, typer.Option(min=1, help="Trials; otherwise as many as the experiment says.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Same seed, same figures, on any number of processes.")] = 1,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes; otherwise one for each core.")] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="The short version, which continuous integration runs.")
    ] = False,
    backend: Annotated[
        str, typer.Option(help="Where trials run: loky (processes), threading, or dask (a cluster).")
    ] = "loky",
    file: Annotated[
        Path | None,
        typer.Option(
            help="A recording: .npz of scans and t for experiments on recorded video, JSON target reports"
            " (an array or one a line, may be gzipped) for those on recorded reports, ADS-B rows as `simulate traffic`"
            " takes them, or a folder of such files, for those on recorded traffic."
        ),
    ] = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="Write the tables as JSON.")] = None,
    markdown: Annotated[Path | None, typer.Option(metavar="FILE", help="Write the tables as Markdown.")] = None,
    report: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write a page with tables and plots, NAME.html, to this folder.")
    ] = None,
) -> None:
    """Measure what the papers claim, and print the table beside theirs.

    [bold]airside evaluate --list[/bold] tells the experiments, [bold]airside evaluate cfar-table1[/bold] runs one,
    [bold]airside evaluate all --quick[/bold] the short version of all. What does not reproduce is printed as such and
    is no error. With --backend dask, DASK_SCHEDULER_ADDRESS names a running cluster; otherwise one is started here.
    """
    from app.threads import one_thread_each

    one_thread_each()
    from app.console import fail
    from app.evaluate.choose import UnknownExperiment
    from app.evaluate.session import Options, run_all, usable_console
    from app.ingest.recording import RecordingError

    console = usable_console()
    if listed:
        from app.evaluate.table import listed as table

        console.print(table())
        return
    if name is None:
        raise fail("say which experiment: `airside evaluate --list` tells them, `airside evaluate all` runs all")
    try:
        options = Options(name, trials, seed, jobs, backend, quick, file, json, markdown, report)
        failed = run_all(console, options)
    except (UnknownExperiment, RecordingError, ValueError, OSError) as error:
        raise fail(str(error)) from error
    except KeyboardInterrupt:
        raise fail("stopped; nothing is written", code=130) from None
    if failed:
        raise fail(f"could not be carried out: {', '.join(failed)}", code=1)
