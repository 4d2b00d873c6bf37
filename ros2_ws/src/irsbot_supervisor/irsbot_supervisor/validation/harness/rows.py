"""A row of the fault campaign: one kind of fault, tried many times, and its result.

A row is a function from a `Job` to a `Row`. It never raises for what it finds: it counts faults. `registry` lists all
rows with their full and quick amounts.
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
    """Amount of work for a row."""

    amount: int  # number of cases; each row defines its case
    seed: int
    tell: Callable[[int], None]  # call it with the number of cases done since the last call
    robots: tuple[str, ...] = ()  # for rows that run over several robots; empty: all of them


class Row(NamedTuple):
    """Result of a row."""

    name: str
    amount: int  # cases that were tried
    unsafe: int
    """Cases in which motion was allowed (OK or WARN in force) although an oracle outside the core required a stop."""
    failed: int
    """Cases in which another requirement was not met; a case may be unsafe and failed."""
    figures: Mapping[str, float]  # measurements, by a text with the unit; the three above have columns
    note: str = ""  # the first thing that went wrong, or what a reader of the table should know

    @property
    def ok(self) -> bool:
        """True if the row is met: it has at least one case, none unsafe and none failed."""
        return self.amount > 0 and self.unsafe == 0 and self.failed == 0


class Entry(NamedTuple):
    """A row in the registry."""

    name: str  # as in `irsbot faults --only NAME`
    must: str  # one line: the requirement
    full: int  # cases of the whole campaign
    quick: int  # cases of `--quick`
    run: Callable[[Job], Row]
    over_robots: bool = False  # spreads its cases over the robots of the job
    needs_ros: bool = False  # starts nodes as processes


class Tally:
    """Counts during a row, and keeps the first fault."""

    def __init__(self, name: str, job: Job) -> None:
        self._name, self._job = name, job
        self._amount = self._unsafe = self._failed = 0
        self._note = ""
        self.figures: dict[str, float] = {}

    def case(self, unsafe: str = "", failed: str = "") -> None:
        """Count one case. unsafe, failed: its faults, empty if none."""
        self._amount += 1
        self._unsafe += bool(unsafe)
        self._failed += bool(failed)
        self._note = self._note or unsafe or failed
        self._job.tell(1)

    def many(self, amount: int, failed: int = 0, note: str = "") -> None:
        """Count many cases, some of which failed."""
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
        """Result of the row so far."""
        return Row(self._name, self._amount, self._unsafe, self._failed, dict(self.figures), self._note)
