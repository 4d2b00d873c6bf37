"""Finds the modules that other modules import, directly or through others, without importing any."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path


def with_imports(source: Path, packages: Sequence[str], files: Iterable[Path]) -> list[Path]:
    """These files and all files of the packages that they import, sorted. A package PACKAGE is below `source/PACKAGE`.

    An import within a function, or for checks of types alone, counts like any other: a compiler follows it too.
    """
    found: set[Path] = set()
    waiting = list(files)
    while waiting:
        file = waiting.pop()
        if file not in found:
            found.add(file)
            names = _imported(ast.parse(file.read_text(encoding="utf-8")))
            waiting += [place for name in names if (place := _file(source, packages, name)) is not None]
    return sorted(found)


def _imported(tree: ast.Module) -> Iterator[str]:
    """Names of modules. Of `from a import b`, which may be a module or not, both `a` and `a.b`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def _file(source: Path, packages: Sequence[str], name: str) -> Path | None:
    """The file of a module; None if the name is not one of the packages' modules."""
    package = name.partition(".")[0]
    if package not in packages:
        return None
    place = (source / package).joinpath(*name.split("."))
    return next((file for file in (place.with_suffix(".py"), place / "__init__.py") if file.is_file()), None)
