"""The Python API: signature and docstring of everything in the `__all__` of the public modules."""

from __future__ import annotations

import dataclasses
import enum
import importlib
import inspect
import re
from collections.abc import Iterator
from types import ModuleType
from typing import Any

from reference.text import docstring, escaped, page, prose, table

PUBLIC = (
    "irsbot_kinematics",
    "irsbot_kinematics.algebra",
    "irsbot_kinematics.stiffness",
    "irsbot_kinematics.design",
    "irsbot_kinematics.own_mechanism",
    "irsbot_supervisor",
    "irsbot_supervisor.consumer",
    "irsbot_supervisor.processes.operating",
)
"""Modules whose public names are documented: those of `__all__`, or what a module without one defines itself."""

LONGEST = 280
"""Lines of a page; a longer module is cut into several pages."""


def pages() -> dict[str, str]:
    """An index and the pages of every public module."""
    made: dict[str, str] = {}
    rows = []
    for name in PUBLIC:
        module = importlib.import_module(name)
        parts = [(public, "\n\n".join(_entry(public, getattr(module, public)))) for public in names(module)]
        for number, chunk in enumerate(_chunks(parts)):
            file = f"{name}{f'_{number + 1}' if number else ''}"
            title = f"{name}{f', part {number + 1}' if number else ''}"
            intro = "" if number else prose(docstring(module))
            made[f"reference/python/{file}.md"] = page(title, intro, *(text for _public, text in chunk))
            for public, _text in chunk:
                rows.append((f"[`{public}`]({file}.md#{_slug(public)})", f"`{name}`", _first(getattr(module, public))))
    told = "These names may be imported and are stable. All others are internal and may change without notice."
    made["reference/python/index.md"] = page("Python API", told, table(("name", "in", "meaning"), rows))
    return made


def names(module: ModuleType) -> list[str]:
    """The public names of a module."""
    listed = getattr(module, "__all__", None)
    if listed is not None:
        return sorted(listed)
    found = {name: thing for name, thing in vars(module).items() if not name.startswith("_")}
    own = [name for name, thing in found.items() if getattr(thing, "__module__", None) == module.__name__]
    return sorted(own)


def _chunks(parts: list[tuple[str, str]]) -> Iterator[list[tuple[str, str]]]:
    chunk: list[tuple[str, str]] = []
    for public, text in parts:
        if chunk and sum(one.count("\n") + 2 for _name, one in chunk) + text.count("\n") > LONGEST:
            yield chunk
            chunk = []
        chunk.append((public, text))
    if chunk:
        yield chunk


def _slug(name: str) -> str:
    return name.lower()


def _entry(name: str, thing: Any) -> Iterator[str]:
    yield f"## {name}"
    if inspect.isclass(thing):
        yield from _class(name, thing)
    elif callable(thing):
        yield _signature(name, thing)
        yield _told(thing)
    else:
        yield f"```python\n{name}: {type(thing).__name__}\n```"


def _class(name: str, thing: type) -> Iterator[str]:
    if issubclass(thing, enum.Enum):
        yield f"```python\nclass {name}({thing.__mro__[1].__name__})\n```"
        yield _told(thing)
        yield table(("member", "value"), [(f"`{member.name}`", f"{member.value}") for member in thing])
        return
    bases = ", ".join(base.__name__ for base in thing.__bases__ if base is not object)
    if issubclass(thing, BaseException):
        yield f"```python\nclass {name}({bases})\n```"
        yield _told(thing)
    else:
        yield _signature(name, thing)
        yield _told(thing)
    comments = _comments(thing)
    if rows := [(f"`{field}`", escaped(comments[field])) for field in _fields(thing) if field in comments]:
        yield table(("field", "meaning"), rows)
    for member, raw in sorted(vars(thing).items()):
        if member.startswith("_") or member in _fields(thing):
            continue
        if isinstance(raw, property):
            yield f"**`{name}.{member}`**" + (f": {escaped(docstring(raw))}" if raw.__doc__ else "")
        elif inspect.isfunction(raw) or isinstance(raw, (classmethod, staticmethod)):
            called = getattr(thing, member)
            yield _signature(f"{name}.{member}", called)
            yield _told(called)


def _fields(thing: type) -> list[str]:
    if dataclasses.is_dataclass(thing):
        return [entry.name for entry in dataclasses.fields(thing)]
    return list(getattr(thing, "_fields", ()))


def _comments(thing: type) -> dict[str, str]:
    """Field -> the comment behind it in the source, or the string below it."""
    try:
        source = inspect.getsource(thing)
    except (OSError, TypeError):
        return {}
    behind = re.findall(r"^    (\w+): [^#\n]*?#\s*(.+)$", source, re.MULTILINE)
    below = re.findall(r'^    (\w+): [^\n]*\n    """(.+?)"""', source, re.MULTILINE | re.DOTALL)
    return {name: " ".join(text.split()) for name, text in [*behind, *below]}


def _signature(name: str, thing: Any) -> str:
    try:
        text = f"{name}{inspect.signature(thing)}"
    except (TypeError, ValueError):
        text = name
    text = re.sub(r"ForwardRef\('([^']*)'[^)]*\)", r"\1", text)
    text = re.sub(r"<(?:class '|function )?([\w.]+)[^>]*>", r"\1", text).replace("'", "")
    if len(text) > 100:
        text = text.replace("(", "(\n    ", 1).replace(", ", ",\n    ")
    return f"```python\n{text}\n```"


def _told(thing: Any) -> str:
    """The docstring of a thing; none where dataclass has written it."""
    own = docstring(thing)
    return "" if own.startswith(f"{getattr(thing, '__name__', '')}(") else prose(own)


def _first(thing: Any) -> str:
    own = docstring(thing) if callable(thing) else ""
    return escaped(" ".join(own.split("\n\n")[0].split()))
