"""Equations as text: polynomials in names, cos(a), sin(a) and tan(a), decimals taken as written."""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

from irsbot_kinematics.algebra.model.engine import AlgebraError
from irsbot_kinematics.algebra.model.exact import exact
from irsbot_kinematics.algebra.model.polynomial import context, rational


class Ratio(NamedTuple):
    """Numerator and denominator, polynomials of one ring."""

    top: Any
    bottom: Any


def cosine_of(angle: str) -> str:
    """Name of the generator that stands for cos(angle)."""
    return f"cos_{angle}"


def sine_of(angle: str) -> str:
    """Name of the generator that stands for sin(angle)."""
    return f"sin_{angle}"


def generators(names: Sequence[str], angles: Sequence[str]) -> tuple[str, ...]:
    """Names of the ring: an angle is a pair."""
    found: list[str] = []
    for name in names:
        found += [cosine_of(name), sine_of(name)] if name in angles else [name]
    return tuple(found)


class Reader:
    """Reads expressions over given names, some of which are angles, into the ring of all names."""

    def __init__(self, names: Sequence[str], angles: Sequence[str]) -> None:
        self.names, self.angles = tuple(names), tuple(angles)
        self.ring = context(generators(names, angles))
        self.one = self.ring.constant(1)

    def gen(self, name: str) -> Any:
        """The generator of that name."""
        return self.ring.gen(self.ring.variable_to_index(name))

    def polynomial(self, text: str | int | Fraction, what: str) -> Any:
        """An expression without denominators. Raises AlgebraError that names the expression."""
        top, bottom = self.ratio(text, what)
        if not bottom.is_constant():
            raise AlgebraError(f"{what} '{text}' divides by {bottom}: only numbers may be divided by")
        return top

    def ratio(self, text: str | int | Fraction, what: str) -> Ratio:
        """An expression as numerator over denominator, without common factors; the denominator is 1 where it can be."""
        stated = str(text).replace("^", "**")
        try:
            tree = ast.parse(stated.strip(), mode="eval").body
        except (SyntaxError, ValueError):
            raise AlgebraError(f"{what} '{text}' is no expression such as 'x^2 + y^2 - rho1^2'") from None
        top, bottom = self._read(tree, stated.strip(), what)
        shared = top.gcd(bottom)
        if not bottom.is_constant() and shared.is_constant():
            return Ratio(top, bottom)
        top, bottom = top / shared, bottom / shared
        return Ratio(top / bottom.leading_coefficient(), self.one) if bottom.is_constant() else Ratio(top, bottom)

    def _read(self, node: ast.expr, stated: str, what: str) -> Ratio:
        match node:
            case ast.Constant(value=int() | float()) if not isinstance(node.value, bool):
                written = ast.get_source_segment(stated, node) or str(node.value)
                return Ratio(self.ring.constant(rational(exact(written.replace("_", ""), what))), self.one)
            case ast.Name(id=name):
                return Ratio(self._named(name, what), self.one)
            case ast.UnaryOp(op=ast.USub(), operand=inner):
                top, bottom = self._read(inner, stated, what)
                return Ratio(-top, bottom)
            case ast.UnaryOp(op=ast.UAdd(), operand=inner):
                return self._read(inner, stated, what)
            case ast.Call(func=ast.Name(id=function), args=[argument], keywords=[]) if function in FUNCTIONS:
                return self._turned(function, argument, what)
            case ast.BinOp(left=left, op=ast.Pow(), right=right):
                return self._power(self._read(left, stated, what), right, what)
            case ast.BinOp(left=left, op=op, right=right):
                return self._combined(self._read(left, stated, what), op, self._read(right, stated, what), what)
        raise AlgebraError(
            f"{what}: '{ast.unparse(node)}' is not allowed; use + - * / ^, numbers, names, cos, sin, tan"
        )

    def _named(self, name: str, what: str) -> Any:
        if name in self.angles:
            raise AlgebraError(f"{what}: '{name}' is an angle and occurs only as cos({name}) or sin({name})")
        if name not in self.names:
            raise AlgebraError(f"{what}: '{name}' is not declared; declared are {', '.join(self.names)}")
        return self.gen(name)

    def _power(self, base: Ratio, exponent: ast.expr, what: str) -> Ratio:
        match exponent:
            case ast.Constant(value=int() as power) if 0 <= power <= 64:
                return Ratio(base.top**power, base.bottom**power)
        raise AlgebraError(f"{what}: the exponent '{ast.unparse(exponent)}' must be a whole number from 0 to 64")

    def _combined(self, left: Ratio, op: ast.operator, right: Ratio, what: str) -> Ratio:
        match op:
            case ast.Add():
                return Ratio(left.top * right.bottom + right.top * left.bottom, left.bottom * right.bottom)
            case ast.Sub():
                return Ratio(left.top * right.bottom - right.top * left.bottom, left.bottom * right.bottom)
            case ast.Mult():
                return Ratio(left.top * right.top, left.bottom * right.bottom)
            case ast.Div():
                if right.top == 0:
                    raise AlgebraError(f"{what} divides by zero")
                if right.top.is_constant():
                    return Ratio(left.top * right.bottom / right.top.leading_coefficient(), left.bottom)
                return Ratio(left.top * right.bottom, left.bottom * right.top)
        raise AlgebraError(f"{what}: only + - * / ^ are allowed")

    def _turned(self, function: str, argument: ast.expr, what: str) -> Ratio:
        c, s = self.pair(self.multiples(argument, what))
        return {"cos": Ratio(c, self.one), "sin": Ratio(s, self.one), "tan": Ratio(s, c)}[function]

    def multiples(self, node: ast.expr, what: str) -> dict[str, int]:
        """A sum of whole multiples of angles, such as a1 + a2 - 2*a3."""
        match node:
            case ast.Name(id=name):
                if name not in self.angles:
                    raise AlgebraError(f"{what}: '{name}' is not declared as an angle")
                return {name: 1}
            case ast.UnaryOp(op=ast.USub(), operand=inner):
                return {name: -k for name, k in self.multiples(inner, what).items()}
            case ast.BinOp(left=ast.Constant(value=int() as k), op=ast.Mult(), right=inner):
                return {name: k * m for name, m in self.multiples(inner, what).items()}
            case ast.BinOp(left=left, op=ast.Add() | ast.Sub() as op, right=right):
                total, sign = self.multiples(left, what), 1 if isinstance(op, ast.Add) else -1
                for name, k in self.multiples(right, what).items():
                    total[name] = total.get(name, 0) + sign * k
                return total
        raise AlgebraError(f"{what}: '{ast.unparse(node)}' must be a sum of whole multiples of angles")

    def pair(self, multiples: Mapping[str, int]) -> tuple[Any, Any]:
        """cos and sin of a sum of whole multiples of angles, expanded."""
        c, s = self.one, 0 * self.one
        for name, k in multiples.items():
            for _ in range(abs(k)):
                a, b = self.gen(cosine_of(name)), self.gen(sine_of(name))
                b = b if k > 0 else -b
                c, s = c * a - s * b, s * a + c * b
        return c, s


FUNCTIONS = ("cos", "sin", "tan")


def two_sides(text: str, what: str) -> tuple[str, str]:
    """(left, right) of an equation; right is 0 if there is no equals sign."""
    sides = text.split("=")
    if len(sides) > 2:
        raise AlgebraError(f"{what} '{text}' has more than one '='")
    return (sides[0], sides[1]) if len(sides) == 2 else (sides[0], "0")


def positive_side(text: str, what: str) -> str:
    """The expression that is positive by an inequality."""
    if text.count("<") + text.count(">") != 1 or "=" in text:
        raise AlgebraError(f"{what} '{text}' must be strict and simple, such as 'rho1 > 0'")
    if ">" in text:
        left, right = text.split(">")
    else:
        right, left = text.split("<")
    return f"({left}) - ({right})"
