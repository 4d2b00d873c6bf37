"""The four checks of ./irsbot test."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

TEST_TIMEOUT_S = 300  # for one test; a hanging node must not hang the whole run


def checks(python: str, arguments: Sequence[str]) -> list[tuple[str, list[str]]]:
    """Name and command of each check; arguments are for pytest, and then pytest runs alone."""
    pytest = ("pytest", [python, "-m", "pytest", f"--timeout={TEST_TIMEOUT_S}", *arguments])
    if arguments:
        return [pytest]
    return [
        ("ruff check", [python, "-m", "ruff", "check"]),
        ("ruff format", [python, "-m", "ruff", "format", "--check"]),
        ("mypy", [python, "-m", "mypy"]),
        pytest,
    ]


def run_checks(commands: Sequence[tuple[str, list[str]]], root: Path, env: Mapping[str, str]) -> int:
    """Run every check whatever the others say, print a summary; 0 if all passed, else 1."""
    lines = []
    failed = False
    for name, command in commands:
        print(f"== {name}", flush=True)
        began_s = time.monotonic()
        code = subprocess.run(command, cwd=root, env=dict(env)).returncode
        verdict = "passed" if code == 0 else f"FAILED (exit code {code})"
        failed |= code != 0
        lines.append(f"{name:<12} {time.monotonic() - began_s:6.1f} s  {verdict}")
    print("== summary", *lines, sep="\n", flush=True)
    return 1 if failed else 0
