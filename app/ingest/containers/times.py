"""Times for datagrams of files that have none: those of the radar video in them.

The messages say a time of day and no date: the day is that of the last datagram with a time, else UNDATED, and goes on
when the time of day begins anew. Where they say no time either, a turn of the antenna is taken for UNTIMED_TURN_S.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from app.ingest.containers.packets import Datagram
from pipeline.asterix.cat240_decode import DecodeError, VideoMessage, decode

UNDATED = "1970-01-01"
"""The day of a time of day without a date, UTC: that of time 0."""

UNTIMED_TURN_S = 1.0
"""Seconds of a turn of an antenna of which nothing is known."""

_DAY_S = 86400.0


def timed(datagrams: Iterable[Datagram]) -> Iterator[Datagram]:
    """The datagrams, each with a time (UTC s); those that have one are left as they are."""
    last, azimuth = math.nan, -1
    for one in datagrams:
        if not math.isnan(one.time):
            last = one.time
            yield one
            continue
        last, azimuth = _next_time(_first_video(one.payload), last, azimuth)
        yield one._replace(time=last)


def _next_time(video: VideoMessage | None, last: float, azimuth: int) -> tuple[float, int]:
    """(time, azimuth count) after `last` and `azimuth`, of which NaN and -1 say that there was none."""
    if video is None:
        return (0.0 if math.isnan(last) else last), azimuth
    if video.time_of_day is not None:
        time = video.time_of_day / 128
        if not math.isnan(last):
            time += round((last - time) / _DAY_S) * _DAY_S
        return time, video.start
    turned = (video.start - azimuth) & 0xFFFF if azimuth >= 0 else 0
    # a message that comes late turned back a little, not nearly all the way round
    turned = turned if turned < 0x8000 else 0
    return (0.0 if math.isnan(last) else last) + turned / 65536 * UNTIMED_TURN_S, video.start


def _first_video(payload: bytes) -> VideoMessage | None:
    try:
        return next((one for one in decode(payload) if isinstance(one, VideoMessage)), None)
    except DecodeError:
        return None
