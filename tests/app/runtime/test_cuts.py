"""What was cut lately: told while it is true, in words that do not change with every block."""

from __future__ import annotations

from app.runtime.cuts import Cuts


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


def test_cuts_are_told_for_ten_seconds_and_then_not() -> None:
    clock = Clock()
    cuts = Cuts(clock)
    cuts.note({"degraded_sweeps": 0, "plots": 9})
    assert cuts.lately() == {}
    assert cuts.words() == ""
    cuts.note({"degraded_sweeps": 300})
    clock.now = 105.0
    cuts.note({"degraded_sweeps": 312, "runs_dropped": 5})
    assert cuts.lately() == {"degraded_sweeps": 312, "runs_dropped": 5}
    assert cuts.words() == (
        "detections cut, 312 sweeps in the last 10 s; echoes left out of plots, 5 runs in the last 10 s"
    )
    clock.now = 110.0
    assert cuts.lately() == {"degraded_sweeps": 12, "runs_dropped": 5}
    clock.now = 115.0
    assert cuts.lately() == {}
    assert cuts.words() == ""


def test_the_words_stand_still_for_a_moment() -> None:
    clock = Clock()
    cuts = Cuts(clock)
    cuts.note({"degraded_sweeps": 1})
    first = cuts.words()
    clock.now += 1.0
    cuts.note({"degraded_sweeps": 50})
    assert cuts.words() == first
    clock.now += 1.0
    assert "50 sweeps" in cuts.words()


def test_counters_that_begin_anew_are_no_cut() -> None:
    cuts = Cuts(Clock())
    cuts.note({"degraded_sweeps": 7})
    cuts.note({})
    cuts.note({"degraded_sweeps": 2})
    assert cuts.lately() == {"degraded_sweeps": 9}
