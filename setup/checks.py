"""The four checks of ./irsbot test."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

ENDING_S = 60  # for a check that is interrupted: its tests end what they have started
TEST_TIMEOUT_S = 300  # for one test; a hanging node must not hang the whole run
MOST_WORKERS = 4  # a test of nodes runs up to five processes of its own


def checks(python: str, arguments: Sequence[str]) -> list[tuple[str, list[str]]]:
    """Name and command of each check; arguments are for pytest, and then pytest runs alone, in one process."""
    pytest = [python, "-m", "pytest", f"--timeout={TEST_TIMEOUT_S}"]
    if arguments:
        return [("pytest", [*pytest, *arguments])]
    workers = min(len(os.sched_getaffinity(0)), MOST_WORKERS)
    # A file stays in one worker, for its fixtures, and so do all files with nodes (conftest.py), which come first.
    spread = [f"--numprocesses={workers}", "--dist=loadfile", "--no-loadscope-reorder"]
    return [
        ("ruff check", [python, "-m", "ruff", "check"]),
        ("ruff format", [python, "-m", "ruff", "format", "--check"]),
        ("mypy", [python, "-m", "mypy"]),
        ("pytest", [*pytest, *spread]),
    ]


def run_checks(commands: Sequence[tuple[str, list[str]]], root: Path, env: Mapping[str, str]) -> int:
    """Run every check, also after a failure, print a summary; 0 if all passed, else 1."""
    lines = []
    failed = False
    for name, command in commands:
        print(f"== {name}", flush=True)
        began_s = time.monotonic()
        code = _run(command, root, env)
        verdict = "passed" if code == 0 else f"FAILED (exit code {code})"
        failed |= code != 0
        lines.append(f"{name:<12} {time.monotonic() - began_s:6.1f} s  {verdict}")
    print("== summary", *lines, sep="\n", flush=True)
    return 1 if failed else 0


def forget_removed(byte_code: Path) -> None:
    """Remove the byte code of folders that are gone: tests make modules in temporary ones."""
    for kept, inside, _files in os.walk(byte_code):
        if not Path("/", Path(kept).relative_to(byte_code)).is_dir():
            shutil.rmtree(kept, ignore_errors=True)
            inside.clear()


def _run(command: Sequence[str], root: Path, env: Mapping[str, str]) -> int:
    """The exit code of a check; on an interrupt the check ends first, in order if possible."""
    process = None
    try:
        with _signals_held_back():
            process = subprocess.Popen(command, cwd=root, env=dict(env))
        return process.wait()
    except KeyboardInterrupt as asked:
        if process is not None:
            if asked.args:  # a signal to us alone; Ctrl-C has told the whole group
                process.send_signal(signal.SIGINT)
            try:
                process.wait(ENDING_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        raise


@contextmanager
def _signals_held_back() -> Iterator[None]:
    """Delay signals to the end of the context: a process that is just being started must not be lost."""
    arrived: list[int] = []
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    ours = {number: handler for number, handler in handlers.items() if callable(handler)}
    for number in ours:
        signal.signal(number, lambda sent, _frame: arrived.append(sent))
    try:
        yield
    finally:
        for number, handler in ours.items():
            signal.signal(number, handler)
        for sent in arrived[:1]:
            signal.raise_signal(sent)
