"""Named tuples in the form that the compiler makes fast: a field is read by its number, a record is made without a call
of Python.

    sample.stamp_ns                       becomes   sample[0]
    Speeds(forward=up, backward=down)     becomes   cast__(Speeds, new__(Speeds, (up, down)))

The type checker says of which expressions this is true: those whose type is one named tuple. A record is made so where
all its fields are given, in their order. Values, their order of evaluation and the lines of a module stay.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from mypy import build
from mypy.main import process_options
from mypy.nodes import ARG_NAMED, ARG_POS, CallExpr, Expression, MemberExpr, RefExpr, TypeInfo
from mypy.server.subexpr import get_subexpressions
from mypy.types import CallableType, TupleType, Type, get_proper_type
from strict_zips import FUTURE, Edit

HEADER = "; from typing import Any as Any__, Final as Final__, cast as cast__; new__: Final__[Any__] = tuple.__new__"
"""Comes on the line of the first import: no line moves for it."""

Types = dict[Expression, Type]
"""What the type checker says of the expressions of all modules."""


def rewrite(files: list[Path], options: list[str]) -> None:
    """Rewrite modules in place. options: for mypy. Raises SystemExit if a type is wrong."""
    sources, stated = process_options([*options, *map(str, files)])
    stated.export_types, stated.preserve_asts, stated.incremental = True, True, False
    found = build.build(sources, stated)
    if found.errors:
        raise SystemExit("\n".join(found.errors))
    for file, source in zip(files, sources, strict=True):
        file.write_bytes(native(file.read_bytes(), get_subexpressions(found.files[source.module]), found.types))


def native(data: bytes, expressions: list[Expression], types: Types) -> bytes:
    """One module, with these expressions, with its named tuples in native form."""
    starts = [0]
    for line in data.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    edits = {edit for expression in expressions for edit in _edits(expression, data, starts, types)}
    for edit in sorted(edits, reverse=True):
        data = data[: edit.begin] + edit.text + data[edit.end :]
    return data.replace(FUTURE.encode(), (FUTURE + HEADER).encode(), 1) if edits else data


def _fields(info: TypeInfo) -> list[str]:
    return list(info.metadata.get("namedtuple", {}).get("fields", ()))


def _number(expression: MemberExpr, types: Types) -> int | None:
    """Number of the field that is read; None if it is no field of one named tuple."""
    kind = get_proper_type(types.get(expression.expr))
    fields = _fields(kind.partial_fallback.type) if isinstance(kind, TupleType) else []
    return fields.index(expression.name) if expression.name in fields else None


def _makes_all(expression: CallExpr, types: Types) -> bool:
    """True if a call makes a named tuple from all its fields in their order."""
    callee = expression.callee
    if not (isinstance(callee, RefExpr) and isinstance(callee.node, TypeInfo)):
        return False
    fields = _fields(callee.node)
    kind = get_proper_type(types.get(callee))
    known = {ARG_POS, ARG_NAMED}
    if not fields or not isinstance(kind, CallableType) or not set(expression.arg_kinds) <= known:
        return False
    given = [name or field for name, field in zip(expression.arg_names, fields, strict=False)]
    return given == fields and len(expression.args) == len(fields)


def _edits(expression: Expression, data: bytes, starts: list[int], types: Types) -> Iterator[Edit]:
    if isinstance(expression, MemberExpr):
        yield from _read(expression, data, starts, types)
    elif isinstance(expression, CallExpr) and _makes_all(expression, types):
        yield from _made(expression, data, starts)


def _read(expression: MemberExpr, data: bytes, starts: list[int], types: Types) -> Iterator[Edit]:
    """The number of a field in place of its name."""
    number = _number(expression, types)
    if number is None:
        return
    field, (_begin, end) = f".{expression.name}".encode(), _span(expression, starts)
    if data[end - len(field) : end] == field:
        yield Edit(end - len(field), end, b"[%d]" % number)


def _made(expression: CallExpr, data: bytes, starts: list[int]) -> Iterator[Edit]:
    """A record from the tuple of its fields."""
    callee_begin, callee_end = _span(expression.callee, starts)
    record = data[callee_begin:callee_end]
    opening = data.index(b"(", callee_end) + 1
    yield Edit(callee_begin, opening, b"cast__(%s, new__(%s, (" % (record, record))
    last, (_begin, end) = opening, _span(expression, starts)
    for name, value in zip(expression.arg_names, expression.args, strict=True):
        begin, after = _span(value, starts)
        if name and (keyword := re.search(rb"\b%s\s*=\s*" % name.encode(), data[last:begin])):
            yield Edit(last + keyword.start(), last + keyword.end(), b"")
        last = after
    yield Edit(end - 1, end, b")))" if b"," in data[last : end - 1] else b",)))")


def _span(expression: Expression, starts: list[int]) -> tuple[int, int]:
    """First byte of an expression and the one after its last."""
    assert expression.end_line is not None
    assert expression.end_column is not None
    return starts[expression.line - 1] + expression.column, starts[expression.end_line - 1] + expression.end_column
