"""Closed joint motions: does the platform return to its pose? Every step is proved.

A cuspidal robot changes its assembly mode on a loop about a cusp although no singularity is met ([S4] and its
references); a label from the sign of det A does not show the change.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import cos, inf, pi, remainder, sin
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from irsbot_kinematics import arguments
from irsbot_kinematics.arguments import checked
from irsbot_kinematics.errors import BadInput
from irsbot_kinematics.mechanism import Mechanism, Posture, Status
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_kinematics.numerics.tolerances import FARTHEST
from irsbot_kinematics.robot import Robot, make_robot

if TYPE_CHECKING:
    from irsbot_kinematics.algebra.model.system import System

CLOSED = 1e-9
"""rad or m: joints that differ by less at both ends of a path are closed."""

MOST_SAMPLES = 10**7
"""1: largest number of points of a circle."""

HALVINGS = 16
"""How often a segment is halved before the branch counts as lost. The number of pieces grows with the inverse square of
the Type 2 margin; a path that needs shorter ones has to give more points."""

SAME_POSE = 1e-6
"""rad, m or the unit of the pose: poses that differ by less are equal."""


@dataclass(frozen=True)
class LoopResult:
    """Result of following a joint path on one branch.

    certified: Every step was proved: one branch, no Type 2 singularity on the way.
    closed: The joints have returned, up to whole turns.
    changed: The joints have returned and the platform has not: another assembly mode.
    start: Pose at the start.
    end: Pose at the end of what was followed: the branch.
    working_mode_kept: No lever changed its sign at the path's points; True where the robot has no such margin.
    smallest_det: Smallest |det A| at the path's points, in the units of the screws (robot) or the equations
        (system).
    smallest_type2: Smallest Type 2 margin at the path's points, 0..1; NaN for a system.
    smallest_type1: Smallest Type 1 margin at the path's points, 0..1; NaN for a system.
    lost_at: Index of the path point after which the branch was lost: nothing is proved on that segment beyond `end`;
        None if it never was.
    steps: Proved steps.
    """

    certified: bool
    closed: bool
    changed: bool
    start: Array
    end: Array
    working_mode_kept: bool
    smallest_det: float
    smallest_type2: float
    smallest_type1: float
    lost_at: int | None
    steps: int


@checked
def circle(
    centre: Sequence[float], joints: tuple[int, int], radius: float, start_rad: float = 0.0, samples: int = 721
) -> Array:
    """A circle in two joints (counted from 1) about a centre, counter-clockwise, first point = last: (samples, n)."""
    middle = arguments.array(centre, "centre", "joint positions")
    if middle.ndim != 1 or not (np.abs(middle) <= FARTHEST).all():
        raise BadInput(f"centre must be finite joint positions, got {arguments.shown(centre)}")
    i, k = (arguments.count(joint, "joints", 1, len(middle)) - 1 for joint in joints)
    path = np.tile(middle, (arguments.count(samples, "samples", 3, MOST_SAMPLES), 1))
    angle = start_rad + np.linspace(0.0, 2.0 * pi, samples)
    path[:, i] += radius * np.cos(angle)
    path[:, k] += radius * np.sin(angle)
    path[-1] = path[0]
    path[[0, -1], i] = centre[i] + radius * cos(start_rad)
    path[[0, -1], k] = centre[k] + radius * sin(start_rad)
    return path


def certify_loop(
    path: ArrayLike, robot: Robot | System | str, start: Sequence[float] | Mapping[str, float] | None = None
) -> LoopResult:
    """Follow the branch of a start pose along joint positions (N, n), straight between them.

    Each segment is halved until its pieces are proved; one that is not, after HALVINGS, is where the branch is lost.
    robot: a Robot, the name of a shipped one, or an algebra.System (then rails and lengths are in its units).
    start: pose near which the branch starts; the usual assembly mode of a robot if left out. Raises BadInput.
    """
    if isinstance(robot, str):
        robot = make_robot(robot)
    if isinstance(robot, Robot):
        return _of_robot(_points(path, len(robot.mechanism.joints)), robot, start)
    from irsbot_kinematics.algebra.model.system import System

    system = arguments.instance(robot, "robot", System, "a Robot, the name of one, or an algebra.System")
    return _of_system(_points(path, len(system.joints)), system, start)


def _points(path: ArrayLike, width: int) -> Array:
    points = arguments.table(path, width, "path")
    if len(points) < 2 or not (np.abs(points) <= FARTHEST).all():
        raise BadInput(f"path must be at least two finite joint positions of at most {FARTHEST:g} in size")
    return points


def _of_robot(points: Array, robot: Robot, start: Any) -> LoopResult:
    mechanism = robot.mechanism
    if start is None:
        at = robot.posture(points[0])
    else:
        at = robot.posture_near(points[0], arguments.place(start, mechanism.task, "start"))
    angles = [joint.is_angle for joint in mechanism.joints]
    first, modes = at, {at.working_mode}
    det, type2, type1 = abs(at.det), at.type2, min(at.type1)
    lost, steps = None, 0
    for k, (a, b) in enumerate(itertools.pairwise(points)):
        at, proved, there = _proved(mechanism, at, a, b, HALVINGS)
        steps += proved
        if not there:
            lost = k
            break
        det, type2, type1 = min(det, abs(at.det)), min(type2, at.type2), min(type1, *at.type1)
        modes.add(at.working_mode)
    closed = lost is None and _back(points, angles)
    apart = _apart(first.pose, at.pose, [c.is_angle for c in mechanism.task])
    return LoopResult(
        lost is None, closed, closed and apart > SAME_POSE, np.array(first.pose), np.array(at.pose), len(modes) == 1,
        det, type2, type1, lost, steps,
    )  # fmt: skip


def _proved(mechanism: Mechanism, at: Posture, a: Array, b: Array, halvings: int) -> tuple[Posture, int, bool]:
    """Follow the branch of `at` from joints a straight to b: the last proved posture, the number of proved pieces, and
    whether b is reached.

    A piece is proved if the Type 2 margin has a positive bound over the box of its joints: then one branch goes through
    all of the box. A piece has at most a turn of a crank, so that its middle is reached the way that was asked for.
    """
    half = 0.5 * np.abs(b - a)
    middle = 0.5 * (a + b)
    if not any(joint.is_angle and travel > pi for joint, travel in zip(mechanism.joints, half, strict=True)):
        inside = mechanism.track(tuple(middle.tolist()), at)
        if inside.status == Status.SOLVED and mechanism.certified_bounds(inside, half.tolist()).type2 > 0.0:
            ahead = mechanism.track(tuple(b.tolist()), inside)
            if ahead.status == Status.SOLVED:
                return ahead, 1, True
    if not halvings:
        return at, 0, False
    at, first, there = _proved(mechanism, at, a, middle, halvings - 1)
    if not there:
        return at, first, False
    at, second, there = _proved(mechanism, at, middle, b, halvings - 1)
    return at, first + second, there


def _of_system(points: Array, system: System, start: Any) -> LoopResult:
    from irsbot_kinematics.algebra.tracking import Tracker

    names = (*system.pose, *system.passive)
    if start is None:
        raise BadInput(f"give the start pose of {system.name}: {', '.join(names)}")
    if isinstance(start, Mapping):
        stated = {str(name): arguments.number(value, f"start of {name}") for name, value in start.items()}
    else:
        given = arguments.vector(start, len(names), f"start ({', '.join(names)})", FARTHEST)
        stated = dict(zip(names, given, strict=True))
    found = Tracker(system).follow(points.tolist(), stated)
    first, last = ([pose[name] for name in system.pose] for pose in (found.poses[0], found.poses[-1]))
    closed = found.lost_at is None and _back(points, [name in system.angles for name in system.joints])
    apart = _apart(first, last, [name in system.angles for name in system.pose])
    nan = float("nan")
    return LoopResult(
        found.lost_at is None, closed, closed and apart > SAME_POSE, np.array(first), np.array(last), True,
        min(map(abs, found.dets), default=inf), nan, nan, found.lost_at, found.steps,
    )  # fmt: skip


def _back(points: Array, angles: Sequence[bool]) -> bool:
    return _apart(points[0], points[-1], angles) <= CLOSED


def _apart(a: Sequence[float] | Array, b: Sequence[float] | Array, angles: Sequence[bool]) -> float:
    return max(
        abs(remainder(float(u - v), 2.0 * pi)) if turned else abs(float(u - v))
        for u, v, turned in zip(a, b, angles, strict=True)
    )
