"""The command line: every command with its help, arguments and options."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

from irsbot_supervisor.cli.app import whole_app
from reference.text import code, page, table, value

SETUP = Path(__file__).parents[3] / "setup" / "__main__.py"

GROUPS = {
    "robots": ("Robots and kinematics", ("robots", "ik", "dk", "evaluate", "map", "urdf", "check-trajectory")),
    "suite": (
        "A running suite",
        (
            "demo",
            "up",
            "verdict",
            "monitor",
            "reset",
            "set",
            "send",
            "settings",
            "limits",
            "policy",
            "bench",
            "faults",
            "docs",
        ),
    ),
    "bags": ("Bags", ("replay", "report", "info", "salvage")),
    "design": ("Design and own mechanisms", ("design", "stiffness", "new-mechanism", "check-mechanism")),
    "algebra": ("Algebra", ("algebra",)),
}
"""Page -> its title and its commands."""


def pages() -> dict[str, str]:
    """An index of all commands and one page for each group. Raises ValueError for a command without a page."""
    found = {name: list(_leaves(command, name)) for name, command in sorted(_root().commands.items())}
    grouped = {name: key for key, (_title, names) in GROUPS.items() for name in names}
    if lost := set(found) ^ set(grouped):
        raise ValueError(f"reference/commands.py: these commands have no page, or are gone: {', '.join(sorted(lost))}")
    made = {"reference/commands/index.md": _index(found, grouped)}
    for key, (title, names) in GROUPS.items():
        parts = [part for name in names for called, command in found[name] for part in _command(called, command)]
        made[f"reference/commands/{key}.md"] = page(title, *parts)
    return made


def _root() -> Any:
    return typer.main.get_command(whole_app())


def _leaves(command: Any, called: str) -> Iterator[tuple[str, Any]]:
    """Commands with the words by which they are called; of a group its members."""
    if hasattr(command, "commands"):
        for name, member in sorted(command.commands.items()):
            yield from _leaves(member, f"{called} {name}")
    else:
        yield called, command


def _index(found: dict[str, list[tuple[str, Any]]], grouped: dict[str, str]) -> str:
    rows = [
        (f"[`./irsbot {called}`]({grouped[name]}.md#{_anchor(called)})", _first(command))
        for name, leaves in found.items()
        for called, command in leaves
    ]

    return page(
        "Commands",
        "Every command has `--help` with an example. Exit codes: 0 done, 1 the checked thing failed, 2 bad use or "
        "input, with one line on stderr that says what would be right.",
        table(("command", "does"), rows),
        "## Before any of them",
        f"```text\n{_usage()}\n```",
    )


def _usage() -> str:
    return SETUP.read_text(encoding="utf-8").split('USAGE = """\\\n')[1].split('"""')[0].strip()


def _first(command: Any) -> str:
    return str(command.help or "").partition("\n")[0].rstrip(".")


def _anchor(called: str) -> str:
    return f"irsbot-{called}".replace(" ", "-")


def _command(called: str, command: Any) -> list[str]:
    text = "\n\n".join(" ".join(part.split()) for part in str(command.help or "").split("\n\n"))
    told, _, example = text.partition("Example: ")
    rows = []
    for option in command.params:
        if option.name == "help":
            continue
        argument = option.param_type_name == "argument"
        name = option.name.upper() if argument else ", ".join((*option.opts, *option.secondary_opts))
        rows.append((code(name), _default(option), str(getattr(option, "help", None) or "")))
    parts = [f"## irsbot {called}", told]
    if rows:
        parts.append(table(("argument or option", "default", "meaning"), rows))
    if example:
        parts.append(f"    ./{example.strip()}")
    return parts


def _default(option: Any) -> str:
    if option.required:
        return "needed"
    given = option.default
    if given is None or given is False or given == () or callable(given) or type(given).__name__ == "Sentinel":
        return ""
    return value(given)
