"""A plug-in of pytest for the tests of a mutant: which of them run, how long each may take, and what became of each.

    pytest -p tests.tools.mutation_watch --mutation-plan plan.json --mutation-results results.jsonl ...

The results are written as the tests end, so that they outlast a run that is ended from outside.
"""

from __future__ import annotations

import json
from pathlib import Path

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


class Watch:
    """Runs the tests of `only` (None: all), each for at most `each_s` s (0: pytest's own limit), until so many have
    failed or were late (0: to the end)."""

    def __init__(self, only: list[str] | None, each_s: float, failures: int, late: int, results: Path) -> None:
        self._only = None if only is None else set(only)
        self._each_s, self._results = each_s, results
        self._left = {FAILED: failures, TIMED_OUT: late}
        self._result, self._seconds = PASSED, 0.0
        self._session: pytest.Session | None = None

    def pytest_sessionstart(self, session: pytest.Session) -> None:
        """What is told to stop."""
        self._session = session

    def pytest_collection_modifyitems(self, config: pytest.Config, items: list[pytest.Item]) -> None:
        """Leave out those that are not asked for."""
        left_out = [one for one in items if self._only is not None and one.nodeid not in self._only]
        items[:] = [one for one in items if self._only is None or one.nodeid in self._only]
        config.hook.pytest_deselected(items=left_out)
        if self._each_s:
            for one in items:
                one.add_marker(pytest.mark.timeout(self._each_s, method="signal"), append=False)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Called for the set-up, the call and the end of each test."""
        if report.when == "setup":
            self._result, self._seconds = PASSED, 0.0
        self._seconds += report.duration
        if report.failed and self._result == PASSED:
            late = "from pytest-timeout" in report.longreprtext
            self._result = TIMED_OUT if late else FAILED
        if report.when == "teardown":
            line = {"test": report.nodeid, "result": self._result, "seconds": round(self._seconds, 3)}
            with self._results.open("a") as file:
                file.write(json.dumps(line) + "\n")
            self._count()

    def _count(self) -> None:
        if self._left.get(self._result):
            self._left[self._result] -= 1
            if not self._left[self._result] and self._session is not None:
                self._session.shouldfail = f"a test {self._result}"
