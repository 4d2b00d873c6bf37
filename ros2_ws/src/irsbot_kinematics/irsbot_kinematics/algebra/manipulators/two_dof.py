"""Manipulators with one or two degrees of freedom. [S4] prints no lengths: the defaults are ours."""

from __future__ import annotations

from typing import Any

from irsbot_kinematics.algebra.model.system import Drawing, System


def rprrp(h: Any = "1/2", L: Any = 2) -> System:
    """RPRRP: P at r1 from the origin and, by a rod L, from a carriage (r2, h)."""
    return System(
        ["x^2 + y^2 = r1^2", "(x - r2)^2 + (y - h)^2 = L^2"],
        pose=["x", "y"],
        joints=["r1", "r2"],
        parameters={"h": h, "L": L},
        inequalities=["r1 > 0"],
        name="rprrp",
        description="planar RPRRP: a leg of variable length and a carriage with a rod",
        drawing=Drawing({"A": ("0", "0"), "P": ("x", "y"), "C": ("r2", "h")}, [["A", "P", "C"]], [], [("A", "P")]),
    )


def prrp(g: Any = ("3/5", "4/5"), L: Any = 2) -> System:
    """PRRP: a rod L between carriages y on the y axis and r on a line at the angle g to it."""
    return System(
        ["r^2 + y^2 - 2*r*y*cos(g) = L^2"],
        pose=["y"],
        joints=["r"],
        angles=["g"],
        parameters={"g": g, "L": L},
        name="prrp",
        description="planar PRRP: a rod between two carriages",
        drawing=Drawing(
            {"O": ("0", "0"), "P": ("0", "y"), "C": ("r*sin(g)", "r*cos(g)")}, [["O", "C", "P"]], [], [("O", "C")]
        ),
    )


def rr_rrr(l1: Any = "3/8", l2: Any = "33/40", b: Any = "11/80") -> System:
    """RR-RRR (five-bar): cranks l1 about (-b, 0) and (b, 0), rods l2 to P; defaults are those of `five_bar`."""
    return System(
        [
            "(x + b - l1*cos(q1))^2 + (z - l1*sin(q1))^2 = l2^2",
            "(x - b - l1*cos(q2))^2 + (z - l1*sin(q2))^2 = l2^2",
        ],
        pose=["x", "z"],
        joints=["q1", "q2"],
        angles=["q1", "q2"],
        parameters={"l1": l1, "l2": l2, "b": b},
        name="rr_rrr",
        description="planar five-bar RR-RRR: two cranks and two rods",
        units={"x": "m", "z": "m", "q1": "rad", "q2": "rad"},
        drawing=five_bar_drawing(1),
    )


def five_bar_drawing(turn: int) -> Drawing:
    """Cranks and rods; turn: +1 or -1, the sense in which the cranks count."""
    up = "l1*sin(q1)" if turn > 0 else "-l1*sin(q1)"
    return Drawing(
        {
            "A1": ("-b", "0"),
            "C1": ("-b + l1*cos(q1)", up),
            "P": ("x", "z"),
            "C2": ("b + l1*cos(q2)", up.replace("q1", "q2")),
            "A2": ("b", "0"),
        },
        [["A1", "C1", "P", "C2", "A2"]],
        [],
        ["A1", "A2"],
    )
