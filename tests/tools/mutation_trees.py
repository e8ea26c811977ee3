"""A copy of the project in which one mutation after the other is tried; the working tree is never written to."""

from __future__ import annotations

import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from app import kernel_cache
from tests.tools.mutants import Mutant

COPIED = ("app", "pipeline", "tests", "pyproject.toml")

MOST_MEMORY = 8 * 2**30
"""Octets of address space for the tests of a mutant; a loop that allocates must not take the machine with it."""

PASSED, NO_TESTS = 0, 5
"""What pytest answers."""

FAULT = re.compile(r"^(?:FAILED|ERROR) (\S+)", re.MULTILINE)


class TreeError(Exception):
    """The unchanged copy does not pass its tests, or is not what they test."""


@dataclass(frozen=True)
class Outcome:
    """What became of a mutant. by: the first test that failed, "time limit", or what else ended the run; empty for a
    survivor."""

    mutant: Mutant
    killed: bool
    by: str
    seconds: float


class Tree:
    """A copy of the project at `folder`/tree with kernels compiled for it, and what its tests took unchanged.

    deselected: tests that are never run, by the names or the starts of names that pytest knows them by.
    """

    def __init__(self, root: Path, folder: Path, deselected: Sequence[str] = ()) -> None:
        self._deselected = [f"--deselect={one}" for one in deselected]
        self._tree, self._kernels, self._spare = folder / "tree", folder / "kernels", folder / "spare"
        self._tree.mkdir(parents=True)
        for name in COPIED:
            if (root / name).is_dir():
                shutil.copytree(root / name, self._tree / name, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy2(root / name, self._tree / name)

    def prove(self, tests: Sequence[str], limit: float) -> float:
        """Run the tests on the unchanged copy, twice: the first compiles. Gives s of the second. Raises TreeError."""
        where = self._python(["-c", "import pipeline; print(pipeline.__file__)"], self._kernels, limit)[1]
        if not Path(where.strip()).is_relative_to(self._tree):
            raise TreeError(f"the tests would run on {where.strip()}, not on the copy")
        for _ in range(2):
            begun = time.monotonic()
            code, output = self._tests(tests, self._kernels, limit)
            if code != PASSED:
                raise TreeError(f"the tests do not pass on unchanged sources ({code}):\n{output[-3000:]}")
        return time.monotonic() - begun

    def attempt(self, mutant: Mutant, tests: Sequence[str], limit: float) -> Outcome:
        """Make the change, run the tests in this order until one fails, and take the change back."""
        begun = time.monotonic()
        with self._changed(mutant) as kernels:
            code, output = self._tests(tests, kernels, limit)
        if code == NO_TESTS:
            raise TreeError("no tests were found")
        fault = FAULT.search(output)
        by = "" if code == PASSED else "time limit" if code is None else fault[1] if fault else f"exit code {code}"
        return Outcome(mutant, code != PASSED, by, time.monotonic() - begun)

    @contextmanager
    def _changed(self, mutant: Mutant) -> Iterator[Path]:
        """The copy with the change; gives the folder for its compiled kernels."""
        path = self._tree / mutant.path
        original = path.read_bytes()
        in_kernels = path in kernel_cache.kernel_sources(self._tree)
        before = self._digest()
        path.write_bytes(mutant.applied(original))
        try:
            if in_kernels:  # a folder of its own, without what the change can reach
                kept = self._spare / self._digest()
                shutil.copytree(self._kernels / before, kept)
                for one in (path, *self._kernel_files_that_import(path)):
                    for index in kept.glob(f"{one.parent.name}_*/{one.stem}.*.nbi"):
                        index.unlink()  # numba looks at the file of a kernel, not at what is compiled into it
            yield self._spare if in_kernels else self._kernels
        finally:
            path.write_bytes(original)
            shutil.rmtree(self._spare, ignore_errors=True)

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

    def _tests(self, tests: Sequence[str], kernels: Path, limit: float) -> tuple[int | None, str]:
        options = ["-x", "-q", "-rfE", "--tb=no", "--no-header", "-p", "no:cacheprovider", "--hypothesis-seed=0"]
        return self._python(["-m", "pytest", *options, *self._deselected, *tests], kernels, limit)

    def _python(self, words: Sequence[str], kernels: Path, limit: float) -> tuple[int | None, str]:
        """Run Python in the copy; its exit code (None past the limit, s) and what it printed."""
        own = {
            "NUMBA_CACHE_DIR": str(kernels),
            "PYTHONDONTWRITEBYTECODE": "1",  # a change within one second and of one length would go unseen
            "HYPOTHESIS_STORAGE_DIRECTORY": str(self._spare / "hypothesis"),
            **{f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")},
        }
        process = subprocess.Popen(
            [sys.executable, *words], cwd=self._tree, env={**os.environ, **own}, stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace", start_new_session=True,
        )  # fmt: skip
        try:
            resource.prlimit(process.pid, resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
            output, _ = process.communicate(timeout=limit)
        except subprocess.TimeoutExpired:
            return None, ""
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)  # a session of its own, with all that the tests started
                process.communicate()
        return process.returncode, output
