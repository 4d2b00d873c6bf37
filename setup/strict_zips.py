"""Loops over `zip(..., strict=True)` in a form that the compiler makes native: it does so for `zip` without keywords.

Of the sequences that a loop zips strictly, the lengths are compared before the loop instead of at its end:

    for a, b in zip(left, right, strict=True)   becomes   for a, b in zip(left, as_long__(right, left))

That takes one sequence that can be named twice without effect, and nothing that is no sequence. Every other `zip` stays
as it is.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from typing import NamedTuple

ITERATORS = {"zip", "map", "filter", "enumerate", "reversed", "iter"}
"""Functions whose results have no length."""

CHECK = """

Counted__ = TypeVar__("Counted__", bound=Sized__)


def as_long__(values: Counted__, like: Sized__) -> Counted__:
    if len(values) != len(like):
        raise ValueError("zip() got sequences of different lengths")
    return values
"""
"""Comes after the last line of a module that has such a loop."""

FUTURE = "from __future__ import annotations"
IMPORTS = "; from collections.abc import Sized as Sized__; from typing import TypeVar as TypeVar__"


class Edit(NamedTuple):
    """A place in a source, in bytes, and what is there then."""

    begin: int
    end: int
    text: bytes


def native(source: str) -> str:
    """The module with native loops, and no line moved."""
    data = source.encode()
    starts = [0]
    for line in data.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    edits = [edit for call in _strict_loops(ast.parse(source)) for edit in _edits(call, data, starts)]
    if not edits:
        return source
    for edit in sorted(edits, reverse=True):
        data = data[: edit.begin] + edit.text + data[edit.end :]
    return data.decode().replace(FUTURE, FUTURE + IMPORTS, 1) + CHECK


def _strict_loops(tree: ast.AST) -> Iterator[ast.Call]:
    """The calls of `zip` that loops of a module run over and that can be made native."""
    iterators = _iterators(tree)
    for node in ast.walk(tree):
        if isinstance(node, ast.For | ast.comprehension):
            call = _strict_zip(node.iter)
            if call is not None and not any(_has_no_length(value, iterators) for value in call.args):
                yield call


def _strict_zip(node: ast.expr) -> ast.Call | None:
    """The strict `zip` of what a loop runs over, itself or numbered."""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        if node.func.id == "enumerate" and len(node.args) == 1 and not node.keywords:
            return _strict_zip(node.args[0])
        if node.func.id == "zip" and [ast.unparse(keyword) for keyword in node.keywords] == ["strict=True"]:
            return node if len(node.args) > 1 and any(map(_is_path, node.args)) else None
    return None


def _iterators(tree: ast.AST) -> set[str]:
    """Names that a module gives to results without length, anywhere."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign) and _has_no_length(node.value, set()):
            found |= {target.id for target in node.targets if isinstance(target, ast.Name)}
    return found


def _has_no_length(node: ast.expr, iterators: set[str]) -> bool:
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        return node.func.id in ITERATORS
    return isinstance(node, ast.GeneratorExp | ast.Starred) or (isinstance(node, ast.Name) and node.id in iterators)


def _is_path(node: ast.expr) -> bool:
    """True for a name, and for an attribute of one."""
    return isinstance(node, ast.Name) or (isinstance(node, ast.Attribute) and _is_path(node.value))


def _edits(call: ast.Call, data: bytes, starts: list[int]) -> list[Edit]:
    """What makes a strict `zip` a native one: every sequence but the one that the others are compared with."""
    like = min(filter(_is_path, call.args), key=lambda node: len(ast.unparse(node).split(".")))
    edits = []
    for value in call.args:
        if value is not like:
            begin, end = _place(value, starts)
            edits += [Edit(begin, begin, b"as_long__("), Edit(end, end, f", {ast.unparse(like)})".encode())]
    (_, last), (_, end) = _place(call.args[-1], starts), _place(call.keywords[0], starts)
    return [*edits, Edit(last, end, b"\n" * data[last:end].count(b"\n"))]


def _place(node: ast.expr | ast.keyword, starts: list[int]) -> tuple[int, int]:
    """First byte of a node, and the byte after its last one."""
    assert node.end_lineno is not None
    assert node.end_col_offset is not None
    return starts[node.lineno - 1] + node.col_offset, starts[node.end_lineno - 1] + node.end_col_offset
