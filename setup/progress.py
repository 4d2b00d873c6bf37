"""Runs the commands of the set-up: output into a log file, progress on the screen."""

from __future__ import annotations

import os
import selectors
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

REDRAW_S = 0.5  # on a terminal
REMIND_S = 15.0  # elsewhere, where every reminder is a new line
GRACE_S = 10.0  # for an interrupted command to end by itself
TAIL_CHARACTERS = 8000


class CommandError(Exception):
    """A command of the set-up failed; its text is the end of what it wrote."""


class Progress:
    """Numbered steps on stderr, with elapsed time and present activity."""

    def __init__(self, log: Path, total: int, keep_open: Sequence[int] = ()) -> None:
        """keep_open: file descriptors that every command inherits."""
        log.parent.mkdir(parents=True, exist_ok=True)
        self._log = log.open("w", encoding="utf-8", errors="replace")
        self._total = total
        self._keep_open = keep_open
        self._number = 0
        self._title = ""
        self._began_s = 0.0
        self._drawn_s = 0.0
        self._terminal = sys.stderr.isatty()

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *error: object) -> None:
        self._log.close()

    @contextmanager
    def step(self, title: str) -> Iterator[None]:
        """Announce one step, and print its duration at its end."""
        self._number += 1
        self._title = title
        self._began_s = time.monotonic()
        self._draw("")
        try:
            yield
        except BaseException:
            if self._terminal:
                print(file=sys.stderr)
            raise
        self._draw("done", last=True)

    def run(
        self,
        command: Sequence[str],
        *,
        cwd: Path,
        env: Mapping[str, str],
        activity: Callable[[str], str] = lambda line: "",
    ) -> None:
        """Run a command to its end; activity converts a line of its output into a text for the screen, or "".

        Raises CommandError if it fails. An exception during the command, such as Ctrl-C, ends it and everything it
        started.
        """
        print("$", *command, file=self._log, flush=True)
        process = subprocess.Popen(
            command,
            cwd=cwd,
            env=dict(env),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,  # one group to end
            pass_fds=self._keep_open,
        )
        assert process.stdout is not None
        output = process.stdout
        try:
            tail = self._follow(output, activity)
            if process.wait() != 0:
                raise CommandError(tail)
        except BaseException:
            _end(process)
            raise
        finally:
            output.close()

    def _follow(self, output: IO[bytes], activity: Callable[[str], str]) -> str:
        """Copy the output of a command into the log until it ends; returns its last part."""
        tail = line = doing = ""
        with selectors.DefaultSelector() as ready:
            ready.register(output, selectors.EVENT_READ)
            while True:
                if ready.select(timeout=REDRAW_S):
                    read = os.read(output.fileno(), 65536).decode(errors="replace")
                    if not read:
                        return tail
                    self._log.write(read)
                    self._log.flush()
                    tail = (tail + read)[-TAIL_CHARACTERS:]
                    *lines, line = (line + read).split("\n")
                    doing = next(filter(None, map(activity, reversed(lines))), doing)
                if time.monotonic() - self._drawn_s > (REDRAW_S if self._terminal else REMIND_S):
                    self._draw(doing)

    def _draw(self, doing: str, last: bool = False) -> None:
        self._drawn_s = time.monotonic()
        elapsed_s = self._drawn_s - self._began_s
        text = f"[{self._number}/{self._total}] {self._title}"
        if elapsed_s >= 1.0 or doing:
            text += f"  {elapsed_s:.0f} s  {doing}".rstrip()
        if self._terminal:
            width = os.get_terminal_size(sys.stderr.fileno()).columns
            print(f"\r\x1b[K{text[: width - 1]}", end="\n" if last else "", file=sys.stderr, flush=True)
        else:
            print(text, file=sys.stderr, flush=True)


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a command and everything it started: first by a request, then by force."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM, signal.SIGHUP})
    try:
        for how in (signal.SIGINT, signal.SIGKILL):
            with suppress(ProcessLookupError, subprocess.TimeoutExpired):
                os.killpg(process.pid, how)
                process.wait(GRACE_S)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
