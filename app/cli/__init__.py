"""The command line: one file a command; each has `register(app)`, and heavy imports stay inside the commands."""

from __future__ import annotations

import importlib
import pkgutil
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperGroup


class Commands(TyperGroup):
    """The commands; one that is stopped says so and ends with status 130."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command of a command line."""
        from app.console import fail
        from app.stopping import STOPPED

        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            raise fail("stopped", code=STOPPED) from None


app = typer.Typer(
    name="airside",
    cls=Commands,
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
    from app.stopping import STOPPED, end_now, stop_on_signals

    any_terminal()
    stop_on_signals()
    try:
        app()
    except SystemExit as end:
        if end.code == STOPPED:
            end_now(STOPPED)  # while the interpreter clears up, a further signal would find no handler any more
        raise
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
