"""The writer: one thread that owns the connection and commits what waits, about once a scan.

When the database cannot be written (disk full, server gone) the same batch is tried again with growing pauses; points
pile up to the queue's limit and are then dropped and counted, alerts wait in memory for as long as it takes.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

from sqlalchemy import Connection, Engine, bindparam, insert, select, update
from sqlalchemy.exc import DBAPIError, InterfaceError, OperationalError, SQLAlchemyError

from app.secret_urls import masked_text
from app.store import schema
from app.store.batch import Batch, Queue
from app.store.retention import Retention
from app.store.rows import Row, alert_row, change_row, node_event_rows, point_rows, sensor_row
from app.wire import Wire, encode
from pipeline.picture import AlertChange
from pipeline.tables import Tracks

log = logging.getLogger(__name__)

COMMIT_S = 1.0
FIRST_PAUSE_S = 0.1
LONGEST_PAUSE_S = 5.0
LAST_TRIES_S = 5.0
FORGET_S = 3600.0
"""A track not heard of for this long is no longer kept in memory."""


class Writer:
    """Runs the thread. failing: why the database cannot be written at the moment, or empty."""

    def __init__(self, engine: Engine, queue: Queue, wire: Wire, nodes: tuple[str, ...], retention: Retention) -> None:
        self.engine = engine
        self.queue = queue
        self.failing = ""
        self.counters: Counter[str] = Counter(
            transactions=0, points=0, tracks=0, alert_changes=0, node_events=0, sensor_states=0, retries=0, refused=0
        )
        self._wire = wire
        self._nodes = nodes
        self._retention = retention
        self._uids: dict[tuple[int, float], tuple[int, float]] = {}
        self._thread = threading.Thread(target=self._run, name="store-writer", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self, timeout: float = 30.0) -> None:
        """Write what waits, then end."""
        self.queue.close()
        if self._thread.is_alive():
            self._thread.join(timeout)

    @property
    def alive(self) -> bool:
        """The thread runs."""
        return self._thread.is_alive()

    def _run(self) -> None:
        while True:
            batch = self.queue.take(COMMIT_S)
            if batch:
                self._write(batch)
                self.queue.written()
            elif self.queue.closed:
                return
            if not self.queue.closed:
                self._clean()

    def _write(self, batch: Batch) -> None:
        """Write until it is written; what can never be written is logged and counted."""
        pause, deadline = FIRST_PAUSE_S, None
        while True:
            try:
                self._transaction(batch)
            except (OperationalError, InterfaceError) as error:
                if not self.failing:
                    log.error("the database cannot be written, trying again: %s", error.orig)
                self.failing = masked_text(str(error.orig))
                self.counters["retries"] += 1
                now = time.monotonic()
                if self.queue.closed:
                    deadline = deadline or now + LAST_TRIES_S
                    if now > deadline:
                        self._give_up(batch)
                        return
                    time.sleep(FIRST_PAUSE_S)
                else:
                    self.queue.pause(pause)
                pause = min(2 * pause, LONGEST_PAUSE_S)
            except SQLAlchemyError as error:
                self._write_singly(batch, error)
                return
            else:
                if self.failing:
                    log.warning("the database can be written again")
                    self.failing = ""
                return

    def _transaction(self, batch: Batch) -> None:
        fresh: dict[tuple[int, float], tuple[int, float]] = {}
        counted: Counter[str] = Counter(transactions=1)
        done: list[tuple[Any, Any]] = []
        with self.engine.begin() as connection:
            for change in batch.changes:
                self._put_change(connection, change)
            counted["alert_changes"] += len(batch.changes)
            if batch.tracks:
                counted += self._put_points(connection, Tracks.concatenate(batch.tracks), fresh)
            airport = self._wire.airport.icao[:16]
            events = [row for one in batch.events for row in node_event_rows(airport, one, self._nodes)]
            if events:
                connection.execute(insert(schema.node_events), events)
                counted["node_events"] += len(events)
            if batch.sensors:
                rows = [sensor_row(airport, at, one) for at, one in batch.sensors]
                connection.execute(insert(schema.sensor_states), rows)
                counted["sensor_states"] += len(rows)
            for work, future in batch.calls:
                done.append((future, work(connection)))
        self._uids.update(fresh)
        self.counters.update(counted)
        times = [float(one.time.max()) for one in batch.tracks] + [at for at, _ in batch.sensors]
        self._retention.newest = max([self._retention.newest, *times])
        for future, result in done:
            future.set_result(result)

    def _put_change(self, connection: Connection, change: AlertChange) -> None:
        row = alert_row(self._wire, change)
        connection.execute(insert(schema.alert_changes), change_row(row, change))
        keys = (schema.alerts.c.airport == row["airport"]) & (schema.alerts.c.id == row["id"])
        if connection.execute(update(schema.alerts).where(keys).values(row)).rowcount == 0:
            connection.execute(insert(schema.alerts), row)

    def _put_points(
        self, connection: Connection, tracks: Tracks, fresh: dict[tuple[int, float], tuple[int, float]]
    ) -> Counter[str]:
        rows = point_rows(self._wire, tracks)
        newest: dict[int, Row] = {}
        made = 0
        keys = zip(tracks.id.tolist(), tracks.born.tolist(), tracks.time.tolist(), strict=True)
        for i, (id, born, at) in enumerate(keys):
            known = fresh.get((id, born)) or self._uids.get((id, born))
            if known is None or at <= known[1]:  # not later than its last point: a recording was wound back
                uid = connection.execute(
                    insert(schema.tracks).values(self._track_row(tracks, i)).returning(schema.tracks.c.uid)
                ).scalar_one()
                made += 1
            else:
                uid = known[0]
            fresh[id, born] = (uid, at)
            rows[i]["uid"] = uid
            newest[uid] = self._track_row(tracks, i)
        connection.execute(insert(schema.track_points), rows)
        names = ("last_time", "category", "callsign", "address", "simulated", "number")
        changed = update(schema.tracks).where(schema.tracks.c.uid == bindparam("which"))
        values = [{"which": uid, **{name: row[name] for name in names}} for uid, row in newest.items()]
        connection.execute(changed.values({name: bindparam(name) for name in names}), values)
        self._forget(min(float(tracks.time.max()), time.time()))
        return Counter(points=len(rows), tracks=made)

    def _track_row(self, tracks: Tracks, i: int) -> Row:
        at = float(tracks.time[i])
        return {
            "airport": self._wire.airport.icao[:16],
            "mode": self._wire.mode,
            "track_id": int(tracks.id[i]),
            "born": float(tracks.born[i]),
            "first_time": at,
            "last_time": at,
            "category": int(tracks.category[i]),
            "callsign": str(tracks.callsign[i]) or None,
            "address": str(tracks.address[i]) or None,
            "simulated": bool(tracks.simulated[i]),
            "number": int(tracks.number[i]) or None,
        }

    def _forget(self, now: float) -> None:
        if len(self._uids) > 4096:
            self._uids = {key: one for key, one in self._uids.items() if now - one[1] < FORGET_S}

    def _write_singly(self, batch: Batch, error: SQLAlchemyError) -> None:
        """Something in the batch is refused for ever: write each thing alone, so that only that is lost."""
        parts = [Batch(changes=[one]) for one in batch.changes]
        parts += [Batch(tracks=[one]) for one in batch.tracks]
        parts += [Batch(events=[one]) for one in batch.events]
        parts += [Batch(sensors=[one]) for one in batch.sensors]
        parts += [Batch(calls=[one]) for one in batch.calls]
        if len(parts) == 1:
            self.counters["refused"] += 1
            what = encode(self._wire.alert(batch.changes[0].alert)).decode() if batch.changes else "not an alert"
            log.error("the database refuses %s", what, exc_info=error)
            for _, future in batch.calls:
                future.set_exception(error)
            return
        for part in parts:
            self._write(part)

    def _give_up(self, batch: Batch) -> None:
        """The service ends and the database still cannot be written: at least the log keeps the alerts."""
        for change in batch.changes:
            alert = encode(self._wire.alert(change.alert)).decode()
            log.error("not stored: %s at %s: %s", change.operation, change.time, alert)
        self.queue.counters["points_dropped"] += sum(map(len, batch.tracks))
        for _, future in batch.calls:
            future.set_exception(RuntimeError("the database cannot be written"))

    def _clean(self) -> None:
        try:
            if self._retention.run(self.engine):
                limit = self._retention.limit
                self._uids = {key: one for key, one in self._uids.items() if one[1] >= limit}
        except DBAPIError as error:
            log.warning("old rows could not be deleted: %s", error.orig)


def close_open_alerts(airport: str, reason: str, at: float) -> Callable[[Connection], int]:
    """Work for the writer: clear the alerts that a service that ended badly left open; how many there were."""

    def work(connection: Connection) -> int:
        table = schema.alerts
        open_ones = (table.c.airport == airport) & (table.c.state != "cleared")
        rows = connection.execute(select(table).where(open_ones)).mappings().all()
        for found in rows:
            row = cleared(dict(found), reason, at)
            same = (table.c.airport == airport) & (table.c.id == row["id"])
            connection.execute(update(table).where(same).values(row))
            change = {name: row[name] for name in ("airport", "stage", "state", "document")}
            change |= {"alert_id": row["id"], "time": at, "operation": "clear"}
            connection.execute(insert(schema.alert_changes), change)
        return len(rows)

    return work


def cleared(row: Row, reason: str, at: float) -> Row:
    """A row of alerts as it is after clearing."""
    import msgspec

    document = msgspec.json.decode(row["document"])
    document |= {"state": "cleared", "cleared_at": at, "clear_reason": reason, "updated_at": at}
    document["duration_s"] = max(0.0, at - document["raised_at"])
    return {**row, "state": "cleared", "cleared_at": at, "updated_at": at, "document": encode(document).decode()}
