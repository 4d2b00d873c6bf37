"""What a row of the fault campaign is: one kind of fault, tried many times, and what came of it.

A row is a function from a `Job` to a `Row`. It never raises for what it finds: what goes wrong is counted. `registry`
lists all rows with their full and quick amounts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

FALSE_STOPS = "false stops"
"""Figure: cases or samples in which motion was forbidden although nothing was wrong."""

TO_STOP_S = "longest time to STOP or UNKNOWN [s]"
"""Figure: from the fault to the first verdict that forbids motion."""

RECOVERY_S = "longest recovery [s]"
"""Figure: from the end of the fault to OK or WARN, without a restart."""


class Job(NamedTuple):
    """How much of a row is to be done."""

    amount: int  # cases; each row says what a case is
    seed: int
    tell: Callable[[int], None]  # call it with the number of cases done since the last call
    robots: tuple[str, ...] = ()  # for rows that run over several robots; empty: all of them


class Row(NamedTuple):
    """What came of a row."""

    name: str
    amount: int  # cases that were tried
    unsafe: int
    """Cases in which motion was allowed (OK or WARN in force) while an oracle outside the core said stop or unknown."""
    failed: int
    """Cases in which something else was not as it must be; a case may be unsafe and failed."""
    figures: Mapping[str, float]  # what was measured, by a text with its unit; the three above have columns
    note: str = ""  # the first thing that went wrong, or what a reader of the table should know

    @property
    def ok(self) -> bool:
        """Whether the row is met: something was tried, nothing was unsafe, nothing failed."""
        return self.amount > 0 and self.unsafe == 0 and self.failed == 0


class Entry(NamedTuple):
    """A row in the registry."""

    name: str  # as in `irsbot faults --only NAME`
    must: str  # one line: what has to hold
    full: int  # cases of the whole campaign
    quick: int  # cases of `--quick`
    run: Callable[[Job], Row]
    over_robots: bool = False  # spreads its cases over the robots of the job
    needs_ros: bool = False  # starts nodes as processes


class Tally:
    """Counts while a row goes on, and keeps the first fault that was met."""

    def __init__(self, name: str, job: Job) -> None:
        self._name, self._job = name, job
        self._amount = self._unsafe = self._failed = 0
        self._note = ""
        self.figures: dict[str, float] = {}

    def case(self, unsafe: str = "", failed: str = "") -> None:
        """One case is done. unsafe, failed: what was wrong with it, empty for nothing."""
        self._amount += 1
        self._unsafe += bool(unsafe)
        self._failed += bool(failed)
        self._note = self._note or unsafe or failed
        self._job.tell(1)

    def many(self, amount: int, failed: int = 0, note: str = "") -> None:
        """Many cases are done, some of which failed."""
        self._amount += amount
        self._failed += failed
        self._note = self._note or note
        self._job.tell(amount)

    def largest(self, figure: str, value: float) -> None:
        """Keep the largest value of a figure."""
        self.figures[figure] = max(value, self.figures.get(figure, value))

    def smallest(self, figure: str, value: float) -> None:
        """Keep the smallest value of a figure."""
        self.figures[figure] = min(value, self.figures.get(figure, value))

    def add(self, figure: str, value: float = 1.0) -> None:
        """Add to a figure."""
        self.figures[figure] = self.figures.get(figure, 0.0) + value

    def row(self) -> Row:
        """What came of the row so far."""
        return Row(self._name, self._amount, self._unsafe, self._failed, dict(self.figures), self._note)
