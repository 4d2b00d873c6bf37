"""joint_states as they come; when more come than can be judged, the newest wins."""

from __future__ import annotations

import time
from collections.abc import Callable

from rclpy.node import Node
from rclpy.qos import QoSPolicyKind, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import JointState

from irsbot_msgs_py.cdr import CdrError, decode_joint_state
from irsbot_msgs_py.records import JointSample
from irsbot_supervisor.nodes.endpoints import subscription

MOST_HZ = 2500.0
"""Up to this rate every sample is judged, on a machine of which we get half a core."""

BURST = 50
"""Samples in a row that are judged whatever their rate: more than the queue holds after a stall of the process."""

LATE_NS = 5_000_000
"""ns: a sample this old has waited for us, or its sender is slow; a look into the queue tells."""

MOST_BYTES = 65_536
"""A joint state of a thousand joints fits; what is larger is not read: that could take longer than the heartbeat."""


OVERRIDES = QoSOverridingOptions([QoSPolicyKind.RELIABILITY])
"""What parameters may say instead, for drivers that offer best effort alone. The depth is reckoned with."""


class Samples:
    """Hands samples to `judge` while open: all of them as long as that can be done in time, then the newest.

    What is skipped was true a moment ago and is not any more: where the robot is now, and how fast, decides whether it
    can still be stopped. Judging it all the same would delay that decision, with every sample more, and the heartbeat
    and the services with it.
    """

    def __init__(self, node: Node, qos: QoSProfile, judge: Callable[[JointSample], object]) -> None:
        self.skipped = 0
        self._clock, self._log = node.get_clock(), node.get_logger()
        self._judge, self._depth = judge, qos.depth
        self._allowed, self._since_ns = float(BURST), time.monotonic_ns()
        self._held = b""  # the newest sample that has not been judged
        self._open = False
        self.subscription = subscription(
            node, JointState, "joint_states", self._on_sample, qos, raw=True, offered=OVERRIDES
        )

    def settle(self) -> None:
        """Judge what has been held back. To be called with every heartbeat: nothing newer may come."""
        if self._held:
            held, self._held = self._held, b""
            self._judge(self._decoded(held))

    def open(self) -> None:
        """From now on."""
        self._open = True

    def close(self) -> None:
        """What is held back is never judged: by the time of the next `open` it would look new."""
        self._open, self._held = False, b""

    def _on_sample(self, data: bytes) -> None:
        if not self._open:
            return
        now_ns = time.monotonic_ns()
        self._allowed = min(self._allowed + (now_ns - self._since_ns) * 1e-9 * MOST_HZ, float(BURST))
        self._since_ns = now_ns
        if self._held:
            self._held = b""
            self.skipped += 1
        if not self._allowed >= 1.0:  # to take what waits costs less than to be called for it
            self._held = self._newest() or data
            return
        self._allowed -= 1.0
        sample = self._decoded(data)
        if sample.received_ns - sample.stamp_ns > LATE_NS and (newest := self._newest()):
            sample = self._decoded(newest)
        self._judge(sample)

    def _newest(self) -> bytes:
        """The last of what waits, at most a full queue of it; empty if nothing does."""
        newest = b""
        handle, kind = self.subscription.handle, self.subscription.msg_type
        with handle:
            for _ in range(self._depth):
                found = handle.take_message(kind, True)
                if found is None:
                    break
                newest = found[0]
                self.skipped += 1
        return newest

    def _decoded(self, data: bytes) -> JointSample:
        received_ns, seen_ns = self._clock.now().nanoseconds, time.monotonic_ns()
        try:
            if len(data) > MOST_BYTES:
                raise CdrError(f"{len(data)} bytes, at most {MOST_BYTES} are read")
            return decode_joint_state(data, received_ns, seen_ns)
        except CdrError as error:
            self._log.warning(f"joint state not read: {error}", throttle_duration_sec=1.0)
            return JointSample(0, received_ns, seen_ns, (), ())  # rejected for its names, and counted
