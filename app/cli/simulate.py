"""`airside simulate`: prepare recorded traffic, record simulated radar video."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

simulate = typer.Typer(no_args_is_help=True, help="Prepare recorded traffic and record simulated radar video.")


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.add_typer(simulate, name="simulate")


@simulate.command()
def traffic(
    file: Annotated[Path, typer.Argument(help="Rows as JSON, may be gzipped: timestamp (ms), icao24, callsign, ...")],
    icao: Annotated[str, typer.Option(help="The airport: a shipped one's code, or the path of an imported map.")],
    output: Annotated[Path, typer.Option(help="Where the compact record goes (.json.gz).")],
    minutes: Annotated[float, typer.Option(min=2.0, help="Length of the window to keep.")] = 60.0,
    attribution: Annotated[str, typer.Option(help="Whom to name, and the licence; kept in the file.")] = "",
) -> None:
    """Clean a recording of ADS-B rows and keep its busiest hour, saying what was left out and why."""
    from rich.console import Console
    from rich.table import Table

    from app.airports import load_airport
    from app.console import fail
    from app.demo.traffic import prepare, write_recording
    from pipeline.airport.geojson import AirportFault
    from pipeline.lab.simulate.recording import RecordingError

    console = Console()
    try:
        airport, _ = load_airport(icao)
        with console.status(f"cleaning {file}", spinner="line"):
            recording, report, window = prepare(file, airport, minutes * 60.0, attribution)
            size = write_recording(output, recording, airport, report)
    except (AirportFault, RecordingError, OSError) as error:
        raise fail(str(error)) from error
    table = Table("rows", "", title=f"{report.rows} rows of {report.aircraft} aircraft", title_justify="left")
    for reason, count in sorted(report.left_out.items(), key=lambda one: -one[1]):
        table.add_row(str(count), f"left out: {reason}")
    table.add_row(str(report.kept), f"kept, in {report.trajectories} trajectories ({report.splits} made by splitting)")
    console.print(table)
    console.print(f"ground is at {report.ground_pressure_altitude_ft:.0f} ft of the record's pressure altitude")
    console.print(
        f"busiest {minutes:g} min begin {window / 60:.0f} min into the record: "
        f"{len(recording.trajectories)} movements -> {output} ({size} octets)"
    )


@simulate.command()
def video(
    output: Annotated[Path, typer.Option(help="The file to write: .npz (scans, t) or .pcap (CAT240 over UDP).")],
    seconds: Annotated[
        int, typer.Option(min=1, max=3600, help="How many turns of one second; the detector learns in the first ones.")
    ] = 30,
    after: Annotated[float, typer.Option(min=0.0, help="Begin so many seconds into the demonstration.")] = 0.0,
    start: Annotated[float, typer.Option(help="UTC seconds that the first sweep carries.")] = 1_700_000_000.0,
    settings: Annotated[Path | None, typer.Option(help="Settings file.")] = None,
    seed: Annotated[int, typer.Option(help="Another seed, other noise.")] = 1,
    rain: Annotated[bool, typer.Option(help="Let it rain.")] = False,
) -> None:
    """Record the demonstration's radar video, with the truth beside it, for `airside replay` or for tests."""
    from rich.console import Console
    from rich.progress import track

    from app.assembly import scans_to_learn
    from app.console import fail
    from app.demo.record import record_video
    from app.settings import SettingsError, load

    console = Console()
    try:
        loaded = load(settings)
        loaded = loaded.model_copy(update={"demo": loaded.demo.model_copy(update={"seed": seed, "rain": rain})})
        turns = iter(track(range(seconds), "recording", console=console, transient=True))
        truth = record_video(loaded, output, seconds, start, lambda: next(turns, None), after=after)
    except (SettingsError, ValueError, OSError) as error:
        raise fail(str(error)) from error
    console.print(f"{seconds} turns -> {output}, the truth -> {truth}")
    learning = scans_to_learn(loaded)
    if seconds <= learning:
        advice = "make more with --seconds, or replay with --loop"
        console.print(f"[yellow]the detector learns for {learning} turns: {advice}[/yellow]")
