"""Motions for a robot without numbers in a scenario: around its posture of largest margins, as far as the margins stay
large."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from irsbot_kinematics import Posture, Robot
from irsbot_kinematics.description.robot_file import preset_names, read_robot
from irsbot_kinematics.mechanism import Floats, Status
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_supervisor.configuration.loading import shipped_values
from irsbot_supervisor.configuration.stoppable_speed import candidates
from irsbot_supervisor.core.margins import margins_of
from irsbot_supervisor.core.settings import Settings, completed
from irsbot_supervisor.core.stopping import limits_of
from irsbot_supervisor.sim.errors import BadScenario
from irsbot_supervisor.sim.scenarios import Piece, TaskMove

LARGEST, SMALLEST, SMALLER = 0.5, 1e-3, 0.8
"""The width of a cycle is searched from the first to the second multiple of `length_m`; the third is the factor between
two tries."""

LIFT, TURN = 0.2, 0.2
"""1, and rad per metre of `length_m`: how far a cycle lifts and turns the platform, per width."""

KEPT = 0.6
"""1: share of the difference between its value at the start and its limit that every margin keeps over a cycle."""

SPEED = 0.6
"""Share of the joint limits; the rest is for braking."""

SPACING = 24
"""Number of poses evaluated along each side of a cycle."""


def is_shipped(robot: Robot) -> bool:
    """True for a preset with its own lengths, for which scenarios have numbers."""
    return robot.name in preset_names() and read_robot(robot.name).mechanism.geometry == robot.mechanism.geometry


def start_of(robot: Robot) -> Floats:
    """Pose of the posture that is farthest from its limits in the usual modes. Raises BadScenario if no posture keeps
    the stop limits."""
    return _roomiest(robot, _settings(robot)).pose


def cycle_of(robot: Robot) -> tuple[Floats, tuple[Piece, ...]]:
    """Start and pieces of a cycle around the posture that is farthest from its limits: up, across, down, and back.
    Raises BadScenario."""
    settings = _settings(robot)
    centre = _roomiest(robot, settings)
    floor = np.array(limits_of(settings, "warn"))
    values = np.array(margins_of(centre))
    low = np.where(values > floor, floor, limits_of(settings, "stop"))
    wanted = np.where(np.isfinite(values), low + KEPT * (values - low), -np.inf)
    width = LARGEST * robot.mechanism.length_m
    while width > SMALLEST * robot.mechanism.length_m:
        corners = _corners(robot, np.array(centre.pose), width)
        if _keeps(robot, settings, corners, wanted):
            steps = np.diff(corners, axis=0)
            there = tuple(tuple(step.tolist()) for step in steps[:3])
            back = tuple(tuple(step.tolist()) for step in steps[3:])
            pieces = tuple(TaskMove(points, True, speed=SPEED) for points in (there, back))
            return tuple(corners[0].tolist()), pieces
        width *= SMALLER
    raise BadScenario(f"{robot.name}: there is no room for a cycle; give a scenario of your own")


def _settings(robot: Robot) -> Settings:
    """Stop and warning limits, and modes; the limits of the drives have no effect here."""
    n = len(robot.mechanism.joints)
    drives = {"velocity_limit": [1.0] * n, "deceleration_limit": [1.0] * n}
    return completed({**drives, **shipped_values(robot), "robot": robot.name}, robot)


def _roomiest(robot: Robot, settings: Settings) -> Posture:
    found = next(candidates(settings, robot.mechanism), None)
    if found is None:
        raise BadScenario(f"{robot.name}: no posture keeps the stop limits in the usual modes; change limits or modes")
    return found


def _corners(robot: Robot, centre: Array, width: float) -> Array:
    """Poses (7, m): start, up, across, down, and up, across, down on the way back."""
    task = robot.mechanism.task
    moves = [k for k, axis in enumerate(task) if not axis.is_angle]
    turns = [k for k, axis in enumerate(task) if axis.is_angle]
    across, lift = np.zeros(len(task)), np.zeros(len(task))
    across[moves[0]] = width
    if len(moves) > 1:
        lift[moves[-1]] = LIFT * width
    lift[turns] = TURN * width / robot.mechanism.length_m
    begin = centre - 0.5 * (across + lift)
    return np.array(
        [begin, begin + lift, begin + lift + across, begin + across, begin + across + lift, begin + lift, begin]
    )


def _keeps(robot: Robot, settings: Settings, corners: Array, wanted: Array) -> bool:
    for posture in _along(robot, settings, corners):
        if posture is None or not (np.array(margins_of(posture)) >= wanted).all():
            return False
    return True


def _along(robot: Robot, settings: Settings, corners: Array) -> Iterator[Posture | None]:
    """Postures along a line; None if a pose is out of reach, a joint out of its range, or nothing is solved."""
    mechanism = robot.mechanism
    shares = np.linspace(0.0, 1.0, SPACING)[:, np.newaxis]
    poses = np.concatenate([a + shares * (b - a) for a, b in itertools.pairwise(corners)])
    joints, status, _box = robot.inverse_many(poses, settings.working_mode)
    for q, pose, solved in zip(joints.tolist(), poses.tolist(), status, strict=True):
        free = all(axis.lower < value < axis.upper for axis, value in zip(mechanism.joints, q, strict=True))
        yield mechanism.at(tuple(q), tuple(pose), 0, (0.0, 0.0)) if free and solved == Status.SOLVED else None
