"""One posture of the five-bar from its motors: ours, and Pinocchio's loop closure where Pinocchio is installed.

Pinocchio has no closed form for a loop. It gives the positions and Jacobians of two open legs; Newton's method brings
their ends together, from the solution of the posture before. Then both give the pose and both Jacobians.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from irsbot_kinematics import Robot, make_robot
from irsbot_kinematics.numerics.arithmetic import Array

ROBOT = "five_bar"
STEP_RAD = 2e-3
"""rad between two postures: a fast motion at 1 kHz."""
CLOSED_M = 1e-10
"""m: distance of the two ends of a closed loop."""
SIDES = (-1.0, 1.0)
"""1: place of each motor in half distances of the motors."""
MOST_STEPS = 20
"""Steps of Newton's method after which a loop is given up."""


class LoopClosure(NamedTuple):
    """us per posture, called from Python; the fastest repetition counts. NaN: Pinocchio is not installed."""

    postures: int
    ours_us: float
    batch_us: float
    """In a batch of all postures."""
    pinocchio_us: float
    difference_m: float
    """Largest distance between the two poses of a posture."""


def measure(tell: Callable[[str], None], *, quick: bool = False) -> LoopClosure:
    """The same postures by both."""
    number, repetitions = (200, 1) if quick else (5000, 5)
    tell(f"loop closure: {number} postures of {ROBOT}")
    robot = make_robot(ROBOT)
    joints = _joints(number)
    ours, poses = _best(lambda: _ours(robot, joints), repetitions)
    batch, _ = _best(lambda: robot.evaluate_many(joints), repetitions)
    theirs, difference = np.nan, np.nan
    if (closing := _closing(robot)) is not None:
        theirs, found = _best(lambda: np.array([closing(row) for row in joints]), repetitions)
        difference = float(np.abs(found - poses).max())
    us = 1e6 / number
    return LoopClosure(number, ours * us, batch * us, theirs * us, difference)


def _joints(number: int) -> Array:
    """(N, 2) rad: motors on a circle."""
    turns = STEP_RAD * np.arange(number)
    return np.column_stack((0.5 + 0.3 * np.sin(turns), 2.6 + 0.3 * np.cos(turns)))


def _ours(robot: Robot, joints: Array) -> Array:
    """Poses; a posture also holds the rows of both Jacobians and all margins."""
    return np.array([robot.posture(row).pose for row in joints])


def _closing(robot: Robot) -> Callable[[Array], Array] | None:
    """A function that gives the pose for the motors by Pinocchio; None if it is not installed."""
    try:
        import pinocchio  # optional: only this comparison uses it
    except ImportError:
        return None
    legs = [_leg(pinocchio, robot, side) for side in SIDES]
    geometry: Any = robot.mechanism.geometry
    axes, elbows = [0, 2], _first_elbows(robot, geometry)

    def close(motors: Array) -> Array:
        for _ in range(MOST_STEPS):
            ends, jacobians = [], []
            for (model, data), motor, elbow in zip(legs, motors, elbows, strict=True):
                q = np.array([motor, elbow])
                pinocchio.computeJointJacobians(model, data, q)
                pinocchio.updateFramePlacements(model, data)
                end = model.nframes - 1
                ends.append(data.oMf[end].translation[axes])
                turned = pinocchio.getFrameJacobian(model, data, end, pinocchio.LOCAL_WORLD_ALIGNED)
                jacobians.append(turned[axes])
            gap = ends[0] - ends[1]
            if np.abs(gap).max() < CLOSED_M:
                passive = np.column_stack((jacobians[0][:, 1], -jacobians[1][:, 1]))
                motor = np.column_stack((jacobians[0][:, 0], -jacobians[1][:, 0]))
                np.linalg.solve(passive, -motor)  # rates of the elbows for rates of the motors
                return np.array(ends[0])
            passive = np.column_stack((jacobians[0][:, 1], -jacobians[1][:, 1]))
            elbows[:] = elbows - np.linalg.solve(passive, gap)
        raise ArithmeticError("the loop does not close")

    return close


def _leg(pinocchio: Any, robot: Robot, side: float) -> tuple[Any, Any]:
    """Model and data of one leg alone, in the plane of x and z."""
    geometry: Any = robot.mechanism.geometry
    model = pinocchio.Model()
    hip = pinocchio.SE3(np.eye(3), np.array([side * geometry.b, 0.0, 0.0]))
    knee = pinocchio.SE3(np.eye(3), np.array([geometry.l1, 0.0, 0.0]))
    end = pinocchio.SE3(np.eye(3), np.array([geometry.l2, 0.0, 0.0]))
    first = model.addJoint(0, pinocchio.JointModelRY(), hip, "motor")
    second = model.addJoint(first, pinocchio.JointModelRY(), knee, "elbow")
    model.addFrame(pinocchio.Frame("end", second, end, pinocchio.FrameType.OP_FRAME))
    return model, model.createData()


def _first_elbows(robot: Robot, geometry: Any) -> Array:
    """rad: turns of the elbows at the first posture, on the robot's own assembly mode."""
    motors = _joints(1)[0]
    pose = robot.direct(motors)
    found = []
    for side, motor in zip(SIDES, motors, strict=True):
        elbow = np.array([side * geometry.b, 0.0]) + geometry.l1 * np.array([np.cos(motor), -np.sin(motor)])
        rod = pose - elbow
        found.append(np.arctan2(-rod[1], rod[0]) - motor)
    return np.array(found)


def _best(work: Callable[[], Any], repetitions: int) -> tuple[float, Any]:
    """s of the fastest repetition, and the last result."""
    fastest, result = np.inf, None
    for _ in range(repetitions):
        begin = time.perf_counter()
        result = work()
        fastest = min(fastest, time.perf_counter() - begin)
    return fastest, result
