"""The time of arrival: steady under corrections of the system's clock, and quick to follow a wrong one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.runtime.host_clock import SLEW, STEP_S, HostClock

T0 = 1.8e9


class Host:
    """A system whose clocks the test moves."""

    def __init__(self) -> None:
        self.utc, self.steady = T0, 100.0
        self.clock = HostClock(lambda: self.utc, lambda: self.steady)

    def pass_(self, seconds: float) -> float:
        self.utc += seconds
        self.steady += seconds
        return self.clock.now()


def test_it_counts_utc() -> None:
    host = Host()
    assert host.clock.now() == T0
    assert host.pass_(12.5) == pytest.approx(T0 + 12.5)


def test_a_clock_set_back_one_second_makes_nothing_run_back() -> None:
    host = Host()
    host.utc -= 1.0
    times = [host.pass_(0.1) for _ in range(600)]
    assert min(np.diff(times)) >= 0.1 * (1 - SLEW) - 1e-6
    assert times[-1] == pytest.approx(host.utc, abs=1e-6)
    assert times[250] > T0 + 24.0 + 0.4, "it is not made good at once"
    assert host.clock.now_and_step()[1] == 0.0


@pytest.mark.parametrize("step", [3600.0, -3600.0, STEP_S, -STEP_S])
def test_a_clock_that_was_wrong_is_followed_at_once_and_told_once(step: float) -> None:
    host = Host()
    host.utc += step
    assert host.pass_(1.0) == pytest.approx(T0 + step + 1.0)
    assert host.clock.now_and_step()[1] == pytest.approx(step)
    assert host.clock.now_and_step()[1] == 0.0


def test_two_steps_between_questions_are_added() -> None:
    host = Host()
    host.utc += 100.0
    host.pass_(1.0)
    host.utc += 200.0
    assert host.clock.now_and_step()[1] == pytest.approx(300.0)


def test_moments_of_the_steady_clock_are_placed() -> None:
    host = Host()
    host.pass_(10.0)
    assert host.clock.at(109.5) == pytest.approx(T0 + 9.5)
    assert np.allclose(host.clock.at(np.array([109.0, 110.0])), [T0 + 9.0, T0 + 10.0])


@given(st.lists(st.tuples(st.floats(0, 100), st.floats(-50, 50)), max_size=40))
def test_without_a_step_it_never_runs_back(moves: list[tuple[float, float]]) -> None:
    host = Host()
    before = host.clock.now()
    for passed, off in moves:
        host.utc = host.clock.now() + off
        after = host.pass_(passed)
        assert after >= before - 1e-6
        before = after
    assert host.clock.now_and_step()[1] == 0.0
