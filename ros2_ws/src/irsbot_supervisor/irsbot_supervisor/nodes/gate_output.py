"""What the command gate publishes: rates and motions for the drives, holds, and its status."""

from __future__ import annotations

import time
from collections.abc import Sequence
from enum import Enum, auto
from threading import Lock

from irsbot_msgs.msg import GateStatus as GateStatusMsg
from rclpy.duration import Duration as Span
from rclpy.lifecycle import LifecycleNode
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from irsbot_msgs_py.convert import gate_status_msg
from irsbot_msgs_py.gate_status import GateCommand, GateStatus
from irsbot_msgs_py.records import Cause
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.core.view import View
from irsbot_supervisor.gate.answer import Answer
from irsbot_supervisor.gate.hold import Hold, hold
from irsbot_supervisor.nodes.commands import trajectory_msg
from irsbot_supervisor.nodes.endpoints import publisher
from irsbot_supervisor.trajectory.joint_path import JointPath

DEPTH = 10
"""Number of commands that may wait; only the newest counts."""

LASTING = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Quality of service of the gate's status: a late subscriber gets the newest message."""

HEARD_S = 0.2
"""s: longest time that the end of the node waits until its last messages are acknowledged; those to a dead node never
are."""


class _Owed(Enum):
    """A message that the drives still have to receive."""

    NOTHING = auto()
    HOLD = auto()  # as soon as the posture is known: an earlier command may still be running
    HOLD_AT_REST = auto()  # where the robot stands, once it does: brakes may have brought it elsewhere than the hold


class GateOutput:
    """Publishers of the gate, and what they have published.

    Who publishes a motion or a hold holds `lock` while deciding and publishing, so that no earlier motion follows a
    hold.
    """

    def __init__(self, node: LifecycleNode, settings: Settings) -> None:
        self.settings = settings
        """Settings in force; the gate replaces them."""
        self.lock = Lock()
        self.told: tuple[GateCommand, Answer] | None = None
        """The last status."""
        self.known: View | None = None
        """The last known state of the robot, from which a hold is made; the gate keeps it up to date."""
        self.moving = False
        """True if the last rates were other than zeros."""
        self._node = node
        self._held: tuple[int, Hold] | None = None  # the last hold, and the time of the sample that it is made from
        self._owed = _Owed.NOTHING
        self._trajectories = publisher(node, JointTrajectory, "command_out", DEPTH)
        self._velocities = publisher(node, Float64MultiArray, "velocity_out", DEPTH)
        self._status = publisher(node, GateStatusMsg, "~/gate", LASTING)

    def begin(self) -> None:
        """The gate opens: the drives get a hold as soon as the state of the robot is known."""
        self.known, self._held, self._owed = None, None, _Owed.HOLD

    def end(self) -> None:
        """Wait until the last messages are acknowledged, at most HEARD_S for each topic."""
        for topic in (self._velocities, self._trajectories, self._status):
            topic.wait_for_all_acked(Span(seconds=HEARD_S))

    def rates(self, rates: Sequence[float]) -> None:
        """Publish joint rates, rad/s or m/s."""
        self._velocities.publish(Float64MultiArray(data=list(rates)))
        self.moving = any(rates)

    def no_rates(self) -> None:
        """Publish zeros."""
        self.rates((0.0,) * len(self.settings.joint_names))

    def motion(self, message: JointTrajectory) -> None:
        """Publish a motion; a hold that was owed is not owed any more. The caller holds `lock`."""
        self._trajectories.publish(message)
        self._owed = _Owed.NOTHING

    def hold(self) -> None:
        """Publish a hold of one point at rest: controllers refuse a message without points and go on with their last
        one. Publishes nothing if the state was never known: then nothing has passed. If the state is not known now, the
        last commanded point is used. The caller holds `lock`."""
        known, settings = self.known, self.settings
        if known is None:
            return
        if self._held is None or self._held[0] != known.seen_ns:
            came_s = known.prediction_delay_s - known.expected_s  # age on arrival
            since_s = (time.monotonic_ns() - known.seen_ns) / NS_PER_S
            age_s = min(came_s + since_s, settings.stale_s)  # later it is no knowledge
            brakes, shortest_s = settings.deceleration_limit, settings.heartbeat_s
            rest = hold(known.at.joints, known.velocity, brakes, age_s, settings.latency_s, shortest_s)
            self._held = known.seen_ns, rest
        after_s, position = self._held[1]
        still = (0.0,) * len(position)
        path = JointPath((0.0, after_s), (position, position), (still, still))
        self._trajectories.publish(trajectory_msg(path, settings.joint_names))
        self._owed = _Owed.HOLD_AT_REST

    def settle(self, supervisor: Supervisor) -> None:
        """Publish the hold that is owed: at once after the gate has opened, and again when the joints stand. The state
        of the robot is known."""
        if self._owed == _Owed.HOLD:
            with self.lock:
                self.hold()
        elif self._owed == _Owed.HOLD_AT_REST and supervisor.standing:
            with self.lock:
                self.hold()
                self._owed = _Owed.NOTHING

    def tell(self, command: GateCommand, answer: Answer, *, always: bool = False) -> None:
        """Publish the result of a command as status, if it is new. always: also if it is not."""
        before, self.told = self.told, (command, answer)
        if always or before is None or (command, answer[:3]) != (before[0], before[1][:3]):
            stamp_ns = self._node.get_clock().now().nanoseconds
            cause = Cause(answer.cause)
            status = GateStatus(stamp_ns, command, answer.outcome, answer.reason, cause, answer.share, answer.text)
            self._status.publish(gate_status_msg(status))
