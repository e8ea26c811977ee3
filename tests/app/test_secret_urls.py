"""Secrets of URLs are shown nowhere: not by settings, errors, logs, nor with tracebacks."""

from __future__ import annotations

import io
import logging
from collections.abc import Iterator
from pathlib import Path

import pytest
from pydantic import SecretStr, ValidationError
from rich.console import Console
from sqlalchemy import make_url
from sqlalchemy.exc import SQLAlchemyError
from typer.testing import CliRunner

from app.bus import connect_bus
from app.cli import app
from app.logs import log_to
from app.secret_urls import check_url, masked_text
from app.settings import MqttSettings, PostgresSettings, Settings, SettingsError, load
from app.store.database import open_engine
from tests.support.fake_service import FakeService
from tests.support.running import until

SECRET = "hunter2-and-more"


@pytest.fixture
def log_of_a_run() -> Iterator[io.StringIO]:
    """What the service writes to its console, at the finest level."""
    root = logging.getLogger()
    before, level = root.handlers[:], root.level
    root.handlers = []
    told = io.StringIO()
    log_to(Console(file=told, width=400), "debug")
    try:
        yield told
    finally:
        root.handlers = before
        root.setLevel(level)


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("see postgresql://a:b@c/d and nats://x@y", "see postgresql://***@c/d and nats://***@y"),
        ("mqtt://user:p@ss@host", "mqtt://***@host"),
        ("mqtt://user:p/a?s#s@host", "mqtt://***@host"),
        ("postgresql:///db?password=x&user=y", "postgresql:///db?password=***&user=y"),
        ("postgresql://h/db?password=x@y", "postgresql://h/db?password=***"),
        ("nats://a:b@one:1,nats://c:d@two:2", "nats://***@one:1,nats://***@two:2"),
        ("bus 'nats://a:b@one:1' is away", "bus 'nats://***@one:1' is away"),
        ("sqlite:////data/a@b.sqlite3", "sqlite:////data/a@b.sqlite3"),
        ("someone@example.org", "someone@example.org"),
    ],
)
def test_texts(text: str, shown: str) -> None:
    assert masked_text(text) == shown


def test_settings_show_no_secret_and_keep_it() -> None:
    settings = Settings(
        database_url=f"postgresql+psycopg://a:{SECRET}@db/x", bus_url=f"nats://{SECRET}@bus:4222",
        mqtt=MqttSettings(url=f"mqtts://a:{SECRET}@broker"),
    )  # fmt: skip
    for shown in (repr(settings), str(settings), settings.model_dump_json(), str(settings.model_dump())):
        assert SECRET not in shown
    assert settings.database == f"postgresql+psycopg://a:{SECRET}@db/x"
    assert settings.bus_url.get_secret_value() == f"nats://{SECRET}@bus:4222"
    assert str(settings.bus_url) == "nats://***@bus:4222"


def test_a_database_password_of_its_own_is_kept_and_not_shown() -> None:
    settings = Settings(postgres=PostgresSettings(host="db", password=SecretStr(f"a {SECRET}@/")))
    for shown in (repr(settings), str(settings), settings.model_dump_json(), str(settings.model_dump())):
        assert SECRET not in shown
    assert make_url(settings.database).password == f"a {SECRET}@/"
    assert SECRET not in masked_text(settings.database)
    with pytest.raises(ValidationError, match="leave one of them out"):
        Settings(postgres=PostgresSettings(host="db"), database_url="postgresql://other/x")


@pytest.mark.parametrize("url", [f"nats://me:{SECRET}/x@bus:4222", f"nats://me:{SECRET}", f"nats://[{SECRET}@bus"])
def test_a_url_that_cannot_be_read_is_refused_without_being_told(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ValueError, match="cannot be read as a URL") as told:
        check_url(url)
    assert SECRET not in str(told.value)
    for name in ("AIRSIDE_BUS_URL", "AIRSIDE_MQTT__URL"):
        monkeypatch.setenv(name, url)
    with pytest.raises(SettingsError, match="bus_url") as refused:
        load()
    assert SECRET not in str(refused.value)
    with pytest.raises(SettingsError, match="database_url") as unread:
        open_engine(f"postgresql://me:{SECRET}@db:port/x")
    assert SECRET not in str(unread.value)


def test_variables_that_are_no_json_are_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AIRSIDE_MQTT", f"url = mqtt://me:{SECRET}@broker")
    with pytest.raises(SettingsError, match="mqtt") as refused:
        load()
    assert SECRET not in str(refused.value)
    assert "\n" not in str(refused.value)


def test_the_log_of_a_run_against_servers_that_are_not_there_tells_no_secret(log_of_a_run: io.StringIO) -> None:
    service = FakeService()
    bus = connect_bus(f"nats://me:{SECRET}@127.0.0.1:9", service)
    until(lambda: bus.counters()["retries"] >= 1, "the bus has complained")
    bus.close()
    try:
        open_engine(f"postgresql://me:{SECRET}@127.0.0.1:9/x?application_name=a").connect()
    except SQLAlchemyError:
        logging.getLogger("app").exception("start-up failed")
    try:
        raise ConnectionError(f"cannot reach mqtt://me:{SECRET}@broker")
    except ConnectionError:
        logging.getLogger("app").exception("a library that tells its URL: %s", f"nats://{SECRET}@bus")
    text = log_of_a_run.getvalue()
    assert "bus nats://***@127.0.0.1:9" in text
    assert "cannot reach mqtt://***@broker" in text
    assert SECRET not in text


def test_a_command_that_fails_tells_no_secret(tmp_path: Path) -> None:
    for url in (f"postgresql://me:{SECRET}@127.0.0.1:9/x", f"nothing://me:{SECRET}@db/x", f"me:{SECRET}@db/x"):
        result = CliRunner().invoke(app, ["migrate", "--url", url])
        assert result.exit_code in (1, 2)
        assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
        assert SECRET not in result.output
    settings = tmp_path / "airside.toml"
    settings.write_text(f'bus_url = ["nats://me:{SECRET}@bus"]\n')
    with pytest.raises(SettingsError) as refused:
        load(settings)
    assert SECRET not in str(refused.value)
