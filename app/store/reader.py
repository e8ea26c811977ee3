"""Questions to the database, each on a connection of its own; for any thread."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
from sqlalchemy import Engine, Select, func, select

from app.store import schema
from app.wire import CLASSES, PHASES, SOURCES, Row, Wire, nullable

POINT_NAMES = (
    "time", "lat", "lon", "east_m", "north_m", "altitude_m", "on_ground", "speed_mps", "course_deg", "heading_deg",
    "accuracy_m", "phase", "sources", "zone", "runway",
)  # fmt: skip


class Reader:
    """Reads what the writer wrote."""

    def __init__(self, engine: Engine, wire: Wire) -> None:
        self.engine = engine
        self.wire = wire
        self.airport = wire.airport.icao[:16]

    def track_history(self, id: int, first: float | None, last: float | None, limit: int) -> Row | None:
        """The newest track with a number (within the times) and its points, oldest first; None when there is none.

        With `first` the points begin there, without it the newest `limit` points are given.
        """
        with self.engine.connect() as connection:
            found = connection.execute(self.bearer(id, first, last)).mappings().first()
            if found is None:
                return None
            forward = first is not None
            rows = connection.execute(self.points(found["uid"], first, last, limit + 1, forward=forward)).all()
        truncated = len(rows) > limit
        rows = rows[:limit] if forward else rows[:limit][::-1]
        return {"track": _track(found), "points": self._points(rows), "truncated": truncated}

    def bearer(self, id: int, first: float | None, last: float | None) -> Select[Any]:
        """The query for the newest track with an id."""
        table = schema.tracks
        wanted = select(table).where(table.c.airport == self.airport, table.c.track_id == id)
        if first is not None:
            wanted = wanted.where(table.c.last_time >= first)
        if last is not None:
            wanted = wanted.where(table.c.first_time <= last)
        return wanted.order_by(table.c.last_time.desc(), table.c.uid.desc()).limit(1)

    def points(
        self, uid: int, first: float | None, last: float | None, limit: int, *, forward: bool = True
    ) -> Select[Any]:
        """The query for the points of one stored track."""
        table = schema.track_points
        wanted = select(table).where(table.c.uid == uid)
        if first is not None:
            wanted = wanted.where(table.c.time >= first)
        if last is not None:
            wanted = wanted.where(table.c.time <= last)
        return wanted.order_by(table.c.time if forward else table.c.time.desc()).limit(limit)

    def tracks(
        self, first: float | None, last: float | None, *, callsign: str | None = None, limit: int = 200
    ) -> list[Row]:
        """Stored tracks that lived within the times, newest first."""
        table = schema.tracks
        wanted = select(table).where(table.c.airport == self.airport)
        if first is not None:
            wanted = wanted.where(table.c.last_time >= first)
        if last is not None:
            wanted = wanted.where(table.c.first_time <= last)
        if callsign:
            wanted = wanted.where(table.c.callsign == callsign.strip().upper())
        wanted = wanted.order_by(table.c.last_time.desc(), table.c.uid.desc()).limit(limit)
        with self.engine.connect() as connection:
            return [_track(row) for row in connection.execute(wanted).mappings()]

    def alerts(self, state: str | None, first: float | None, last: float | None, limit: int) -> list[Row]:
        """Stored alerts that were raised within the times, newest first. state: "live" for all but cleared."""
        table = schema.alerts
        wanted = select(table.c.document, table.c.worst_stage, table.c.acknowledged_by)
        wanted = wanted.where(table.c.airport == self.airport)
        if state == "live":
            wanted = wanted.where(table.c.state != "cleared")
        elif state is not None:
            wanted = wanted.where(table.c.state == state)
        if first is not None:
            wanted = wanted.where(table.c.raised_at >= first)
        if last is not None:
            wanted = wanted.where(table.c.raised_at <= last)
        wanted = wanted.order_by(table.c.raised_at.desc(), table.c.id.desc()).limit(limit)
        with self.engine.connect() as connection:
            return [_alert(row) for row in connection.execute(wanted)]

    def alert_changes(self, id: int) -> list[Row]:
        """Every stored step of one alert, in order."""
        table = schema.alert_changes
        wanted = select(table.c.time, table.c.operation, table.c.document)
        wanted = wanted.where(table.c.airport == self.airport, table.c.alert_id == id).order_by(table.c.change_id)
        with self.engine.connect() as connection:
            steps = [
                {"time": row.time, "operation": row.operation, "alert": msgspec.json.decode(row.document)}
                for row in connection.execute(wanted)
            ]
        worst = "information"
        for step in steps:  # documents of earlier versions do not tell it
            worst = "alarm" if step["alert"]["stage"] == "alarm" else worst
            step["alert"].setdefault("worst_stage", worst)
        return steps

    def last_alert_id(self) -> int:
        """The greatest alert number of this airport; 0 when there is none."""
        wanted = select(func.max(schema.alerts.c.id)).where(schema.alerts.c.airport == self.airport)
        with self.engine.connect() as connection:
            return int(connection.scalar(wanted) or 0)

    def count(self, table: str) -> int:
        """Rows in a table."""
        with self.engine.connect() as connection:
            return int(connection.scalar(select(func.count()).select_from(schema.metadata.tables[table])) or 0)

    def _points(self, rows: Any) -> list[Row]:
        """Wire rows of points, column by column: an hour of one track is 3,600 of them."""
        if not rows:
            return []
        given: dict[str, Any] = dict(zip(schema.track_points.c.keys(), zip(*rows, strict=True), strict=True))
        latitude = np.array(given["lat"], dtype=np.float64)
        longitude = np.array(given["lon"], dtype=np.float64)
        east, north = self.wire.airport.frame.to_local(latitude, longitude)
        given |= {"east_m": nullable(east, 2), "north_m": nullable(north, 2)}
        for name in ("altitude_m", "speed_mps", "course_deg", "heading_deg", "accuracy_m"):
            given[name] = nullable(np.array(given[name], dtype=np.float64), 2)
        given["phase"] = [PHASES[one] for one in given["phase"]]
        given["sources"] = [SOURCES[one & 7] for one in given["sources"]]
        columns = [given[name] for name in POINT_NAMES]
        return [dict(zip(POINT_NAMES, row, strict=True)) for row in zip(*columns, strict=True)]


def _alert(row: Any) -> Row:
    """A stored alert. Documents of earlier versions lack what its columns tell."""
    document: Row = msgspec.json.decode(row.document)
    document["worst_stage"] = row.worst_stage
    document["acknowledged_by"] = document.get("acknowledged_by") or row.acknowledged_by
    return document


def _track(row: Any) -> Row:
    return {
        "uid": row["uid"],
        "id": row["track_id"],
        "number": row["number"],
        "born": row["born"],
        "first": row["first_time"],
        "last": row["last_time"],
        "class": CLASSES[row["category"]],
        "callsign": row["callsign"],
        "address": row["address"],
        "simulated": row["simulated"],
        "mode": row["mode"],
    }
