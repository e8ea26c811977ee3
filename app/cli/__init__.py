"""The command line: one file a command; each has `register(app)`, and heavy imports stay inside the commands."""

from __future__ import annotations

import importlib
import pkgutil

import typer

app = typer.Typer(
    name="airside",
    help="Surveillance of the airport surface: radar video and pavement nodes in, one live picture and alerts out.",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_show_locals=False,
)

for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f"app.cli.{_module.name}").register(app)


def main() -> None:
    """Run the command line (the `airside` script)."""
    app()
