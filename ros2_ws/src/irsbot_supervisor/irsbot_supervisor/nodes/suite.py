"""suite_node: the nodes of the suite in one process, each in a thread of its own; same names, same topics.

    ros2 run irsbot_supervisor suite_node [NODE..] --ros-args -p robot:=irsbot2

NODE: recorder, kinematics, supervisor, simulated_joints; all of them if none is named.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from rclpy.utilities import remove_ros_args

from irsbot_kinematics import KinematicsError
from irsbot_kinematics.nodes.kinematics import KinematicsNode
from irsbot_msgs_py.process.run import run_together
from irsbot_msgs_py.process.usage import USAGE
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.core.settings import InvalidSettings
from irsbot_supervisor.nodes.recorder import RecorderNode
from irsbot_supervisor.nodes.simulated_joints import SimulatedJointsNode
from irsbot_supervisor.nodes.supervisor import SupervisorNode
from irsbot_supervisor.sim.errors import SimulationError
from irsbot_supervisor.trajectory.joint_path import BadTrajectory

NODES = {
    "recorder": RecorderNode,
    "kinematics": KinematicsNode,
    "supervisor": SupervisorNode,
    "simulated_joints": SimulatedJointsNode,
}
"""In the order of their start: the recorder starts first and misses nothing."""

REFUSED = (InvalidSettings, KinematicsError, BagError, SimulationError, BadTrajectory)


def wanted(arguments: Sequence[str]) -> list[str]:
    """The named nodes, in the order of their start. Raises ValueError."""
    if unknown := [name for name in arguments if name not in NODES]:
        raise ValueError(f"no node '{unknown[0]}'; there are {', '.join(NODES)}")
    return [name for name in NODES if name in arguments or not arguments]


def main() -> None:
    """Entry point of `ros2 run irsbot_supervisor suite_node`."""
    try:
        names = wanted(remove_ros_args(sys.argv)[1:])
    except ValueError as error:
        print(error, file=sys.stderr)
        sys.exit(USAGE)
    sys.exit(run_together([NODES[name] for name in names], usage_errors=REFUSED, log="suite"))


if __name__ == "__main__":
    main()
