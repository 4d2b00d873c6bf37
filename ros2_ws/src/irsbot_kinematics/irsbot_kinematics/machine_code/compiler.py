"""Has C source compiled to a library."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from irsbot_kinematics.errors import NotCompiled


def compiler() -> list[str]:
    """The command of the C compiler: CC, or cc. Raises NotCompiled."""
    stated = os.environ.get("CC", "").strip() or "cc"
    try:
        command = shlex.split(stated)
    except ValueError as error:
        raise NotCompiled(f"CC is {stated!r}, which is no command ({error}): name a C compiler") from error
    if shutil.which(command[0]) is None and not Path(command[0]).exists():
        raise NotCompiled(f"no C compiler: '{command[0]}' was not found; install gcc, or name one in CC")
    return command


def compile_library(text: str, command: Sequence[str], libraries: Sequence[str], library: Path) -> None:
    """Compile C source by a command with its options. The library is there completely or not at all. Raises
    NotCompiled."""
    try:
        library.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=library.parent) as folder:
            made = Path(folder) / library.name
            source = Path(folder) / "source.c"
            source.write_text(text)
            _run([*command, "-o", str(made), str(source), *libraries])
            made.replace(library)
    except OSError as error:
        raise NotCompiled(f"the machine code cannot be kept in {library.parent}: {error}") from error


def _run(command: list[str]) -> None:
    """Run the compiler. Raises NotCompiled."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError as error:
        raise NotCompiled(f"cannot run '{command[0]}' ({error.strerror}): name a C compiler in CC") from error
    if done.returncode:
        raise NotCompiled(f"the compiler failed: {shlex.join(done.args)}\n{done.stderr.strip()}")
