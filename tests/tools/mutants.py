"""Single mutations of a source file: one operator, comparison, constant, condition, statement or return is changed.

A mutation replaces a stretch of the text and leaves the rest as it is, so that places stay what they are.
"""

from __future__ import annotations

import ast
import hashlib
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

Function = ast.FunctionDef | ast.AsyncFunctionDef

OPERATORS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.Pow: ast.Mult,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.BitXor: ast.BitAnd,
    ast.And: ast.Or,
    ast.Or: ast.And,
}

COMPARISONS: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
"""The boundary moved, and the sense turned round."""

CALLS = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum", "fmin": "fmax", "fmax": "fmin"}
"""Functions that stand for an operator."""

UNTOUCHED = frozenset({"annotation", "returns", "decorator_list"})
"""Parts of a node that say nothing of what the code does."""

DROPPED = "pass"
"""What stands where a statement was."""


@dataclass(frozen=True)
class Mutant:
    """One change: bytes `start` to `stop` of the file become `text`.

    path: of the file, from the root of the project. function: where in it ("Class.method", "" at module level).
    before, after: the change for people. source: the line where it begins. ordinal: tells apart those that would have
    one name.
    """

    path: str
    line: int
    function: str
    kind: str
    before: str
    after: str
    source: str
    start: int
    stop: int
    text: str
    ordinal: int = 1

    @property
    def name(self) -> str:
        """The same as long as its line is, wherever in the file it stands."""
        more = f" #{self.ordinal}" if self.ordinal > 1 else ""
        return f"{self.path} {self.function}: {self.before} -> {self.after} in `{self.source}`{more}"

    def applied(self, source: bytes) -> bytes:
        """The file with the change."""
        return source[: self.start] + self.text.encode() + source[self.stop :]


def mutants(path: str, source: bytes) -> list[Mutant]:
    """All mutations of a file that still compile, in order of their place."""
    text = _Text(path, source)
    found = [one for node, scope, above in _nodes(ast.parse(source), (), None) for one in _of(text, node, scope, above)]
    found += [one for node, scope, _ in _nodes(ast.parse(source), (), None) for one in _of_function(text, node, scope)]
    whole = [one for one in sorted(found, key=lambda one: (one.start, one.stop)) if _compiles(one.applied(source))]
    seen: Counter[str] = Counter()
    made = []
    for one in whole:
        seen[one.name] += 1
        made.append(replace(one, ordinal=seen[one.name]))
    return made


def shuffled(found: Iterable[Mutant], seed: int) -> list[Mutant]:
    """In an order by chance that a change of other lines does not disturb: a sample is the first so many."""
    return sorted(found, key=lambda one: hashlib.sha256(f"{seed} {one.name}".encode()).digest())


class _Text:
    """A source whose places are bytes."""

    def __init__(self, path: str, source: bytes) -> None:
        self.path, self.source = path, source
        self._lines = source.splitlines(keepends=True)
        self._first = [0]
        for line in self._lines:
            self._first.append(self._first[-1] + len(line))

    def line(self, number: int) -> str:
        return self._lines[number - 1].decode().strip()

    def change(
        self, node: ast.expr | ast.stmt, scope: tuple[str, ...], kind: str, text: str, *, only_start: bool = False
    ) -> Mutant:
        """The node's stretch becomes `text`; with only_start, `text` is put before it."""
        start = self._first[node.lineno - 1] + node.col_offset
        stop = start if only_start else self._first[(node.end_lineno or 0) - 1] + (node.end_col_offset or 0)
        before = "" if only_start else " ".join(self.source[start:stop].decode().split())
        return Mutant(
            self.path, node.lineno, ".".join(scope), kind, before or "(begin)", " ".join(text.split()),
            self.line(node.lineno), start, stop, text,
        )  # fmt: skip


def _nodes(
    node: ast.AST, scope: tuple[str, ...], above: ast.AST | None
) -> Iterator[tuple[ast.AST, tuple[str, ...], ast.AST | None]]:
    """Every node that may be changed, with the names of what it stands in, and the node above it."""
    yield node, scope, above
    inner = (*scope, node.name) if isinstance(node, Function | ast.ClassDef) else scope
    for name, value in ast.iter_fields(node):
        for child in value if isinstance(value, list) else [value]:
            # places within f-strings are wrong before Python 3.12
            if isinstance(child, ast.AST) and name not in UNTOUCHED and not isinstance(child, ast.JoinedStr):
                yield from _nodes(child, inner, node)


