"""The command line as a shell sees it, in this process: exit code, standard output, standard error."""

from __future__ import annotations

import contextlib
import io
import sys
from typing import NamedTuple
from unittest import mock

from irsbot_supervisor.cli.app import main

IRSBOT = [sys.executable, "-m", "irsbot_supervisor"]
"""The command in a process of its own."""

PATIENCE_S = 120.0
"""s a test waits for an event on a busy machine."""


class Said(NamedTuple):
    """What a command left behind."""

    code: int
    out: str
    err: str

    @property
    def refusal(self) -> str:
        """The one line of a refusal."""
        (line,) = self.err.strip().splitlines()
        return line


def irsbot(*words: object) -> Said:
    """Run a command."""
    out, err = io.StringIO(), io.StringIO()
    with (
        mock.patch.object(sys, "argv", ["irsbot", *map(str, words)]),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            main()
            code = 0
        except SystemExit as end:
            code = int(end.code or 0)
    return Said(code, out.getvalue(), err.getvalue())
