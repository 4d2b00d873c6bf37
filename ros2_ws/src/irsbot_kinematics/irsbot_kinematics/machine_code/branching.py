"""Numbers that record what is done to them and may be compared: a program of one way through equations that branch.

Every comparison is taken to be true and becomes a guard: where it is not true, the program says nothing. `Trace` can
also take one guard to be false, to find out what the equations answer then.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from irsbot_kinematics.machine_code.symbols import Operation, Program, Symbol, stated


class Guard(NamedTuple):
    """A comparison that is true on the way of the program."""

    place: int  # number of operations before it
    left: str
    sign: str
    right: str


class Further(Exception):
    """Behind a guard that is not true, the equations do more than to return."""


class Trace(Program):
    """One run of equations. denied: number of a guard that is taken to be false; from then on, nothing new is
    computed."""

    def __init__(self, denied: int | None = None) -> None:
        super().__init__()
        self.guards: list[Guard] = []
        self._denied = denied

    @property
    def _ended(self) -> bool:
        return self._denied is not None and len(self.guards) > self._denied

    def input(self, name: str) -> Number:
        """A number that is given from outside."""
        return Number(self, name)

    def value(self, name: str, *operands: Symbol | float) -> Number:
        """The result of an operation."""
        if self._ended and Operation(name, tuple(map(stated, operands))) not in self._numbers:
            raise Further
        return Number(self, super().value(name, *operands).name)

    def compared(self, left: Symbol, sign: str, right: Symbol | float) -> Condition:
        """The result of a comparison."""
        return Condition(self, Guard(len(self._numbers), stated(left), sign, stated(right)))

    def decided(self, guard: Guard) -> bool:
        """The answer to a comparison."""
        if self._ended:
            raise Further
        self.guards.append(guard)
        return not self._ended


class Condition:
    """A comparison that is decided when its truth is asked for."""

    def __init__(self, trace: Trace, guard: Guard) -> None:
        self._trace, self._guard = trace, guard

    def __bool__(self) -> bool:
        return self._trace.decided(self._guard)


class Number(Symbol):
    """A number of a trace."""

    _program: Trace

    def __abs__(self) -> Number:
        return self._program.value("abs", self)

    def __lt__(self, other: Symbol | float) -> Any:
        return self._program.compared(self, "<", other)

    def __le__(self, other: Symbol | float) -> Any:
        return self._program.compared(self, "<=", other)

    def __gt__(self, other: Symbol | float) -> Any:
        return self._program.compared(self, ">", other)

    def __ge__(self, other: Symbol | float) -> Any:
        return self._program.compared(self, ">=", other)
