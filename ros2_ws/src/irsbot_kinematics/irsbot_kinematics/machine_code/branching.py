"""Numbers that record what is done to them and may be compared: programs of equations that branch.

A `Trace` takes every comparison to be true and keeps it as a guard: where it is not true, the program says nothing. It
can also take one guard to be false, to find out what the equations answer then. A `Branch` is told the answers of the
first comparisons and ends at the next one: with both answers to it, all ways through short equations are found.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from irsbot_kinematics.machine_code.symbols import Operation, Program, Symbol, stated


class Comparison(NamedTuple):
    """left sign right: names of values, or constants as Python writes them."""

    left: str
    sign: str
    right: str


class Guard(NamedTuple):
    """Comparisons that are all true on the way of the program."""

    place: int  # number of operations before them
    comparisons: tuple[Comparison, ...]


class Further(Exception):
    """Behind a guard that is not true, the equations do more than to return."""


class Undecided(Exception):
    """The answer to a guard was not told."""

    def __init__(self, guard: Guard) -> None:
        super().__init__(guard)
        self.guard = guard


class Recorder(Program, ABC):
    """A program of numbers that may be compared."""

    def input(self, name: str) -> Number:
        """A number that is given from outside."""
        return Number(self, name)

    def value(self, name: str, *operands: Symbol | float) -> Number:
        """The result of an operation."""
        return Number(self, super().value(name, *operands).name)

    @abstractmethod
    def decided(self, comparisons: tuple[Comparison, ...]) -> bool:
        """The answer to comparisons: are they all true?"""


class Trace(Recorder):
    """One run of equations. denied: number of a guard that is taken to be false; from then on, nothing new is
    computed."""

    def __init__(self, denied: int | None = None) -> None:
        super().__init__()
        self.guards: list[Guard] = []
        self._denied = denied

    @property
    def _ended(self) -> bool:
        return self._denied is not None and len(self.guards) > self._denied

    def value(self, name: str, *operands: Symbol | float) -> Number:
        """The result of an operation."""
        if self._ended and Operation(name, tuple(map(stated, operands))) not in self._numbers:
            raise Further
        return super().value(name, *operands)

    def decided(self, comparisons: tuple[Comparison, ...]) -> bool:
        """True, except at the guard that is denied."""
        if self._ended:
            raise Further
        self.guards.append(Guard(len(self._numbers), comparisons))
        return not self._ended


class Branch(Recorder):
    """One run of equations with these answers to the first comparisons; Undecided at the next one."""

    LETTER = "w"

    def __init__(self, answers: Sequence[bool]) -> None:
        super().__init__()
        self._answers = iter(answers)

    def decided(self, comparisons: tuple[Comparison, ...]) -> bool:
        """The answer that was told."""
        for answer in self._answers:
            return answer
        raise Undecided(Guard(len(self._numbers), comparisons))


class Condition:
    """Comparisons that are decided when their truth is asked for: are they all true?"""

    def __init__(self, recorder: Recorder, *comparisons: Comparison) -> None:
        self.recorder, self.comparisons = recorder, comparisons

    def __bool__(self) -> bool:
        return self.recorder.decided(self.comparisons)


def all_of(conditions: Iterable[Any]) -> Any:
    """The built-in function `all`, also of conditions, which become one."""
    known = list(conditions)
    asked = [one for one in known if isinstance(one, Condition)]
    if not asked or not all(one for one in known if not isinstance(one, Condition)):
        return not asked and all(known)
    return Condition(asked[0].recorder, *[comparison for one in asked for comparison in one.comparisons])


class Number(Symbol):
    """A number of a recorder."""

    _program: Recorder

    def __abs__(self) -> Number:
        return self._program.value("abs", self)

    def _compared(self, sign: str, other: Symbol | float) -> Condition:
        return Condition(self._program, Comparison(self.name, sign, stated(other)))

    def __lt__(self, other: Symbol | float) -> Any:
        return self._compared("<", other)

    def __le__(self, other: Symbol | float) -> Any:
        return self._compared("<=", other)

    def __gt__(self, other: Symbol | float) -> Any:
        return self._compared(">", other)

    def __ge__(self, other: Symbol | float) -> Any:
        return self._compared(">=", other)
