"""Rows of the campaign for tests of its runner: a row's process imports them."""

from __future__ import annotations

from irsbot_supervisor.validation.harness.rows import Job, Row, Tally


def break_down(_job: Job) -> Row:
    raise ValueError("out of luck")


def not_met(work: Job) -> Row:
    tally = Tally("bad", work)
    tally.case(unsafe="allowed")
    tally.case(failed="late")
    tally.case()
    return tally.row()
