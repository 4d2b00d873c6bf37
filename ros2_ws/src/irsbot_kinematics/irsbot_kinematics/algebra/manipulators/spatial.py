"""Spatial platforms on three legs; the rotation is a unit quaternion (a, b, c, d). [S4] prints no lengths: ours."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from irsbot_kinematics.algebra.manipulators.planar import POINT_DIGITS
from irsbot_kinematics.algebra.model.engine import AlgebraError
from irsbot_kinematics.algebra.model.exact import digits_of, exact, square_root
from irsbot_kinematics.algebra.model.system import System

R = {
    "11": "(a^2 + b^2 - c^2 - d^2)", "12": "(2*(b*c - a*d))", "13": "(2*(b*d + a*c))",
    "21": "(2*(b*c + a*d))", "22": "(a^2 - b^2 + c^2 - d^2)", "23": "(2*(c*d - a*b))",
    "31": "(2*(b*d - a*c))", "32": "(2*(c*d + a*b))", "33": "(a^2 - b^2 - c^2 + d^2)",
}  # fmt: skip
"""Entries of the rotation matrix of a unit quaternion."""
UNIT = "a^2 + b^2 + c^2 + d^2 = 1"


def ppps3(h: Any = None, digits: Any = POINT_DIGITS) -> System:
    """3-PPPS with U base: legs 1, 2 drive (y, z) of (-1/2, 0, 0), (1/2, 0, 0), leg 3 drives (x, z) of (0, h, 0).

    h: sqrt(3)/2, rationalised, if left out. Each rotation occurs as two quaternions.
    """
    height = square_root(Fraction(3, 4), digits_of(digits, "digits")) if h is None else exact(h, "h")
    corners = (("-1/2", "0"), ("1/2", "0"), ("0", "h"))
    driven = (("x1", "y1", "z1"), ("x2", "y2", "z2"), ("x3", "y3", "z3"))
    equations = [
        f"{centre} + {R[f'{i}1']}*({bx}) + {R[f'{i}2']}*({by}) = {names[i - 1]}"
        for (bx, by), names in zip(corners, driven, strict=True)
        for i, centre in ((1, "x"), (2, "y"), (3, "z"))
    ]
    return System(
        [*equations, UNIT],
        pose=["x", "y", "z", "a", "b", "c", "d"],
        joints=["y1", "z1", "y2", "z2", "x3", "z3"],
        passive=["x1", "x2", "y3"],
        parameters={"h": height},
        name="3ppps",
        description="3-PPPS with U base, six degrees of freedom",
    )


@dataclass(frozen=True)
class UprightRods:
    """Structure of a 3-PRS: carriage i at (radius, height) in its upright plane, one of the two driven."""

    radius: Fraction | None
    """Radius of the carriages; None if it is actuated."""
    rod: Fraction
    platform: Fraction


def prs3_upright(radius: Any = 3, l: Any = 4, p: Any = 1, digits: Any = POINT_DIGITS) -> System:
    """3-PRS v: upright rails at `radius`, carriage heights rho_i, rods l, platform radius p."""
    return _prs("3prs_v", exact(radius, "radius"), l, p, digits)


def prs3_level(l: Any = 4, p: Any = 1, digits: Any = POINT_DIGITS) -> System:
    """3-PRS h: level rails through one point, carriage radii rho_i, rods l, platform radius p."""
    return _prs("3prs_h", None, l, p, digits)


def _prs(name: str, radius: Fraction | None, l: Any, p: Any, digits: Any) -> System:
    """Points B_i = p (R at 0, 120, 240 deg) stay in the upright planes: three rational equations without a joint."""
    rod, platform = exact(l, "l"), exact(p, "p")
    if not (rod > 0 and platform > 0):
        raise AlgebraError("l and p must be positive")
    along = {1: f"x + p*{R['11']}", 2: f"-2*x + p*({R['11']} - w*{R['12']})", 3: f"-2*x + p*({R['11']} + w*{R['12']})"}
    height = {
        1: f"z + p*{R['31']}",
        2: f"z + p*(-{R['31']} + w*{R['32']})/2",
        3: f"z + p*(-{R['31']} - w*{R['32']})/2",
    }
    rods = []
    for i in (1, 2, 3):
        r, h = ("radius", f"rho{i}") if radius is not None else (f"rho{i}", "0")
        rods.append(f"({along[i]} - {r})^2 + ({height[i]} - {h})^2 = l^2")
    parameters = {"p": platform, "l": rod, "w": square_root(Fraction(3), digits_of(digits, "digits"))}
    if radius is not None:
        parameters["radius"] = radius
    return System(
        [UNIT, f"y = -p*{R['21']}", f"{R['21']} = {R['12']}", f"2*x = p*({R['11']} - {R['22']})", *rods],
        pose=["x", "y", "z", "a", "b", "c", "d"],
        joints=["rho1", "rho2", "rho3"],
        parameters=parameters,
        name=name,
        description=f"3-PRS with {'upright rails' if radius is not None else 'level rails through one point'}",
        structure=UprightRods(radius, rod, platform),
    )
