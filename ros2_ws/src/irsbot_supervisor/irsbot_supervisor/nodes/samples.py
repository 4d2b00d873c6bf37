"""Receives joint_states; if more samples come than can be judged, only the newest is judged; after a stall, only those
that are not old."""

from __future__ import annotations

import time
from collections.abc import Callable

from rclpy.node import Node
from rclpy.qos import QoSPolicyKind, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import JointState

from irsbot_msgs_py.cdr import decode_joint_state
from irsbot_msgs_py.errors import CdrError
from irsbot_msgs_py.records import JointSample
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.nodes.allowance import Allowance
from irsbot_supervisor.nodes.clocks import both_clocks
from irsbot_supervisor.nodes.endpoints import subscription

SHARE = 0.6
"""1: share of the time that goes to judging, besides one held sample with every heartbeat. The rest is for the
heartbeat, the gate and services, and for rclpy, which takes half as long for a message as judging it."""

BURST_S = 0.05
"""s of judging that may come at once: a process that was interrupted while it judged has not judged too much."""

SAVED_S = 0.01
"""s of judging that stay saved up for samples: with less, what can wait is left out."""

WAITED_NS = 1_000_000
"""ns: an older sample has waited here, or its sender is slow. Others may wait behind it: to take them together costs
less than a callback for each."""

LATE_NS = 5_000_000
"""ns: an older sample is not judged if a newer one waits."""

MOST_BYTES = 65_536
"""A joint state of a thousand joints fits; larger messages are not decoded, because that could take longer than the
heartbeat."""


OVERRIDES = QoSOverridingOptions([QoSPolicyKind.RELIABILITY])
"""Policies that parameters may change, for drivers that offer only best effort. The depth is fixed: the supervisor
computes with it."""


class Samples:
    """Passes samples to `judge` while open: all of them as long as time allows, then only the newest. Of samples that
    waited, those that are old when their turn comes are skipped for newer ones.

    The present position and speed decide whether the robot can still be stopped. Judging older samples would delay this
    decision, the heartbeat and the services.
    """

    def __init__(self, node: Node, qos: QoSProfile, judge: Callable[[JointSample], object]) -> None:
        self.skipped = 0
        self._node, self._log = node, node.get_logger()
        self._judge, self._depth = judge, qos.depth
        self._time = Allowance(SHARE, BURST_S, time.monotonic_ns())  # s, for judging
        self._held = b""  # the newest sample that has not been judged
        self._open = False
        self.subscription = subscription(
            node, JointState, "joint_states", self._on_sample, qos, raw=True, offered=OVERRIDES
        )

    @property
    def time_is_scarce(self) -> bool:
        """True if samples come nearly as fast as they can be judged, or after a stall."""
        return self._time.left < SAVED_S

    def settle(self) -> None:
        """Judge the sample that was held back. Called with every heartbeat: a newer one may not come."""
        if self._held:
            held, self._held = self._held, b""
            self._judge(self._decoded(held))

    def open(self) -> None:
        """Open the intake."""
        self._open = True

    def close(self) -> None:
        """Close the intake. Waiting samples are never judged: at the next `open` they would look new."""
        self._open, self._held = False, b""

    def _on_sample(self, data: bytes) -> None:
        if not self._open:
            return
        begin_ns = time.monotonic_ns()
        if self._held:
            self._held = b""
            self.skipped += 1
        if self._time.grow(begin_ns) <= 0.0:  # taking the waiting samples costs less than a callback for each
            waiting = [data, *self._waiting()]
            self.skipped += len(waiting) - 1
            self._held = waiting[-1]
            return
        sample = self._decoded(data)
        waiting = self._waiting() if _age_ns(sample) > WAITED_NS else []
        for newer in map(self._decoded, waiting):
            if _age_ns(sample) > LATE_NS:
                self.skipped += 1
            else:
                self._judge(sample)
            sample = newer
        self._judge(sample)
        self._time.left -= (time.monotonic_ns() - begin_ns) / NS_PER_S

    def _waiting(self) -> list[bytes]:
        """The waiting messages, at most a full queue."""
        waiting: list[bytes] = []
        handle, kind = self.subscription.handle, self.subscription.msg_type
        with handle:
            for _ in range(self._depth):
                found = handle.take_message(kind, True)
                if found is None:
                    break
                waiting.append(found[0])
        return waiting

    def _decoded(self, data: bytes) -> JointSample:
        received_ns, seen_ns = both_clocks(self._node)
        try:
            if len(data) > MOST_BYTES:
                raise CdrError(f"{len(data)} bytes, at most {MOST_BYTES} are read")
            return decode_joint_state(data, received_ns, seen_ns)
        except CdrError as error:
            self._log.warning(f"joint state not read: {error}", throttle_duration_sec=1.0)
            return JointSample(0, received_ns, seen_ns, (), ())  # rejected for its names, and counted


def _age_ns(sample: JointSample) -> int:
    return sample.received_ns - sample.stamp_ns
