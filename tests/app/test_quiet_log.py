"""Faults of clients in the log: seldom, in one line, and nothing else is left out."""

from __future__ import annotations

import logging
import sys

from app.quiet_log import SAID_EVERY_S, Sparing


class Clock:
    now = 1000.0

    def __call__(self) -> float:
        return self.now


def record(text: str, error: Exception | None = None) -> logging.LogRecord:
    try:
        raise error or ValueError("wrong")
    except Exception:
        return logging.LogRecord("uvicorn.error", logging.ERROR, "x.py", 1, text, (), sys.exc_info())


def test_the_same_fault_is_said_once_a_minute_with_how_often_it_came() -> None:
    clock = Clock()
    sparing = Sparing(clock)
    many = [record("socket.accept() out of system resource\nsocket: <x>", OSError(24, "Too many")) for _ in range(500)]
    assert [sparing.filter(one) for one in many] == [True] + [False] * 499
    assert many[0].getMessage() == "web server: no descriptor left for a new connection: [Errno 24] Too many"
    assert many[0].exc_info is None
    clock.now += SAID_EVERY_S
    again = record("socket.accept() out of system resource\nsocket: <x>", OSError(24, "Too many"))
    assert sparing.filter(again)
    assert again.getMessage().endswith("(499 more since this was last said)")


def test_each_fault_is_said_and_what_is_not_of_clients_is_untouched() -> None:
    sparing = Sparing(Clock())
    assert sparing.filter(record("Invalid HTTP request received."))
    assert sparing.filter(record("Unsupported upgrade request."))
    for _ in range(3):
        own = record("Exception in ASGI application\n")
        assert sparing.filter(own)
        assert own.exc_info is not None
