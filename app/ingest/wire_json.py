"""What the JSON ways in have in common: one or many objects, numbers that are numbers, times in two spellings."""

from __future__ import annotations

import math
from datetime import datetime
from typing import TypeVar

import msgspec

from app.contract import Refused

EARLIEST, LATEST = 946684800.0, 4102444800.0
"""2000-01-01 and 2100-01-01 UTC: no recording is of another time."""

MAX_TEXT_ECHO = 40

MOST_S = 1e300
"""Greater numbers are no times in any unit."""

Row = TypeVar("Row", bound=msgspec.Struct)


class BadMessage(Refused):
    """A message that cannot be taken. reason: bad_json, bad_value, unknown_node, wrong_node or too_many."""

    def __init__(self, reason: str, message: str) -> None:
        super().__init__(message)
        self.reason = reason


def decode_rows(body: bytes, kind: type[Row], limit: int) -> list[Row]:
    """The objects of a body that holds one object or an array of them.

    Raises BadMessage: not JSON (NaN and Infinity are not JSON), a wrong or unknown field, more than `limit` objects.
    """
    try:
        raw = msgspec.json.decode(body)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise BadMessage("bad_json", f"not JSON: {error}") from error
    many = raw if isinstance(raw, list) else [raw]
    if len(many) > limit:
        raise BadMessage("too_many", f"{len(many)} entries in one message; at most {limit} are taken")
    try:
        return msgspec.convert(many, list[kind])  # type: ignore[valid-type]
    except (msgspec.ValidationError, RecursionError, OverflowError) as error:
        raise BadMessage("bad_value", str(error)) from error


def unix_time(value: float | int | str, where: str) -> float:
    """UTC seconds of a Unix time in seconds or an ISO 8601 time with its zone. Raises BadMessage.

    Whether the clock that it comes from can be right is judged when the row is submitted, by the time of its arrival.
    """
    if isinstance(value, str):
        try:
            moment = datetime.fromisoformat(value)
        except ValueError as error:
            raise BadMessage(
                "bad_value", f"{where}: time {value[:MAX_TEXT_ECHO]!r} is neither ISO 8601 nor Unix seconds"
            ) from error
        if moment.tzinfo is None:
            raise BadMessage("bad_value", f"{where}: time {value[:MAX_TEXT_ECHO]!r} has no zone; end it with Z")
        try:
            return moment.timestamp()
        except (OverflowError, ValueError) as error:
            raise BadMessage("bad_value", f"{where}: time {value[:MAX_TEXT_ECHO]!r} is out of range") from error
    return number(value, "time", where, -MOST_S, MOST_S)


def recorded_time(value: float | int | str, where: str) -> float:
    """`unix_time` of a recording, which nobody else judges: between the years 2000 and 2100. Raises BadMessage."""
    seconds = unix_time(value, where)
    if not EARLIEST <= seconds < LATEST:
        raise BadMessage("bad_value", f"{where}: time must lie between the years 2000 and 2100 (Unix seconds, UTC)")
    return seconds


def number(value: float | int | None, name: str, where: str, low: float, high: float) -> float:
    """A finite number within bounds, nan for None. Raises BadMessage."""
    if value is None:
        return math.nan
    try:
        given = float(value)
    except OverflowError:
        given = math.inf
    if not math.isfinite(given) or not low <= given <= high:
        raise BadMessage("bad_value", f"{where}: {name} must be a number from {low:g} to {high:g}")
    return given
