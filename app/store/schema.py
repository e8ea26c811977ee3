"""The tables, as SQLAlchemy Core; `migrations/` brings a database to them step by step.

Columns are in the units of the wire and carry them in their names; times are Unix seconds (UTC). The ids of tracks
begin anew with each run of the service, so a stored track has a `uid` of its own. Its `number` is the last ASTERIX
track number that it had. Points are clustered by (uid, time): the history of a track is one contiguous read. The
`stage` of an alert is its last one, `worst_stage` the gravest that it had.
"""

from __future__ import annotations

from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    Double,
    Float,
    Index,
    Integer,
    MetaData,
    SmallInteger,
    String,
    Table,
    Text,
)

metadata = MetaData()

_Integer64 = BigInteger().with_variant(Integer, "sqlite")
"""64 bits. SQLite's INTEGER has them too, so that a column of an earlier version need not be made anew."""

_Key = _Integer64
"""SQLite numbers rows by itself only where the type is spelt INTEGER."""

_Address = String(7).with_variant(String(6), "sqlite")
"""SQLite's texts have any length, so that a column of an earlier version need not be made anew."""

tracks = Table(
    "tracks",
    metadata,
    Column("uid", _Key, primary_key=True, autoincrement=True),
    Column("airport", String(16), nullable=False),
    Column("mode", String(8), nullable=False),
    Column("track_id", _Integer64, nullable=False),
    Column("born", Double, nullable=False),
    Column("first_time", Double, nullable=False),
    Column("last_time", Double, nullable=False),
    Column("category", SmallInteger, nullable=False),
    Column("callsign", String(8)),
    Column("address", _Address),
    Column("simulated", Boolean, nullable=False),
    Column("number", Integer),
    Index("ix_tracks_number", "airport", "track_id", "last_time"),
    Index("ix_tracks_last", "airport", "last_time"),
)

track_points = Table(
    "track_points",
    metadata,
    Column("uid", BigInteger, primary_key=True, autoincrement=False),
    Column("time", Double, primary_key=True),
    Column("lat", Double),
    Column("lon", Double),
    Column("altitude_m", Float),
    Column("speed_mps", Float),
    Column("course_deg", Float),
    Column("heading_deg", Float),
    Column("accuracy_m", Float),
    Column("phase", SmallInteger, nullable=False),
    Column("sources", SmallInteger, nullable=False),
    Column("on_ground", Boolean, nullable=False),
    Column("zone", String(64)),
    Column("runway", String(16)),
    sqlite_with_rowid=False,
)

alerts = Table(
    "alerts",
    metadata,
    Column("airport", String(16), primary_key=True),
    Column("id", BigInteger, primary_key=True, autoincrement=False),
    Column("mode", String(8), nullable=False),
    Column("rule", String(64), nullable=False),
    Column("stage", String(16), nullable=False),
    Column("state", String(16), nullable=False),
    Column("runway", String(16)),
    Column("raised_at", Double, nullable=False),
    Column("updated_at", Double, nullable=False),
    Column("cleared_at", Double),
    Column("simulated", Boolean, nullable=False),
    Column("document", Text, nullable=False),
    Column("worst_stage", String(16), nullable=False, server_default="information"),
    Column("acknowledged_by", String(64)),
    Index("ix_alerts_raised", "airport", "raised_at"),
    Index("ix_alerts_state", "airport", "state"),
)

alert_changes = Table(
    "alert_changes",
    metadata,
    Column("change_id", _Key, primary_key=True, autoincrement=True),
    Column("airport", String(16), nullable=False),
    Column("alert_id", BigInteger, nullable=False),
    Column("time", Double, nullable=False),
    Column("operation", String(16), nullable=False),
    Column("stage", String(16), nullable=False),
    Column("state", String(16), nullable=False),
    Column("document", Text, nullable=False),
    Index("ix_alert_changes_alert", "airport", "alert_id", "change_id"),
)

node_events = Table(
    "node_events",
    metadata,
    Column("event_id", _Key, primary_key=True, autoincrement=True),
    Column("airport", String(16), nullable=False),
    Column("time", Double, nullable=False),
    Column("node", String(32), nullable=False),
    Column("kind", String(16), nullable=False),
    Column("speed_mps", Float),
    Column("length_m", Float),
    Column("strength", Float),
    Column("simulated", Boolean, nullable=False),
    Index("ix_node_events_time", "airport", "time"),
)

sensor_states = Table(
    "sensor_states",
    metadata,
    Column("state_id", _Key, primary_key=True, autoincrement=True),
    Column("airport", String(16), nullable=False),
    Column("time", Double, nullable=False),
    Column("sensor", String(64), nullable=False),
    Column("kind", String(16), nullable=False),
    Column("status", String(16), nullable=False),
    Column("detail", Text, nullable=False),
    Column("counters", Text, nullable=False),
    Index("ix_sensor_states_time", "airport", "sensor", "time"),
)
