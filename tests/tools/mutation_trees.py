"""A copy of the project in which one mutation after the other is tried; the working tree is never written to."""

from __future__ import annotations

import json
import math
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from numba.core.caching import UserProvidedCacheLocator

from app import kernel_cache
from tests.tools.mutants import Mutant
from tests.tools.mutation_watch import FAILED, PASSED, TIMED_OUT

COPIED = ("app", "pipeline", "static", "migrations", "tests", "pyproject.toml", "README.md")

MOST_MEMORY = 8 * 2**30
"""Octets of address space for the tests of a mutant; a loop that allocates must not take the machine with it."""

WITHOUT_BROWSER = "not browser"
"""A browser takes more address space than MOST_MEMORY."""

QUICK_S = 1.0
"""A test that takes more processor time without the compiler, s, is left to the round with it."""

LATE_S, LATE_TESTS = 20.0, 2
"""Without the compiler, a mutant runs away when so many quick tests each take more processor time, s: at least twenty
times what they take unchanged."""

STARTING_S, COMPILING_S, LIMIT_FACTOR = 60.0, 120.0, 4.0
"""A mutant's tests may take so many times the processor time that they take on unchanged sources, and so many seconds
more to start without the compiler or to compile with it."""

CLOCK_FACTOR = 10.0
"""Time on the clock that a process may take, over the processor time that it may take: others may use the host too."""

ALL_PASSED, SOME_FAILED = 0, 1
"""What pytest answers."""

FAULT = re.compile(r"^(?:FAILED|ERROR) (\S+)", re.MULTILINE)

KILLED, RAN_AWAY, SURVIVED = "killed", "timed out", "survived"
"""What may become of a mutant: a test failed; its tests did not come to an end; they passed."""


class TreeError(Exception):
    """The unchanged copy does not pass its tests, or is not what they test."""


@dataclass(frozen=True)
class Outcome:
    """What became of a mutant. by: the first test that failed, or what else ended the run; empty for a survivor."""

    mutant: Mutant
    verdict: str
    by: str
    seconds: float

    @property
    def killed(self) -> bool:
        """A test failed: one that only took long does not count."""
        return self.verdict == KILLED


@dataclass(frozen=True)
class Unchanged:
    """What is known of the tests on unchanged sources. quick: those that pass without the compiler within QUICK_S, and
    what they take, s. every: all, with the compiler."""

    quick: Mapping[str, float]
    every: Mapping[str, float]

    @property
    def slow(self) -> set[str]:
        """Tests that only the round with the compiler runs."""
        return self.every.keys() - self.quick.keys()


@dataclass(frozen=True)
class _Run:
    """How a run of pytest ended: its exit code (None: past the limit), what became of each test (result, s), and what
    it printed."""

    code: int | None
    results: Mapping[str, tuple[str, float]]
    output: str

    def verdict(self, late_tests: int) -> tuple[str, str]:
        """Of a mutant with this run, and by what; it runs away when so many tests were late."""
        failed = next((test for test, (result, _) in self.results.items() if result == FAILED), None)
        late = [test for test, (result, _) in self.results.items() if result == TIMED_OUT]
        if failed is not None:
            return KILLED, failed
        if self.code is None:
            return RAN_AWAY, "the limit of its tests"
        if late:
            return (RAN_AWAY, late[-1]) if len(late) >= late_tests else (SURVIVED, "")
        if self.code == ALL_PASSED:
            return SURVIVED, ""
        fault = FAULT.search(self.output)
        return KILLED, fault[1] if fault else f"exit code {self.code}"


