"""`airside bench`: what each stage costs, as ratios to reading the radar frame once, next to other libraries."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.table import Table


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("bench")(bench)


def bench(
    repeats: Annotated[int, typer.Option(min=3, help="Turns measured for each line; the median is printed.")] = 60,
    peers: Annotated[bool, typer.Option(help="Also measure numpy, scipy and OpenCV on the same input.")] = True,
) -> None:
    """Measure the stages on this machine, side by side in one run.

    One turn is 4096 x 1024 cells of 8 bits, a second of a 60 rpm radar. Read the ratios: milliseconds depend on what
    else the machine does.
    """
    from rich.console import Console

    console = Console()
    with console.status("Compiling, or loading compiled kernels ..."):
        table = _front_end(repeats, peers)
    console.print(table)
    # further sections (tracker, datagram to client) print their own tables here


def _front_end(repeats: int, peers: bool) -> Table:
    import time

    from rich.table import Table

    from pipeline.measure.bench_frontend import bench_frontend

    table = Table(title="Radar front end, one turn of 4096 x 1024 x 8 bit", title_justify="left")
    for name, side in (("stage", "left"), ("ms", "right"), ("least", "right"), ("x read once", "right"), ("", "left")):
        table.add_column(name, justify="right" if side == "right" else "left", no_wrap=side == "right")
    for row in bench_frontend(time.perf_counter, repeats, peers):
        table.add_row(
            row.name,
            f"{row.median_s * 1e3:.2f}",
            f"{row.least_s * 1e3:.2f}",
            f"{row.ratio:.1f}",
            row.note,
            style="dim" if row.peer else None,
        )
    return table
