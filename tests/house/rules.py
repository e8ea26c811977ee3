"""What the rules of the house read in a source file. Each answers with the faults it found, in words."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping, Set
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

DECORATORS_OF_KERNELS = "pipeline.kernels.compiled"

COMPILERS = frozenset(
    {"njit", "jit", "vectorize", "guvectorize", "stencil", "cfunc", "generated_jit", "jit_module", "jitclass"}
)
"""What of numba compiles a function or class; `prange` and the like only mean something inside of one."""

Function = ast.FunctionDef | ast.AsyncFunctionDef


def sources(*rooms: str) -> dict[str, str]:
    """Every Python file below these folders of the project: its path from the root, and its text."""
    return {
        path.relative_to(ROOT).as_posix(): path.read_text()
        for room in rooms
        for path in sorted((ROOT / room).rglob("*.py"))
    }


def kernel_decorators(tree: ast.AST) -> set[str]:
    """The names by which the file calls the decorators of kernels."""
    return {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module == DECORATORS_OF_KERNELS
        for alias in node.names
    }


def kernels(tree: ast.Module) -> list[ast.FunctionDef]:
    """The functions at module level that numba compiles: kernels and intrinsics."""
    names = kernel_decorators(tree) | {"intrinsic"}
    return [
        node
        for node in tree.body
        if isinstance(node, ast.FunctionDef)
        and any(isinstance(one, ast.Name) and one.id in names for one in node.decorator_list)
    ]


def kernel_faults(source: str, intrinsics: bool = False) -> list[str]:
    """Why the kernels of a file are not as they should be. intrinsics: the file may hold some."""
    tree = ast.parse(source)
    return [*_compilers_used(tree, intrinsics), *_decorators_misused(tree), *_functions_within(tree)]


def _compilers_used(tree: ast.Module, intrinsics: bool) -> Iterator[str]:
    refused = COMPILERS if intrinsics else COMPILERS | {"extending", "intrinsic"}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "numba":
            named = {alias.name for alias in node.names} | set((node.module or "").split("."))
            yield from (f"line {node.lineno}: imports {name} of numba" for name in sorted(named & (refused | {"*"})))
        elif isinstance(node, ast.Import):
            named = {step for alias in node.names for step in alias.name.split(".")}
            yield from (f"line {node.lineno}: imports {name}" for name in sorted(named & refused))
        elif isinstance(node, ast.Attribute) and node.attr in refused:
            yield f"line {node.lineno}: uses {node.attr}"
        elif isinstance(node, ast.Call) and ast.unparse(node.func) == "getattr":
            words = {one.value for one in node.args if isinstance(one, ast.Constant) and isinstance(one.value, str)}
            yield from (f"line {node.lineno}: uses {name}" for name in sorted(words & refused))


def _decorators_misused(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        whole_module = isinstance(node, ast.Import) and any(one.name == DECORATORS_OF_KERNELS for one in node.names)
        from_room = isinstance(node, ast.ImportFrom) and f"{node.module}." == DECORATORS_OF_KERNELS[: -len("compiled")]
        if whole_module or (from_room and any(one.name == "compiled" for one in node.names)):
            yield f"line {node.lineno}: import the decorators by name, from {DECORATORS_OF_KERNELS}"
    names = kernel_decorators(tree)
    right = {
        id(one)
        for node in tree.body
        if isinstance(node, ast.FunctionDef)
        for one in node.decorator_list
        if isinstance(one, ast.Name)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and node.id in names and id(node) not in right:
            yield f"line {node.lineno}: {node.id} may only decorate a function at module level"


def _functions_within(tree: ast.Module) -> Iterator[str]:
    for kernel in kernels(tree):
        if any(isinstance(one, ast.Name) and one.id == "intrinsic" for one in kernel.decorator_list):
            continue  # it answers with the function that writes its code
        for node in ast.walk(kernel):
            if node is not kernel and isinstance(node, Function | ast.Lambda):
                yield f"line {node.lineno}: a function within the kernel {kernel.name}"


def rooms_imported(source: str) -> dict[str, int]:
    """The rooms of the core that a file imports ("detect", "engine"), each with a line; "." for a relative import."""
    found: dict[str, int] = {}
    for node in ast.walk(ast.parse(source)):
        modules: list[str] = []
        if isinstance(node, ast.Import):
            modules = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            modules = [f"{node.module}.{alias.name}" for alias in node.names] if not node.level else ["pipeline.."]
        elif isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] in ("import_module", "__import__"):
            modules = [one.value for one in node.args if isinstance(one, ast.Constant) and isinstance(one.value, str)]
        for module in modules:
            first, _, rest = module.partition(".")
            if first == "pipeline" and rest:
                found.setdefault(rest.split(".")[0] or ".", node.lineno)
    return found


def room_of(path: str) -> str:
    """The room of a file: "detect" of pipeline/detect/ca.py, "engine" of pipeline/engine.py."""
    return path.split("/")[1].removesuffix(".py")


def room_faults(path: str, source: str, rooms: Mapping[str, Set[str]]) -> list[str]:
    """The imports of a file of the core that its room is not allowed. rooms: what each may import beside itself."""
    room = room_of(path)
    if room not in rooms:
        return [f"{path}: the room {room} is not in the table"]
    return [
        f"{path}, line {line}: {room} may not import {other}"
        for other, line in rooms_imported(source).items()
        if other != room and other not in rooms[room]
    ]


def long_functions(source: str, most: int) -> dict[str, tuple[int, bool]]:
    """The functions of more than so many lines, without their decorators: their length, and whether each is a
    kernel. A method is named with its class."""
    tree = ast.parse(source)
    compiled = {id(one) for one in kernels(tree)}
    return {
        name: (lines, id(node) in compiled)
        for name, node in _functions(tree)
        if (lines := (node.end_lineno or node.lineno) - node.lineno + 1) > most
    }


def _functions(node: ast.AST, above: str = "") -> Iterator[tuple[str, Function]]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, Function | ast.ClassDef):
            name = f"{above}{child.name}"
            if isinstance(child, Function):
                yield name, child
            yield from _functions(child, f"{name}.")
        else:
            yield from _functions(child, above)


def folders_of_tests_without_sources(root: Path) -> list[str]:
    """The folders below tests/pipeline and tests/app that hold Python files and mirror no folder of the sources."""
    folders = {
        path.parent.relative_to(root / "tests")
        for room in ("pipeline", "app")
        for path in (root / "tests" / room).rglob("*.py")
    }
    return sorted(one.as_posix() for one in folders if not (root / one).is_dir())