class Tree:
    """A copy of the project at `folder`/tree with kernels compiled for it.

    deselected: tests that are never run, by the names or the starts of names that pytest knows them by.
    """

    def __init__(self, root: Path, folder: Path, deselected: Sequence[str] = ()) -> None:
        self._deselected = [f"--deselect={one}" for one in deselected]
        self._tree, self._kernels, self._spare = folder / "tree", folder / "kernels", folder / "spare"
        self._tree.mkdir(parents=True)
        for name in COPIED:
            if not (root / name).exists():
                continue
            if (root / name).is_dir():
                shutil.copytree(root / name, self._tree / name, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy2(root / name, self._tree / name)
        self._newest = max(int(one.stat().st_mtime) for one in self._tree.rglob("*.py"))

    def take_kernels(self, root: Path, kernels: Path) -> None:
        """Take over what `kernels` holds of the same sources at `root`; what it lacks is compiled."""
        for folder in {path.parent for path in kernel_cache.kernel_sources(self._tree)}:
            there = root / folder.relative_to(self._tree)
            # numba names the folder of a file's kernels after the place of the file
            names = [UserProvidedCacheLocator.get_suitable_cache_subpath(str(one / "_.py")) for one in (there, folder)]
            kept = kernels / self._digest() / names[0]
            if kept.is_dir():
                shutil.copytree(kept, self._kernels / self._digest() / names[1], dirs_exist_ok=True)

    def give_kernels(self, to: Tree) -> None:
        """Let another copy of the same project have the kernels of this one."""
        to.take_kernels(self._tree, self._kernels)

    def without_compiler(self, files: Sequence[str], limit: float) -> dict[str, float]:
        """Tests that pass on unchanged sources without the compiler within QUICK_S, and what they take, s."""
        self._check_place(limit)
        run = self._tests(files, limit, each=QUICK_S)
        if run.code not in (ALL_PASSED, SOME_FAILED):
            raise TreeError(f"the tests without the compiler came to no end ({run.code}):\n{run.output[-3000:]}")
        passed = {test: seconds for test, (result, seconds) in run.results.items() if result == PASSED}
        return {test: seconds for test, seconds in passed.items() if seconds <= QUICK_S}

    def with_compiler(self, files: Sequence[str], limit: float) -> dict[str, float]:
        """All tests and what they take, s, on unchanged sources with the compiler. Raises TreeError if any fails."""
        self._check_place(limit)
        run = self._tests(files, limit, self._kernels, failures=1)
        if run.code != ALL_PASSED:
            raise TreeError(f"the tests do not pass on unchanged sources ({run.code}):\n{run.output[-3000:]}")
        return {test: seconds for test, (_, seconds) in run.results.items()}

    def attempt(self, mutant: Mutant, files: Sequence[str], unchanged: Unchanged) -> Outcome:
        """Make the change, run the tests of these files in their order until one fails, and take the change back.

        The quick ones run without the compiler. What survives is held with the compiler against the others, and
        against those of the first file again.
        """
        begun = time.monotonic()
        first = STARTING_S + LIMIT_FACTOR * sum(unchanged.quick.values())
        again = f"{files[0]}::"
        left = {one: s for one, s in unchanged.every.items() if one in unchanged.slow or one.startswith(again)}
        second = COMPILING_S + LIMIT_FACTOR * sum(left.values())
        with self._changed(mutant):
            run = self._tests(files, first, only=unchanged.quick, each=LATE_S, failures=1, late=LATE_TESTS)
            verdict, by = run.verdict(LATE_TESTS)
            if verdict == SURVIVED and left:
                fit = [one for one in files if any(test.startswith(f"{one}::") for test in left)]
                with self._kernels_of(mutant) as kernels:
                    verdict, by = self._tests(fit, second, kernels, only=left, failures=1, late=1).verdict(1)
        return Outcome(mutant, verdict, by, time.monotonic() - begun)

    @contextmanager
    def _changed(self, mutant: Mutant) -> Iterator[None]:
        """The copy with the change."""
        path = self._tree / mutant.path
        original, when = path.read_bytes(), path.stat().st_mtime
        path.write_bytes(mutant.applied(original))
        # Python takes a file of the same length and the same second for the one that it has compiled
        self._newest += 1
        os.utime(path, (self._newest, self._newest))
        try:
            yield
        finally:
            path.write_bytes(original)
            os.utime(path, (when, when))
            shutil.rmtree(self._spare, ignore_errors=True)

    @contextmanager
    def _kernels_of(self, mutant: Mutant) -> Iterator[Path]:
        """The folder for the compiled kernels of the changed copy."""
        path = self._tree / mutant.path
        if path not in kernel_cache.kernel_sources(self._tree):
            yield self._kernels
            return
        # a folder of its own, without what the change can reach
        kept, spare = next(one for one in self._kernels.iterdir() if one.is_dir()), self._spare / "kernels"
        shutil.copytree(kept, spare / self._digest())
        for one in (path, *self._kernel_files_that_import(path)):
            for index in (spare / self._digest()).glob(f"{one.parent.name}_*/{one.stem}.*.nbi"):
                index.unlink()  # numba looks at the file of a kernel, not at what is compiled into it
        yield spare

    def _digest(self) -> str:
        return kernel_cache._digest(self._tree)

    def _kernel_files_that_import(self, path: Path) -> list[Path]:
        """Files of kernels into which something of this file may be compiled, over any number of steps."""
        sources = {one: one.read_text() for one in (self._tree / "pipeline").rglob("*.py")}
        found, new = set[Path](), {path}
        while new:
            modules = [".".join(one.relative_to(self._tree).with_suffix("").parts) for one in new]
            words = re.compile(r"(?:from|import) (?:" + "|".join(re.escape(one) for one in modules) + r")\b")
            new = {one for one, text in sources.items() if words.search(text)} - found - {path}
            found |= new
        return [one for one in kernel_cache.kernel_sources(self._tree) if one in found]

    def _check_place(self, limit: float) -> None:
        where = self._python(["-c", "import pipeline; print(pipeline.__file__)"], {}, limit)[1]
        if not Path(where.strip()).is_relative_to(self._tree):
            raise TreeError(f"the tests would run on {where.strip()}, not on the copy")

    def _tests(
        self,
        files: Sequence[str],
        limit: float,
        kernels: Path | None = None,
        *,
        only: Collection[str] | None = None,
        each: float = 0.0,
        failures: int = 0,
        late: int = 0,
    ) -> _Run:
        """Run tests with these kernels, or without the compiler; the other words are those of mutation_watch.Watch."""
        self._spare.mkdir(exist_ok=True)
        plan, results = self._spare / "plan.json", self._spare / "results.jsonl"
        words = {"only": None if only is None else sorted(only), "each_s": each, "failures": failures, "late": late}
        plan.write_text(json.dumps(words))
        results.write_text("")
        code, output = self._python(
            ["-m", "pytest", "-q", "-rfE", "--tb=no", "--no-header", "-p", "no:cacheprovider", "--hypothesis-seed=0",
             "-m", WITHOUT_BROWSER,
             "-p", "tests.tools.mutation_watch", f"--mutation-plan={plan}", f"--mutation-results={results}",
             *self._deselected, *files],
            {"NUMBA_DISABLE_JIT": "1", "NUMBA_CACHE_DIR": str(self._spare / "none")}
            if kernels is None
            else {"NUMBA_DISABLE_JIT": "0", "NUMBA_CACHE_DIR": str(kernels)},
            limit,
        )  # fmt: skip
        lines = [json.loads(line) for line in results.read_text().splitlines() if line.endswith("}")]
        return _Run(code, {one["test"]: (one["result"], one["seconds"]) for one in lines}, output)

    def _python(self, words: Sequence[str], more: Mapping[str, str], limit: float) -> tuple[int | None, str]:
        """Run Python in the copy; its exit code (None past the limit, s of processor time) and what it printed."""
        own = {
            "HYPOTHESIS_STORAGE_DIRECTORY": str(self._spare / "hypothesis"),
            **{f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")},
            **more,
        }
        process = subprocess.Popen(
            [sys.executable, *words], cwd=self._tree, env={**os.environ, **own}, stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace", start_new_session=True,
        )  # fmt: skip
        try:
            resource.prlimit(process.pid, resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
            resource.prlimit(process.pid, resource.RLIMIT_CPU, (math.ceil(limit), math.ceil(limit) + 1))
            output, _ = process.communicate(timeout=CLOCK_FACTOR * limit)
        except subprocess.TimeoutExpired:
            return None, ""
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)  # a session of its own, with all that the tests started
                process.communicate()
        return None if process.returncode == -signal.SIGXCPU else process.returncode, output
