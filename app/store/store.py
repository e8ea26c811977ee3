"""The store: what the service records, and what it can be asked."""

from __future__ import annotations

import logging

import numpy as np
from numpy.typing import NDArray

from app.settings import Settings
from app.store.batch import Queue
from app.store.database import migrate, open_engine
from app.store.reader import Reader
from app.store.retention import Retention
from app.store.writer import FORGET_S, Writer, close_open_alerts
from app.wire import Row, Wire, plain
from pipeline.airport.model import Airport
from pipeline.picture import AlertChange, Picture, SensorState
from pipeline.tables import NodeEvents, Tracks

log = logging.getLogger(__name__)

SENSOR_EVERY_S = 60.0
CALL_S = 30.0


class Store:
    """Records pictures, alert changes and node events without keeping the caller waiting, and answers questions.

    url: of an SQLite file or of PostgreSQL. `record` belongs to one thread (the surface thread); the rest to any.
    """

    def __init__(self, url: str, settings: Settings, airport: Airport) -> None:
        self.url = url
        self.settings = settings
        self.wire = Wire(airport, settings.mode)
        self.airport = airport.icao[:16]
        self.engine = open_engine(url)
        self.reading = open_engine(url, reading=True)
        self._queue = Queue(settings.limits.rows_queued)
        self._retention = Retention(settings.storage.retention_days, self.airport)
        self._nodes = tuple(one.id for one in settings.nodes)
        self._writer = Writer(self.engine, self._queue, self.wire, self._nodes, self._retention)
        self._reader = Reader(self.reading, self.wire)
        self._due = _Due(settings.storage.point_interval_s)
        self._sensors: dict[str, tuple[str, str, float]] = {}
        self._failed = 0

    def start(self) -> None:
        """Bring the schema up to date and start the writer. Raises SQLAlchemyError when there is no database."""
        migrate(self.url)
        self._writer.start()

    def stop(self) -> None:
        """Write what waits, end the writer, close the connections."""
        self._writer.stop()
        self.engine.dispose()
        self.reading.dispose()

    def record(self, picture: Picture, changes: tuple[AlertChange, ...]) -> None:
        """Take a picture (a `PictureListener`): returns at once, never raises."""
        try:
            self._queue.put(changes=changes)
            due = picture.tracks[self._due.choose(picture.tracks, picture.time)]
            self._queue.put(tracks=due, sensors=self._changed_sensors(picture))
        except Exception:
            self._failed += 1
            log.exception("a picture could not be recorded")

    def record_node_events(self, events: NodeEvents) -> None:
        """Take node events; returns at once."""
        self._queue.put(events=events)

    def writer_counters(self) -> dict[str, int]:
        """What was written, retried, refused and dropped; they only grow."""
        return {**self._writer.counters, **self._queue.counters, "failed": self._failed}

    def queued(self) -> int:
        """Batches, alert changes and events that wait for the writer."""
        return len(self._queue)

    def health(self) -> SensorState:
        """The state of the database in the form of a sensor's: degraded while it cannot be written."""
        failing = self._writer.failing
        if not self._writer.alive:
            return SensorState("database", "store", "waiting", None, counters=self.writer_counters())
        last = self._retention.newest or None
        return SensorState(
            "database", "store", "degraded" if failing else "ok", last, detail=failing, counters=self.writer_counters()
        )

    def track_history(self, id: int, first: float | None, last: float | None, limit: int) -> Row | None:
        """The newest track with an id (within the times) with its points; None when there is none."""
        return self._reader.track_history(id, first, last, limit)

    def tracks(
        self, first: float | None, last: float | None, *, callsign: str | None = None, limit: int = 200
    ) -> list[Row]:
        """Stored tracks that lived within the times, newest first."""
        return self._reader.tracks(first, last, callsign=callsign, limit=limit)

    def alerts(self, state: str | None, first: float | None, last: float | None, limit: int = 200) -> list[Row]:
        """Alerts raised within the times, newest first; those that wait to be written are among them."""
        waiting = {one.alert.id: plain(self.wire.alert(one.alert)) for one in self._queue.changes()}
        rows = {row["id"]: row for row in self._reader.alerts(state, first, last, limit)}
        for id, row in waiting.items():
            rows.pop(id, None)
            wanted = state in (None, row["state"]) or (state == "live" and row["state"] != "cleared")
            if wanted and (first is None or row["raised_at"] >= first) and (last is None or row["raised_at"] <= last):
                rows[id] = row
        return sorted(rows.values(), key=lambda row: (row["raised_at"], row["id"]), reverse=True)[:limit]

    def alert_changes(self, id: int) -> list[Row]:
        """Every step of one alert; those that wait to be written are among them."""
        waiting = [one for one in self._queue.changes() if one.alert.id == id]
        rows = self._reader.alert_changes(id)
        for one in waiting:
            row = {"time": one.time, "operation": one.operation, "alert": plain(self.wire.alert(one.alert))}
            if row not in rows:
                rows.append(row)
        return rows

    def last_alert_id(self) -> int:
        """The greatest alert number of this airport; 0 when there is none."""
        return self._reader.last_alert_id()

    def close_open_alerts(self, reason: str, time: float) -> int:
        """Clear the alerts that were left open when the service last ended; how many there were."""
        future = self._queue.call(close_open_alerts(self.airport, reason, time))
        closed: int = future.result(CALL_S)
        return closed

    def count(self, table: str) -> int:
        """Rows in a table."""
        return self._reader.count(table)

    def _changed_sensors(self, picture: Picture) -> tuple[tuple[float, SensorState], ...]:
        changed = []
        for sensor in picture.sensors:
            status, detail, at = self._sensors.get(sensor.id, ("", "", -1e18))
            if (sensor.status, sensor.detail) != (status, detail) or not 0 <= picture.time - at < SENSOR_EVERY_S:
                self._sensors[sensor.id] = (sensor.status, sensor.detail, picture.time)
                changed.append((picture.time, sensor))
        return tuple(changed)


