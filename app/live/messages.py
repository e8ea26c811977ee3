"""What a client may say, decoded strictly: unknown types, wrong types, NaN and infinities are refused with words."""

from __future__ import annotations

import math
from typing import Literal

import msgspec

from app.live.stream import TrackFilter

SUBPROTOCOL = "airside.v1.json"
SCHEMA = "1.0"
TOPICS = ("tracks", "alerts", "status")
RATES_HZ = (0.1, 0.2, 0.5, 1.0, 2.0, 4.0, 5.0, 8.0, 10.0, 16.0, 20.0, 32.0)
"""Rates that are granted; a wish is rounded down to one of them, so that clients fall into few groups."""

DEFAULT_RATE_HZ = 4.0

SUBSCRIPTIONS_PER_S = 2.0
"""How often a client may change its subscription: each change costs a snapshot of its own."""

SUBSCRIPTION_BURST = 5.0
"""Changes at once, for a person who tries several filters."""

SUBSCRIPTIONS_IN_VAIN = 20.0
"""Changes beyond that, each refused, after which the connection is closed."""


class BadMessage(ValueError):
    """The client's message cannot be understood; `id` is what to answer with."""

    def __init__(self, message: str, id: int | str | None = None) -> None:
        super().__init__(message)
        self.id = id


class Resume(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where a client stood before it lost its connection."""

    epoch: str
    seq: int


class Hello(msgspec.Struct, frozen=True, tag="hello", tag_field="type"):
    """First message of a client."""

    id: int | str | None = None
    resume: Resume | None = None


CLASSES = frozenset({"aircraft", "vehicle", "unknown"})
"""All of them is as good as none."""


class Filter(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Which tracks; bbox is west, south, east, north in degrees."""

    classes: tuple[Literal["aircraft", "vehicle", "unknown"], ...] = ()
    bbox: tuple[float, float, float, float] | None = None


class Subscribe(msgspec.Struct, frozen=True, tag="subscribe", tag_field="type", forbid_unknown_fields=True):
    """What the client wants from now on; takes the place of an earlier subscription."""

    id: int | str | None = None
    topics: tuple[Literal["tracks", "alerts", "status"], ...] = TOPICS  # type: ignore[assignment]
    filter: Filter = Filter()
    max_rate_hz: float = DEFAULT_RATE_HZ


class Ping(msgspec.Struct, frozen=True, tag="ping", tag_field="type"):
    """Answered with a result, for clients that measure the way there and back."""

    id: int | str | None = None


Message = Hello | Subscribe | Ping
_decoder: msgspec.json.Decoder[Message] = msgspec.json.Decoder(Message)


class _Numbered(msgspec.Struct):
    id: int | str | None = None


def decode(data: str | bytes) -> Message:
    """The message in a text frame. Raises BadMessage."""
    try:
        return _decoder.decode(data)
    except (msgspec.MsgspecError, UnicodeError, RecursionError) as error:
        try:
            id = msgspec.json.decode(data, type=_Numbered).id
        except (msgspec.MsgspecError, UnicodeError, RecursionError):
            id = None
        raise BadMessage(str(error), id) from error


def track_filter(wanted: Subscribe) -> TrackFilter:
    """The filter that a subscription asks for. Raises BadMessage."""
    box = wanted.filter.bbox
    if box is not None:
        west, south, east, north = box
        if not (-180 <= west <= east <= 180 and -90 <= south <= north <= 90):
            raise BadMessage("filter.bbox must be [west, south, east, north] in degrees", wanted.id)
    classes = frozenset(wanted.filter.classes)
    return TrackFilter(frozenset() if classes == CLASSES else classes, box)


def granted_rate(wanted: Subscribe) -> float:
    """The rate that a subscription gets. Raises BadMessage when it is not above zero."""
    if not (math.isfinite(wanted.max_rate_hz) and wanted.max_rate_hz > 0):
        raise BadMessage("max_rate_hz must be above 0", wanted.id)
    return max((one for one in RATES_HZ if one <= wanted.max_rate_hz), default=RATES_HZ[0])
