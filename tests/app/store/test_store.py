from __future__ import annotations

import contextlib
import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import create_engine, select, text
from sqlalchemy.exc import OperationalError

from app.settings import LimitsSettings, NodeSettings, StorageSettings
from app.store import database, schema
from app.store.batch import Queue
from app.store.database import migrate, open_engine
from app.store.store import Store, _Due
from pipeline.picture import Picture, SensorState
from pipeline.tables import NodeEvents, Tracks
from tests.support.fake_service import FakeService
from tests.support.running import settings_for_tests, until
from tests.support.small_airport import small_airport

POSTGRES = "postgresql+psycopg://postgres@127.0.0.1:5432"
T0 = 1_760_000_000.0


@pytest.fixture
def sqlite_url(tmp_path: Path) -> str:
    return f"sqlite:///{tmp_path / 'new folder' / 'airside.sqlite3'}"


@pytest.fixture(params=["sqlite", pytest.param("postgresql", marks=pytest.mark.services)])
def url(request: pytest.FixtureRequest, sqlite_url: str) -> Iterator[str]:
    if request.param == "sqlite":
        yield sqlite_url
        return
    name = f"airside_{uuid.uuid4().hex[:12]}"
    admin = create_engine(f"{POSTGRES}/postgres", isolation_level="AUTOCOMMIT", connect_args={"connect_timeout": 2})
    try:
        with admin.connect() as connection:
            connection.execute(text(f"CREATE DATABASE {name}"))
    except OperationalError as error:
        if os.environ.get("AIRSIDE_REQUIRE_SERVICES") == "1":
            raise
        pytest.skip(f"no PostgreSQL on localhost:5432: {str(error.orig).splitlines()[0]}")
    try:
        yield f"{POSTGRES}/{name}"
    finally:
        with admin.connect() as connection:
            connection.execute(text(f"DROP DATABASE {name} WITH (FORCE)"))
        admin.dispose()


@contextlib.contextmanager
def opened(url: str, **values: Any) -> Iterator[Store]:
    store = Store(url, settings_for_tests(**values), small_airport())
    store.start()
    try:
        yield store
    finally:
        store.stop()


def tracks_at(t: float, ids: list[int] | None = None, born: float = T0) -> Tracks:
    ids = ids if ids is not None else [1, 2, 3]
    n = len(ids)
    state = np.array([[10.0 * i + (t - T0), 5.0, 1.0, 0.0] for i in ids]).reshape(n, 4)
    return Tracks.build(n, id=ids, time=t, state=state, covariance=np.eye(4), born=born, callsign="AFR1", category=1)


def test_points_tracks_and_history(url: str) -> None:
    with opened(url) as store:
        for k in range(41):
            store.record(Picture(T0 + 0.25 * k, tracks_at(T0 + 0.25 * k)), ())
    with opened(url) as store:
        assert (store.count("track_points"), store.count("tracks")) == (33, 3)
        found = store.track_history(2, None, None, 100)
        assert found is not None
        assert [one["time"] - T0 for one in found["points"]] == list(range(11))
        assert found["track"]["callsign"] == "AFR1"
        first = found["points"][0]
        assert abs(first["east_m"] - 20.0) < 0.02
        assert abs(first["north_m"] - 5.0) < 0.02
        assert (first["speed_mps"], first["course_deg"], first["phase"]) == (1.0, 90.0, "tentative")
        some = store.track_history(2, T0 + 2.5, T0 + 6.0, 2)
        assert some is not None
        assert [one["time"] - T0 for one in some["points"]] == [3.0, 4.0]
        assert some["truncated"] is True
        newest = store.track_history(2, None, None, 2)
        assert newest is not None
        assert [one["time"] - T0 for one in newest["points"]] == [9.0, 10.0]
        assert store.track_history(9, None, None, 5) is None
        assert [one["id"] for one in store.tracks(None, None)] == [3, 2, 1]
        assert store.tracks(T0 + 100, None) == []


def test_a_number_that_comes_round_again_is_another_track(url: str) -> None:
    with opened(url) as store:
        store.record(Picture(T0, tracks_at(T0, [7], born=T0)), ())
        store.record(Picture(T0 + 100, tracks_at(T0 + 100, [7], born=T0 + 99)), ())
    with opened(url) as store:
        newest, older = store.track_history(7, None, None, 10), store.track_history(7, None, T0 + 50, 10)
        assert newest is not None
        assert older is not None
        assert newest["track"]["uid"] != older["track"]["uid"]
        assert (newest["track"]["born"], older["track"]["born"]) == (T0 + 99, T0)


