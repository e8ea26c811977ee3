"""Clocks of reports and events: every row of the trials, and that nothing wrong moves anything."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.timing.source_clock import AHEAD_S, ClockRules, SourceClock, Verdict

NOW = 1.8e9


def feed(
    clock: SourceClock,
    wrong: Callable[[float], float],
    seconds: float = 60.0,
    *,
    rate: float = 4.0,
    jitter: float = 0.3,
    begin: float = NOW,
    seed: int = 1,
) -> list[tuple[float, float, Verdict]]:
    """(true time, arrival, verdict) of reports with `wrong(true time)` as the offset, late by up to `jitter`."""
    rng = np.random.default_rng(seed)
    out = []
    for i in range(round(seconds * rate)):
        true = begin + i / rate
        arrival = true + rng.uniform(0.0, jitter)
        out.append((true, arrival, clock.take(np.array([true + wrong(true)]), arrival)))
    return out


def errors(fed: list[tuple[float, float, Verdict]]) -> np.ndarray:
    return np.array([verdict.time[0] - true for true, _, verdict in fed])


def refused(fed: list[tuple[float, float, Verdict]]) -> int:
    return sum(len(verdict.refused) for _, _, verdict in fed)


@pytest.mark.parametrize(
    ("offset", "reason", "words"),
    [
        (18.0, "ahead", "ahead 18 s: GPS time?"),
        (3600.0, "ahead", "ahead 3,600 s: local time?"),
        (-7200.0, "behind", "behind 7,200 s: local time?"),
        (73 * 365.2425 * 86400, "ahead", "ahead 73 years"),
    ],
)
def test_far_off_is_refused_by_name(offset: float, reason: str, words: str) -> None:
    clock = SourceClock(ClockRules())
    fed = feed(clock, lambda _: offset, jitter=0.0)
    assert all(not verdict.ok[0] and [one[:2] for one in verdict.refused] == [(0, reason)] for _, _, verdict in fed)
    assert all(verdict.words.startswith(words) for _, _, verdict in fed)
    assert clock.offset == pytest.approx(offset, abs=0.01)


def test_uptime_is_refused_by_name() -> None:
    verdict = SourceClock(ClockRules()).take(np.array([123.4]), NOW)
    assert verdict.words == "behind 57 years: counts from its own start?"
    assert [one[:2] for one in verdict.refused] == [(0, "behind")]
    assert verdict.refused[0][2].startswith("time is 57 years behind this host")


def test_no_time_is_refused_as_invalid() -> None:
    verdict = SourceClock(ClockRules()).take(np.array([np.nan, NOW, np.inf]), NOW)
    assert verdict.ok.tolist() == [False, True, False]
    assert verdict.refused == ((0, "invalid", "time is not a number"), (2, "invalid", "time is not a number"))


def test_only_the_wrong_rows_are_refused() -> None:
    clock = SourceClock(ClockRules())
    verdict = clock.take(NOW + np.array([-0.2, 3600.0, -0.1, -9.0]), NOW)
    assert verdict.ok.tolist() == [True, False, True, False]
    assert verdict.time[verdict.ok].tolist() == [NOW - 0.2, NOW - 0.1]
    assert verdict.refused == (
        (1, "ahead", "time is 3,600 s ahead of this host: local time?"),
        (3, "behind", "time is 9.0 s behind this host"),
    )
    assert clock.offset == pytest.approx(-0.1)


def test_a_clock_0_7_s_ahead_is_corrected_and_shown() -> None:
    clock = SourceClock(ClockRules())
    fed = feed(clock, lambda _: 0.7)
    assert refused(fed) == 0
    assert clock.offset == pytest.approx(0.7, abs=0.1)
    assert np.abs(errors(fed)[40:]).max() < 0.15
    assert all(verdict.time[0] <= arrival for _, arrival, verdict in fed)


def test_latency_is_not_corrected() -> None:
    clock = SourceClock(ClockRules())
    fed = feed(clock, lambda _: 0.0, jitter=1.5)
    assert np.array_equal(errors(fed), np.zeros(len(fed)))


def test_a_clock_that_is_behind_more_than_latency_explains_is_corrected() -> None:
    clock = SourceClock(ClockRules())
    fed = feed(clock, lambda _: -3.0)
    assert refused(fed) == 0
    assert np.abs(errors(fed)[40:]).max() < 0.15


@pytest.mark.parametrize("drift", [50e-6, -50e-6])
def test_a_drifting_clock_is_followed_until_it_is_too_far(drift: float) -> None:
    clock = SourceClock(ClockRules(mode="corrected"))
    fed = feed(clock, lambda true: drift * (true - NOW), seconds=4 * 3600.0, rate=1.0, jitter=0.05)
    assert refused(fed) == 0
    assert clock.offset == pytest.approx(drift * 4 * 3600, abs=0.05)
    assert np.abs(errors(fed)[60:]).max() < 0.07
    assert clock.steps == 0


def test_modes() -> None:
    for mode, wanted in (("taken", 0.7), ("auto", 0.0), ("corrected", 0.0)):
        fed = feed(SourceClock(ClockRules(mode=mode)), lambda _: 0.7, jitter=0.0)  # type: ignore[arg-type]
        assert errors(fed)[-1] == pytest.approx(wanted, abs=1e-6), mode


def test_stamped_on_arrival_nothing_is_refused() -> None:
    clock = SourceClock(ClockRules(mode="arrival"))
    verdict = clock.take(np.array([NOW + 3600, np.nan, 12.0]), NOW)
    assert verdict.ok.all()
    assert verdict.time.tolist() == [NOW] * 3
    assert clock.offset == pytest.approx(3600.0)


@given(st.floats(-5.0, 5.0), st.integers(0, 1000))
@settings(deadline=None)
def test_one_outlier_changes_nothing(outlier: float, seed: int) -> None:
    clock, other = SourceClock(ClockRules()), SourceClock(ClockRules())
    feed(clock, lambda _: 0.0, seconds=20, seed=seed)
    feed(other, lambda _: 0.0, seconds=20, seed=seed)
    verdict = clock.take(np.array([NOW + 20.0 + outlier]), NOW + 20.0)
    assert verdict.time[0] <= NOW + 20.0 + AHEAD_S
    first = feed(clock, lambda _: 0.0, seconds=5, begin=NOW + 20.3, seed=seed)
    second = feed(other, lambda _: 0.0, seconds=5, begin=NOW + 20.3, seed=seed)
    assert np.array_equal(errors(first), errors(second))


@given(st.lists(st.floats(allow_nan=True, allow_infinity=True), min_size=1, max_size=20))
def test_what_is_refused_moves_nothing(times: list[float]) -> None:
    stated = np.array(times)
    stated = stated[~(np.abs(stated - NOW) <= 5.0)]
    clock, other = SourceClock(ClockRules()), SourceClock(ClockRules())
    feed(clock, lambda _: 0.7, seconds=10)
    feed(other, lambda _: 0.7, seconds=10)
    verdict = clock.take(stated, NOW + 10)
    assert not verdict.ok.any()
    assert len(verdict.refused) == len(stated)
    good = np.array([NOW + 11.5])
    assert clock.take(good, NOW + 11).time.tolist() == other.take(good, NOW + 11).time.tolist()


@given(st.lists(st.tuples(st.floats(-6, 6), st.floats(0, 3)), max_size=60), st.sampled_from(["auto", "corrected"]))
def test_corrected_times_do_not_run_ahead_of_arrival(rows: list[tuple[float, float]], mode: str) -> None:
    clock = SourceClock(ClockRules(mode=mode))  # type: ignore[arg-type]
    arrival = NOW
    for offset, passed in rows:
        arrival += passed
        verdict = clock.take(np.array([arrival + offset]), arrival)
        assert not verdict.ok[0] or verdict.time[0] <= arrival + AHEAD_S + 1e-6


def test_a_step_of_the_clock_is_followed_and_counted() -> None:
    clock = SourceClock(ClockRules())
    feed(clock, lambda _: 0.0, seconds=30, jitter=0.1)
    after = feed(clock, lambda _: 2.0, seconds=30, jitter=0.1, begin=NOW + 30)
    assert clock.steps == 1
    assert np.abs(errors(after)[20:]).max() < 0.15
    back = feed(clock, lambda _: 0.0, seconds=30, jitter=0.1, begin=NOW + 60)
    assert clock.steps == 2
    assert np.abs(errors(back)[-20:]).max() < 0.15


def test_good_times_after_refused_ones_are_taken_at_once() -> None:
    clock = SourceClock(ClockRules())
    feed(clock, lambda _: 3600.0, seconds=10)
    fed = feed(clock, lambda _: 0.0, seconds=10, begin=NOW + 10)
    assert refused(fed) == 0
    assert np.abs(errors(fed)).max() == 0.0
    assert abs(clock.offset or 0.0) < 0.3


def test_a_host_whose_clock_was_set_back_learns_anew() -> None:
    clock = SourceClock(ClockRules(mode="corrected"))
    feed(clock, lambda _: 0.0, seconds=30, jitter=0.0)
    fed = feed(clock, lambda _: 0.4, seconds=3, jitter=0.0, begin=NOW - 3600)
    assert np.abs(errors(fed)).max() < 1e-6
