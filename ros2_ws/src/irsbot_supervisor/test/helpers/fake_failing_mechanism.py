"""supervisor_node with a fake: an IRSBot-2 whose mathematics fails on one side. Run as a module."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import irsbot_supervisor.configuration.loading
from irsbot_kinematics import Robot, make_robot
from irsbot_kinematics.mechanism import Posture
from irsbot_kinematics.mechanisms.irsbot2 import Irsbot2

FAILS_ABOVE = 2.95
"""rad: where the fake fails, of the first joint."""


class FakeFailingIrsbot2(Irsbot2):
    """Raises what no mechanism may raise."""

    def posture(self, joints: Sequence[float], assembly: int) -> Posture:
        if joints[0] > FAILS_ABOVE:
            raise ArithmeticError("a fake error of the mechanism")
        return super().posture(joints, assembly)


def fake_robot_of(name: str) -> Robot:
    robot = make_robot(name)
    return Robot(FakeFailingIrsbot2(robot.mechanism.geometry), robot.name)


if __name__ == "__main__":
    from fake_failing_mechanism import fake_robot_of as importable  # by its worker process, too

    from irsbot_supervisor.nodes.supervisor import main  # needs ROS 2, the fake does not

    irsbot_supervisor.configuration.loading.robot_of = importable
    sys.exit(main())
