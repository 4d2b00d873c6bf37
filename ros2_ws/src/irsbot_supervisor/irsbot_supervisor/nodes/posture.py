"""~/passive_joint_states and /tf: positions of the links without encoder, for RViz and robot_state_publisher.

robot_state_publisher does not handle loops. It moves the links of the joints in `joint_states`; this node publishes the
links that hang from passive joints, in the supervised posture. `irsbot urdf` writes the description.
"""

from __future__ import annotations

from math import cos, isfinite, sin
from typing import Any

from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode
from sensor_msgs.msg import JointState

from irsbot_kinematics import Robot
from irsbot_kinematics.skeleton import Link
from irsbot_msgs_py.records import SingularityState
from irsbot_msgs_py.stamps import sec_nanosec
from irsbot_supervisor.nodes.endpoints import publisher
from irsbot_supervisor.nodes.guard import Fail, guarded

PERIOD_S = 0.05
"""s between messages, as in robot_state_publisher."""


class PosturePublisher:
    """Keeps the newest state and publishes its passive joints while there is a subscriber. A mechanism without skeleton
    has none."""

    def __init__(self, node: LifecycleNode, robot: Robot, prefix: str, fail: Fail) -> None:
        """prefix: of the frames, as in robot_state_publisher for several robots."""
        self.state: SingularityState | None = None
        skeleton = robot.mechanism.skeleton()
        if skeleton is None:
            return
        self._skeleton, self._prefix = skeleton, prefix
        self._links = [link for link in skeleton.links if link.joint in skeleton.passive]
        self._told = 0  # sequence of the last published state
        self._joints = publisher(node, JointState, "~/passive_joint_states", 10)
        self._frames_type = frames_type()
        self._frames = publisher(node, self._frames_type, "/tf", 100) if self._frames_type else None
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # simulated time may stand still
        node.create_timer(PERIOD_S, guarded(self._tell, fail), clock=steady)

    def _tell(self) -> None:
        state = self.state
        listened = self._joints.get_subscription_count()
        watched = self._frames is not None and self._frames.get_subscription_count()
        if state is None or state.sequence == self._told or not (listened or watched):
            return
        if not all(map(isfinite, (*state.joint_position, *state.pose))):
            return
        self._told = state.sequence
        positions = self._skeleton.closing(state.joint_position, state.pose)
        if listened:
            message = JointState(name=[link.joint for link in self._links])
            message.header.stamp.sec, message.header.stamp.nanosec = sec_nanosec(state.stamp_ns)
            message.position = [positions[link.joint] for link in self._links]
            self._joints.publish(message)
        if self._frames is not None and watched:
            frames = [self._frame(link, positions[link.joint], state.stamp_ns) for link in self._links]
            self._frames.publish(self._frames_type(transforms=frames))

    def _frame(self, link: Link, position: float, stamp_ns: int) -> TransformStamped:
        frame = TransformStamped(child_frame_id=self._prefix + link.name)
        frame.header.frame_id = self._prefix + link.parent
        frame.header.stamp.sec, frame.header.stamp.nanosec = sec_nanosec(stamp_ns)
        x, y, z = link.origin
        frame.transform.translation = Vector3(x=x, y=y, z=z)
        half = sin(0.5 * position)
        x, y, z = link.axis or (0.0, 0.0, 0.0)
        frame.transform.rotation = Quaternion(x=half * x, y=half * y, z=half * z, w=cos(0.5 * position))
        return frame


def frames_type() -> Any:
    """tf2_msgs/TFMessage, or None where tf2_msgs is not installed."""
    try:
        from tf2_msgs.msg import TFMessage
    except ImportError:
        return None
    return TFMessage
