"""A process that publishes pick and place and records the time of each sample."""

from __future__ import annotations

import sys
import time
from array import array

from rclpy.node import Node
from sensor_msgs.msg import JointState

from irsbot_msgs_py.cdr import encode_joint_state
from irsbot_msgs_py.process.priority import PRIORITY
from irsbot_msgs_py.process.run import FAILED, run
from irsbot_msgs_py.records import JointSample
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.nodes.pacing import Pacer, RosTime
from irsbot_supervisor.nodes.supervisor import STREAM
from irsbot_supervisor.validation.bench.motion import RATE_HZ, machine_of


class Source(Node):  # type: ignore[misc]
    """Parameters: robot; rate_hz; times, the file that gets pairs of stamp and steady clock, ns, as 64-bit integers."""

    thread_priority = PRIORITY  # as the supervisor has it: equal for all nodes of the chain

    def __init__(self) -> None:
        super().__init__("source")
        self.exit_code: int | None = None
        name = self.declare_parameter("robot", "irsbot2").value
        rate_hz = self.declare_parameter("rate_hz", RATE_HZ).value
        self._times_file = self.declare_parameter("times", "").value
        settings, robot = read_settings(name)
        self._names, self._machine = settings.joint_names, machine_of(robot, name)
        self._times = array("q")
        self._outlet = self.create_publisher(JointState, "joint_states", STREAM)
        self._ros_time = RosTime(self.get_clock())
        self._period_s = 1.0 / rate_hz
        self._pacer = Pacer(rate_hz, self._cycle, self._fail)

    def close(self) -> None:
        """Called by the shell before the node is destroyed."""
        self._pacer.close()
        with open(self._times_file, "wb") as file:
            self._times.tofile(file)

    def _cycle(self, due_ns: int) -> None:
        reading = self._machine.step(self._period_s, 1.0)
        stamp_ns = self._ros_time.of(due_ns)  # time of reading: delayed samples were read in time
        message = encode_joint_state(JointSample(stamp_ns, stamp_ns, due_ns, self._names, *reading))
        self._times.extend((stamp_ns, time.monotonic_ns()))
        self._outlet.publish(message)

    def _fail(self, error: Exception) -> None:
        self.get_logger().fatal(f"{type(error).__name__}: {error}")
        self.exit_code = FAILED


if __name__ == "__main__":
    sys.exit(run(Source))
