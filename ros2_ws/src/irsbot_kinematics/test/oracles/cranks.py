"""Platforms on cranks: closures, their gradients and random poses, written once more from the drawings."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
import pytest

from irsbot_kinematics import Robot
from irsbot_kinematics.mechanisms.rrr3_base import Rrr3Base, Rrr3BaseGeometry
from irsbot_kinematics.mechanisms.ruu4 import Ruu4, Ruu4Geometry
from irsbot_kinematics.numerics.arithmetic import FLOATS

TRIANGLES = Rrr3BaseGeometry(  # nothing about it is symmetric
    a1=(-0.31, -0.16),
    a2=(0.29, -0.2),
    a3=(0.04, 0.33),
    b1=(-0.1, -0.03),
    b2=(0.08, -0.06),
    b3=(0.01, 0.11),
    l1=0.35,
    l2=0.42,
)
EQUAL = Rrr3BaseGeometry(
    **{f"a{i}": (0.35 * cos(t), 0.35 * sin(t)) for i, t in enumerate((7 * pi / 6, 11 * pi / 6, pi / 2), 1)},
    **{f"b{i}": (0.1 * cos(t), 0.1 * sin(t)) for i, t in enumerate((7 * pi / 6, 11 * pi / 6, pi / 2), 1)},
    l1=0.4,
    l2=0.4,
)
ROBOTS = {
    "general triangles": Robot(Rrr3Base(TRIANGLES)),
    "equilateral": Robot(Rrr3Base(EQUAL)),
    "4-RUU": Robot(Ruu4(Ruu4Geometry(0.35, 0.1, 0.3, 0.6))),
}
HOME = {"general triangles": (0.02, 0.01, 0.6), "equilateral": (0.03, 0.02, 0.9), "4-RUU": (0.03, 0.02, -0.42, 0.1)}
every_robot = pytest.mark.parametrize("name", ROBOTS)
EXACT = 1e-9
"""m or rad, away from singularities."""


def layout(robot):
    """Base points, platform points (n, 3) and both lengths."""
    g = robot.mechanism.geometry
    if isinstance(g, Ruu4Geometry):
        ways = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]], dtype=float)
        return g.rb * ways, g.rp * ways, g.l1, g.l2
    A, B = (np.array([[*getattr(g, f"{letter}{i}"), 0.0] for i in (1, 2, 3)]) for letter in "ab")
    return A, B, g.l1, g.l2


def rods(robot, q, x):
    """C_iB_i (n, 3); complex numbers pass."""
    A, B, l1, _ = layout(robot)
    position = np.array([x[0], x[1], x[2] if len(x) == 4 else 0.0 * x[0]])
    c, s = np.cos(x[-1]), np.sin(x[-1])
    turned = np.stack([c * B[:, 0] - s * B[:, 1], s * B[:, 0] + c * B[:, 1], B[:, 2] + 0.0 * c], axis=1)
    cranks = np.stack([np.cos(q), np.sin(q), 0.0 * np.asarray(q)], axis=1)
    return position + turned - A - l1 * cranks


def closure(robot, q, x):
    return np.sqrt(np.sum(rods(robot, q, x) ** 2, axis=1)) - layout(robot)[3]


def gradients(robot, q, x):
    step = 1e-30
    n = len(q)
    by_x = [np.imag(closure(robot, q, np.array(x) + 1j * step * np.eye(n)[i])) / step for i in range(n)]
    by_q = [np.imag(closure(robot, np.array(q) + 1j * step * np.eye(n)[i], np.array(x))) / step for i in range(n)]
    return np.array(by_x).T, np.array(by_q).T


def close(robot, q, near):
    x = np.array(near, dtype=float)
    for _ in range(30):
        error = closure(robot, q, x)
        if np.abs(error).max() < 1e-15:
            break
        x = x - np.linalg.solve(gradients(robot, q, x)[0], error)
    assert np.abs(error).max() < 1e-13
    return x


def random_poses(robot, rng, number, best=0.02):
    """(q, x, mode) of reachable poses with all margins above `best`."""
    m, found = robot.mechanism, []
    while len(found) < number:
        x = (
            *rng.uniform(-0.15, 0.15, 2),
            *([-rng.uniform(0.2, 0.5)] if len(m.task) == 4 else []),
            rng.uniform(-pi, pi),
        )
        mode = m.working_modes[rng.integers(len(m.working_modes))]
        q, reach = m.inverse(FLOATS, x, mode)
        if min(reach) > 1e-3:
            at = m.at(q, x, 1, (0.0, 1.0))
            if min(at.type1) > best and min(at.cos_pressure) > best:
                found.append((np.array(q), np.array(x), mode))
    return found
