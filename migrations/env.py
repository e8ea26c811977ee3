"""Runs the migrations on the database that `app.store.database.migrate` names."""

from __future__ import annotations

from alembic import context
from sqlalchemy import text

from app.store.database import open_engine
from app.store.schema import metadata

LOCK = 0x41495253
"""Number of the advisory lock under which PostgreSQL lets one process migrate at a time."""


def run() -> None:
    url = context.config.attributes.get("url")
    if url is None:
        from app.settings import load

        url = load().database
    engine = open_engine(url)
    try:
        with engine.connect() as connection:
            sqlite = connection.dialect.name == "sqlite"
            context.configure(connection=connection, target_metadata=metadata, render_as_batch=sqlite)
            with context.begin_transaction():
                if not sqlite:
                    connection.execute(text("SELECT pg_advisory_xact_lock(:lock)"), {"lock": LOCK})
                context.run_migrations()
            if connection.in_transaction():
                connection.commit()
    finally:
        engine.dispose()


run()
