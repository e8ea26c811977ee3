"""Ids of tracks with 64 bits, which are never given twice in a run, and the ASTERIX track number beside them.

Of tracks stored before, the id was the track number; they have no number of their own.
"""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("tracks", sa.Column("number", sa.Integer))
    if op.get_bind().dialect.name != "sqlite":  # whole numbers of SQLite have 64 bits, whatever their type is called
        op.alter_column("tracks", "track_id", existing_type=sa.Integer, type_=sa.BigInteger, existing_nullable=False)


def downgrade() -> None:
    if op.get_bind().dialect.name != "sqlite":
        op.alter_column("tracks", "track_id", existing_type=sa.BigInteger, type_=sa.Integer, existing_nullable=False)
    op.drop_column("tracks", "number")
