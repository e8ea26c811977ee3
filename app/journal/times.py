"""Moments in a journal as a person writes and reads them."""

from __future__ import annotations

import math
from datetime import UTC, datetime

from app.journal.names import JournalError


def moment(text: str, start: float) -> float:
    """UTC s of an ISO 8601 time (UTC where it names no zone), of epoch seconds, or of "+seconds" after `start` (UTC s).

    Raises JournalError for what is none of these.
    """
    try:
        if text.startswith("+"):
            return _finite(start + float(text[1:]))
        return _finite(float(text))
    except ValueError:
        pass
    try:
        found = datetime.fromisoformat(text)
        return (found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp()
    except (ValueError, OverflowError):
        raise JournalError(
            f"{text!r} is no time: 2026-11-27T11:30:00Z, epoch seconds, or +seconds from the start"
        ) from None


def utc_text(time: float | None) -> str:
    """UTC s as ISO 8601 with milliseconds: "2026-11-27T11:30:00.000Z"; "-" for None, the number if it is no date."""
    if time is None:
        return "-"
    try:
        return datetime.fromtimestamp(time, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
    except (OverflowError, ValueError, OSError):
        return f"{time:.3f}"


def _finite(value: float) -> float:
    if not math.isfinite(value):
        raise ValueError
    return value
