"""`airside bench`: what each stage costs, next to other libraries; `airside bench picture`: how good the picture is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.table import Table

    from pipeline.lab.measure.picture_quality import Score


def register(app: typer.Typer) -> None:
    """Add the commands."""
    group = typer.Typer(invoke_without_command=True)
    group.callback()(bench)
    group.command("picture")(picture)
    group.command("soak")(soak)
    group.command("journal")(journal)
    app.add_typer(group, name="bench")


def bench(
    context: typer.Context,
    repeats: Annotated[int, typer.Option(min=3, help="Turns measured for each line; the median is printed.")] = 60,
    peers: Annotated[bool, typer.Option(help="Also measure numpy, scipy and OpenCV on the same input.")] = True,
    service: Annotated[bool, typer.Option(help="Also run the service: intake, delay, clients (two minutes).")] = True,
    seconds: Annotated[float, typer.Option(min=2.0, help="Length of each measurement of the service.")] = 15.0,
) -> None:
    """Measure the stages on this machine, side by side in one run.

    One turn is 4096 x 1024 cells of 8 bits, a second of a 60 rpm radar. Read the ratios: milliseconds depend on what
    else the machine does.
    """
    if context.invoked_subcommand is not None:
        return
    from rich.console import Console

    console = Console()
    with console.status("Compiling, or loading compiled kernels ..."):
        table = _front_end(repeats, peers)
    console.print(table)
    with console.status("Tracking a thousand targets ..."):
        lines = _tracker(peers)
    console.print("\n".join(lines), highlight=False)
    if service:
        from app.bench.report import service_table

        with console.status("Starting the service ...") as status:
            table = service_table(seconds, lambda what: status.update(f"Measuring: {what} ..."))
        console.print(table)


def soak(
    minutes: Annotated[int, typer.Option(min=2, help="Minutes of the demonstration to run.")] = 60,
) -> None:
    """Run the demonstration for an hour of its own time as fast as this machine can; does memory stay flat?"""
    import tempfile
    from pathlib import Path

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


def journal(
    seconds: Annotated[int, typer.Option(min=5, help="Length of the measurement, at the pace of the clock.")] = 60,
    targets: Annotated[int, typer.Option(min=1, help="Targets that move on the airport.")] = 100,
    seed: Annotated[int, typer.Option(min=0, help="Of the simulated world and its radar video.")] = 1,
) -> None:
    """Measure what the journal costs: the same inputs through an engine with a journal and one without, in one run."""
    from rich.console import Console
    from rich.table import Table

    from app.bench.journal import MOST_MB_S, MOST_SHARE, measure_journal

    console = Console()
    with console.status("") as status:
        cost = measure_journal(seconds, targets, seed, lambda what: status.update(f"{what} ..."))
    title = f"The journal without raw sweeps, {cost.targets} targets ({cost.tracks:.0f} tracks), {cost.seconds:g} s"
    table = Table(title=title, title_justify="left")
    for name in ("figure", "measured", "wanted", ""):
        table.add_column(name, justify="left" if name in ("figure", "") else "right")
    table.add_row("surface thread, a picture, without", f"{cost.without_us:.0f}", "", "us")
    table.add_row("surface thread, a picture, with the journal", f"{cost.with_us:.0f}", "", "us")
    table.add_row("added to the surface thread", f"{100 * cost.surface:.2f}", "", "% of a core")
    table.add_row("the writer's thread", f"{100 * cost.writer:.2f}", "", "% of a core")
    for name, value, most, unit in (
        ("both", 100 * cost.share, 100 * MOST_SHARE, "% of a core"),
        ("on disk", cost.mb_s, MOST_MB_S, "MB/s"),
        ("records dropped", cost.dropped, 0, ""),
    ):
        table.add_row(name, f"{value:.3g}", f"<= {most:g}", unit, style=None if value <= most else "red")
    console.print(table)


def _tracker(peers: bool) -> tuple[str, ...]:
    import time

    from pipeline.lab.measure.bench_tracker import bench_tracker

    return ("Tracker, 1000 targets, one turn", *bench_tracker(time.perf_counter, compare=peers).lines())


def picture(
    scans: Annotated[int, typer.Option(min=40, help="Turns of the radar to run; the first 30 are not counted.")] = 300,
    seed: Annotated[int, typer.Option(min=0, help="Of the simulated world and its radar video.")] = 1,
) -> None:
    """Run the demonstration's world through radar chain and tracker and compare the picture with the truth.

    Bounds are those of EUROCAE ED-87 for the manoeuvring area where it has one: targets, not a certificate.
    """
    from rich.console import Console
    from rich.progress import Progress

    from app.bench.picture import demo_quality

    with Progress(transient=True) as progress:
        task = progress.add_task("Turns of the radar", total=scans)
        score = demo_quality(scans, lambda scan: progress.update(task, completed=scan + 1), seed=seed)
    Console().print(_quality(score, f"Picture against truth, {scans} turns, seed {seed}"))


def _quality(score: Score, title: str) -> Table:
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for name, side in (("figure", "left"), ("measured", "right"), ("wanted", "right"), ("", "left"), ("", "left")):
        table.add_column(name, justify="right" if side == "right" else "left", no_wrap=side == "right")
    for row in score.rows():
        wanted = "" if row.bound is None else f"{'>=' if row.at_least else '<='} {row.bound:g}"
        verdict = {True: "met", False: "NOT MET", None: ""}[row.met]
        style = {True: None, False: "red", None: "dim"}[row.met]
        table.add_row(row.name, f"{row.value:.4g}", wanted, row.unit, verdict, style=style)
    return table


def _front_end(repeats: int, peers: bool) -> Table:
    import time

    from rich.table import Table

    from pipeline.lab.measure.bench_frontend import bench_frontend

    table = Table(title="Radar front end, one turn of 4096 x 1024 x 8 bit", title_justify="left")
    figures = ("ms", "least", "x read once", "wanted")
    for name in ("stage", *figures, ""):
        table.add_column(name, justify="right" if name in figures else "left", no_wrap=name in figures)
    for row in bench_frontend(time.perf_counter, repeats, peers):
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
