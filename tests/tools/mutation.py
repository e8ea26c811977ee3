"""Mutation testing: do the tests of a part of the program notice when one thing in it is changed?

    python -m tests.tools.mutation tracker --sample 60 --seed 1 --jobs 2 --json mutants.json

takes a seeded sample of single mutations of the folders of a suite (SUITES: tracker, service), tries each in a copy of
the project, and says which were killed and which survived. A survivor is a hole in the tests, or does the same
as the original: those are set aside by name, with the reason, in tests/tools/equivalent_mutants.toml.

To compile the kernels anew for each mutant would take most of the time, so it is tried in two rounds. Before them, the
tests run on unchanged sources: all must pass with the compiler (numba); those that also pass without it, within a
second of processor time, are the quick ones. First round: the quick tests, without the compiler, those of the mutant's
source first, then those of its room, then the others, the shortest first. Second round, only for what survives the
first: the remaining tests and again those of the mutant's source, with the compiler.

A mutant is killed when a test fails that passes in the same way on unchanged sources, and also when its sources cannot
be imported or the process crashes. Where only time ran out it is "timed out", which does not count as killed. Without
the compiler an index beyond an array raises an error; with it, such a mutant may read some other number and survive.
"""

from __future__ import annotations

import argparse
import json
import os
import queue
import sys
import tempfile
import time
import tomllib
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from app.output_files import check_writable
from tests.tools.mutants import Mutant, mutants, shuffled
from tests.tools.mutation_trees import RAN_AWAY, SURVIVED, Outcome, Tree, TreeError, Unchanged

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Suite:
    """rooms: folders that are mutated. more_tests: what a mutation is held against beside the tests of these folders,
    those that take longest at the end."""

    rooms: tuple[str, ...]
    more_tests: tuple[str, ...]

    @property
    def tests(self) -> tuple[str, ...]:
        """Folders and files of tests."""
        return (*(there for room in self.rooms if (ROOT / (there := f"tests/{room}")).exists()), *self.more_tests)


SUITES = {
    "tracker": Suite(
        tuple(f"pipeline/{room}" for room in ("track", "filter", "associate", "lifecycle", "group")),
        ("tests/pipeline/test_engine.py", "tests/proof"),
    ),
    "service": Suite(
        ("pipeline/alert", "pipeline/situation", "app/live", "app/api", "app/ingest"),
        ("tests/app/test_wire.py", "tests/app/test_service_contract.py"),
    ),
}

EQUIVALENT = Path(__file__).with_name("equivalent_mutants.toml")

FIRST_LIMIT_S = 1800.0
"""Processor time for the tests of the unchanged sources, with all kernels to compile."""


