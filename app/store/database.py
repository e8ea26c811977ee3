"""Opening a database and bringing its schema up to date."""

from __future__ import annotations

import sqlite3
from functools import partial
from pathlib import Path
from typing import Any

from sqlalchemy import Engine, create_engine, event
from sqlalchemy.engine import URL, make_url
from sqlalchemy.exc import ArgumentError

from app.private_files import FOLDER_MODE, make_private_file
from app.settings import ROOT, SettingsError

MIGRATIONS = ROOT / "migrations"
BUSY_MS = 10_000
PATIENCE = {
    "connect_timeout": 3,
    "tcp_user_timeout": 5_000,
    "keepalives_idle": 5,
    "keepalives_interval": 2,
    "keepalives_count": 3,
}
"""Seconds for a connection to PostgreSQL, ms for what was sent to be acknowledged, and seconds (and probes) after which
a silent connection is tried out: a host that is gone gives no answer at all, and who asks is to be told so."""

READ_MS = 4_000
"""A question is ended by the database itself after this long (PostgreSQL), or waits no longer for a lock (SQLite):
before `read_pool.ANSWER_S`, so that its thread is free again for the next."""

READ_POOL = {"pool_size": 4, "pool_timeout": READ_MS / 1000}
"""Connections for questions: one for each thread that asks (`read_pool.THREADS`)."""


def open_engine(url: str, *, reading: bool = False) -> Engine:
    """An engine for SQLite (WAL, waits for locks) or PostgreSQL. Makes the folder of a SQLite file.

    reading: for questions alone, none of which may take longer than READ_MS. Raises SettingsError when the URL cannot
    be read or no such database is known.
    """
    parsed = _read(url)
    if parsed.drivername in ("postgresql", "postgres"):
        parsed = parsed.set(drivername="postgresql+psycopg")
    if parsed.get_backend_name() != "sqlite":
        try:
            engine = create_engine(parsed, pool_pre_ping=True, connect_args=PATIENCE, **(READ_POOL if reading else {}))
        except (ArgumentError, ImportError):
            raise SettingsError(f"database_url: {parsed.drivername} is no known kind of database") from None
        if reading:
            event.listen(engine, "connect", _limit_questions)
        return engine
    if parsed.database and parsed.database != ":memory:":
        file = Path(parsed.database)
        file.parent.mkdir(mode=FOLDER_MODE, parents=True, exist_ok=True)
        if not parsed.database.startswith("file:"):
            make_private_file(file)  # the files of the write-ahead log take its mode
    engine = create_engine(parsed, **(READ_POOL if reading else {}))
    event.listen(engine, "connect", partial(_prepare_sqlite, busy_ms=READ_MS if reading else BUSY_MS))
    return engine


def _read(url: str) -> URL:
    try:
        return make_url(url)
    except (ArgumentError, ValueError):
        # what the library says holds the URL, with its password
        raise SettingsError(
            "database_url: cannot be read as a database URL; in a password write / ? # @ and % as %2F %3F %23 %40 %25"
        ) from None


def _limit_questions(connection: Any, _record: Any) -> None:
    with connection.cursor() as cursor:
        cursor.execute(f"SET statement_timeout = {READ_MS}")
        cursor.execute("SET default_transaction_read_only = on")
    connection.commit()


def _prepare_sqlite(connection: sqlite3.Connection, _record: Any, busy_ms: int) -> None:
    cursor = connection.cursor()
    cursor.execute(f"PRAGMA busy_timeout = {busy_ms}")
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
