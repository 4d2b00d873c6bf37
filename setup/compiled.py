"""Compiled modules: made on request, used while the sources are unchanged. Without them everything runs, slower.

`./irsbot setup --compiled` makes them, `./irsbot setup` renews them when sources have changed, and `./irsbot setup
--plain` removes them. The environment variable IRSBOT_PLAIN switches them off.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import compile_modules
import environment
from place import Place
from progress import CommandError, Progress
from steps import alone

SWITCH = "IRSBOT_PLAIN"
COMPILED, PLAIN = "--compiled", "--plain"
"""Options of the set-up."""


def prepare(place: Place, option: str = "") -> None:
    """Renew outdated modules, make missing ones, or remove all, by the option of the set-up."""
    if option == PLAIN:
        shutil.rmtree(place.compiled, ignore_errors=True)
        return
    source = place.workspace / "src"
    if not option and not (place.compiled / compile_modules.INDEX).exists():
        return
    with alone(place) as lock:
        if not compile_modules.is_current(source, place.compiled):
            _make(place, source, lock)


def _make(place: Place, source: Path, lock: int) -> None:
    """Compile; after a failure, a message is printed and plain Python runs."""
    script = Path(compile_modules.__file__)
    try:
        with Progress(place.log, total=1, keep_open=[lock]) as progress, progress.step("compiled modules"):
            command = [place.interpreter, str(script), str(source), str(place.compiled)]
            progress.run(command, cwd=place.root, env=place.underlay())
    except (CommandError, OSError):
        print(f"irsbot: not compiled, plain Python runs (details: {place.log})", file=sys.stderr)


def added_to(env: dict[str, str], place: Place) -> dict[str, str]:
    """The environment with the compiled modules. Prints once if they are older than their sources."""
    if env.get(SWITCH) or not (place.compiled / compile_modules.INDEX).exists():
        return env
    if not compile_modules.is_current(place.workspace / "src", place.compiled):
        text = "sources have changed since they were compiled, plain Python runs: ./irsbot setup compiles them again"
        print(f"irsbot: {text}", file=sys.stderr)
        return {**env, SWITCH: "1"}
    return environment.prepend({"PYTHONPATH": [str(place.compiled)]}, env)