def test_a_recording_that_is_wound_back_is_stored_again(url: str) -> None:
    with opened(url) as store:
        for _ in range(2):
            for k in range(3):
                store.record(Picture(T0 + k, tracks_at(T0 + k, [1])), ())
    with opened(url) as store:
        assert (store.count("tracks"), store.count("track_points")) == (2, 6)
        assert store.writer_counters()["refused"] == 0


def test_every_alert_change_is_stored_and_numbers_go_on(url: str) -> None:
    service = FakeService()
    with opened(url) as store:
        assert store.last_alert_id() == 0
        service.listen(store.record)
        first = service.raise_alert(now=T0)
        for i in range(20):
            service.update_alert(first.id, text=f"step {i}", now=T0 + i)
        service.step(T0 + 20)
        service.clear_alert(first.id, now=T0 + 21)
        second = service.raise_alert(now=T0 + 22)
        service.step(T0 + 22)
    with opened(url) as store:
        steps = store.alert_changes(first.id)
        assert [one["operation"] for one in steps] == ["raise", *["update"] * 20, "clear"]
        assert [one["alert"]["text"] for one in steps[1:-1]] == [f"step {i}" for i in range(20)]
        assert store.last_alert_id() == second.id == 2
        assert [one["id"] for one in store.alerts("live", None, None)] == [second.id]
        assert [one["id"] for one in store.alerts(None, None, T0 + 10)] == [first.id]
        assert store.close_open_alerts("restart", T0 + 60) == 1
        assert store.alerts("live", None, None) == []
        last = store.alert_changes(second.id)[-1]
        assert (last["operation"], last["alert"]["clear_reason"], last["alert"]["duration_s"]) == (
            "clear",
            "restart",
            38.0,
        )
        assert store.close_open_alerts("restart", T0 + 61) == 0


def test_an_alert_is_filed_under_its_worst_stage_and_with_who_acknowledged_it(url: str) -> None:
    service = FakeService()
    with opened(url) as store:
        service.listen(store.record)
        alert = service.raise_alert(now=T0)
        service.step(T0)
        service.acknowledge(alert.id, "TWR-1")
        steps: tuple[dict[str, Any], ...] = (
            {"stage": "alarm", "worst_stage": "alarm", "state": "ongoing"},
            {"stage": "information"},
        )
        for k, values in enumerate(steps):
            service.update_alert(alert.id, now=T0 + 1 + k, **values)
        service.step(T0 + 3)
        service.clear_alert(alert.id, now=T0 + 4)
        service.step(T0 + 4)
    with opened(url) as store, store.engine.connect() as connection:
        row = connection.execute(select(schema.alerts)).one()
        assert (row.stage, row.worst_stage, row.acknowledged_by) == ("information", "alarm", "TWR-1")
        [filed] = store.alerts("cleared", None, None)
        assert (filed["stage"], filed["worst_stage"], filed["acknowledged_by"]) == ("information", "alarm", "TWR-1")


def test_alerts_of_earlier_versions_get_their_worst_stage_from_their_steps(url: str) -> None:
    migrate(url, "0003")
    engine = open_engine(url)
    airport = small_airport().icao
    lives: dict[int, list[tuple[str, str, str | None]]] = {
        1: [("raise", "information", None), ("acknowledge", "information", "TWR-1"), ("update", "alarm", None),
            ("clear", "information", None)],
        2: [("raise", "information", None), ("clear", "information", None)],
    }  # fmt: skip
    with engine.begin() as connection:
        for id, steps in lives.items():
            for operation, stage, name in steps:
                document = json.dumps({"id": id, "stage": stage, "raised_at": T0, "acknowledged_by": name})
                connection.execute(
                    text(
                        "INSERT INTO alert_changes (airport, alert_id, time, operation, stage, state, document) "
                        "VALUES (:airport, :id, 0, :operation, :stage, 'new', :document)"
                    ),
                    {"airport": airport, "id": id, "operation": operation, "stage": stage, "document": document},
                )
            connection.execute(
                text(
                    "INSERT INTO alerts (airport, id, mode, rule, stage, state, raised_at, updated_at, simulated, "
                    "document) VALUES (:airport, :id, 'live', 'a', :stage, 'cleared', :at, :at, true, :document)"
                ),
                {"airport": airport, "id": id, "stage": stage, "at": T0, "document": document},
            )
    engine.dispose()
    with opened(url) as store:
        found = store.alerts(None, None, None)
        assert [(one["id"], one["worst_stage"], one["acknowledged_by"]) for one in found] == [
            (2, "information", None),
            (1, "alarm", "TWR-1"),
        ]
        assert [one["alert"]["worst_stage"] for one in store.alert_changes(1)] == [
            "information", "information", "alarm", "alarm",
        ]  # fmt: skip
        assert store.alert_changes(1)[-1]["alert"]["stage"] == "information"


