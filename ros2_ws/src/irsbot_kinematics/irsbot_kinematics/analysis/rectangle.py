"""The largest useful rectangle of a robot that moves in a plane."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from irsbot_kinematics.arguments import checked, count, working_mode
from irsbot_kinematics.errors import BadInput
from irsbot_kinematics.mechanism import Mechanism, Signs
from irsbot_kinematics.mechanisms.irsbot2_space.designs import Flags
from irsbot_kinematics.numerics.arithmetic import ARRAYS, Array

MOST_CELLS = 10**5
"""1: largest number along one side of the grid; a tenth of a millimetre on ten metres."""


class Limits(NamedTuple):
    """Smallest margins of a useful pose."""

    type1: float = 0.3
    type2: float = 0.5
    constraint: float = 0.1


class Rectangle(NamedTuple):
    """|x| <= half_width, z_low <= z <= z_high < 0, m."""

    half_width: float
    z_low: float
    z_high: float

    @property
    def area(self) -> float:
        return 2.0 * self.half_width * (self.z_high - self.z_low)


@checked
def largest_rectangle(
    robot: Mechanism, limits: Limits | None = None, mode: Signs | str = (1, -1), cells: tuple[int, int] = (400, 800)
) -> Rectangle:
    """Largest rectangle symmetric about x = 0 and below z = 0 in which every pose of the working mode exceeds all
    limits without leaving the robot's usual assembly mode, judged at the nodes of a grid of cells[0] x cells[1] over
    0 <= x, z <= 0 within the reach. Mode: one that is its own mirror image, (1, -1) or (-1, 1). Area 0 if no pose is
    useful.
    """
    limits, mode = limits or Limits(), working_mode(robot, mode)
    across, along = (count(number, "cells", 1, MOST_CELLS) for number in cells)
    extent = robot.symmetric_extent()
    if extent is None:
        raise BadInput(f"a rectangle about x = 0 needs a workspace that is its own mirror image; {robot.kind} has none")
    x = np.linspace(0.0, extent[0], across + 1)
    z = np.linspace(extent[1], 0.0, along + 2)[:-1]
    useful = _useful(robot, limits, mode, x[np.newaxis, :], z[:, np.newaxis])
    width = np.where(useful.all(axis=1), across, np.argmin(useful, axis=1) - 1)  # last node of the run from x = 0
    best = Rectangle(0.0, 0.0, 0.0)
    for low in range(len(z)):
        if x[-1] * 2.0 * (z[-1] - z[low]) <= best.area:
            break
        if width[low] <= 0:
            continue
        narrow = np.minimum.accumulate(width[low:])
        areas = np.where(narrow > 0, x[narrow], 0.0) * (z[low:] - z[low])
        high = int(np.argmax(areas))
        if 2.0 * areas[high] > best.area:
            best = Rectangle(float(x[narrow[high]]), float(z[low]), float(z[low + high]))
    return best


def _useful(robot: Mechanism, limits: Limits, mode: Signs, x: Array, z: Array) -> Flags:
    pose = np.broadcast_arrays(x, z)
    joints, reach = robot.inverse(ARRAYS, pose, mode)
    legs = robot.legs(ARRAYS, joints, pose)
    (ax, az), (bx, bz) = legs.screws
    useful: Flags = (np.minimum(*reach) > 0.0) & (robot.usual_assembly_mode * (ax * bz - az * bx) > limits.type2)
    for sine in legs.normalised_levers:
        useful &= np.abs(sine) > limits.type1
    if legs.constraint is not None:
        useful &= legs.constraint > limits.constraint
    return useful
