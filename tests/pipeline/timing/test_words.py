"""What is said of a clock that is off."""

import math

import pytest

from pipeline.timing.words import clock_time, describe, sentence

NOW = 1.8e9


@pytest.mark.parametrize(
    ("offset", "says"),
    [
        (18.0, "ahead 18 s: GPS time?"),
        (37.2, "ahead 37 s: TAI?"),
        (-18.0, "behind 18 s"),
        (3600.0, "ahead 3,600 s: local time?"),
        (-18_000.3, "behind 18,000 s: local time?"),
        (20_700.0, "ahead 20,700 s: local time?"),
        (54_000.0, "ahead 54,000 s"),
        (86_400.0, "ahead 86,400 s: wrong date?"),
        (0.7, "ahead 0.7 s"),
        (-0.05, "behind 0.1 s"),
        (1234.0, "ahead 1,234 s"),
        (40 * 86_400.0 + 1234, "ahead 40 days"),
        (73 * 365.2425 * 86_400, "ahead 73 years"),
        (1e300, "ahead over 10,000 years"),
        (math.nan, "not a time"),
        (-math.inf, "not a time"),
    ],
)
def test_an_offset_is_described_with_its_likely_cause(offset: float, says: str) -> None:
    assert describe(offset) == says


@pytest.mark.parametrize(
    ("stated", "cause"),
    [
        (12.5, "counts from its own start?"),
        (0.0, "counts from its own start?"),
        (NOW * 1e3, "milliseconds in place of seconds?"),
        (NOW * 1e6, "microseconds in place of seconds?"),
        (NOW * 1e9, "nanoseconds in place of seconds?"),
    ],
)
def test_a_time_of_another_kind_is_known_by_its_value(stated: float, cause: str) -> None:
    assert describe(stated - NOW, stated).endswith(": " + cause)


def test_the_answer_is_a_sentence() -> None:
    assert sentence(3600.0) == "time is 3,600 s ahead of this host: local time?"
    assert sentence(-7.0) == "time is 7.0 s behind this host"
    assert sentence(math.nan) == "time is not a number"


def test_the_time_of_day() -> None:
    assert clock_time(20_000 * 86_400 + 12 * 3600 + 3 * 60 + 4.9) == "12:03:04 UTC"
