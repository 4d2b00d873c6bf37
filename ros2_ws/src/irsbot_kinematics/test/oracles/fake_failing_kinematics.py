"""kinematics_node with a fake: an IRSBot-2 whose mathematics fails on one side and above. Run as a module."""

from __future__ import annotations

import sys

import numpy as np

import irsbot_kinematics.nodes.kinematics as node
from irsbot_kinematics import Robot, make_robot
from irsbot_kinematics.mechanisms.irsbot2 import Irsbot2

FAILS_ABOVE = 2.95
"""rad: where the fake fails, of the first joint."""


class FakeFailingIrsbot2(Irsbot2):
    """Raises what no mechanism may raise."""

    def posture(self, joints, assembly):
        if joints[0] > FAILS_ABOVE:
            raise ArithmeticError("a fake error of the mechanism")
        return super().posture(joints, assembly)

    def inverse(self, k, pose, mode):
        if np.max(pose[1]) > 0.0:
            raise ArithmeticError("a fake error of the mechanism")
        return super().inverse(k, pose, mode)


def fake_robot(name: str) -> Robot:
    return Robot(FakeFailingIrsbot2(make_robot(name).mechanism.geometry), name)


if __name__ == "__main__":
    node.make_robot = fake_robot
    sys.exit(node.main())
