"""Log lines: for a person at a terminal; elsewhere one line an event, in words or as JSON."""

from __future__ import annotations

import json
import logging
import os
import threading
from datetime import UTC, datetime
from typing import get_args

from rich.console import Console
from rich.logging import RichHandler

from app.console import accept_any_sign
from app.quiet_log import Sparing
from app.secret_urls import MaskedFormatter, masked_text
from app.settings import LogFormat

VARIABLE = "AIRSIDE_LOG_FORMAT"
"""The setting in the environment, for what is logged before the settings are read."""

NOISY = ("uvicorn.error", "uvicorn.access", "websockets", "alembic", "numba")
"""Libraries of which only warnings are of interest."""

_CONTROL = {code: f"\\x{code:02x}" for code in (*range(0x20), *range(0x7F, 0xA0))} | {
    0x09: " ", 0x0A: "\\n", 0x0D: "\\r", 0x2028: "\\u2028", 0x2029: "\\u2029",
}  # fmt: skip
"""Signs that would end a line or steer a terminal, and what is written for them."""

log = logging.getLogger(__name__)


def log_to(console: Console, level: str = "info", format: LogFormat | None = None) -> None:
    """Send the log of the whole process to a console, in place of where it went before.

    format: None for what the environment says, "auto" where that says nothing that is known.
    """
    accept_any_sign(console.file)
    form = _asked() if format is None else format
    handler: logging.Handler
    if in_lines(console, form):
        handler = logging.StreamHandler(console.file)
        handler.setFormatter(JsonFormatter() if form == "json" else LineFormatter())
    else:
        handler = RichHandler(console=console, show_path=False)
        handler.setFormatter(MaskedFormatter("%(message)s", "%H:%M:%S"))
    handler.addFilter(Sparing())
    logging.basicConfig(level=level.upper(), handlers=[handler], force=True)
    for noisy in NOISY:
        logging.getLogger(noisy).setLevel(logging.WARNING)
    logging.captureWarnings(True)
    threading.excepthook = _thread_failed


def _asked() -> LogFormat:
    said = os.environ.get(VARIABLE, "")
    return next((one for one in get_args(LogFormat) if one == said), "auto")


def in_lines(console: Console, format: LogFormat) -> bool:
    """Whether events are lines of their own, and not told to a person with colours and spinners."""
    return format != "auto" or not console.is_terminal


class LineFormatter(MaskedFormatter):
    """`2026-01-31T12:00:00.000Z WARNING app.ingest.udp: message`; a traceback stands in the same line, cut by "\\n"."""

    def format(self, record: logging.LogRecord) -> str:
        """The record in one line."""
        told = f"{_utc(record)} {record.levelname} {record.name}: {super().format(record)}"
        return told.translate(_CONTROL)


class JsonFormatter(logging.Formatter):
    """One JSON object of ASCII signs: `time`, `level`, `logger`, `message`, and `traceback` where there is one."""

    def format(self, record: logging.LogRecord) -> str:
        """The record in one line."""
        told = {
            "time": _utc(record),
            "level": record.levelname,
            "logger": record.name,
            "message": masked_text(record.getMessage()),
        }
        stack = [self.formatException(record.exc_info)] if record.exc_info else []
        stack += [record.stack_info] if record.stack_info else []
        if stack:
            told["traceback"] = masked_text("\n".join(stack))
        return json.dumps(told)


def _utc(record: logging.LogRecord) -> str:
    return datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _thread_failed(failed: threading.ExceptHookArgs) -> None:
    if failed.exc_type is SystemExit or failed.exc_value is None:
        return
    name = failed.thread.name if failed.thread is not None else "unknown"
    trace = (failed.exc_type, failed.exc_value, failed.exc_traceback)
    log.error("thread %s failed: %s", name, failed.exc_value, exc_info=trace)
