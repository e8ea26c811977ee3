"""What clients do wrong is said in one line, and seldom: a log that clients can fill hides what matters."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable

from app.console import one_line

SAID_EVERY_S = 60.0
"""Seconds between two lines about the same fault."""

FAULTS_OF_CLIENTS = {
    "Invalid HTTP request received.": "web server: a request was not HTTP",
    "Unsupported upgrade request.": "web server: a request for another protocol than WebSocket",
    "Invalid UTF-8 sequence received from client.": "web server: a WebSocket message was not UTF-8",
    "socket.accept() out of system resource": "web server: no descriptor left for a new connection",
    "opening handshake failed": "3D view: what connected to its own port did not speak WebSocket",
    "connection handler failed": "3D view: a connection to its own port failed",
}
"""How the libraries begin to say it (with a traceback, each time), and how it is said here."""


class Sparing(logging.Filter):
    """Lets a fault of `FAULTS_OF_CLIENTS` pass once a minute, in one line, with how often it was left out before."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._clock = clock
        self._said: dict[str, float] = {}
        self._left_out: dict[str, int] = {}

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether it is logged; changes the record to the one line that is."""
        said = str(record.msg)
        fault = next((one for one in FAULTS_OF_CLIENTS if said.startswith(one)), None)
        if fault is None:
            return True
        now = self._clock()
        if now - self._said.get(fault, -SAID_EVERY_S) < SAID_EVERY_S:
            self._left_out[fault] = self._left_out.get(fault, 0) + 1
            return False
        self._said[fault] = now
        before = self._left_out.pop(fault, 0)
        more = f" ({before} more since this was last said)" if before else ""
        error = record.exc_info[1] if isinstance(record.exc_info, tuple) else None
        why = f": {one_line(error)}" if error is not None else ""
        record.msg, record.args = f"{FAULTS_OF_CLIENTS[fault]}{why}{more}", None
        record.exc_info, record.exc_text, record.stack_info = None, None, None
        return True
