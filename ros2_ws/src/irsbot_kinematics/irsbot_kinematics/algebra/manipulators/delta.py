"""The Delta-like robots of [S4], section 3: C_i = o_i + rho_i u_i, |P - C_i| = L, 0 < rho_i < 4."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from irsbot_kinematics.algebra.model.engine import AlgebraError
from irsbot_kinematics.algebra.model.exact import digits_of, exact, square_root
from irsbot_kinematics.algebra.model.system import Drawing, System

Vector = tuple[Fraction, Fraction, Fraction]
X, Y, Z = (
    (Fraction(1), Fraction(0), Fraction(0)),
    (Fraction(0), Fraction(1), Fraction(0)),
    (Fraction(0), Fraction(0), Fraction(1)),
)
ORIGIN = (Fraction(0), Fraction(0), Fraction(0))


@dataclass(frozen=True)
class DeltaRails:
    """Structure of a linear Delta: rails o_i, unit directions u_i, rods L."""

    origins: tuple[Vector, Vector, Vector]
    directions: tuple[Vector, Vector, Vector]
    rod: Fraction


def delta_system(
    name: str,
    origins: Sequence[Vector],
    directions: Sequence[Vector],
    rod: Any,
    low: Any,
    high: Any,
    joints: Sequence[str] = ("rho1", "rho2", "rho3"),
    description: str = "",
    unit: str = "",
) -> System:
    """The system of three rails; directions must be unit vectors up to the rounding of their coordinates."""
    length = exact(rod, "L")
    if not length > 0:
        raise AlgebraError(f"L must be positive, got {length}")
    equations, points, chains = [], {"P": ("x", "y", "z")}, []
    for i, (o, u, rho) in enumerate(zip(origins, directions, joints, strict=True), 1):
        slide = tuple(_term(o[k], u[k], rho) for k in range(3))
        squares = " + ".join(f"({c} - ({s}))^2" for c, s in zip("xyz", slide, strict=True))
        equations.append(f"{squares} = L^2")
        points[f"O{i}"], points[f"C{i}"] = tuple(str(v) for v in o), slide  # type: ignore[assignment]
        chains.append([f"O{i}", f"C{i}", "P"])
    return System(
        equations,
        pose=["x", "y", "z"],
        joints=list(joints),
        parameters={"L": length},
        inequalities=[text for rho in joints for text in (f"{rho} > {low}", f"{rho} < {high}")],
        name=name,
        description=description or f"{name}: three carriages, rods of one length, three translations",
        units=dict.fromkeys(("x", "y", "z", *joints), unit) if unit else {},
        drawing=Drawing(points, chains, [], [(f"O{i}", f"C{i}") for i in (1, 2, 3)]),
        structure=DeltaRails(tuple(origins), tuple(directions), length),  # type: ignore[arg-type]
    )


def _term(origin: Fraction, direction: Fraction, rho: str) -> str:
    if direction == 0:
        return str(origin)
    return f"{origin} + {rho}" if direction == 1 else f"{origin} + ({direction})*{rho}"


def orthoglide(L: Any = 2, low: Any = 0, high: Any = 4) -> System:
    """Rails along x, y and z from the origin."""
    return delta_system("orthoglide", (ORIGIN,) * 3, (X, Y, Z), L, exact(low), exact(high))


def hybridglide(L: Any = 2, o: Any = 1, low: Any = 0, high: Any = 4) -> System:
    """Rails along y through (o, 0, 0) and (-o, 0, 0), along z from the origin."""
    e = exact(o, "o")
    origins = ((e, Fraction(0), Fraction(0)), (-e, Fraction(0), Fraction(0)), ORIGIN)
    return delta_system("hybridglide", origins, (Y, Y, Z), L, exact(low), exact(high))


def triaglide(L: Any = 2, o: Any = 1, low: Any = 0, high: Any = 4) -> System:
    """Rails along y through (o, 0, 0), (-o, 0, 0) and the origin."""
    e = exact(o, "o")
    origins = ((e, Fraction(0), Fraction(0)), (-e, Fraction(0), Fraction(0)), ORIGIN)
    return delta_system("triaglide", origins, (Y, Y, Y), L, exact(low), exact(high))


def uranesx(L: Any = 2, half_root_3: Any = "433/500", low: Any = 0, high: Any = 4) -> System:
    """Rails along z through the corners (1, 0) and (-1/2, +-sqrt 3/2) of a triangle; the root is rationalised.

    half_root_3: a rational number, or a number of digits as an int for sqrt(3)/2.
    """
    if isinstance(half_root_3, int):
        h = square_root(Fraction(3, 4), digits_of(half_root_3, "half_root_3"))
    else:
        h = exact(half_root_3, "half_root_3")
    origins = (
        (Fraction(1), Fraction(0), Fraction(0)),
        (Fraction(-1, 2), h, Fraction(0)),
        (Fraction(-1, 2), -h, Fraction(0)),
    )
    return delta_system("uranesx", origins, (Z, Z, Z), L, exact(low), exact(high))
