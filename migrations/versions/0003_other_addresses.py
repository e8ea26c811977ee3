"""Addresses that are not of ICAO have "~" before their six digits."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


def upgrade() -> None:
    if op.get_bind().dialect.name != "sqlite":  # texts of SQLite have any length, whatever their type is called
        op.alter_column("tracks", "address", existing_type=sa.String(6), type_=sa.String(7), existing_nullable=True)


def downgrade() -> None:
    if op.get_bind().dialect.name != "sqlite":
        op.execute("UPDATE tracks SET address = NULL WHERE length(address) > 6")
        op.alter_column("tracks", "address", existing_type=sa.String(7), type_=sa.String(6), existing_nullable=True)
