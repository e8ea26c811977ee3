"""`airside parts`: the methods that can be chosen, with their settings."""

from __future__ import annotations

from typing import Annotated, Any

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(name="parts")(list_parts)


def list_parts(
    verb: Annotated[str | None, typer.Argument(help="One stage only: detect, extract, alert, ...")] = None,
) -> None:
    """List the parts: the methods of each stage, what they do, and their settings with defaults.

    A settings file chooses them under [bold]\\[parts.STAGE][/bold]; a name or a setting that does not exist stops the
    start with the nearest right word.
    """
    from rich.console import Console

    from app.console import fail
    from pipeline import parts

    console = Console()
    try:
        found = {one: parts.available(one) for one in ([verb] if verb else parts.VERBS)}
    except parts.PartError as error:
        raise fail(str(error)) from error
    for one, methods in found.items():
        console.print(_table(one, methods, with_meaning=verb is not None))
    if verb is None:
        console.print("What the settings of a stage mean: [bold]airside parts STAGE[/bold]")


def _table(verb: str, methods: dict[str, type[Any]], with_meaning: bool) -> Any:
    from rich.table import Table
    from rich.text import Text

    table = Table(title=f"parts.{verb}", title_justify="left", show_lines=True, expand=False)
    table.add_column("name", style="bold", no_wrap=True)
    table.add_column("what it does")
    table.add_column("settings")
    for name, kind in sorted(methods.items()):
        table.add_row(name, Text(_meaning(kind, with_meaning)), Text(_settings(kind)))
    if not methods:
        table.add_row("-", "none is installed", "")
    return table


def _meaning(kind: type[Any], whole: bool) -> str:
    import inspect
    import sys

    module = inspect.getdoc(sys.modules[kind.__module__]) or ""
    own = inspect.getdoc(kind) or ""
    return f"{module}\n\n{own}".strip() if whole else (module or own).split("\n\n")[0].strip()


def _settings(kind: type[Any]) -> str:
    from dataclasses import MISSING, fields

    lines = []
    for field in fields(kind):
        if not field.init:
            continue
        if field.default is not MISSING:
            lines.append(f"{field.name} = {field.default!r}")
        elif field.default_factory is not MISSING:
            lines.append(f"{field.name} = {field.default_factory()!r}")
        else:
            lines.append(field.name)
    return "\n".join(lines)
