"""Which mutations a source has, and that each is one change that compiles."""

from __future__ import annotations

import ast

import pytest

from tests.house.rules import sources
from tests.tools.mutants import Mutant, mutants, shuffled

PATH = "pipeline/filter/one.py"


def changes(source: str, kind: str | None = None) -> set[tuple[str, str]]:
    return {(one.before, one.after) for one in mutants(PATH, source.encode()) if kind in (None, one.kind)}


@pytest.mark.parametrize(
    ("source", "kind", "expected"),
    [
        ("x = a + b * c\n", "operator", {("a + b * c", "(a - b * c)"), ("b * c", "(b / c)")}),
        ("x = not a and ~b\n", "operator", {("not a and ~b", "(not a or ~b)"), ("not a", "(a)"), ("~b", "(b)")}),
        ("x = a < b\n", "comparison", {("a < b", "(a <= b)"), ("a < b", "(a >= b)")}),
        ("x = a == b\n", "comparison", {("a == b", "(a != b)")}),
        ("x = 0 < a <= b\n", "comparison", {
            ("0 < a <= b", "(0 <= a <= b)"), ("0 < a <= b", "(0 >= a <= b)"),
            ("0 < a <= b", "(0 < a < b)"), ("0 < a <= b", "(0 < a > b)"),
        }),
        ("x = [3, 2.5, 0.0, True, 'word']\n", "constant",
         {("3", "4"), ("2.5", "5.0"), ("0.0", "1.0"), ("True", "False")}),
        ("x = np.maximum(min(a, b), c)\n", "operator", {("np.maximum", "np.minimum"), ("min", "max")}),
        ("if a:\n    x = 1\n", "condition", {("a", "(not (a))")}),
        ("x |= a\n", "operator", {("x |= a", "x &= a")}),
    ],
)  # fmt: skip
def test_expressions(source: str, kind: str, expected: set[tuple[str, str]]) -> None:
    assert changes(source, kind) == expected


def test_what_says_nothing_of_what_code_does_is_left_alone() -> None:
    assert changes('def f(a: A[1] = b) -> A[2]:\n    """3"""\n    return f"{a + 1}"\n') == set()
    assert changes("@decorated(slots=True)\nclass A:\n    b: C[1]\n") == set()


def test_statements_are_dropped_where_that_is_no_mere_want_of_a_name() -> None:
    source = "def f(a):\n    b = g(a)\n    a = b\n    a[0] = b\n    h(a)\n    a.c += b\n    b, d = a\n    return d\n"
    dropped = {before for before, after in changes(source, "statement") if after == "pass"}
    assert dropped == {"a = b", "a[0] = b", "h(a)", "a.c += b"}


def test_early_returns_are_dropped_and_put_in() -> None:
    guarded = "def f(a):\n    if a:\n        return 1\n    return 2\n"
    assert changes(guarded, "return") == {("return 1", "pass")}
    silent = 'def f(a):\n    """Text."""\n    a.b()\n    a.c()\n'
    assert changes(silent, "return") == {("(begin)", "return")}
    made = next(one for one in mutants(PATH, silent.encode()) if one.kind == "return").applied(silent.encode())
    assert made.decode() == 'def f(a):\n    """Text."""\n    return\n    a.b()\n    a.c()\n'


def test_places_are_right_behind_letters_of_several_bytes_and_over_lines() -> None:
    source = 'x = "éé"; y = (a +\n    b)\n'.encode()
    (one,) = mutants(PATH, source)
    assert one.applied(source).decode() == 'x = "éé"; y = ((a - b))\n'
    assert (one.line, one.before) == (1, "a + b")


def test_names_tell_apart_and_do_not_depend_on_other_lines() -> None:
    line = "class A:\n    def f(self):\n        return self.a[0, 0]\n"
    names = [one.name for one in mutants(PATH, line.encode())]
    assert names == [
        f"{PATH} A.f: 0 -> 1 in `return self.a[0, 0]`",
        f"{PATH} A.f: 0 -> 1 in `return self.a[0, 0]` #2",
    ]
    assert [one.name for one in mutants(PATH, b"import b\n\n" + line.encode())] == names


def test_a_sample_is_seeded_and_outlasts_changes_elsewhere() -> None:
    few = mutants(PATH, b"x = [1, 2, 3, 4, 5, 6, 7, 8]\n")
    more = [*mutants("pipeline/filter/two.py", b"y = [1, 2, 3]\n"), *few]
    assert shuffled(few, 1) == shuffled(few[::-1], 1)
    assert shuffled(few, 1) != shuffled(few, 2)
    assert [one for one in shuffled(more, 1) if one in few] == shuffled(few, 1)


ROOMS = sources("pipeline/lifecycle", "pipeline/group")


@pytest.mark.parametrize("path", ROOMS)
def test_every_mutation_of_real_files_changes_one_place_and_compiles(path: str) -> None:
    source = ROOMS[path].encode()
    found = mutants(path, source)
    assert len({one.name for one in found}) == len(found)
    before = ast.dump(ast.parse(source))
    for one in found:
        made = one.applied(source)
        assert ast.dump(ast.parse(made)) != before
        assert made.startswith(source[: one.start])
        assert made.endswith(source[one.stop :])


def test_real_files_have_many() -> None:
    found: list[Mutant] = [one for path, text in ROOMS.items() for one in mutants(path, text.encode())]
    assert len(found) > 300
    assert {one.kind for one in found} == {"operator", "comparison", "constant", "condition", "statement", "return"}
