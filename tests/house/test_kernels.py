"""Every kernel goes through a decorator of pipeline/kernels/compiled.py and stands at module level."""

from __future__ import annotations

import ast

import pytest

from app.kernel_cache import ROOT, kernel_sources
from tests.house.rules import kernel_faults, kernels, sources

COMPILED = "pipeline/kernels/compiled.py"
FILES = {path: text for path, text in sources("pipeline", "app").items() if path != COMPILED}


@pytest.mark.parametrize("path", FILES)
def test_only_the_decorators_of_kernels_compile(path: str) -> None:
    assert kernel_faults(FILES[path], intrinsics=path.startswith("pipeline/kernels/")) == []


def test_the_rule_sees_the_kernels_there_are() -> None:
    found = {path: len(kernels(ast.parse(text))) for path, text in FILES.items()}
    assert sum(found.values()) > 100
    assert found["app/ingest/socket_kernel.py"] == 1
    assert found["pipeline/kernels/tiles.py"] == 4
    assert any("imports njit" in fault for fault in kernel_faults((ROOT / COMPILED).read_text()))


def test_the_kernel_cache_counts_every_file_with_a_kernel() -> None:
    counted = {path.relative_to(ROOT).as_posix() for path in kernel_sources()}
    assert {path for path, text in FILES.items() if kernels(ast.parse(text))} | {COMPILED} <= counted


GOOD = """
from pipeline.kernels.compiled import allocating, kernel as bare

@allocating
def one(a):
    return a + 1

@bare
def two(a):
    return one(a)

def usual(a):
    return [one(b) for b in a]
"""


def test_a_good_file_passes() -> None:
    assert kernel_faults(GOOD) == []
    assert [one.name for one in kernels(ast.parse(GOOD))] == ["one", "two"]


@pytest.mark.parametrize(
    ("source", "word"),
    [
        ("from numba import njit\n", "njit"),
        ("from numba import types, vectorize as v\n", "vectorize"),
        ("from numba import *\n", "*"),
        ("from numba.experimental import jitclass\n", "jitclass"),
        ("from numba.core.decorators import jit\n", "jit"),
        ("import numba\n\n@numba.njit(cache=True)\ndef one(a): ...\n", "njit"),
        ("import numba as nb\n\none = nb.guvectorize(str)\n", "guvectorize"),
        ("import numba\n\nmade = getattr(numba, 'njit')\n", "njit"),
        ("from numba import extending\n", "extending"),
        ("from numba.extending import intrinsic\n", "intrinsic"),
        ("import numba.extending\n", "extending"),
        ("from pipeline.kernels import compiled\n", "by name"),
        ("import pipeline.kernels.compiled as c\n", "by name"),
        (f"{GOOD}\nthree = allocating(usual)\n", "module level"),
        (f"{GOOD}\ndef make():\n    @allocating\n    def three(a): ...\n    return three\n", "module level"),
        (f"{GOOD}\nclass Part:\n    @bare\n    def three(a): ...\n", "module level"),
        (f"{GOOD}\n@allocating()\ndef three(a): ...\n", "module level"),
        (f"{GOOD}\n@allocating\ndef three(a):\n    def four(): ...\n    return four\n", "within the kernel three"),
        (f"{GOOD}\n@allocating\ndef three(a):\n    return sorted(a, key=lambda b: -b)\n", "within the kernel three"),
    ],
)
def test_what_is_refused(source: str, word: str) -> None:
    faults = kernel_faults(source)
    assert faults
    assert any(word in fault for fault in faults), faults


def test_intrinsics_are_for_the_room_of_kernels() -> None:
    source = "from numba import extending\nintrinsic = extending.intrinsic\n\n@intrinsic\ndef one(typing, a):\n"
    source += "    def build(context): ...\n    return a, build\n"
    assert kernel_faults(source, intrinsics=True) == []
    assert kernel_faults(source) != []
    assert kernel_faults("from numba import extending, njit\n", intrinsics=True) != []
