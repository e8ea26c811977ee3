"""The command line: one file a command; each has `register(app)`, and heavy imports stay inside the commands."""

from __future__ import annotations

import importlib
import pkgutil
from typing import Annotated, NoReturn

import typer

app = typer.Typer(
    name="airside",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_show_locals=False,
)


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"airside {version('airside')}")
        raise typer.Exit


@app.callback()
def airside(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Surveillance of the airport surface: radar video and pavement nodes in, one live picture and alerts out.

    Start with [bold]airside demo[/bold] (Paris-Orly, simulated radar video), then [bold]airside init[/bold] to write a
    settings file for your own airport and [bold]airside serve[/bold] to run it.
    """


for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f"app.cli.{_module.name}").register(app)


def main() -> None:
    """Run the command line (the `airside` script)."""
    from app.console import any_terminal

    any_terminal()
    try:
        app()
    except (OSError, ValueError) as error:
        _end(error)


def _end(error: OSError | ValueError) -> NoReturn:
    """End with one line for what lies outside the program; anything else is a fault of it, and told as a whole."""
    from app.console import fail
    from app.settings import SettingsError
    from pipeline.airport.geojson import AirportFault

    if isinstance(error, ValueError) and not isinstance(error, SettingsError | AirportFault):
        raise error
    raise SystemExit(fail(str(error)).exit_code) from None
