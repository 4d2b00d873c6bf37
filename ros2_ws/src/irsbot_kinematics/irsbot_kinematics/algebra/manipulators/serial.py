"""Serial 3R manipulator with orthogonal axes (alpha = -90, 90 deg, r3 = 0)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from irsbot_kinematics.algebra.model.system import Drawing, System


@dataclass(frozen=True)
class Orthogonal3R:
    """Structure: the inverse kinematics is a quartic in tan(th3/2)."""


def serial_3r(d2: Any = 1, d3: Any = 2, d4: Any = "3/2", r2: Any = 1) -> System:
    """Position (x, y, z) of three orthogonal axes: A = d3 + d4 c3, B = r2 + d4 s3, radius (d2 + A c2, B), z = -A s2."""
    A, B = "(d3 + d4*cos(th3))", "(r2 + d4*sin(th3))"
    reach = f"(d2 + {A}*cos(th2))"
    return System(
        [
            f"x = {reach}*cos(th1) - {B}*sin(th1)",
            f"y = {reach}*sin(th1) + {B}*cos(th1)",
            f"z = -{A}*sin(th2)",
        ],
        pose=["x", "y", "z"],
        joints=["th1", "th2", "th3"],
        angles=["th1", "th2", "th3"],
        parameters={"d2": d2, "d3": d3, "d4": d4, "r2": r2},
        name="serial_3r",
        description="serial 3R with orthogonal axes",
        units={"th1": "rad", "th2": "rad", "th3": "rad"},
        drawing=Drawing(
            {
                "O": ("0", "0", "0"),
                "E1": ("d2*cos(th1)", "d2*sin(th1)", "0"),
                "E2": (
                    "(d2 + d3*cos(th2))*cos(th1) - r2*sin(th1)",
                    "(d2 + d3*cos(th2))*sin(th1) + r2*cos(th1)",
                    "-d3*sin(th2)",
                ),
                "P": ("x", "y", "z"),
            },
            [["O", "E1", "E2", "P"]],
            [],
            ["O", "E1", "E2"],
        ),
        structure=Orthogonal3R(),
    )
