"""bond: a sign of life for lifecycle managers that keep a bond with each of their nodes, such as
nav2_lifecycle_manager.

The contract is that of bond_core: both ends publish bond/Status on the topic `bond` with one id, the name of the node,
and each with its own instance id. An end that is silent for `heartbeat_timeout`, or publishes that it is not active,
has broken the bond. The manager decides what follows; the supervisor works without one.
"""

from __future__ import annotations

from typing import Any
from uuid import uuid4

from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode

from irsbot_supervisor.nodes.endpoints import publisher
from irsbot_supervisor.nodes.guard import Fail, guarded

PERIOD_S = 0.1
"""s between signs of life, as in nodes of nav2."""

TIMEOUT_S = 4.0
"""s of silence after which the bond is broken: the default of bond_core."""


class Bond:
    """The supervisor's end of the bond; it does nothing if bond is not installed."""

    def __init__(self, node: LifecycleNode, fail: Fail) -> None:
        self._node, self._status = node, status_type()
        self._formed = False
        if self._status is None:
            return
        self._instance = str(uuid4())
        self._publisher = publisher(node, self._status, "bond", 5)
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # simulated time may stand still
        node.create_timer(PERIOD_S, guarded(self._beat, fail), clock=steady)

    def form(self) -> None:
        """Begin a bond with an activation, with a new instance id, because a manager remembers a broken one."""
        self._formed, self._instance = True, str(uuid4())

    def end(self) -> None:
        """End the bond with an activation."""
        if self._formed and self._status is not None:
            self._say(active=False)
        self._formed = False

    def _beat(self) -> None:
        if self._formed:
            self._say(active=True)

    def _say(self, active: bool) -> None:
        assert self._status is not None, "called where it is installed"
        status = self._status(id=self._node.get_name(), instance_id=self._instance, active=active)
        status.header.stamp = self._node.get_clock().now().to_msg()
        status.heartbeat_timeout, status.heartbeat_period = TIMEOUT_S, PERIOD_S
        self._publisher.publish(status)


def status_type() -> Any:
    """bond/Status, or None where bond is not installed."""
    try:
        from bond.msg import Status
    except ImportError:
        return None
    return Status
