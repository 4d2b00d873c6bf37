"""Rows of the campaign for tests of its runner: a row's process imports them."""

from __future__ import annotations

import os
from pathlib import Path
from threading import Event

from irsbot_supervisor.validation.harness.rows import Job, Row, Tally


def break_down(_job: Job) -> Row:
    raise ValueError("out of luck")


def not_met(work: Job) -> Row:
    tally = Tally("bad", work)
    tally.case(unsafe="allowed")
    tally.case(failed="late")
    tally.case()
    return tally.row()


def end(_job: Job) -> Row:
    os._exit(3)


def tell_and_wait(job: Job) -> Row:
    """Write the process into the file that the job names as its robot, and never end."""
    write_and_wait(Path(job.robots[0]))
    raise AssertionError("nobody ends it")


def write_and_wait(file: Path) -> None:
    """Write the process into a file, and never end."""
    file.write_text(str(os.getpid()))
    Event().wait()
