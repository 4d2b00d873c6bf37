"""Planar platforms on three legs. [S4] prints lengths of the 3-RPR alone; the other defaults are ours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from irsbot_kinematics.algebra.model.engine import AlgebraError
from irsbot_kinematics.algebra.model.exact import angle_pair, digits_of, exact, square_root
from irsbot_kinematics.algebra.model.system import Drawing, System

POINT_DIGITS = 40
"""1: digits after the point of rationalised square roots."""


@dataclass(frozen=True)
class Leg:
    """A leg that holds platform point (bx, by) at a distance from (kx, ky); texts over joints and parameters."""

    bx: str
    by: str
    kx: str
    ky: str
    square: str

    @property
    def equation(self) -> str:
        """|p + R b - k|^2 = square."""
        x = f"x + {self.bx}*cos(phi) - ({self.by})*sin(phi) - ({self.kx})"
        y = f"y + {self.bx}*sin(phi) + ({self.by})*cos(phi) - ({self.ky})"
        return f"({x})^2 + ({y})^2 = {self.square}"


@dataclass(frozen=True)
class PlanarLegs:
    """A planar platform with two or three circles as legs: its direct kinematics is one equation of degree 6."""

    legs: tuple[Leg, ...]
    line: str | None = None
    """Two legs only: abscissa of the point of y = 0 through which the platform's x axis passes."""


def planar_drawing(legs: Sequence[Leg], feet: Sequence[tuple[str, str]]) -> Drawing:
    """Base joints, carriages and platform joints of three legs."""
    points: dict[str, Sequence[str]] = {}
    for i, (leg, foot) in enumerate(zip(legs, feet, strict=True), 1):
        points[f"A{i}"] = foot
        if (leg.kx, leg.ky) != foot:
            points[f"C{i}"] = (leg.kx, leg.ky)
        points[f"B{i}"] = (
            f"x + {leg.bx}*cos(phi) - ({leg.by})*sin(phi)",
            f"y + {leg.bx}*sin(phi) + ({leg.by})*cos(phi)",
        )
    chains = [[name for name in (f"A{i}", f"C{i}", f"B{i}") if name in points] for i in (1, 2, 3)]
    return Drawing(
        points, chains, [["B1", "B2", "B3"]], [(f"A{i}", f"C{i}" if f"C{i}" in points else f"B{i}") for i in (1, 2, 3)]
    )


def _platform(d1: Any, d2: Any, d3: Any, beta: Any, digits: Any) -> dict[str, Fraction]:
    """b2 = (d1, 0) and b3 = d3 (cos beta, sin beta); beta, where given, replaces d2."""
    first, third, places = exact(d1, "d1"), exact(d3, "d3"), digits_of(digits, "digits")
    if beta is not None:
        c, s = angle_pair(beta, "beta")
        return {"d1": first, "b3x": third * c, "b3y": third * s}
    second = exact(d2, "d2")
    if first == 0:
        raise AlgebraError("d1 must not be 0")
    along = (first**2 + third**2 - second**2) / (2 * first)
    if along**2 > third**2:
        raise AlgebraError(f"no platform triangle has the sides d1 = {first}, d2 = {second}, d3 = {third}")
    return {
        "d1": first,
        "b3x": Fraction(round(along * 10**places), 10**places),
        "b3y": square_root(third**2 - along**2, places),
    }


def rpr3(
    d1: Any = "17.04",
    d2: Any = "16.54",
    d3: Any = "20.84",
    beta: Any = None,
    A2x: Any = "15.91",
    A3x: Any = 0,
    A3y: Any = 10,
    digits: Any = POINT_DIGITS,
) -> System:
    """3-RPR of [S4], Listing 8: legs rho_i from A1 = 0, A2 = (A2x, 0), A3 to B1 = P, B2, B3.

    beta (rad or pair) replaces d2. digits: of the rationalised ordinate of B3.
    """
    legs = (
        Leg("0", "0", "0", "0", "rho1^2"),
        Leg("d1", "0", "A2x", "0", "rho2^2"),
        Leg("b3x", "b3y", "A3x", "A3y", "rho3^2"),
    )
    return System(
        [leg.equation for leg in legs],
        pose=["x", "y", "phi"],
        joints=["rho1", "rho2", "rho3"],
        angles=["phi"],
        parameters={**_platform(d1, d2, d3, beta, digits), "A2x": A2x, "A3x": A3x, "A3y": A3y},
        inequalities=["rho1 > 0", "rho2 > 0", "rho3 > 0"],
        name="3rpr",
        description="planar 3-RPR: three legs of variable length",
        units={"phi": "rad"},
        drawing=planar_drawing(legs, [("0", "0"), ("A2x", "0"), ("A3x", "A3y")]),
        structure=PlanarLegs(legs),
    )


