"""The command that tries mutations, on a project of a few lines."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from tests.tools import mutation, mutation_trees
from tests.tools.mutants import Mutant, mutants
from tests.tools.mutation import ROOT, document, equivalents, sample
from tests.tools.mutation_trees import KILLED, RAN_AWAY, SURVIVED, Outcome, Tree, TreeError, Unchanged

pytestmark = pytest.mark.slow

KERNELS = "from pipeline.kernels.compiled import allocating\n"
FILES = {
    "pyproject.toml": "",
    "tests/conftest.py": "import app\n",
    "tests/__init__.py": "",
    "tests/tools/__init__.py": "",
    "app/ingest/socket_kernel.py": "",
    "pipeline/__init__.py": "",
    "pipeline/filter/plain.py": "def add(a, b):\n    c = a * 0\n    return a + b\n",
    "pipeline/filter/endless.py": "def count(n):\n    k = 0\n    while k < n:\n        k += 1\n    return k\n",
    "pipeline/filter/inner.py": KERNELS + "@allocating\ndef inner(a):\n    return a + 1.0\n",
    "pipeline/track/outer.py": KERNELS
    + "from pipeline.filter.inner import inner\n@allocating\ndef outer(a):\n    return inner(a) * 3.0\n",
    "tests/pipeline/filter/test_plain.py": "from pipeline.filter.plain import add\n"
    "def test_add():\n    assert add(1, 2) == 3\n",
    "tests/pipeline/track/test_outer.py": "from pipeline.track.outer import outer\n"
    "from numba import config\n"
    "def test_outer():\n    assert outer(1.0) == 6.0 and not config.DISABLE_JIT\n",
    "tests/pipeline/filter/test_endless.py": "import pytest\nfrom pipeline.filter.endless import count\n"
    "@pytest.mark.parametrize('n', [3, 4, 5])\n"
    "def test_count(n):\n    assert count(n) == n\n"
    "def test_nothing():\n    assert count(0) == 0\n"
    "def test_much():\n    assert count(10**6) == 10**6\n",
}
PLAIN = "tests/pipeline/filter/test_plain.py"
OUTER = "tests/pipeline/track/test_outer.py"
ENDLESS = "tests/pipeline/filter/test_endless.py"
TESTS = [PLAIN, OUTER, ENDLESS]
TRACKER = mutation.SUITES["tracker"]
LIMIT = 240.0


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("project")
    for name, text in FILES.items():
        (made / name).parent.mkdir(parents=True, exist_ok=True)
        (made / name).write_text(text)
    for name in (
        "app/__init__.py",
        "app/kernel_cache.py",
        "pipeline/kernels/compiled.py",
        "tests/tools/mutation_watch.py",
    ):
        (made / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, made / name)
    return made


@pytest.fixture(scope="module")
def tree(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Tree:
    return Tree(root, tmp_path_factory.mktemp("copies"))


def proven(tree: Tree, files: list[str]) -> Unchanged:
    return Unchanged(tree.without_compiler(files, LIMIT), tree.with_compiler(files, LIMIT))


@pytest.fixture(scope="module")
def unchanged(tree: Tree) -> Unchanged:
    return proven(tree, TESTS)


def one_of(path: str, before: str, after: str) -> Mutant:
    found = [one for one in mutants(path, FILES[path].encode()) if (one.before, one.after) == (before, after)]
    assert len(found) == 1
    return found[0]


def test_what_fails_or_is_slow_without_the_compiler_is_left_to_the_round_with_it(
    tree: Tree, unchanged: Unchanged, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert unchanged.slow == {f"{OUTER}::test_outer"}
    assert len(unchanged.quick) == 6
    assert all(0 <= seconds < 60 for seconds in (*unchanged.quick.values(), *unchanged.every.values()))
    monkeypatch.setattr(mutation_trees, "QUICK_S", 0.01)
    assert f"{ENDLESS}::test_much" not in tree.without_compiler([ENDLESS], LIMIT)


def test_what_the_tests_notice_is_killed_by_the_test_that_failed(tree: Tree, unchanged: Unchanged) -> None:
    outcome = tree.attempt(one_of("pipeline/filter/plain.py", "a + b", "(a - b)"), TESTS, unchanged)
    assert outcome.killed
    assert outcome.by == f"{PLAIN}::test_add"


def test_what_they_do_not_notice_survives_and_nothing_stays_behind(
    tree: Tree, unchanged: Unchanged, root: Path
) -> None:
    outcome = tree.attempt(one_of("pipeline/filter/plain.py", "0", "1"), TESTS, unchanged)
    assert (outcome.killed, outcome.verdict, outcome.by) == (False, SURVIVED, "")
    for name, text in FILES.items():
        assert (root / name).read_text() == text


def test_a_change_of_the_same_length_within_the_same_second_is_seen(tree: Tree, unchanged: Unchanged) -> None:
    source = FILES["pipeline/filter/plain.py"]
    start = source.index("a + b")
    for operator in "-*+|":
        change = replace(one_of("pipeline/filter/plain.py", "a + b", "(a - b)"), start=start, text=f"a {operator} b")
        assert tree.attempt(change, TESTS, unchanged).killed is (operator in "-*")  # 1 + 2 == 1 | 2


def test_a_source_that_cannot_be_imported_is_killed(tree: Tree, unchanged: Unchanged) -> None:
    change = replace(one_of("pipeline/filter/plain.py", "0", "1"), start=0, stop=0, text="1 / 0\n")
    outcome = tree.attempt(change, TESTS, unchanged)
    assert (outcome.verdict, outcome.by) == (KILLED, PLAIN)


def test_a_kernel_compiled_into_a_kernel_of_another_file_is_compiled_anew(tree: Tree, unchanged: Unchanged) -> None:
    change = one_of("pipeline/filter/inner.py", "a + 1.0", "(a - 1.0)")
    outcome = tree.attempt(change, TESTS, unchanged)
    assert outcome.killed
    assert outcome.by == f"{OUTER}::test_outer"
    same = one_of("pipeline/filter/plain.py", "0", "1")
    assert not tree.attempt(same, TESTS, unchanged).killed  # the change is taken back, its kernels too


def test_what_runs_away_is_not_killed_but_timed_out(
    tree: Tree, unchanged: Unchanged, monkeypatch: pytest.MonkeyPatch
) -> None:
    endless = one_of("pipeline/filter/endless.py", "k += 1", "k -= 1")
    monkeypatch.setattr(mutation_trees, "LATE_S", 0.5)
    outcome = tree.attempt(endless, [ENDLESS], unchanged)
    assert (outcome.killed, outcome.verdict, outcome.by) == (False, RAN_AWAY, f"{ENDLESS}::test_count[4]")
    monkeypatch.setattr(mutation_trees, "STARTING_S", 0.5)
    outcome = tree.attempt(endless, [ENDLESS], unchanged)
    assert (outcome.killed, outcome.verdict) == (False, RAN_AWAY)


def test_a_late_test_hides_no_failure(tree: Tree, unchanged: Unchanged, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mutation_trees, "LATE_S", 0.5)
    one_late = replace(unchanged, quick={f"{ENDLESS}::test_count[3]": 0.0, f"{ENDLESS}::test_nothing": 0.0})
    change = replace(
        one_of("pipeline/filter/endless.py", "k += 1", "k -= 1"), stop=len(FILES["pipeline/filter/endless.py"]),
        text="k -= 1\n    return k + 1\n",
    )  # fmt: skip
    outcome = tree.attempt(change, [ENDLESS], one_late)
    assert (outcome.verdict, outcome.by) == (KILLED, f"{ENDLESS}::test_nothing")


def test_a_project_whose_tests_fail_unchanged_is_refused(root: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken"
    shutil.copytree(root, broken)
    (broken / PLAIN).write_text("def test_add():\n    assert False\n")
    with pytest.raises(TreeError, match="do not pass on unchanged"):
        Tree(broken, tmp_path / "copies").with_compiler([PLAIN], LIMIT)


def test_kernels_of_the_same_sources_elsewhere_are_taken_over(
    tree: Tree, unchanged: Unchanged, root: Path, tmp_path: Path
) -> None:
    other = Tree(root, tmp_path)
    tree.give_kernels(other)
    given = sorted((one.parent.name[:6], one.name, one.stat().st_mtime) for one in tmp_path.rglob("*.nbi"))
    assert len(given) == 2
    assert OUTER in str(other.with_compiler([OUTER], LIMIT))
    after = sorted((one.parent.name[:6], one.name, one.stat().st_mtime) for one in tmp_path.rglob("*.nbi"))
    assert after == given  # nothing was compiled


def test_the_tests_named_after_the_source_come_first_then_those_of_its_room() -> None:
    found = one_of("pipeline/filter/plain.py", "0", "1")
    room = "tests/pipeline/filter"
    files = ["tests/pipeline/track/test_plain.py", f"{room}/test_other.py", f"{room}/test_plain.py"]
    assert mutation.tests_for(found, files, {}) == [files[2], files[1], files[0]]


def test_of_the_others_the_shortest_come_first() -> None:
    found = one_of("pipeline/filter/plain.py", "0", "1")
    files = [f"tests/pipeline/track/test_{one}.py" for one in "abc"]
    seconds = {f"{files[0]}::x": 3.0, f"{files[0]}::y": 3.0, f"{files[1]}::x": 5.0, f"{files[2]}::x": 1.0}
    assert mutation.tests_for(found, files, seconds) == [files[2], files[1], files[0]]


def test_all_tests_named_are_there(root: Path) -> None:
    for suite in mutation.SUITES.values():
        assert all((ROOT / one).exists() for one in (*suite.rooms, *suite.tests))
    assert "tests/pipeline/track/test_store.py" in mutation.files_of_tests(TRACKER)
    assert "tests/app/live/test_live.py" in mutation.files_of_tests(mutation.SUITES["service"])
    assert mutation.files_of_tests(TRACKER, root) == [OUTER, ENDLESS, PLAIN]


def test_a_deselected_test_is_not_run(root: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken"
    shutil.copytree(root, broken)
    with (broken / PLAIN).open("a") as file:
        file.write("def test_that_fails():\n    assert False\n")
    tree = Tree(broken, tmp_path / "copies", [f"{PLAIN}::test_that_fails"])
    unchanged = proven(tree, [PLAIN])
    assert unchanged.every.keys() == unchanged.quick.keys() == {f"{PLAIN}::test_add"}
    assert tree.attempt(one_of("pipeline/filter/plain.py", "a + b", "(a - b)"), [PLAIN], unchanged).killed


def test_equivalent_ones_are_set_aside_and_others_take_their_place() -> None:
    every = mutants("pipeline/filter/one.py", b"x = [1, 2, 3, 4, 5, 6]\n")
    first = sample(every, (), seed=1, size=3)
    second = sample(every, [first[0].name], seed=1, size=3)
    assert second[:2] == first[1:]
    assert len(second) == 3
    assert [one.before for one in sample(every, (), 1, 9, only="4 -> 5")] == ["4"]


def test_equivalent_ones_need_a_reason(tmp_path: Path) -> None:
    file = tmp_path / "equivalent.toml"
    file.write_text('[[equivalent]]\nname = "a"\nreason = "b"\n')
    assert equivalents(file) == {"a": "b"}
    file.write_text('[[equivalent]]\nname = "a"\nreason = " "\n')
    with pytest.raises(ValueError, match="no reason"):
        equivalents(file)
    assert isinstance(equivalents(mutation.EQUIVALENT), dict)


def test_names_that_are_gone_are_told(root: Path) -> None:
    every = mutation.all_mutants(TRACKER.rooms, root)
    there = one_of("pipeline/filter/plain.py", "0", "1").name
    assert there in {one.name for one in every}
    assert mutation.gone([there, "pipeline/filter/plain.py add: 1 -> 2 in `old`"], every) == [
        "pipeline/filter/plain.py add: 1 -> 2 in `old`"
    ]


def test_the_document_says_what_was_killed_where_and_by_what() -> None:
    killed, left, late = mutants("pipeline/filter/one.py", b"x = [1, 2, 3]\n")
    outcomes = [Outcome(killed, KILLED, "tests/a.py::b", 1.0), Outcome(left, SURVIVED, "", 2.0)]
    found = document([*outcomes, Outcome(late, RAN_AWAY, "tests/a.py::c", 3.0)], 7)
    assert (found["seed"], found["sample"], found["killed"], found["timed_out"]) == (7, 3, 1, 1)
    assert found["share"] == pytest.approx(1 / 3)  # what timed out does not count as killed
    assert found["rows"][0]["place"] == "pipeline/filter/one.py:1"
    assert [row["killed"] for row in found["rows"]] == [True, False, False]
    assert [row["verdict"] for row in found["rows"]] == ["killed", "survived", "timed out"]
    assert [row["by"] for row in found["rows"]] == ["tests/a.py::b", "", "tests/a.py::c"]


def test_the_list_of_a_sample_is_printed_without_trying_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert mutation.main(["tracker", "--list", "--sample", "4", "--rooms", "pipeline/lifecycle"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 4
    assert all(line.startswith("pipeline/lifecycle/") for line in lines)
    assert mutation.main(["tracker", "--rooms", "pipeline/lifecycle", "--only", "nothing is called so"]) == 2
    assert mutation.main(["tracker", "--rooms", "app/live"]) == 2
    assert "app/live: not a folder of this suite (pipeline/track, " in capsys.readouterr().err