class _Due:
    """Which tracks of a picture are due for a stored point: each at most once in `interval` seconds.

    Remembers of each track, by id in ascending order, the time of its last point and its birth.
    """

    def __init__(self, interval: float) -> None:
        self.interval = interval
        self._ids: NDArray[np.int64] = np.zeros(0, np.int64)
        self._last: NDArray[np.float64] = np.zeros(0)
        self._born: NDArray[np.float64] = np.zeros(0)
        self._time = -np.inf

    def choose(self, tracks: Tracks, time: float) -> NDArray[np.bool_]:
        """Mask of the tracks to store now; remembers them."""
        if time < self._time - 1.0:
            self._last[:] = -np.inf  # a replay was wound back
        self._time = time
        if not np.isin(tracks.id, self._ids).all():
            self._make_room(np.unique(tracks.id), time)
        at = np.searchsorted(self._ids, tracks.id)
        waited = tracks.time - self._last[at]
        due = (self._born[at] != tracks.born) | ((waited > 0) & (waited >= 0.999 * self.interval))
        self._last[at[due]] = tracks.time[due]
        self._born[at[due]] = tracks.born[due]
        return np.asarray(due)

    def _make_room(self, ids: NDArray[np.int64], time: float) -> None:
        """Remember these ids (k,), ascending, too, and forget those not among them that were not due for long."""
        kept = (self._last >= time - FORGET_S) | np.isin(self._ids, ids)
        fresh = np.setdiff1d(ids, self._ids, assume_unique=True)
        all_ids = np.r_[self._ids[kept], fresh]
        order = np.argsort(all_ids, kind="stable")
        self._ids = all_ids[order]
        self._last = np.r_[self._last[kept], np.full(len(fresh), -np.inf)][order]
        self._born = np.r_[self._born[kept], np.full(len(fresh), np.nan)][order]