def rpr3_full(**lengths: Any) -> System:
    """3-RPR with the passive angles theta_i of its legs; lengths as for 3rpr."""
    plain = rpr3(**lengths)
    assert isinstance(plain.structure, PlanarLegs)
    equations = []
    for i, leg in enumerate(plain.structure.legs, 1):
        equations.append(f"x + {leg.bx}*cos(phi) - ({leg.by})*sin(phi) - ({leg.kx}) = rho{i}*cos(theta{i})")
        equations.append(f"y + {leg.bx}*sin(phi) + ({leg.by})*cos(phi) - ({leg.ky}) = rho{i}*sin(theta{i})")
    return System(
        equations,
        pose=plain.pose,
        joints=plain.joints,
        passive=["theta1", "theta2", "theta3"],
        angles=["phi", "theta1", "theta2", "theta3"],
        parameters=plain.parameters,
        inequalities=plain.inequalities,
        name="3rpr_full",
        description="planar 3-RPR with the passive angles of its legs",
        units={"phi": "rad"} | {f"theta{i}": "rad" for i in (1, 2, 3)},
        drawing=plain.drawing,
    )


def prr3(
    l: Any = 3,
    o2x: Any = 6,
    o2y: Any = 0,
    o3x: Any = 1,
    o3y: Any = 6,
    u2: Any = ("-3/5", "4/5"),
    b2x: Any = 2,
    b2y: Any = 0,
    b3x: Any = 1,
    b3y: Any = "3/2",
) -> System:
    """3-PRR: carriages at o_i + r_i u_i, rods l; o1 = 0, u1 = (1, 0), u3 = (0, -1), b1 = 0."""
    legs = (
        Leg("0", "0", "r1", "0", "l^2"),
        Leg("b2x", "b2y", "o2x + r2*cos(u2)", "o2y + r2*sin(u2)", "l^2"),
        Leg("b3x", "b3y", "o3x", "o3y - r3", "l^2"),
    )
    return System(
        [leg.equation for leg in legs],
        pose=["x", "y", "phi"],
        joints=["r1", "r2", "r3"],
        angles=["phi", "u2"],
        parameters={
            "l": l,
            "o2x": o2x,
            "o2y": o2y,
            "o3x": o3x,
            "o3y": o3y,
            "u2": u2,
            "b2x": b2x,
            "b2y": b2y,
            "b3x": b3x,
            "b3y": b3y,
        },
        name="3prr",
        description="planar 3-PRR: three carriages and rods",
        units={"phi": "rad"},
        drawing=planar_drawing(legs, [("0", "0"), ("o2x", "o2y"), ("o3x", "o3y")]),
        structure=PlanarLegs(legs),
    )


def _two_carriages(b2x: str = "b2x") -> tuple[Leg, Leg]:
    return Leg(b2x, "0", "r2", "o2y", "l2^2"), Leg("b3x", "b3y", "o3x", "r3", "l3^2")


def rpr_2prr(
    o2y: Any = 3, b2x: Any = 2, l2: Any = 3, o3x: Any = 5, b3x: Any = 1, b3y: Any = 2, l3: Any = "5/2"
) -> System:
    """RPR-2PRR: leg 1 of length r1 from the origin, carriages 2 on y = o2y and 3 on x = o3x."""
    second, third = _two_carriages()
    legs = (Leg("0", "0", "0", "0", "r1^2"), second, third)
    return System(
        [leg.equation for leg in legs],
        pose=["x", "y", "phi"],
        joints=["r1", "r2", "r3"],
        angles=["phi"],
        parameters={"o2y": o2y, "b2x": b2x, "l2": l2, "o3x": o3x, "b3x": b3x, "b3y": b3y, "l3": l3},
        inequalities=["r1 > 0"],
        name="rpr_2prr",
        description="planar RPR-2PRR: one leg of variable length, two carriages and rods",
        units={"phi": "rad"},
        drawing=planar_drawing(legs, [("0", "0"), ("0", "o2y"), ("o3x", "0")]),
        structure=PlanarLegs(legs),
    )


def prp_2prr(
    o2y: Any = 3, b2x: Any = 2, l2: Any = 3, o3x: Any = 5, b3x: Any = 1, b3y: Any = 2, l3: Any = "5/2"
) -> System:
    """PRP-2PRR: carriage r1 on y = 0 lies on the platform's x axis; carriages 2 and 3 as in RPR-2PRR."""
    second, third = _two_carriages()
    return System(
        ["cos(phi)*y - sin(phi)*(x - r1) = 0", second.equation, third.equation],
        pose=["x", "y", "phi"],
        joints=["r1", "r2", "r3"],
        angles=["phi"],
        parameters={"o2y": o2y, "b2x": b2x, "l2": l2, "o3x": o3x, "b3x": b3x, "b3y": b3y, "l3": l3},
        name="prp_2prr",
        description="planar PRP-2PRR: a carriage on the platform's line, two carriages and rods",
        units={"phi": "rad"},
        drawing=Drawing(
            {
                "C1": ("r1", "0"),
                "B1": ("x", "y"),
                "A2": ("0", "o2y"),
                "C2": ("r2", "o2y"),
                "B2": ("x + b2x*cos(phi)", "y + b2x*sin(phi)"),
                "A3": ("o3x", "0"),
                "C3": ("o3x", "r3"),
                "B3": ("x + b3x*cos(phi) - b3y*sin(phi)", "y + b3x*sin(phi) + b3y*cos(phi)"),
            },
            [["C1", "B1"], ["A2", "C2", "B2"], ["A3", "C3", "B3"]],
            [["B1", "B2", "B3"]],
            [("A2", "C2"), ("A3", "C3")],
        ),
        structure=PlanarLegs((second, third), "r1"),
    )
