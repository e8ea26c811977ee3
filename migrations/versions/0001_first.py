"""Tracks, track points, alerts with their changes, node events, sensor states."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None

KEY = sa.BigInteger().with_variant(sa.Integer, "sqlite")


def upgrade() -> None:
    op.create_table(
        "tracks",
        sa.Column("uid", KEY, primary_key=True, autoincrement=True),
        sa.Column("airport", sa.String(16), nullable=False),
        sa.Column("mode", sa.String(8), nullable=False),
        sa.Column("track_id", sa.Integer, nullable=False),
        sa.Column("born", sa.Double, nullable=False),
        sa.Column("first_time", sa.Double, nullable=False),
        sa.Column("last_time", sa.Double, nullable=False),
        sa.Column("category", sa.SmallInteger, nullable=False),
        sa.Column("callsign", sa.String(8)),
        sa.Column("address", sa.String(6)),
        sa.Column("simulated", sa.Boolean, nullable=False),
    )
    op.create_index("ix_tracks_number", "tracks", ["airport", "track_id", "last_time"])
    op.create_index("ix_tracks_last", "tracks", ["airport", "last_time"])
    op.create_table(
        "track_points",
        sa.Column("uid", sa.BigInteger, primary_key=True, autoincrement=False),
        sa.Column("time", sa.Double, primary_key=True),
        sa.Column("lat", sa.Double),
        sa.Column("lon", sa.Double),
        sa.Column("altitude_m", sa.Float),
        sa.Column("speed_mps", sa.Float),
        sa.Column("course_deg", sa.Float),
        sa.Column("heading_deg", sa.Float),
        sa.Column("accuracy_m", sa.Float),
        sa.Column("phase", sa.SmallInteger, nullable=False),
        sa.Column("sources", sa.SmallInteger, nullable=False),
        sa.Column("on_ground", sa.Boolean, nullable=False),
        sa.Column("zone", sa.String(64)),
        sa.Column("runway", sa.String(16)),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "alerts",
        sa.Column("airport", sa.String(16), primary_key=True),
        sa.Column("id", sa.BigInteger, primary_key=True, autoincrement=False),
        sa.Column("mode", sa.String(8), nullable=False),
        sa.Column("rule", sa.String(64), nullable=False),
        sa.Column("stage", sa.String(16), nullable=False),
        sa.Column("state", sa.String(16), nullable=False),
        sa.Column("runway", sa.String(16)),
        sa.Column("raised_at", sa.Double, nullable=False),
        sa.Column("updated_at", sa.Double, nullable=False),
        sa.Column("cleared_at", sa.Double),
        sa.Column("simulated", sa.Boolean, nullable=False),
        sa.Column("document", sa.Text, nullable=False),
    )
    op.create_index("ix_alerts_raised", "alerts", ["airport", "raised_at"])
    op.create_index("ix_alerts_state", "alerts", ["airport", "state"])
    op.create_table(
        "alert_changes",
        sa.Column("change_id", KEY, primary_key=True, autoincrement=True),
        sa.Column("airport", sa.String(16), nullable=False),
        sa.Column("alert_id", sa.BigInteger, nullable=False),
        sa.Column("time", sa.Double, nullable=False),
        sa.Column("operation", sa.String(16), nullable=False),
        sa.Column("stage", sa.String(16), nullable=False),
        sa.Column("state", sa.String(16), nullable=False),
        sa.Column("document", sa.Text, nullable=False),
    )
    op.create_index("ix_alert_changes_alert", "alert_changes", ["airport", "alert_id", "change_id"])
    op.create_table(
        "node_events",
        sa.Column("event_id", KEY, primary_key=True, autoincrement=True),
        sa.Column("airport", sa.String(16), nullable=False),
        sa.Column("time", sa.Double, nullable=False),
        sa.Column("node", sa.String(32), nullable=False),
        sa.Column("kind", sa.String(16), nullable=False),
        sa.Column("speed_mps", sa.Float),
        sa.Column("length_m", sa.Float),
        sa.Column("strength", sa.Float),
        sa.Column("simulated", sa.Boolean, nullable=False),
    )
    op.create_index("ix_node_events_time", "node_events", ["airport", "time"])
    op.create_table(
        "sensor_states",
        sa.Column("state_id", KEY, primary_key=True, autoincrement=True),
        sa.Column("airport", sa.String(16), nullable=False),
        sa.Column("time", sa.Double, nullable=False),
        sa.Column("sensor", sa.String(64), nullable=False),
        sa.Column("kind", sa.String(16), nullable=False),
        sa.Column("status", sa.String(16), nullable=False),
        sa.Column("detail", sa.Text, nullable=False),
        sa.Column("counters", sa.Text, nullable=False),
    )
    op.create_index("ix_sensor_states_time", "sensor_states", ["airport", "sensor", "time"])


def downgrade() -> None:
    for name in ("sensor_states", "node_events", "alert_changes", "alerts", "track_points", "tracks"):
        op.drop_table(name)
