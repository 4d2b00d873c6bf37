"""One rule for all files that commands write: never overwrite the input, an existing file only with --force; make
folders."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Annotated, Any

import typer

from irsbot_kinematics import BadInput

OUTPUTS = ("output", "target", "junit", "plot")
"""Parameters of commands that name a file to write."""

FOLDERS = ("dataset", "pages")
"""Likewise, of what becomes a folder where several bags are given; the command itself checks a folder that exists."""

DRAFTS = ("write_expect",)
"""The same for files that people write and that are never replaced; the command itself refuses that."""


def guarded(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the rule and the option --force to a command (--overwrite if its --force is a force, in N). A command that
    writes no file is returned unchanged."""
    signature = inspect.signature(command, eval_str=True)
    named = [name for name in signature.parameters if name in OUTPUTS + FOLDERS + DRAFTS]
    if not named:
        return command
    flag = "overwrite" if "force" in signature.parameters else "force"

    @functools.wraps(command)
    def keeping_the_rule(**given: Any) -> Any:
        force = given.pop(flag)
        written = named if given.get("map_", True) else []  # some commands write with --map alone
        files = {name: given[name] for name in written if given[name] is not None}
        inputs = [entry for name, value in given.items() if name not in files for entry in _entries(value)]
        for name, file in files.items():
            if name in FOLDERS and file.is_dir():
                continue
            check_target(file, inputs, "" if force or name in DRAFTS else f"--{flag}")
        with _folders_of(files.values()):
            try:
                return command(**given)
            except OSError as error:
                if error.filename is None and len(files) == 1:  # of libraries that do not tell
                    error.filename = str(next(iter(files.values())))
                raise

    annotation = Annotated[bool, typer.Option(f"--{flag}", help="replace files that exist")]
    option = inspect.Parameter(flag, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=annotation)
    parameters = [one.replace(kind=inspect.Parameter.KEYWORD_ONLY) for one in signature.parameters.values()]
    keeping_the_rule.__signature__ = signature.replace(parameters=[*parameters, option])  # type: ignore[attr-defined]
    keeping_the_rule.__annotations__ = {**command.__annotations__, flag: annotation}
    return keeping_the_rule


def check_target(file: Path, inputs: list[str | Path], flag: str = "") -> None:
    """Raises BadInput for a file that must not be written. flag: option that allows replacing it; empty: it may be
    replaced."""
    if file.is_dir():
        raise BadInput(f"cannot write '{file}': it is a folder")
    if not file.exists():
        return
    if any(Path(entry).is_file() and Path(entry).samefile(file) for entry in inputs):
        raise BadInput(f"cannot write '{file}': it is the input")
    if flag:
        raise BadInput(f"'{file}' exists; {flag} replaces it")


@contextmanager
def _folders_of(files: Any) -> Iterator[None]:
    """Make the folders of files; remove those in which nothing was written."""
    made: list[Path] = []
    try:
        for file in files:
            made += [folder for folder in file.parents if not folder.exists()]
            file.parent.mkdir(parents=True, exist_ok=True)
        yield
    finally:
        for folder in sorted(made, key=lambda one: -len(one.parts)):
            with suppress(OSError):  # not empty: something was written
                folder.rmdir()


def _entries(value: Any) -> list[str | Path]:
    if isinstance(value, (str, Path)):
        return [value]
    return [entry for entry in value if isinstance(entry, (str, Path))] if isinstance(value, (list, tuple)) else []
