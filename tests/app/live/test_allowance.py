"""So many a second in the long run, some at once, and debts for what was asked for in vain."""

from __future__ import annotations

from app.live.allowance import Allowance


def test_a_burst_then_the_rate() -> None:
    allowance = Allowance(2.0, 3.0)
    assert [allowance.take(5.0) >= 0 for _ in range(5)] == [True, True, True, False, False]
    assert allowance.take(6.0) < 0  # the two in vain are paid first
    assert allowance.take(7.0) >= 0
    assert all(allowance.take(8.0 + i / 2) >= 0 for i in range(100))


def test_rest_brings_no_more_than_a_burst() -> None:
    allowance = Allowance(2.0, 3.0)
    allowance.take(0.0)
    assert [allowance.take(1e6) for _ in range(4)] == [2.0, 1.0, 0.0, -1.0]


def test_it_goes_deeper_the_longer_it_goes_on() -> None:
    allowance = Allowance(2.0, 5.0)
    left = [allowance.take(i / 18) for i in range(40)]
    assert left[-1] < -20
    assert left == sorted(left, reverse=True)