def _of(text: _Text, node: ast.AST, scope: tuple[str, ...], above: ast.AST | None) -> Iterator[Mutant]:
    if isinstance(node, ast.expr):
        for kind, changed in _expressions(node):
            yield text.change(node, scope, kind, changed)
    elif isinstance(node, ast.AugAssign) and type(node.op) in OPERATORS:
        yield text.change(node, scope, "operator", ast.unparse(_with(node, op=OPERATORS[type(node.op)]())))
    if isinstance(node, ast.If | ast.IfExp | ast.While) and not isinstance(node.test, ast.Compare | ast.UnaryOp):
        yield text.change(node.test, scope, "condition", f"(not ({ast.unparse(node.test)}))")
    if isinstance(node, ast.Return) and isinstance(above, ast.If | ast.For | ast.While):
        yield text.change(node, scope, "return", DROPPED)


def _expressions(node: ast.expr) -> Iterator[tuple[str, str]]:
    if isinstance(node, ast.BinOp | ast.BoolOp) and type(node.op) in OPERATORS:
        yield "operator", f"({ast.unparse(_with(node, op=OPERATORS[type(node.op)]()))})"
    elif isinstance(node, ast.UnaryOp) and not isinstance(node.op, ast.UAdd):
        yield "operator", f"({ast.unparse(node.operand)})"
    elif isinstance(node, ast.Compare):
        for k, op in enumerate(node.ops):
            for other in COMPARISONS[type(op)]:
                ops = [*node.ops[:k], other(), *node.ops[k + 1 :]]
                yield "comparison", f"({ast.unparse(_with(node, ops=ops))})"
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        yield "constant", str(not node.value)
    elif isinstance(node, ast.Constant) and isinstance(node.value, int):
        yield "constant", str(node.value + 1)
    elif isinstance(node, ast.Constant) and isinstance(node.value, float):
        yield "constant", repr(2.0 * node.value if node.value else 1.0)
    elif isinstance(node, ast.Name) and node.id in CALLS:
        yield "operator", CALLS[node.id]
    elif isinstance(node, ast.Attribute) and node.attr in CALLS:
        yield "operator", ast.unparse(_with(node, attr=CALLS[node.attr]))


def _with(node: ast.AST, **fields: object) -> ast.AST:
    return type(node)(**{**dict(ast.iter_fields(node)), **fields})


def _of_function(text: _Text, node: ast.AST, scope: tuple[str, ...]) -> Iterator[Mutant]:
    """Statements dropped within a function, and a return at its begin where it answers nothing."""
    if not isinstance(node, Function):
        return
    inner = (*scope, node.name)
    known = {one.arg for one in ast.walk(node.args) if isinstance(one, ast.arg)}
    within = [one for one in ast.walk(node) if isinstance(one, ast.stmt) and one is not node]
    for statement in sorted(within, key=lambda one: (one.lineno, one.col_offset)):
        if _may_be_dropped(statement, known):
            yield text.change(statement, inner, "statement", DROPPED)
        known |= {one.id for one in ast.walk(statement) if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store)}
    body = [one for one in node.body if not (isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant))]
    answers = any(isinstance(one, ast.Return) and one.value is not None for one in ast.walk(node))
    yields = any(isinstance(one, ast.Yield | ast.YieldFrom) for one in ast.walk(node))
    if body and not answers and not yields and not isinstance(body[0], ast.Return | ast.Pass):
        yield text.change(body[0], inner, "return", f"return\n{' ' * body[0].col_offset}", only_start=True)


def _may_be_dropped(statement: ast.stmt, known: set[str]) -> bool:
    """It does something, and what comes after it does not fail for want of a name."""
    if isinstance(statement, ast.Expr):
        return isinstance(statement.value, ast.Call)
    if isinstance(statement, ast.Assign):
        names = {
            one.id
            for target in statement.targets
            for one in ast.walk(target)
            if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store)
        }
        return names <= known
    return isinstance(statement, ast.AugAssign | ast.Continue | ast.Break | ast.Raise | ast.Delete)


def _compiles(source: bytes) -> bool:
    try:
        compile(source, "mutant", "exec")
    except (SyntaxError, ValueError):
        return False
    return True