def test_node_events_and_sensor_states(url: str) -> None:
    nodes = (NodeSettings(id="n-a", latitude=48.7, longitude=2.3),)
    with opened(url, nodes=nodes) as store:
        store.record_node_events(NodeEvents.build(2, time=[T0, T0 + 1], node=[0, 5], kind=[1, 2]))
        for k in range(130):
            status = "silent" if k == 100 else "ok"
            sensor = SensorState("smr-1", "radar", status, T0 + k, counters={"lost": k})
            store.record(Picture(T0 + k, Tracks.empty(), sensors=(sensor,)), ())
    with opened(url) as store, store.engine.connect() as connection:
        events = connection.execute(select(schema.node_events).order_by(schema.node_events.c.time)).all()
        assert [(one.node, one.kind, one.speed_mps) for one in events] == [
            ("n-a", "arrived", None),
            ("5", "left", None),
        ]
        states = connection.execute(select(schema.sensor_states).order_by(schema.sensor_states.c.time)).all()
        assert [(one.time - T0, one.status) for one in states] == [(0, "ok"), (60, "ok"), (100, "silent"), (101, "ok")]


def test_the_schema_and_the_migrations_agree(url: str) -> None:
    migrate(url)
    migrate(url)
    engine = open_engine(url)
    with engine.connect() as connection:
        assert compare_metadata(MigrationContext.configure(connection), schema.metadata) == []
    engine.dispose()


def test_tracks_stored_before_ids_had_64_bits_are_kept(url: str) -> None:
    migrate(url, "0001")
    engine = open_engine(url)
    with engine.begin() as connection:
        connection.execute(
            text(
                "INSERT INTO tracks (airport, mode, track_id, born, first_time, last_time, category, simulated) "
                f"VALUES ('{small_airport().icao}', 'live', 17, {T0}, {T0}, {T0}, 1, true)"
            )
        )
    engine.dispose()
    with opened(url) as store:
        store.record(Picture(T0 + 1, tracks_at(T0 + 1, [2**40]).replace(number=4095)), ())
    with opened(url) as store:
        assert [(one["id"], one["number"]) for one in store.tracks(None, None)] == [(2**40, 4095), (17, None)]
        found = store.track_history(2**40, None, None, 5)
        assert found is not None
        assert len(found["points"]) == 1


def test_the_last_number_of_a_track_is_stored(sqlite_url: str) -> None:
    with opened(sqlite_url) as store:
        for k, number in enumerate((0, 17, 18)):
            store.record(Picture(T0 + k, tracks_at(T0 + k, [5000]).replace(number=number)), ())
    with opened(sqlite_url) as store:
        assert [(one["id"], one["number"]) for one in store.tracks(None, None)] == [(5000, 18)]


def test_what_is_due_for_a_point_is_known_of_any_id_in_any_order() -> None:
    due = _Due(1.0)
    ids = [2**62, 3, 2**33, 4]
    assert due.choose(tracks_at(T0, ids), T0).all()
    assert not due.choose(tracks_at(T0 + 0.5, ids), T0 + 0.5).any()
    assert due.choose(tracks_at(T0 + 0.5, [5, *ids[::-1], 2]), T0 + 0.5).tolist() == [True, *[False] * 4, True]
    assert due.choose(tracks_at(T0 + 1.0, [3, 5]), T0 + 1.0).tolist() == [True, False]
    assert due.choose(tracks_at(T0 + 1.1, [3], born=T0 + 1), T0 + 1.1).all()
    assert not due.choose(Tracks.empty(), T0 + 2).size


