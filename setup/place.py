"""The place of irsbot, and its Python and ROS 2."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import environment


@dataclass(frozen=True)
class Place:
    """One copy of irsbot on one machine.

    sourced: a ROS 2 Jazzy is sourced and used as it is; else wheels are installed in .venv.
    python: the interpreter outside .venv.
    """

    root: Path
    sourced: bool
    python: str

    @property
    def venv(self) -> Path:
        return self.root / ".venv"

    @property
    def workspace(self) -> Path:
        return self.root / "ros2_ws"

    @property
    def build(self) -> Path:
        return self.workspace / "build"

    @property
    def install(self) -> Path:
        return self.workspace / "install"

    @property
    def paths_file(self) -> Path:
        """File with the additions of the built workspace to the search paths."""
        return self.build / "irsbot_paths.json"

    @property
    def compiled(self) -> Path:
        """Compiled modules, if there are any."""
        return self.workspace / "compiled"

    @property
    def byte_code(self) -> Path:
        """Byte code, where Python must not write it beside the modules; gone with the next build."""
        return self.build / "byte_code"

    @property
    def log(self) -> Path:
        return self.root / "runs" / "setup.log"

    @property
    def interpreter(self) -> str:
        """The Python in which irsbot runs."""
        return self.python if self.sourced else str(self.venv / "bin" / "python")

    def underlay(self) -> dict[str, str]:
        """The environment of ROS 2 without the workspace, which may be sourced too."""
        if self.sourced:
            return environment.without((self.install, self.build), os.environ)
        return environment.with_wheels(self.venv, os.environ)

    def environment(self) -> dict[str, str]:
        """The environment of irsbot after the set-up."""
        env = environment.prepend(environment.load(self.paths_file), self.underlay())
        return environment.with_byte_code(env, self.byte_code)
