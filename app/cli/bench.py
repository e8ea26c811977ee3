"""`airside bench`: what each stage costs, next to other libraries; `bench tracker`, `picture`, `soak`, `journal`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from app.bench.tables import Row
    from pipeline.lab.measure.picture_quality import QualityRow
    from pipeline.lab.measure.stopwatch import BenchRow

JsonFile = Annotated[
    Path | None, typer.Option("--json", metavar="FILE", help='Write the rows as JSON, {"rows": [...]}.')
]


def register(app: typer.Typer) -> None:
    """Add the commands."""
    group = typer.Typer(invoke_without_command=True)
    group.callback()(bench)
    for command in (tracker, picture, soak, journal):
        group.command(command.__name__)(command)
    app.add_typer(group, name="bench")


def bench(
    context: typer.Context,
    repeats: Annotated[int, typer.Option(min=3, help="Turns measured for each line; the median is printed.")] = 60,
    peers: Annotated[bool, typer.Option(help="Also measure numpy, scipy and OpenCV on the same input.")] = True,
    service: Annotated[bool, typer.Option(help="Also run the service: intake, delay, clients (two minutes).")] = True,
    seconds: Annotated[float, typer.Option(min=2.0, help="Length of each measurement of the service.")] = 15.0,
    json: JsonFile = None,
) -> None:
    """Measure the stages on this machine, side by side in one run.

    One turn is 4096 x 1024 cells of 8 bits, a second of a 60 rpm radar. Read the ratios, to reading that frame once:
    milliseconds depend on what else the machine does.
    """
    if context.invoked_subcommand is not None:
        if json is not None:
            from app.console import fail

            raise fail(f"--json belongs behind {context.invoked_subcommand}, whose rows it writes")
        return
    _check(json)
    from rich.console import Console

    from app.bench.tables import figures_table, timed_table

    console = Console()
    with console.status("Compiling, or loading compiled kernels ...", spinner="line"):
        front_end = _front_end(repeats, peers)
    console.print(timed_table("Radar front end, one turn of 4096 x 1024 x 8 bit", front_end))
    with console.status("Tracking thousands of targets ...", spinner="line"):
        tracking = _tracker(repeats, peers)
    console.print(timed_table("Tracker, one turn of 1,000 targets", tracking))
    served: list[QualityRow] = []
    if service:
        from app.bench.report import service_rows

        with console.status("Starting the service ...", spinner="line") as status:
            served = list(service_rows(seconds, lambda what: status.update(f"Measuring: {what} ...")))
        console.print(figures_table("The running service", served))
    _write(json, [*front_end, *tracking, *served])


def tracker(
    turns: Annotated[int, typer.Option(min=30, help="Turns measured; the median is printed.")] = 30,
    seed: Annotated[int, typer.Option(min=0, help="Of the simulated targets and false plots.")] = 1,
    json: JsonFile = None,
) -> None:
    """Measure the tracker on one thread: 1,000 targets and 180 false plots a turn, and 5,000 at the same density.

    Ratios are to reading a 4 MiB frame once, turn about in the same run; the one of scaling_5000 is to the cost of
    1,000 targets. What is wanted stands beside what is measured, and a row that does not meet it is no error.
    """
    _check(json)
    from app.threads import one_thread_each

    one_thread_each()
    import time

    from rich.console import Console

    from app.bench.tables import timed_table
    from pipeline.lab.measure.bench_tracker import bench_tracker, frames
    from pipeline.lab.measure.stopwatch import Stopwatch

    console = Console()
    with console.status("Compiling, or loading compiled kernels; tracking thousands of targets ...", spinner="line"):
        rows = bench_tracker(Stopwatch(time.perf_counter, turns, frames()), seed=seed)
    console.print(timed_table(f"Tracker, median of {turns} turns", rows))
    _write(json, rows)


def soak(
    minutes: Annotated[int, typer.Option(min=2, help="Minutes of the demonstration to run.")] = 60,
    json: JsonFile = None,
) -> None:
    """Run the demonstration for an hour of its own time as fast as this machine can; does memory stay flat?"""
    _check(json)
    import tempfile

    from rich.console import Console
    from rich.progress import Progress

    from app.bench.soak import soak as run

    with Progress(transient=True) as progress, tempfile.TemporaryDirectory() as folder:
        task = progress.add_task("Minutes of the demonstration", total=minutes)
        result = run(minutes, Path(folder), lambda done: progress.update(task, completed=done))
    Console().print(
        f"{minutes} minutes at {result.speed:.1f} times the clock: {result.resident_mib[-1]:.0f} MiB at the end,"
        f" {result.growth_mib:+.1f} MiB since a tenth of the way",
        highlight=False,
    )
    _write(json, result.rows())


def journal(
    seconds: Annotated[int, typer.Option(min=5, help="Length of the measurement, at the pace of the clock.")] = 60,
    targets: Annotated[int, typer.Option(min=1, help="Targets that move on the airport.")] = 100,
    seed: Annotated[int, typer.Option(min=0, help="Of the simulated world and its radar video.")] = 1,
    json: JsonFile = None,
) -> None:
    """Measure what the journal costs: the same inputs through an engine with a journal and one without, in one run."""
    _check(json)
    from rich.console import Console

    from app.bench.journal import measure_journal
    from app.bench.tables import figures_table

    console = Console()
    with console.status("", spinner="line") as status:
        cost = measure_journal(seconds, targets, seed, lambda what: status.update(f"{what} ..."))
    title = f"The journal without raw sweeps, {cost.targets} targets ({cost.tracks:.0f} tracks), {cost.seconds:g} s"
    console.print(figures_table(title, cost.rows()))
    _write(json, cost.rows())


def picture(
    scans: Annotated[int, typer.Option(min=40, help="Turns of the radar to run; the first 30 are not counted.")] = 300,
    seed: Annotated[int, typer.Option(min=0, help="Of the simulated world and its radar video.")] = 1,
    json: JsonFile = None,
) -> None:
    """Run the demonstration's world through radar chain and tracker and compare the picture with the truth.

    Bounds are those of EUROCAE ED-87 for the manoeuvring area where it has one: targets, not a certificate.
    """
    _check(json)
    from rich.console import Console
    from rich.progress import Progress

    from app.bench.picture import demo_quality
    from app.bench.tables import figures_table

    with Progress(transient=True) as progress:
        task = progress.add_task("Turns of the radar", total=scans)
        score = demo_quality(scans, lambda scan: progress.update(task, completed=scan + 1), seed=seed)
    rows = score.rows()
    Console().print(figures_table(f"Picture against truth, {scans} turns, seed {seed}", rows))
    _write(json, rows)


def _front_end(repeats: int, peers: bool) -> list[BenchRow]:
    import time

    from pipeline.lab.measure.bench_frontend import bench_frontend

    return list(bench_frontend(time.perf_counter, repeats, peers))


def _tracker(repeats: int, peers: bool) -> list[BenchRow]:
    import time

    from pipeline.lab.measure.bench_tracker import bench_tracker, frames
    from pipeline.lab.measure.stopwatch import Stopwatch
    from pipeline.lab.measure.tracker_parts import bench_tracker_parts

    watch = Stopwatch(time.perf_counter, repeats, frames())
    return [*bench_tracker(watch), *bench_tracker_parts(watch, peers=peers)]


def _check(json: Path | None) -> None:
    """Before minutes of measuring: can the file be written?"""
    from app.console import fail
    from app.output_files import check_writable

    try:
        if json is not None:
            check_writable(json)
    except ValueError as error:
        raise fail(str(error)) from error


def _write(json: Path | None, rows: Sequence[Row]) -> None:
    if json is None:
        return
    from app.bench.tables import write_rows
    from app.console import fail

    try:
        write_rows(json, rows)
    except OSError as error:
        raise fail(str(error)) from error
