"""`airside serve` and `airside demo`: run the service."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

SettingsFile = Annotated[
    Path | None,
    typer.Option("--settings", "-s", envvar="AIRSIDE_SETTINGS", help="TOML file; see [bold]airside init[/bold]."),
]
Port = Annotated[int | None, typer.Option("--port", "-p", help="HTTP port; 8000 unless AIRSIDE_PORT says otherwise.")]
Host = Annotated[str | None, typer.Option("--host", help="Address to listen on.")]

Record = Annotated[
    Path | None,
    typer.Option("--record", metavar="DIR", help="Write a journal there; see [bold]airside replay[/bold]."),
]


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command()(serve)
    app.command()(demo)


def serve(settings: SettingsFile = None, port: Port = None, host: Host = None, record: Record = None) -> None:
    """Run the service on your own sensors, as the settings file says.

    Radar video is awaited as ASTERIX CAT240 over UDP on each radar's port; everything else comes and goes over HTTP.
    """
    _run(settings, "live", port, host, record)


def demo(settings: SettingsFile = None, port: Port = None, host: Host = None, record: Record = None) -> None:
    """Run the demonstration: Paris-Orly, recorded movements as simulated radar video, an incident every 90 s.

    The simulator sends CAT240 datagrams to the same UDP port that a real radar would use.
    """
    _run(settings, "demo", port, host, record)


def _run(path: Path | None, mode: str, port: int | None, host: str | None, record: Path | None) -> None:
    from rich.console import Console
    from rich.markup import escape

    from app.console import fail
    from app.logs import log_to
    from app.settings import SettingsError, load
    from pipeline.airport.geojson import AirportFault

    overrides = {"port": port, "host": host, "mode": mode}
    console = Console(stderr=False)
    log_to(console)
    try:
        settings = load(path, **{key: value for key, value in overrides.items() if value is not None})
        if record is not None:
            settings = settings.model_copy(update={"journal": settings.journal.model_copy(update={"folder": record})})
        if mode == "demo":
            from app.demo import demo_settings

            settings = demo_settings(settings)
        log_to(console, settings.log_level, settings.log_format)
        from app.startup import say

        begins = f"starts: {settings.airport}, mode {settings.mode}"
        say(console, settings, f"Airside {begins}", f"[bold]Airside[/bold] {escape(begins)}")
        from app.run import serve as run

        status = run(settings, console)
    except (SettingsError, AirportFault, OSError) as error:
        raise fail(str(error)) from error
    raise typer.Exit(status)
