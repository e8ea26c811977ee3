"""A plug-in of pytest for the tests of a mutant: which of them run, how long each may take, and what became of each.

    pytest -p tests.tools.mutation_watch --mutation-plan plan.json --mutation-results results.jsonl ...

The results are written as the tests end, so that they outlast a run that is ended from outside.
"""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Generator
from pathlib import Path
from types import FrameType

import hypothesis
import pytest

PASSED, FAILED, TIMED_OUT = "passed", "failed", "timed out"


def pytest_addoption(parser: pytest.Parser) -> None:
    """The two files, both wanted."""
    parser.addoption("--mutation-plan", type=Path)
    parser.addoption("--mutation-results", type=Path)


def pytest_configure(config: pytest.Config) -> None:
    """Watch the tests; none that hypothesis drives fails for its time, which without the compiler is another."""
    hypothesis.settings.register_profile("mutation", deadline=None, suppress_health_check=list(hypothesis.HealthCheck))
    hypothesis.settings.load_profile("mutation")
    plan = json.loads(config.getoption("--mutation-plan").read_text())
    watch = Watch(plan["only"], plan["each_s"], plan["failures"], plan["late"], config.getoption("--mutation-results"))
    config.pluginmanager.register(watch)


class Late(BaseException):
    """A test has used up its time; no test catches this by accident."""


class Watch:
    """Runs the tests of `only` (None: all), each for at most `each_s` s of processor time (0: as long as it takes),
    until so many have failed or were late (0: to the end). Processor time, since that of a busy host's clock says
    nothing; that of processes which a test starts is counted, but does not make it late.
    """

    def __init__(self, only: list[str] | None, each_s: float, failures: int, late: int, results: Path) -> None:
        self._only = None if only is None else set(only)
        self._each_s, self._results = each_s, results
        self._left = {FAILED: failures, TIMED_OUT: late}
        self._result, self._begun = PASSED, 0.0
        self._session: pytest.Session | None = None

    def pytest_sessionstart(self, session: pytest.Session) -> None:
        """What is told to stop."""
        self._session = session

    def pytest_collection_modifyitems(self, config: pytest.Config, items: list[pytest.Item]) -> None:
        """Leave out those that are not asked for."""
        left_out = [one for one in items if self._only is not None and one.nodeid not in self._only]
        items[:] = [one for one in items if self._only is None or one.nodeid in self._only]
        config.hook.pytest_deselected(items=left_out)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_setup(self) -> Generator[None]:
        """A test begins."""
        self._result, self._begun = PASSED, _processor_time()
        yield from self._limited()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self) -> Generator[None]:
        """What may run away."""
        yield from self._limited()

    def _limited(self) -> Generator[None]:
        signal.signal(signal.SIGPROF, self._stop)
        signal.setitimer(signal.ITIMER_PROF, self._each_s)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)

    def _stop(self, number: int, frame: FrameType | None) -> None:
        self._result = TIMED_OUT
        raise Late

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Called for the set-up, the call and the end of each test."""
        if report.failed and self._result == PASSED:
            self._result = TIMED_OUT if "from pytest-timeout" in report.longreprtext else FAILED
        if report.when == "teardown":
            line = {"test": report.nodeid, "result": self._result, "seconds": round(_processor_time() - self._begun, 3)}
            with self._results.open("a") as file:
                file.write(json.dumps(line) + "\n")
            if self._left.get(self._result):
                self._left[self._result] -= 1
                if not self._left[self._result] and self._session is not None:
                    self._session.shouldfail = f"a test {self._result}"


def _processor_time() -> float:
    """Of this process and those that it has waited for, s."""
    return sum(os.times()[:4])
