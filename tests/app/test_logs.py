"""The log at a terminal and outside of one: lines with date and time, JSON, tracebacks, secrets, any encoding."""

from __future__ import annotations

import io
import json
import logging
import re
import threading
import warnings
from datetime import UTC, datetime
from typing import Any

import pytest
from rich.console import Console

from app.logs import log_to
from app.settings import LogFormat

LINE = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z [A-Z]+ [\w.]+: .*")

pytestmark = pytest.mark.usefixtures("logging_as_it_was")


def logged(format: LogFormat | None, *, terminal: bool = False, encoding: str = "utf-8") -> tuple[Any, io.BytesIO]:
    """A logger whose lines go to a console 40 columns wide, and what that console writes to."""
    octets = io.BytesIO()
    file = io.TextIOWrapper(octets, encoding=encoding, write_through=True)
    log_to(Console(file=file, width=40, force_terminal=terminal), "info", format)
    return logging.getLogger("app.some.place"), octets


def failing() -> None:
    raise RuntimeError("no such thing at nats://user:hunter2@bus:4222")


def test_an_event_is_one_line_with_date_level_and_place_and_is_never_wrapped() -> None:
    log, octets = logged("auto")
    log.warning("radar %s: %s", "smr-1", "x" * 300)
    log.debug("not asked for")
    (line,) = octets.getvalue().decode().splitlines()
    stamp, rest = line.split(" ", 1)
    assert abs((datetime.now(UTC) - datetime.fromisoformat(stamp)).total_seconds()) < 60
    assert rest == f"WARNING app.some.place: radar smr-1: {'x' * 300}"


def test_a_traceback_and_signs_that_end_lines_stay_in_the_line_of_their_event() -> None:
    log, octets = logged("text")
    try:
        failing()
    except RuntimeError:
        log.exception("failed for %s", "a\r\nb\x1b[31m\x85")
    text = octets.getvalue().decode()
    (line,) = text.splitlines()
    assert LINE.fullmatch(line)
    assert r"failed for a\r\nb\x1b[31m\x85" in line
    assert "in failing" in line
    assert "RuntimeError" in line
    assert "hunter2" not in text


def test_json_has_the_traceback_in_one_member_and_no_secrets() -> None:
    log, octets = logged("json", terminal=True)
    log.info("at %s, Zürich", "mqtt://node:hunter2@broker")
    try:
        failing()
    except RuntimeError:
        log.exception("failed")
    text = octets.getvalue().decode("ascii")
    first, second = (json.loads(line) for line in text.splitlines())
    assert first.keys() == {"time", "level", "logger", "message"}
    assert (first["level"], first["logger"]) == ("INFO", "app.some.place")
    assert first["message"] == "at mqtt://***@broker, Zürich"
    assert datetime.fromisoformat(first["time"]).tzinfo is UTC
    assert second["message"] == "failed"
    assert second["traceback"].startswith("Traceback")
    assert "in failing" in second["traceback"]
    assert "hunter2" not in text


@pytest.mark.parametrize("encoding", ["latin-1", "ascii"])
@pytest.mark.parametrize("format", ["auto", "text", "json"])
@pytest.mark.parametrize("terminal", [True, False])
def test_signs_that_the_output_has_no_code_for_are_replaced(
    encoding: str, format: LogFormat, terminal: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    log, octets = logged(format, terminal=terminal, encoding=encoding)
    log.warning("callsign \u6f22\u5b57 \udcff end")
    assert b"end" in octets.getvalue()
    assert capsys.readouterr().err == ""  # where logging tells of its own failures


def test_a_terminal_gets_colours_and_a_file_none_unless_lines_are_asked_for() -> None:
    for format, terminal, coloured in (("auto", True, True), ("auto", False, False), ("text", True, False)):
        log, octets = logged(format, terminal=terminal)  # type: ignore[arg-type]
        log.warning("told")
        assert (b"\x1b[" in octets.getvalue()) == coloured


def test_warnings_and_failures_of_threads_are_events_too() -> None:
    _, octets = logged("text")
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        logging.captureWarnings(True)
        warnings.warn("old way", DeprecationWarning, stacklevel=1)
    thread = threading.Thread(target=failing, name="feed-1")
    thread.start()
    thread.join()
    first, second = octets.getvalue().decode().splitlines()
    assert LINE.fullmatch(first)
    assert "old way" in first
    assert LINE.fullmatch(second)
    assert "ERROR app.logs: thread feed-1 failed: no such thing" in second


@pytest.mark.parametrize(("said", "json_lines"), [("json", True), ("text", False), ("loud", False)])
def test_before_the_settings_are_read_the_environment_says_the_form(
    said: str, json_lines: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("AIRSIDE_LOG_FORMAT", said)
    log, octets = logged(None)
    log.info("told")
    assert octets.getvalue().startswith(b"{") == json_lines