def main(words: Sequence[str] | None = None) -> int:
    """Run the command; 0, 1 when fewer were killed than --least wants, 2 when it cannot be done, 130 when stopped."""
    options = _parser().parse_args(words)
    try:
        suite = SUITES[options.suite]
        if unknown := set(options.rooms or ()) - set(suite.rooms):
            raise ValueError(f"{', '.join(sorted(unknown))}: not a folder of this suite ({', '.join(suite.rooms)})")
        rooms = tuple(options.rooms or suite.rooms)
        every, aside = all_mutants(rooms), equivalents(EQUIVALENT)
        for name in gone((name for name in aside if name.startswith(tuple(f"{room}/" for room in rooms))), every):
            print(f"set aside, but not there any more: {name}", file=sys.stderr)
        chosen = sample(every, aside, options.seed, options.sample, options.only)
        if options.list:
            print("\n".join(one.name for one in chosen))
            return 0
        if not chosen:
            raise ValueError("no mutation has such a name")
        print(f"{len(chosen)} of {len(every):,} mutations, seed {options.seed}", flush=True)
        if options.json is not None:
            check_writable(options.json)
        outcomes = try_all(chosen, suite, options.jobs, options.deselect)
    except (TreeError, ValueError, OSError) as error:
        print(f"mutation: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("mutation: stopped; nothing is written", file=sys.stderr)
        return 130
    found = document(outcomes, options.seed)
    print("\n".join(_summary(outcomes, found)))
    if options.json is not None:
        options.json.write_text(json.dumps(found, indent=2, ensure_ascii=False) + "\n")
    return int(found["share"] < options.least)


def all_mutants(rooms: Iterable[str], root: Path = ROOT) -> list[Mutant]:
    """Every mutation of these folders."""
    files = [path for room in rooms for path in sorted((root / room).rglob("*.py"))]
    return [one for path in files for one in _mutants(path.relative_to(root).as_posix(), path.read_bytes())]


@cache
def _mutants(path: str, source: bytes) -> tuple[Mutant, ...]:
    """Those of one file, found once: finding those of all rooms takes some fifteen seconds."""
    return tuple(mutants(path, source))


def equivalents(path: Path) -> dict[str, str]:
    """Names of mutations that change nothing, with the reasons. Raises ValueError for one without a reason."""
    listed = tomllib.loads(path.read_text()).get("equivalent", [])
    for one in listed:
        if not (one.get("name") and str(one.get("reason", "")).strip()):
            raise ValueError(f"{path.name}: {one.get('name', 'an entry')!r} has no name or no reason")
    return {one["name"]: one["reason"] for one in listed}


def gone(aside: Iterable[str], every: Iterable[Mutant]) -> list[str]:
    """Names set aside that no mutation bears any more: what they spoke of has changed, and so may the reason have."""
    there = {one.name for one in every}
    return [name for name in aside if name not in there]


def sample(
    every: Sequence[Mutant], aside: Iterable[str], seed: int, size: int, only: str | None = None
) -> list[Mutant]:
    """The first `size` in an order by chance, without those set aside; with `only`, those whose name holds it."""
    left = set(aside)
    fit = [one for one in shuffled(every, seed) if one.name not in left and (only is None or only in one.name)]
    return fit[:size]


def files_of_tests(suite: Suite, root: Path = ROOT) -> list[str]:
    """All files of a suite's tests that are there."""
    found = [path for one in suite.tests for path in ([root / one] if one.endswith(".py") else _tests_in(root / one))]
    return [path.relative_to(root).as_posix() for path in found if path.is_file()]


def tests_for(mutant: Mutant, files: Sequence[str], seconds: Mapping[str, float]) -> list[str]:
    """The test file named after the mutant's source, then those of its room, then all others, each the shortest first.

    seconds: of tests, by pytest's names of them.
    """
    source = Path(mutant.path)
    room = f"tests/{source.parent.as_posix()}/"
    took = defaultdict[str, float](float)
    for test, one in seconds.items():
        took[test.partition("::")[0]] += one
    return sorted(files, key=lambda one: (one != f"{room}test_{source.name}", not one.startswith(room), took[one]))


def _tests_in(folder: Path) -> list[Path]:
    return sorted(folder.rglob("test_*.py"))


def try_all(chosen: Sequence[Mutant], suite: Suite, jobs: int, deselected: Sequence[str] = ()) -> list[Outcome]:
    """Try each in one of `jobs` copies of the project and print what became of it; in the order given.

    deselected: tests that are left out, as they fail without a mutation.
    """
    with tempfile.TemporaryDirectory(prefix="airside-mutation-") as folder, ThreadPoolExecutor(jobs) as pool:
        files = files_of_tests(suite)
        trees = [Tree(ROOT, Path(folder).resolve() / str(k), deselected) for k in range(jobs)]
        unchanged = _prove(trees, files, pool)
        free = queue.SimpleQueue[Tree]()
        for tree in trees:
            free.put(tree)

        def attempt(mutant: Mutant) -> Outcome:
            tree = free.get()
            try:
                return tree.attempt(mutant, tests_for(mutant, files, unchanged.quick), unchanged)
            finally:
                free.put(tree)

        waiting = {pool.submit(attempt, one): k for k, one in enumerate(chosen)}
        outcomes: dict[int, Outcome] = {}
        try:
            for done in as_completed(waiting):
                outcomes[waiting[done]] = done.result()
                print(_line(done.result()), flush=True)
        finally:
            for one in waiting:
                one.cancel()  # nothing is left to cancel unless something went wrong or a person stopped it
    return [outcomes[k] for k in range(len(chosen))]


def _prove(trees: Sequence[Tree], files: Sequence[str], pool: ThreadPoolExecutor) -> Unchanged:
    """Run the tests on unchanged sources, with the compiler and without it, side by side where there are two copies."""
    begun = time.monotonic()
    trees[0].take_kernels(ROOT, Path(os.environ["NUMBA_CACHE_DIR"]).parent)  # set when app was imported
    every = pool.submit(trees[0].with_compiler, files, FIRST_LIMIT_S)
    quick = pool.submit(trees[-1].without_compiler, files, FIRST_LIMIT_S)
    unchanged = Unchanged(quick=quick.result(), every=every.result())
    for tree in trees[1:]:
        trees[0].give_kernels(tree)
    print(
        f"unchanged, {len(unchanged.every):,} tests pass in {sum(unchanged.every.values()):.0f} s with the compiler, "
        f"{len(unchanged.quick):,} are quick without it, {sum(unchanged.quick.values()):.0f} s "
        f"({time.monotonic() - begun:.0f} s)",
        flush=True,
    )
    return unchanged


def document(outcomes: Sequence[Outcome], seed: int) -> dict[str, Any]:
    """What became of them, as JSON has it."""
    killed = sum(one.killed for one in outcomes)
    return {
        "seed": seed,
        "sample": len(outcomes),
        "killed": killed,
        "timed_out": sum(one.verdict == RAN_AWAY for one in outcomes),
        "share": killed / len(outcomes),
        "rows": [
            {
                "name": one.mutant.name,
                "place": f"{one.mutant.path}:{one.mutant.line}",
                "kind": one.mutant.kind,
                "before": one.mutant.before,
                "after": one.mutant.after,
                "killed": one.killed,
                "verdict": one.verdict,
                "by": one.by,
                "seconds": round(one.seconds, 1),
            }
            for one in outcomes
        ],
    }


def _line(one: Outcome) -> str:
    what = "SURVIVED" if one.verdict == SURVIVED else f"{one.verdict} by {one.by}"
    return f"{one.mutant.path}:{one.mutant.line} {_change(one.mutant)}: {what} ({one.seconds:.0f} s)"


def _change(mutant: Mutant) -> str:
    return f"{mutant.function or 'module'}: {mutant.before} -> {mutant.after}"


def _summary(outcomes: Sequence[Outcome], found: dict[str, Any]) -> list[str]:
    left = [one for one in outcomes if not one.killed]
    lines = ["", *(f"{one.verdict}: {one.mutant.name} (line {one.mutant.line})" for one in left)]
    late = f", {found['timed_out']} timed out" if found["timed_out"] else ""
    return [*lines, f"{found['killed']} of {found['sample']} killed, {found['share']:.1%}{late}"]


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        "python -m tests.tools.mutation", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("suite", choices=sorted(SUITES), help="what is mutated")
    parser.add_argument("--sample", type=_positive, default=60, help="mutations to try (60)")
    parser.add_argument("--seed", type=int, default=1, help="of the sample; the same seed takes the same (1)")
    parser.add_argument("--jobs", type=_positive, default=1, help="copies of the project that work side by side (1)")
    parser.add_argument("--rooms", nargs="+", metavar="FOLDER", help="folders of the suite, as app/live (all)")
    parser.add_argument("--only", metavar="TEXT", help="only mutations whose name holds this text")
    parser.add_argument(
        "--deselect", action="append", default=[], metavar="TEST", help="leave out a test, as pytest does; repeatable"
    )
    parser.add_argument("--list", action="store_true", help="print the names of the sample and try nothing")
    parser.add_argument("--least", type=float, default=0.0, help="exit with 1 when a smaller share is killed (0)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write what became of each as JSON")
    return parser


def _positive(word: str) -> int:
    value = int(word)
    if value < 1:
        raise argparse.ArgumentTypeError("must be at least 1")
    return value


if __name__ == "__main__":
    sys.exit(main())
