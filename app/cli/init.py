"""`airside init`: write a settings file in which everything that can be set stands with its default."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(init)


def init(
    output: Annotated[Path, typer.Option("--output", "-o", help="File to write.")] = Path("airside.toml"),
    force: Annotated[bool, typer.Option("--force", help="Write over a file that is there.")] = False,
) -> None:
    """Write a commented settings file to start from.

    Every setting stands in it with its default, commented out: remove the # in front of what you change, then run
    [bold]airside serve --settings airside.toml[/bold].
    """
    from rich.console import Console

    from app.console import fail
    from app.settings_file import settings_file

    if output.exists() and not force:
        raise fail(f"{output} is there already; --force writes over it")
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        output.write_text(settings_file(), encoding="utf-8")
    except OSError as error:
        raise fail(f"{output}: {error.strerror}") from error
    Console().print(f"{output} is written. Next: put your radars in, then [bold]airside serve -s {output}[/bold]")
