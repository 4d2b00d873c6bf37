"""A process that publishes joint states of a robot at rest at any rate and size."""

from __future__ import annotations

import struct
import sys
import time

from rclpy.node import Node
from sensor_msgs.msg import JointState

from irsbot_msgs_py.cdr import encode_joint_state
from irsbot_msgs_py.process.run import FAILED, run
from irsbot_msgs_py.records import JointSample
from irsbot_msgs_py.stamps import sec_nanosec
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.nodes.pacing import Pacer
from irsbot_supervisor.nodes.supervisor import STREAM

STAMP = struct.Struct("<4xiI")
"""Position of the stamp in a JointState: after the encapsulation."""

BURSTS_HZ = 1000.0
"""Hz: largest wake-up rate; a higher rate is sent in bursts, as by a driver that has caught up."""

EXTRA_JOINT = "joint_of_somebody_else_%05d"
"""Names of joints that make a message large."""


class FloodSource(Node):  # type: ignore[misc]
    """Parameters: robot; pose; rate_hz; extra_joints, besides those of the robot."""

    def __init__(self) -> None:
        super().__init__("flood_source")
        self.exit_code: int | None = None
        settings, robot = read_settings(self.declare_parameter("robot", "irsbot2").value)
        pose = self.declare_parameter("pose", [0.0, -0.85]).value
        rate_hz = self.declare_parameter("rate_hz", 1000.0).value
        extra = self.declare_parameter("extra_joints", 0).value
        names = (*settings.joint_names, *(EXTRA_JOINT % k for k in range(extra)))
        position = (*robot.inverse(pose).tolist(), *(0.0,) * extra)
        rest = (0.0,) * len(names)
        self._message = bytearray(encode_joint_state(JointSample(0, 0, 0, names, position, rest, rest)))
        self._burst = max(round(rate_hz / BURSTS_HZ), 1)
        self._outlet = self.create_publisher(JointState, "joint_states", STREAM)
        self._pacer = Pacer(min(rate_hz, BURSTS_HZ), self._cycle, self._fail)

    def close(self) -> None:
        """Called by the shell before the node is destroyed."""
        self._pacer.close()

    def _cycle(self, due_ns: int) -> None:
        head = bytes(self._message[:4])
        for _ in range(self._burst):
            STAMP.pack_into(self._message, 0, *sec_nanosec(time.time_ns()))
            self._message[:4] = head
            self._outlet.publish(bytes(self._message))

    def _fail(self, error: Exception) -> None:
        self.get_logger().fatal(f"{type(error).__name__}: {error}")
        self.exit_code = FAILED


if __name__ == "__main__":
    sys.exit(run(FloodSource))
