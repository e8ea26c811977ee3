"""Alerts while the database does not answer."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from sqlalchemy.exc import OperationalError

from tests.support.running import Server, first_picture, running, until


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    with running(tmp_path) as made:
        first_picture(made)
        yield made


@pytest.fixture
def down(server: Server, monkeypatch: pytest.MonkeyPatch) -> Server:
    """The server once its database has gone; before, it had three alerts, of which the first was cleared."""
    alerts = [server.service.raise_alert(f"number {i}") for i in range(3)]
    server.service.step()
    server.service.acknowledge(alerts[1].id, "TWR")
    server.service.clear_alert(alerts[0].id)
    server.service.step()
    until(lambda: alerts[0].id in server.hub.recent and server.hub.recent[1].state == "cleared", "the feed knows of it")

    def refuse(*_: Any, **__: Any) -> Any:
        raise OperationalError("SELECT", {}, Exception("connection refused"))

    assert server.store is not None
    for name in ("alerts", "alert_changes", "tracks", "track_history"):
        monkeypatch.setattr(server.store, name, refuse)
    return server


def told(server: Server, question: str = "") -> Any:
    answer = httpx.get(f"{server.url}/api/v1/alerts{question}")
    assert answer.status_code == 200, answer.text
    return answer.json()


def test_alerts_are_told_from_memory(down: Server) -> None:
    made = told(down)
    assert [(one["text"], one["state"]) for one in made["alerts"]] == [
        ("number 2", "new"), ("number 1", "acknowledged"), ("number 0", "cleared"),
    ]  # fmt: skip
    assert made["complete"] is False


@pytest.mark.parametrize(
    ("question", "texts"),
    [
        ("?state=live", ["number 2", "number 1"]), ("?state=cleared", ["number 0"]), ("?limit=1", ["number 2"]),
        ("?state=acknowledged", ["number 1"]), ("?to=1000", []),
    ],
)  # fmt: skip
def test_the_question_holds_for_them_too(down: Server, question: str, texts: list[str]) -> None:
    assert [one["text"] for one in told(down, question)["alerts"]] == texts


def test_one_alert_is_told_from_memory_and_one_that_is_not_there_may_be_stored(down: Server) -> None:
    made = httpx.get(f"{down.url}/api/v1/alerts/1").json()
    assert (made["alert"]["state"], made["changes"], made["complete"]) == ("cleared", [], False)
    assert httpx.get(f"{down.url}/api/v1/alerts/77").status_code == 503


def test_what_only_the_database_has_is_not_told(down: Server) -> None:
    for path in ("/api/v1/history/tracks", "/api/v1/tracks/1/history"):
        answer = httpx.get(down.url + path)
        assert answer.status_code == 503
        assert answer.headers["retry-after"]


def test_with_the_database_all_is_told(server: Server) -> None:
    server.service.raise_alert("stored")
    server.service.step()
    until(lambda: told(server)["alerts"], "the alert is told")
    assert told(server)["complete"] is True
    until(lambda: httpx.get(f"{server.url}/api/v1/alerts/1").json()["changes"], "its step is stored")
    assert httpx.get(f"{server.url}/api/v1/alerts/1").json()["complete"] is True
    assert httpx.get(f"{server.url}/api/v1/alerts/77").status_code == 404


def test_a_real_database_that_is_gone(tmp_path: Path) -> None:
    with running(tmp_path) as server:
        server.service.raise_alert("live")
        server.service.step()
        until(lambda: told(server)["alerts"], "the alert is told")
        assert server.store is not None
        server.store.engine.dispose()
        server.store.reading.dispose()
        for path in tmp_path.glob("airside.sqlite3*"):
            path.unlink()
        (tmp_path / "airside.sqlite3").mkdir()
        made = told(server)
        assert ([one["text"] for one in made["alerts"]], made["complete"]) == (["live"], False)
