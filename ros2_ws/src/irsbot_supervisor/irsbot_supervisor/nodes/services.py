"""The services ~/reset, ~/bypass and ~/check_trajectory: request, event for the core, answer."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from irsbot_msgs.srv import BypassStop, CheckTrajectory, ResetStop
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from irsbot_msgs_py.records import Bypass, Reset
from irsbot_supervisor.core.events import Step
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.nodes.callers import Callers
from irsbot_supervisor.nodes.check import answered, asked, refused
from irsbot_supervisor.nodes.clocks import both_clocks
from irsbot_supervisor.nodes.later import Later, Steps
from irsbot_supervisor.trajectory.joint_path import BadTrajectory

REQUESTS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
"""The default depth of ten would leave most of a hundred simultaneous clients without an answer."""

INACTIVE = "the supervisor is not active"
"""Answer while the supervisor is inactive."""


class Services:
    """Answers from the core while the supervisor is active; else refuses."""

    def __init__(
        self,
        node: Node,
        supervisor: Supervisor,
        later: Later,
        callers: Callers,
        is_active: Callable[[], bool],
        take: Callable[[Reset | Bypass], Step | None],
        fail: Callable[[Exception], None],
    ) -> None:
        """take: records an operator's wish in the journal, then has it judged; None after an error."""
        self._node, self._supervisor, self._callers = node, supervisor, callers
        self._is_active, self._take, self._fail = is_active, take, fail
        node.create_service(ResetStop, "~/reset", self._on_reset, qos_profile=REQUESTS)
        node.create_service(BypassStop, "~/bypass", self._on_bypass, qos_profile=REQUESTS)
        check = node.create_service(CheckTrajectory, "~/check_trajectory", _served_later, qos_profile=REQUESTS)
        later.serve(check, self._on_check)

    def _on_reset(self, request: ResetStop.Request, response: ResetStop.Response) -> ResetStop.Response:
        what = f"reset of event {request.event}, {request.operator_text!r}"
        given = request.event, request.operator_text, tuple(request.seed_pose)
        response.accepted, response.message = self._answer(Reset, given, what, "~/reset")
        return response

    def _on_bypass(self, request: BypassStop.Request, response: BypassStop.Response) -> BypassStop.Response:
        given = request.event, request.cause, request.duration_s, request.operator_name, request.reason
        what = f"bypass of cause {request.cause} of event {request.event} for {request.duration_s:g} s"
        what += f" by {request.operator_name!r}, {request.reason!r}"
        response.accepted, response.message = self._answer(Bypass, given, what, "~/bypass")
        return response

    def _answer(self, kind: type[Reset | Bypass], given: tuple[Any, ...], what: str, service: str) -> tuple[bool, str]:
        """Have an operator's wish judged. Returns whether it was accepted, and the reason if not."""
        if not self._is_active():
            return False, INACTIVE
        step = self._take(kind(*both_clocks(self._node), *given))
        accepted = step is not None and not step.refusal
        message = step.refusal if step is not None else "an error occurred inside the supervisor"
        calls = "resets" if kind is Reset else "bypasses"
        self._callers.count(calls, accepted)
        if accepted:
            self._node.get_logger().info(f"{what}, {self._callers.who(service)}: accepted")
        elif self._callers.is_due(calls):
            self._node.get_logger().info(f"{what}, {self._callers.who(service)}: {message}")
        return accepted, message

    def _on_check(self, request: CheckTrajectory.Request, response: CheckTrajectory.Response) -> Steps:
        """Check a planned motion while the robot stands: a moving robot has left the start of the motion when the
        answer comes."""
        supervisor = self._supervisor
        if not self._is_active():
            return refused(response, INACTIVE)
        if not supervisor.standing:
            return refused(response, "the robot is moving, or its state is not known: ask while it stands")
        try:
            task = asked(supervisor.robot, supervisor.settings, request, supervisor.view)
            return answered((yield task), response)
        except BadTrajectory as error:
            return refused(response, str(error))
        except Exception as error:
            self._fail(error)
            return refused(CheckTrajectory.Response(), f"an error occurred inside the supervisor: {error}")


def _served_later(request: Any, response: Any) -> Any:
    """Placeholder for a callback, until `Later` serves the service."""
    raise NotImplementedError
