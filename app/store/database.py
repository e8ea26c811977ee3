"""Opening a database and bringing its schema up to date."""

from __future__ import annotations

import sqlite3
from pathlib import Path
from typing import Any

from sqlalchemy import Engine, create_engine, event
from sqlalchemy.engine import URL, make_url
from sqlalchemy.exc import ArgumentError

from app.private_files import FOLDER_MODE, make_private_file
from app.settings import ROOT, SettingsError

MIGRATIONS = ROOT / "migrations"
BUSY_MS = 10_000
PATIENCE = {"connect_timeout": 3, "tcp_user_timeout": 5_000}
"""Seconds for a connection to PostgreSQL, and ms for what was sent to be acknowledged: a host that is gone gives no
answer at all, and who asks is to be told so."""


def open_engine(url: str) -> Engine:
    """An engine for SQLite (WAL, waits for locks) or PostgreSQL. Makes the folder of a SQLite file.

    Raises SettingsError when the URL cannot be read or no such database is known.
    """
    parsed = _read(url)
    if parsed.drivername in ("postgresql", "postgres"):
        parsed = parsed.set(drivername="postgresql+psycopg")
    if parsed.get_backend_name() != "sqlite":
        try:
            return create_engine(parsed, pool_pre_ping=True, connect_args=PATIENCE)
        except (ArgumentError, ImportError):
            raise SettingsError(f"database_url: {parsed.drivername} is no known kind of database") from None
    if parsed.database and parsed.database != ":memory:":
        file = Path(parsed.database)
        file.parent.mkdir(mode=FOLDER_MODE, parents=True, exist_ok=True)
        if not parsed.database.startswith("file:"):
            make_private_file(file)  # the files of the write-ahead log take its mode
    engine = create_engine(parsed)
    event.listen(engine, "connect", _prepare_sqlite)
    return engine


def _read(url: str) -> URL:
    try:
        return make_url(url)
    except (ArgumentError, ValueError):
        # what the library says holds the URL, with its password
        raise SettingsError(
            "database_url: cannot be read as a database URL; in a password write / ? # @ and % as %2F %3F %23 %40 %25"
        ) from None


def _prepare_sqlite(connection: sqlite3.Connection, _record: Any) -> None:
    cursor = connection.cursor()
    cursor.execute(f"PRAGMA busy_timeout = {BUSY_MS}")
    cursor.execute("PRAGMA journal_mode = WAL")
    cursor.execute("PRAGMA synchronous = FULL")
    cursor.close()


def migrate(url: str, revision: str = "head") -> None:
    """Bring the schema of the database to a revision; nothing happens when it is there already."""
    from alembic import command
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS).replace("%", "%%"))
    config.attributes["url"] = url
    command.upgrade(config, revision)
