"""A process that records the arrival of each message of one topic."""

from __future__ import annotations

import sys
import time
from array import array
from pathlib import Path
from struct import Struct

from irsbot_msgs.msg import SingularityState
from rclpy.node import Node
from sensor_msgs.msg import JointState

from irsbot_msgs_py.process.priority import PRIORITY
from irsbot_msgs_py.process.run import run
from irsbot_msgs_py.stamps import nanoseconds
from irsbot_supervisor.nodes.supervisor import STREAM

TYPES = {"JointState": JointState, "SingularityState": SingularityState}
STAMP = Struct("<4xiI")
"""Both types begin with a header: encapsulation, seconds, nanoseconds."""


class Sink(Node):  # type: ignore[misc]
    """Parameters: topic; type, a key of TYPES; times, a file as `source` writes it, there from the first message on."""

    thread_priority = PRIORITY  # as the supervisor has it: equal for all nodes of the chain

    def __init__(self) -> None:
        super().__init__("sink")
        topic = self.declare_parameter("topic", "").value
        kind = self.declare_parameter("type", "JointState").value
        self._times_file = Path(self.declare_parameter("times", "").value)
        self._times = array("q")
        self.create_subscription(TYPES[kind], topic, self._on_message, STREAM, raw=True)

    def close(self) -> None:
        """Called by the shell before the node is destroyed."""
        self._times_file.write_bytes(self._times.tobytes())

    def _on_message(self, data: bytes) -> None:
        now_ns = time.monotonic_ns()
        if not self._times:
            self._times_file.touch()
        self._times.extend((nanoseconds(*STAMP.unpack_from(data)), now_ns))


if __name__ == "__main__":
    sys.exit(run(Sink))
