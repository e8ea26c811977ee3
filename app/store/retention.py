"""Deletes what is older than the retention time, a little at a time, so that no transaction is long."""

from __future__ import annotations

import time
from collections.abc import Callable

from sqlalchemy import Engine, delete, select

from app.store import schema

EVERY_S = 600.0
TRACKS_AT_ONCE = 200


class Retention:
    """newest: the newest time that was recorded; age is counted from there, so that old recordings can be replayed.

    now: UTC s of the host. What is recorded with a time beyond it makes nothing older.
    """

    def __init__(self, days: float, airport: str, now: Callable[[], float] = time.time) -> None:
        self.keep_s = days * 86400.0
        self.airport = airport
        self.newest = 0.0
        self.deleted = 0
        self._now = now
        self._next = time.monotonic()

    @property
    def limit(self) -> float:
        """What is older than this goes."""
        return min(self.newest, self._now()) - self.keep_s

    def run(self, engine: Engine, *, force: bool = False) -> bool:
        """Delete, if it is time; whether it was. Some hundred tracks a transaction, and the rest by time."""
        if not self.newest or (time.monotonic() < self._next and not force):
            return False
        self._next = time.monotonic() + EVERY_S
        limit = self.limit
        tracks, points = schema.tracks, schema.track_points
        while True:
            with engine.begin() as connection:
                old = (tracks.c.airport == self.airport) & (tracks.c.last_time < limit)
                uids = connection.scalars(select(tracks.c.uid).where(old).limit(TRACKS_AT_ONCE)).all()
                for uid in uids:
                    self.deleted += connection.execute(delete(points).where(points.c.uid == uid)).rowcount
                if uids:
                    connection.execute(delete(tracks).where(tracks.c.uid.in_(uids)))
            if len(uids) < TRACKS_AT_ONCE:
                break
        with engine.begin() as connection:
            begun = (tracks.c.airport == self.airport) & (tracks.c.first_time < limit)
            for uid in connection.scalars(select(tracks.c.uid).where(begun)).all():
                gone = (points.c.uid == uid) & (points.c.time < limit)
                self.deleted += connection.execute(delete(points).where(gone)).rowcount
            alerts, changes = schema.alerts, schema.alert_changes
            ended = (alerts.c.airport == self.airport) & (alerts.c.state == "cleared") & (alerts.c.cleared_at < limit)
            ids = select(alerts.c.id).where(ended)
            connection.execute(delete(changes).where(changes.c.airport == self.airport, changes.c.alert_id.in_(ids)))
            connection.execute(delete(alerts).where(ended))
            for table in (schema.node_events, schema.sensor_states):
                connection.execute(delete(table).where(table.c.airport == self.airport, table.c.time < limit))
        return True
