"""The rules of the house that a machine can check."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ALLOWED_IN_THE_CORE = {
    "__future__", "abc", "collections", "copy", "dataclasses", "difflib", "enum", "functools", "heapq", "importlib",
    "itertools", "math", "pkgutil", "re", "struct", "types", "typing", "bisect", "operator", "zlib", "string",
    "unicodedata", "numpy", "scipy", "numba", "llvmlite", "filterpy", "shapely", "pyproj", "networkx", "pipeline",
}  # fmt: skip
FOR_ONE_FILE = {"pipeline/kernels/compiled.py": {"uuid"}}
"""What one file may import besides, for the names of files that numba writes."""

NUMERICS = {"scipy", "numba", "filterpy"}


def imported(path: Path) -> set[str]:
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            found.add(node.module.split(".")[0])
    return found


@pytest.mark.parametrize("path", sorted((ROOT / "pipeline").rglob("*.py")), ids=str)
def test_the_core_imports_nothing_of_the_world(path: Path) -> None:
    assert imported(path) <= ALLOWED_IN_THE_CORE | FOR_ONE_FILE.get(path.relative_to(ROOT).as_posix(), set())


@pytest.mark.parametrize("path", sorted((ROOT / "app").rglob("*.py")), ids=str)
def test_the_shell_holds_no_numerics(path: Path) -> None:
    if path.relative_to(ROOT).as_posix() == "app/ingest/socket_kernel.py":
        return  # numba serves there to receive datagrams without the interpreter's lock, not to calculate
    assert not imported(path) & NUMERICS


def test_the_lock_names_no_host() -> None:
    for lock in ROOT.glob("requirements*.lock"):
        assert "://" not in lock.read_text()
