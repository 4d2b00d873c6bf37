"""Numbers that record what is done to them, so that equations for floats and arrays give a program."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, NoReturn

from irsbot_kinematics.numerics.arithmetic import Arithmetic


class NoClosedForm(TypeError):
    """Equations that need the values of their numbers: they branch on them, or iterate."""


class Operation(NamedTuple):
    """One step of a program: a function of earlier values or constants.

    name: "+", "-", "*", "/", or a function of `Arithmetic`.
    operands: names of values, or constants as Python writes them.
    """

    name: str
    operands: tuple[str, ...]


def stated(value: Symbol | float) -> str:
    """A value by its name, or a constant as Python writes it."""
    return value.name if isinstance(value, Symbol) else repr(float(value))


class Program:
    """Operations in the order of their execution. What is computed twice by the equations is one operation."""

    LETTER = "v"
    """First letter of the names of values."""

    def __init__(self) -> None:
        self._numbers: dict[Operation, int] = {}

    @property
    def operations(self) -> list[tuple[str, Operation]]:
        """Name and operation of every value, without the inputs."""
        return [(f"{self.LETTER}{number}", operation) for operation, number in self._numbers.items()]

    def input(self, name: str) -> Symbol:
        """A number that is given from outside."""
        return Symbol(self, name)

    def value(self, name: str, *operands: Symbol | float) -> Symbol:
        """The result of an operation."""
        operation = Operation(name, tuple(map(stated, operands)))
        return Symbol(self, f"{self.LETTER}{self._numbers.setdefault(operation, len(self._numbers))}")

    @property
    def arithmetic(self) -> Arithmetic[Any]:
        """The elementary functions, which record themselves."""
        value = self.value
        return Arithmetic(
            sin=lambda angle: value("sin", angle),
            cos=lambda angle: value("cos", angle),
            cos_sin=lambda angle: (value("cos", angle), value("sin", angle)),
            acos=lambda cosine: value("acos", cosine),
            atan2=lambda y, x: value("atan2", y, x),
            hypot=lambda x, y: value("sqrt", x * x + y * y),
            sqrt=lambda square: value("sqrt", square),
            safe_sqrt=lambda square: value("safe_sqrt", square),
            abs=lambda number: value("abs", number),
            minimum=lambda a, b: value("minimum", a, b),
            maximum=lambda a, b: value("maximum", a, b),
            ratio=lambda part, whole: value("ratio", part, whole),
            quotient=lambda above, below: value("quotient", above, below),
            wrap=lambda angle: value("wrap", angle),
        )


class Symbol:
    """A number of a program. Its value is not known: it cannot be compared, nor be part of an array."""

    __array_ufunc__ = None  # numpy raises TypeError instead of making an array of objects

    def __init__(self, program: Program, name: str) -> None:
        self._program = program
        self.name = name

    def __add__(self, other: Symbol | float) -> Symbol:
        return self._program.value("+", self, other)

    def __radd__(self, other: float) -> Symbol:
        return self._program.value("+", other, self)

    def __sub__(self, other: Symbol | float) -> Symbol:
        return self._program.value("-", self, other)

    def __rsub__(self, other: float) -> Symbol:
        return self._program.value("-", other, self)

    def __mul__(self, other: Symbol | float) -> Symbol:
        return self._program.value("*", self, other)

    def __rmul__(self, other: float) -> Symbol:
        return self._program.value("*", other, self)

    def __truediv__(self, other: Symbol | float) -> Symbol:
        return self._program.value("/", self, other)

    def __rtruediv__(self, other: float) -> Symbol:
        return self._program.value("/", other, self)

    def __neg__(self) -> Symbol:
        return self._program.value("-", self)

    def _refuse(self, *_others: object) -> NoReturn:
        raise NoClosedForm("the value of a symbol is not known")

    __bool__ = __float__ = __int__ = __index__ = _refuse
    __lt__: Callable[..., Any]
    __le__: Callable[..., Any]
    __gt__: Callable[..., Any]
    __ge__: Callable[..., Any]
    __lt__ = __le__ = __gt__ = __ge__ = __eq__ = __ne__ = _refuse
