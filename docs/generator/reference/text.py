"""Markdown of generated pages."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Sequence
from enum import Enum
from typing import Any

NOTE = "*Generated from the code when the site is built.*"


def page(title: str, *parts: str) -> str:
    """A page with its title; parts are separated by empty lines."""
    return "\n\n".join([f"# {title}", NOTE, *(part.strip("\n") for part in parts if part.strip())]) + "\n"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; a bar within a cell does not end it."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(
        "| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in row) + " |" for row in lines
    )


def code(text: object) -> str:
    """Inline code; nothing for an empty text."""
    return f"`{text}`" if str(text) else ""


def value(given: Any) -> str:
    """A default as it is written: numbers short, sequences with commas."""
    if isinstance(given, Enum):
        return given.name
    if isinstance(given, float):
        return f"{given:g}"
    if isinstance(given, (list, tuple)):
        return ", ".join(map(value, given)) or "empty"
    return "empty" if given == "" else str(given)


def docstring(thing: object) -> str:
    """The docstring of something, without the indentation of its source; empty if there is none of its own."""
    return inspect.cleandoc(getattr(thing, "__doc__", None) or "")


def escaped(text: str) -> str:
    """Text whose characters mean themselves in Markdown; what stands between backticks stays code."""
    parts = text.split("`")
    return "`".join(
        part if number % 2 else re.sub(r"([*_\\[\]<>#])", r"\\\1", part) for number, part in enumerate(parts)
    )


def prose(text: str) -> str:
    """Paragraphs of a docstring; indented lines, formulas and examples, stay as they are."""
    parts = []
    for paragraph in text.split("\n\n"):
        if re.search(r"^(import|from) \w|^\w+ = ", paragraph, re.MULTILINE):
            parts.append(f"```python\n{paragraph}\n```")
        elif re.search(r"^ ", paragraph, re.MULTILINE):
            parts.append(f"```text\n{paragraph}\n```")
        else:
            parts.append("  \n".join(escaped(line) for line in paragraph.splitlines()))
    return "\n\n".join(parts)
