"""Settings that go with a recording tell no secrets."""

from __future__ import annotations

import json

from app.journal.masked import masked
from app.settings import MqttSettings, Settings


def test_no_secret_of_any_url_is_left() -> None:
    settings = Settings(
        database_url="postgresql+psycopg://tower:hunter2@db.example:5432/airside?sslmode=require&password=hunter2",
        bus_url="nats://s3cr3ttoken@bus.example:4222",
        mqtt=MqttSettings(url="mqtts://node:p%40ss@broker.example:8883"),
    )
    told = masked(settings)
    text = json.dumps(told)
    for secret in ("hunter2", "s3cr3ttoken", "p%40ss", "tower", "node:"):
        assert secret not in text
    assert told["database_url"] == "postgresql+psycopg://***@db.example:5432/airside?sslmode=require&password=***"
    assert told["bus_url"] == "nats://***@bus.example:4222"
    assert told["mqtt"]["url"] == "mqtts://***@broker.example:8883"


def test_what_is_no_secret_stays() -> None:
    settings = Settings(bus_url="nats://bus.example:4222", allowed_origins=("https://tower.example",))
    assert masked(settings) == settings.model_dump(mode="json")
