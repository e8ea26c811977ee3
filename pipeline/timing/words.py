"""What a clock is off by, in words for a person, with a guess at the cause."""

from __future__ import annotations

import math

LOCAL_STEP_S = 900.0
"""Time zones differ from UTC by whole quarters of an hour."""

LOCAL_MOST_S = 14 * 3600.0
"""No time zone differs from UTC by more."""

LOCAL_TOLERANCE_S = 10.0
"""An offset this near to that of a time zone is taken for local time: the clock itself may be off by so much."""

GPS_S, TAI_S = 18.0, 37.0
"""GPS time and international atomic time have been this much ahead of UTC since 2017."""

SCALE_TOLERANCE_S = 1.0
"""An offset this near to that of GPS time or TAI is taken for it: the clock itself may be off by so much."""

OWN_START_S = 1e9
"""UTC s (September 2001). A clock that states less counts from when its sensor was switched on."""

DAY_S, YEAR_S = 86400.0, 365.2425 * 86400.0
"""A day, and the mean year of the calendar."""

MOST_YEARS = 10_000
"""A greater offset is given as "over 10,000 years"."""

UNITS = ((1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds"))
"""Counts of a second in units that are mistaken for seconds, and their names."""


def amount(offset: float) -> str:
    """How much, without the sign: "0.7 s", "3,600 s", "12 days", "73 years"."""
    size = abs(offset)
    if size < 10:
        return f"{size:.1f} s"
    if size < 10 * DAY_S:
        return f"{size:,.0f} s"
    if size < YEAR_S:
        return f"{size / DAY_S:.0f} days"
    if size < MOST_YEARS * YEAR_S:
        return f"{size / YEAR_S:,.0f} years"
    return f"over {MOST_YEARS:,} years"


def side(offset: float) -> str:
    """ "ahead" or "behind"."""
    return "ahead" if offset > 0 else "behind"


def guess(offset: float, stated: float = math.nan) -> str:
    """What may be the cause, or nothing. stated: a time (s) that is off by `offset`, where one is at hand."""
    arrival = stated - offset
    for factor, unit in UNITS:
        if arrival > 0 and abs(stated / factor / arrival - 1) < 0.1:
            return f"{unit} in place of seconds?"
    if stated < OWN_START_S < arrival:
        return "counts from its own start?"
    if abs(offset - GPS_S) <= SCALE_TOLERANCE_S:
        return "GPS time?"
    if abs(offset - TAI_S) <= SCALE_TOLERANCE_S:
        return "TAI?"
    quarters = round(offset / LOCAL_STEP_S)
    near = abs(offset - quarters * LOCAL_STEP_S) <= LOCAL_TOLERANCE_S
    if quarters and near and abs(offset) <= LOCAL_MOST_S + LOCAL_TOLERANCE_S:
        return "local time?"
    days = round(offset / DAY_S)
    if days and abs(offset) < YEAR_S and abs(offset - days * DAY_S) <= LOCAL_TOLERANCE_S:
        return "wrong date?"
    return ""


def describe(offset: float, stated: float = math.nan) -> str:
    """For a status line: "ahead 3,600 s: local time?". offset: s, stated less arrival; nan for a time that is none."""
    if not math.isfinite(offset):
        return "not a time"
    cause = guess(offset, stated)
    return f"{side(offset)} {amount(offset)}{': ' if cause else ''}{cause}"


def sentence(offset: float, stated: float = math.nan) -> str:
    """For an answer: "time is 3,600 s ahead of this host: local time?"."""
    if not math.isfinite(offset):
        return "time is not a number"
    cause = guess(offset, stated)
    preposition = "ahead of" if offset > 0 else "behind"
    return f"time is {amount(offset)} {preposition} this host{': ' if cause else ''}{cause}"


def clock_time(utc: float) -> str:
    """ "12:03:04 UTC"."""
    second = int(utc % DAY_S)
    return f"{second // 3600:02d}:{second // 60 % 60:02d}:{second % 60:02d} UTC"
