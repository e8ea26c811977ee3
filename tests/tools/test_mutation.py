"""The command that tries mutations, on a project of a few lines."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.tools import mutation
from tests.tools.mutants import Mutant, mutants
from tests.tools.mutation import ROOT, document, equivalents, sample
from tests.tools.mutation_trees import Outcome, Tree, TreeError

pytestmark = pytest.mark.slow

KERNELS = "from pipeline.kernels.compiled import allocating\n"
FILES = {
    "pyproject.toml": "",
    "tests/conftest.py": "import app\n",
    "app/ingest/socket_kernel.py": "",
    "pipeline/__init__.py": "",
    "pipeline/filter/plain.py": "def add(a, b):\n    c = a * 0\n    return a + b\n",
    "pipeline/filter/inner.py": KERNELS + "@allocating\ndef inner(a):\n    return a + 1.0\n",
    "pipeline/track/outer.py": KERNELS
    + "from pipeline.filter.inner import inner\n@allocating\ndef outer(a):\n    return inner(a) * 3.0\n",
    "tests/pipeline/filter/test_plain.py": "from pipeline.filter.plain import add\n"
    "def test_add():\n    assert add(1, 2) == 3\n",
    "tests/pipeline/track/test_outer.py": "from pipeline.track.outer import outer\n"
    "def test_outer():\n    assert outer(1.0) == 6.0\n",
}
TESTS = ["tests/pipeline/filter", "tests/pipeline/track"]
LIMIT = 240.0


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("project")
    for name, text in FILES.items():
        (made / name).parent.mkdir(parents=True, exist_ok=True)
        (made / name).write_text(text)
    for name in ("app/__init__.py", "app/kernel_cache.py", "pipeline/kernels/compiled.py"):
        (made / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, made / name)
    return made


@pytest.fixture(scope="module")
def tree(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Tree:
    made = Tree(root, tmp_path_factory.mktemp("copies"))
    assert made.prove(TESTS, LIMIT) > 0
    return made


def one_of(path: str, before: str, after: str) -> Mutant:
    found = [one for one in mutants(path, FILES[path].encode()) if (one.before, one.after) == (before, after)]
    assert len(found) == 1
    return found[0]


def test_what_the_tests_notice_is_killed_by_the_test_that_failed(tree: Tree) -> None:
    outcome = tree.attempt(one_of("pipeline/filter/plain.py", "a + b", "(a - b)"), TESTS, LIMIT)
    assert outcome.killed
    assert outcome.by == "tests/pipeline/filter/test_plain.py::test_add"


def test_what_they_do_not_notice_survives_and_nothing_stays_behind(tree: Tree, root: Path) -> None:
    outcome = tree.attempt(one_of("pipeline/filter/plain.py", "0", "1"), TESTS, LIMIT)
    assert (outcome.killed, outcome.by) == (False, "")
    for name, text in FILES.items():
        assert (root / name).read_text() == text


def test_a_kernel_compiled_into_a_kernel_of_another_file_is_compiled_anew(tree: Tree) -> None:
    change = one_of("pipeline/filter/inner.py", "a + 1.0", "(a - 1.0)")
    outcome = tree.attempt(change, TESTS, LIMIT)
    assert outcome.killed
    assert outcome.by == "tests/pipeline/track/test_outer.py::test_outer"
    unchanged = one_of("pipeline/filter/plain.py", "0", "1")
    assert not tree.attempt(unchanged, TESTS, LIMIT).killed  # the change is taken back, its kernels too


def test_what_takes_too_long_is_killed(tree: Tree) -> None:
    outcome = tree.attempt(one_of("pipeline/filter/plain.py", "0", "1"), TESTS, 0.05)
    assert (outcome.killed, outcome.by) == (True, "time limit")


def test_a_project_whose_tests_fail_unchanged_is_refused(root: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken"
    shutil.copytree(root, broken)
    (broken / "tests/pipeline/filter/test_plain.py").write_text("def test_add():\n    assert False\n")
    with pytest.raises(TreeError, match="do not pass on unchanged"):
        Tree(broken, tmp_path / "copies").prove(TESTS[:1], LIMIT)


def test_the_tests_named_after_the_source_come_first_then_those_of_its_room() -> None:
    found = one_of("pipeline/filter/plain.py", "0", "1")
    room = "tests/pipeline/filter"
    files = ["tests/pipeline/track/test_plain.py", f"{room}/test_other.py", f"{room}/test_plain.py"]
    assert mutation.tests_for(found, files) == [files[2], files[1], files[0]]


def test_all_tests_named_are_there(root: Path) -> None:
    assert all((ROOT / one).exists() for one in mutation.TESTS)
    assert "tests/pipeline/track/test_store.py" in mutation.files_of_tests()
    assert mutation.files_of_tests(root) == [
        "tests/pipeline/track/test_outer.py", "tests/pipeline/filter/test_plain.py"
    ]  # fmt: skip


def test_a_deselected_test_is_not_run(root: Path, tmp_path: Path) -> None:
    name = "tests/pipeline/filter/test_plain.py"
    broken = tmp_path / "broken"
    shutil.copytree(root, broken)
    with (broken / name).open("a") as file:
        file.write("def test_that_fails():\n    assert False\n")
    tree = Tree(broken, tmp_path / "copies", [f"{name}::test_that_fails"])
    assert tree.prove([name], LIMIT) > 0
    assert tree.attempt(one_of("pipeline/filter/plain.py", "a + b", "(a - b)"), [name], LIMIT).killed


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
    there = one_of("pipeline/filter/plain.py", "0", "1").name
    assert mutation.gone([there, "pipeline/filter/plain.py add: 1 -> 2 in `old`"], root) == [
        "pipeline/filter/plain.py add: 1 -> 2 in `old`"
    ]


def test_the_document_says_what_was_killed_where_and_by_what() -> None:
    killed, left = mutants("pipeline/filter/one.py", b"x = [1, 2]\n")
    found = document([Outcome(killed, True, "tests/a.py::b", 1.0), Outcome(left, False, "", 2.0)], 7)
    assert (found["seed"], found["sample"], found["killed"], found["share"]) == (7, 2, 1, 0.5)
    assert found["rows"][0]["place"] == "pipeline/filter/one.py:1"
    assert [row["killed"] for row in found["rows"]] == [True, False]
    assert [row["by"] for row in found["rows"]] == ["tests/a.py::b", ""]


def test_the_list_of_a_sample_is_printed_without_trying_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert mutation.main(["--list", "--sample", "4", "--rooms", "lifecycle"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 4
    assert all(line.startswith("pipeline/lifecycle/") for line in lines)
    assert mutation.main(["--only", "nothing is called so"]) == 2