def test_tracks_that_are_gone_for_long_are_not_remembered_for_ever() -> None:
    due = _Due(1.0)
    for k in range(20):
        due.choose(tracks_at(T0 + 600.0 * k, [7, 1000 + k]), T0 + 600.0 * k)
    assert len(due._ids) < 10
    standing = tracks_at(T0, [9])
    assert due.choose(standing, T0 + 12000).all()
    for k in range(1, 20):  # it has no news, however many come and go beside it
        shown = Tracks.concatenate([standing, tracks_at(T0, [2000 + k])])
        assert due.choose(shown, T0 + 12000 + 600.0 * k).tolist() == [False, True]


def test_old_rows_are_deleted(url: str) -> None:
    with opened(url, storage=StorageSettings(retention_days=1.0)) as store:
        service = FakeService()
        alert = service.raise_alert(now=T0)
        service.listen(store.record)
        service.step(T0)
        service.clear_alert(alert.id, now=T0 + 1)
        service.step(T0 + 1)
        store.record(Picture(T0 + 2, tracks_at(T0 + 2, [50])), ())
        until(lambda: store.writer_counters()["points"] >= 25, "the first day is written")
        day = T0 + 86400
        store.record(Picture(day + 100, tracks_at(day + 100, [50])), ())
        until(lambda: store.writer_counters()["points"] >= 26, "all is written")
        store._retention.run(store.engine, force=True)
        assert [one["id"] for one in store.tracks(None, None)] == [50]
        found = store.track_history(50, None, None, 10)
        assert found is not None
        assert [one["time"] for one in found["points"]] == [day + 100]
        assert store.alerts(None, None, None) == []
        assert store.alert_changes(alert.id) == []


@pytest.mark.parametrize("ahead", [3600.0 * 24 * 2, 2_290_000_000.0], ids=["two days", "in 2099"])
def test_a_time_beyond_the_hosts_deletes_nothing(sqlite_url: str, ahead: float) -> None:
    with opened(sqlite_url, storage=StorageSettings(retention_days=1.0)) as store:
        now = time.time()
        wrong = now + ahead
        store.record(Picture(now, tracks_at(now, [50])), ())
        store.record(Picture(wrong, tracks_at(wrong, [51])), ())
        until(lambda: store.writer_counters()["points"] >= 2, "both are written")
        assert store._retention.newest >= wrong
        store._retention.run(store.engine, force=True)
        assert {one["id"] for one in store.tracks(None, None)} == {50, 51}


def test_the_history_of_a_track_is_one_contiguous_read(sqlite_url: str) -> None:
    with opened(sqlite_url) as store, store.engine.connect() as connection:
        for query, index in (
            (store._reader.bearer(7, T0, T0 + 1), "ix_tracks_number (airport=? AND track_id=? AND last_time>?)"),
            (store._reader.points(7, T0, T0 + 1, 10), "PRIMARY KEY (uid=? AND time>? AND time<?)"),
        ):
            compiled = query.compile(store.engine, compile_kwargs={"literal_binds": True})
            plan = [row[-1] for row in connection.execute(text(f"EXPLAIN QUERY PLAN {compiled}"))]
            assert any(index in line for line in plan), plan
            if "PRIMARY" in index:
                assert not any("TEMP B-TREE" in line for line in plan), plan


def test_a_full_queue_drops_points_and_never_alerts() -> None:
    service = FakeService()
    queue = Queue(limit=16)
    alert = service.raise_alert(now=T0)
    for i in range(100):
        service.update_alert(alert.id, text=str(i), now=T0 + i)
    changes = tuple(service._changes)
    for k, change in enumerate(changes):
        queue.put(changes=(change,), tracks=tracks_at(T0 + k))
    assert queue.counters["points_dropped"] == (len(changes) - 16) * 3
    taken = queue.take(0.0)
    assert taken.changes == list(changes)
    assert [float(one.time[0]) for one in taken.tracks] == [T0 + k for k in range(len(changes) - 16, len(changes))]


