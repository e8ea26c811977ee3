"""Variables that others add under the prefix stop nothing; settings among them hold."""

from __future__ import annotations

import logging
import os

import pytest

from app.settings import SettingsError, load


@pytest.fixture(autouse=True)
def no_settings_from_outside(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [one for one in os.environ if one.startswith("AIRSIDE_")]:
        monkeypatch.delenv(name)


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("AIRSIDE_SERVICE_HOST", "10.0.0.1", "is not a setting"),
        ("AIRSIDE_PORT_8000_TCP_ADDR", "10.0.0.1", "is not a setting"),
        ("AIRSIDE_PORT", "tcp://10.0.0.1:8000", "Kubernetes"),
        ("AIRSIDE_PROT", "8001", "did you mean AIRSIDE_PORT?"),
        ("AIRSIDE_FEED__MAX_CLIENT", "7", "did you mean AIRSIDE_FEED__MAX_CLIENTS?"),
        ("AIRSIDE_FEED__MAX_CLIENTS__MORE", "7", "is not a setting"),
    ],
)
def test_a_variable_that_is_no_setting_is_warned_of_by_name(
    name: str, value: str, told: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    plain = load()
    monkeypatch.setenv(name, value)
    with caplog.at_level(logging.WARNING):
        assert load() == plain
    (line,) = caplog.messages
    assert name in line
    assert told in line


def test_those_of_compose_and_real_settings_are_silent(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    for name, value in {
        "AIRSIDE_PUBLISH": "80", "AIRSIDE_COMMAND": "demo", "AIRSIDE_PORT": "81", "AIRSIDE_FEED__MAX_CLIENTS": "7",
        "AIRSIDE_PARTS__DETECT__NAME": "ca", "AIRSIDE_PARTS__DETECT__FALSE_ALARM": "1e-5",
    }.items():  # fmt: skip
        monkeypatch.setenv(name, value)
    made = load()
    assert (made.port, made.feed.max_clients, made.parts.detect.name) == (81, 7, "ca")
    assert caplog.messages == []


def test_a_wrong_value_of_a_setting_is_still_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AIRSIDE_PORT", "eighty")
    with pytest.raises(SettingsError, match="port"):
        load()
