"""Random postures of any robot of the library: joints over their whole range, in every assembly mode."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st
from numpy.typing import NDArray

import irsbot_kinematics as irs

Array = NDArray[np.float64]

NAMES = irs.robots()
ROBOTS = {name: irs.make_robot(name) for name in NAMES}


class Sample(NamedTuple):
    """One posture that exists."""

    q: Array
    x: Array
    assembly: int
    at: irs.Posture


def joint_range(robot: irs.Robot) -> tuple[Array, Array]:
    """Angles over a whole turn, slides over their travel."""
    lower = [max(joint.lower, -np.pi) if joint.is_angle else joint.lower for joint in robot.mechanism.joints]
    upper = [min(joint.upper, np.pi) if joint.is_angle else joint.upper for joint in robot.mechanism.joints]
    assert np.isfinite([*lower, *upper]).all()
    return np.array(lower), np.array(upper)


def random_joints(robot: irs.Robot, rng: np.random.Generator, number: int) -> Array:
    lower, upper = joint_range(robot)
    return rng.uniform(lower, upper, (number, len(lower)))


def solutions(robot: irs.Robot, q: tuple[float, ...]) -> list[irs.Posture]:
    """The postures of all assembly modes that exist at these joints."""
    found = [robot.mechanism.posture(q, label) for label in robot.mechanism.assembly_modes]
    return [at for at in found if at.status == irs.Status.SOLVED]


def some_postures(
    robot: irs.Robot, number: int, *, seed: int, least: float = 0.0, modes: Sequence[int] = ()
) -> list[irs.Posture]:
    """Of all assembly modes in turn, or of these. least: of the Type 1 and Type 2 margins and the clearances of the
    assembly."""
    found, rng = list[irs.Posture](), np.random.default_rng(seed)
    while len(found) < number:
        (q,) = random_joints(robot, rng, 1).tolist()
        there = [
            at
            for at in solutions(robot, tuple(q))
            if (not modes or at.assembly_mode in modes) and min(*at.type1, at.type2, *at.gaps) > least
        ]
        if there:
            found.append(there[len(found) % len(there)])
    return found


@st.composite
def samples(draw: st.DrawFn, robot: irs.Robot, *, type1: float = 1e-3, type2: float = 1e-3) -> Sample:
    """A posture whose margins exceed the given ones."""
    lower, upper = joint_range(robot)
    share = st.floats(0.001, 0.999)
    q = lower + (upper - lower) * np.array([draw(share) for _ in lower])
    meant = [at for at in solutions(robot, tuple(q.tolist())) if min(at.type1) > type1 and at.type2 > type2]
    assume(meant)
    at = draw(st.sampled_from(meant))
    return Sample(q, np.array(at.pose), at.assembly_mode, at)


class Near(NamedTuple):
    """Margins of N postures on the branch of another one: the fields of `Evaluations`."""

    status: Array
    pose: Array
    working_mode: Array
    type1_margin: Array
    type2_margin: Array
    constraint_margin: Array
    limb_margin: Array


def near(robot: irs.Robot, at: irs.Posture, joints: Array) -> Near | irs.Evaluations:
    """Postures at joints (N, n) near those of `at`: by its label, or followed where labels do not hold."""
    mechanism = robot.mechanism
    if mechanism.label_is_invariant:
        return robot.evaluate_many(joints, at.assembly_mode)
    found = [mechanism.track(tuple(q), at) for q in joints.tolist()]
    limb = [one.limb or (np.nan,) * mechanism.limb_count for one in found]
    columns = zip(*[(o.status, o.pose, o.working_mode, o.type1, o.type2, o.constraint) for o in found], strict=True)
    return Near(*[np.array(column) for column in columns], np.array(limb))


def vectors(size: int, largest: float) -> st.SearchStrategy[Array]:
    return st.lists(st.floats(-largest, largest, allow_subnormal=False), min_size=size, max_size=size).map(np.array)


def apart(robot: irs.Robot, a: Array, b: Array, *, joints: bool = False) -> Array:
    """|a - b| per coordinate, angles modulo a whole turn."""
    coordinates = robot.mechanism.joints if joints else robot.mechanism.task
    difference = np.abs(np.asarray(a) - np.asarray(b))
    for i, coordinate in enumerate(coordinates):
        if coordinate.is_angle:
            difference[..., i] = np.abs(np.remainder(difference[..., i] + np.pi, 2 * np.pi) - np.pi)
    return difference