def test_a_database_that_cannot_be_written_is_tried_again(sqlite_url: str, caplog: pytest.LogCaptureFixture) -> None:
    """A full disk, played by SQLite's own page limit: degraded, alerts kept, all there once there is room."""
    limits = LimitsSettings(rows_queued=16)
    with opened(sqlite_url, limits=limits) as store:
        from sqlalchemy import event

        full = [True]

        @event.listens_for(store.engine, "begin")
        def limit_pages(connection: Any) -> None:
            cursor = connection.connection.cursor()
            used = cursor.execute("PRAGMA page_count").fetchone()[0]
            cursor.execute(f"PRAGMA max_page_count = {used if full[0] else 1_000_000}")
            cursor.close()

        service = FakeService()
        service.listen(store.record)
        alert = service.raise_alert("x" * 9000, now=T0)
        service.step(T0)
        until(lambda: store.writer_counters()["retries"] >= 2, "the writer tries again")
        health = store.health()
        assert health.status == "degraded"
        assert "full" in health.detail
        for k in range(60):
            service.update_alert(alert.id, text=str(k), now=T0 + 1 + k)
            service.step(T0 + 1 + k)
        assert store.writer_counters()["points_dropped"] > 0
        assert [one["alert"]["text"] for one in store.alert_changes(alert.id)][1:] == [str(k) for k in range(60)]
        assert [one["text"] for one in store.alerts("live", None, None)] == ["59"]
        assert store.alerts("cleared", None, None) == []
        full[0] = False
        until(lambda: store.writer_counters()["alert_changes"] == 61, "the alerts are written")
        assert store.health().status == "ok"
        assert [one["alert"]["text"] for one in store.alert_changes(alert.id)][1:] == [str(k) for k in range(60)]
    assert "trying again" in caplog.text


def test_what_the_database_refuses_does_not_take_the_rest_with_it(sqlite_url: str) -> None:
    with opened(sqlite_url) as store:
        with store.engine.begin() as connection:
            connection.execute(
                text(
                    "CREATE TRIGGER no BEFORE INSERT ON alert_changes WHEN NEW.alert_id = 2 "
                    "BEGIN SELECT RAISE(ABORT, 'no'); END"
                )
            )
        service = FakeService()
        for _ in range(3):
            service.raise_alert(now=T0)
        service.listen(store.record)
        service.step(T0)
        until(lambda: store.writer_counters()["refused"] == 1, "the refused one is counted")
        until(lambda: store.writer_counters()["points"] == 12, "the rest is written")
        until(lambda: [one["id"] for one in store.alerts(None, None, None)] == [3, 1], "the refused one waits no more")


def test_a_question_waits_for_the_database_only_so_long(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(database, "READ_MS", 100)
    migrate(url)
    writing, reading = open_engine(url), open_engine(url, reading=True)
    try:
        with writing.connect() as writer, reading.connect() as reader:
            question = "SELECT pg_sleep(60)"
            if url.startswith("sqlite"):
                question = "DELETE FROM tracks"
                writer.execute(text(question))
            with pytest.raises(OperationalError, match=r"locked|statement timeout"):
                reader.execute(text(question))
    finally:
        writing.dispose()
        reading.dispose()


def test_recording_does_not_fail_with_the_writer_gone(sqlite_url: str) -> None:
    with opened(sqlite_url) as store:
        pass
    store.record(Picture(T0, tracks_at(T0)), ())
    with pytest.raises(RuntimeError):
        store.close_open_alerts("late", T0)


def test_nothing_committed_is_missing_after_kill_9(tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path / 'airside.sqlite3'}"
    child = subprocess.Popen(
        [sys.executable, "-m", "tests.app.store.writing_process", url], stdout=subprocess.PIPE, text=True
    )
    assert child.stdout is not None
    told = (0, 0)
    began = time.monotonic()
    for line in child.stdout:
        told = (int(line.split()[0]), int(line.split()[1]))
        if told[0] >= 1200 and told[1] >= 30:
            break
        assert time.monotonic() - began < 60
    os.kill(child.pid, signal.SIGKILL)
    child.wait()
    child.stdout.close()
    assert told[0] >= 1200
    with sqlite3.connect(tmp_path / "airside.sqlite3") as raw:
        assert raw.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    raw.close()
    with opened(url) as store:
        assert store.count("track_points") >= told[0]
        assert store.count("alert_changes") >= told[1]
        assert store.last_alert_id() == 1
        assert store.close_open_alerts("restart", T0 + 1e6) == 1
