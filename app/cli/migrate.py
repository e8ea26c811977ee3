"""`airside migrate`: bring the database to the schema of this version."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(migrate)


def migrate(
    settings: Annotated[
        Path | None,
        typer.Option("--settings", "-s", envvar="AIRSIDE_SETTINGS", help="TOML file; see [bold]airside init[/bold]."),
    ] = None,
    url: Annotated[str | None, typer.Option("--url", help="Database URL instead of the one in the settings.")] = None,
) -> None:
    """Bring the database to the schema of this version. `airside serve` does the same when it starts.

    Examples: [bold]airside migrate[/bold], [bold]airside migrate --url postgresql+psycopg://user@host/airside[/bold]
    """
    from sqlalchemy.exc import SQLAlchemyError

    from app.console import fail
    from app.secret_urls import masked_text
    from app.settings import SettingsError, load
    from app.store.database import migrate as bring_up_to_date

    try:
        database = url or load(settings).database
        bring_up_to_date(database)
    except SettingsError as error:
        raise fail(str(error)) from error
    except (SQLAlchemyError, OSError) as error:
        raise fail(f"the database cannot be migrated: {error}", 1) from error
    typer.echo(f"{masked_text(database)} is up to date")
