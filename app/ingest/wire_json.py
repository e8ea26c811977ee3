"""What the JSON ways in have in common: one or many objects, numbers that are numbers, times in two spellings."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Generic, TypeVar

import msgspec

from app.contract import Refused, RefusedRow

EARLIEST, LATEST = 946684800.0, 4102444800.0
"""2000-01-01 and 2100-01-01 UTC: no recording is of another time."""

MAX_TEXT_ECHO = 40

MOST_S = 1e300
"""Greater numbers are no times in any unit."""

MAX_IGNORED = 20
"""Names of unknown members that are told of one message."""

BYTE_ORDER_MARK = b"\xef\xbb\xbf"
"""Some programs write it before their JSON; it means nothing."""

Row = TypeVar("Row", bound=msgspec.Struct)
Read = TypeVar("Read")
T = TypeVar("T")
U = TypeVar("U")


class BadMessage(Refused):
    """A message, or one row of it, that cannot be taken. rows: each row with its reason, when it is for its rows.

    reason: bad_json, bad_value, unknown_node, wrong_node or too_many.
    """

    def __init__(self, reason: str, message: str, rows: Sequence[RefusedRow] = ()) -> None:
        super().__init__(message)
        self.reason = reason
        self.rows = tuple(rows)


@dataclass(frozen=True, slots=True, eq=False)
class Parsed(Generic[T]):
    """What a message holds: the rows that can be taken, and those that cannot.

    rows: a list or a table. places: where in the message each of them stands. bad: the others, with their places.
    ignored: names of members that nobody knows.
    """

    rows: T
    places: tuple[int, ...]
    bad: tuple[RefusedRow, ...]
    ignored: tuple[str, ...]

    def holding(self, rows: U) -> Parsed[U]:
        """The same with its rows in another form."""
        return Parsed(rows, self.places, self.bad, self.ignored)


def parse_rows(
    body: bytes, kind: type[Row], limit: int, word: str, read: Callable[[Row, str], Read]
) -> Parsed[list[Read]]:
    """Read each object of a body that holds one object or an array of them.

    word: what one object is called. read: makes of a row what is wanted, told where it stands ("report 3"); raises
    BadMessage. Members that `kind` does not have are ignored, and named. Raises BadMessage: not JSON (NaN and Infinity
    are not JSON), more than `limit` objects, or no object that can be taken although there are some.
    """
    made: list[Read] = []
    places: list[int] = []
    bad: list[RefusedRow] = []
    ignored: dict[str, None] = {}
    known = frozenset(kind.__struct_fields__)
    for place, raw in enumerate(_objects(body, limit)):
        where = f"{word} {place}"
        try:
            made.append(read(_row(raw, kind, where), where))
        except BadMessage as error:
            bad.append(RefusedRow(place, error.reason, str(error)))
        else:
            places.append(place)
            ignored.update(dict.fromkeys(name[:MAX_TEXT_ECHO] for name in raw if name not in known))
    if bad and not made:
        raise BadMessage(bad[0].reason, bad[0].message, bad)
    return Parsed(made, tuple(places), tuple(bad), tuple(ignored)[:MAX_IGNORED])


def columns_of(rows: Sequence[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """The values of rows with the same names, by name; nothing when there are no rows."""
    return {name: [row[name] for row in rows] for name in (rows[0] if rows else ())}


def decode_rows(body: bytes, kind: type[Row], limit: int, word: str) -> list[Row]:
    """The objects of a body that holds one object or an array of them, as they are. Raises BadMessage like
    `parse_rows`, and for the first object that is wrong."""
    parsed = parse_rows(body, kind, limit, word, lambda row, _: row)
    if parsed.bad:
        raise BadMessage(parsed.bad[0].reason, parsed.bad[0].message, parsed.bad)
    return parsed.rows


def _objects(body: bytes, limit: int) -> list[Any]:
    try:
        raw = msgspec.json.decode(body.removeprefix(BYTE_ORDER_MARK))
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise BadMessage("bad_json", f"not JSON: {error}") from error
    many = raw if isinstance(raw, list) else [raw]
    if len(many) > limit:
        raise BadMessage("too_many", f"{len(many)} entries in one message; at most {limit} are taken")
    return many


def _row(raw: Any, kind: type[Row], where: str) -> Row:
    try:
        return msgspec.convert(raw, kind)
    except (msgspec.ValidationError, RecursionError, OverflowError) as error:
        raise BadMessage("bad_value", f"{where}: {error}") from error


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
