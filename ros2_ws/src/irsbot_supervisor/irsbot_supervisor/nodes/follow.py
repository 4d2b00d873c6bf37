"""~/follow_joint_trajectory: control_msgs/FollowJointTrajectory through the command gate, for MoveIt and similar
clients.

A goal is handled like any other command: certified, perhaps slowed down or ended early, published on `command_out`. The
result has the outcome. The heartbeat supervises goals, not a coroutine: the EventsExecutor calls a waiting coroutine
again and again without a pause.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Any, NamedTuple

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.lifecycle import LifecycleNode

from irsbot_msgs_py.gate_status import GateOutcome, GateReason
from irsbot_msgs_py.records import Floats, Level
from irsbot_msgs_py.stamps import NS_PER_S, nanoseconds
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.nodes.certifier import Outcome
from irsbot_supervisor.nodes.commands import point_msg
from irsbot_supervisor.nodes.gate import CommandGate
from irsbot_supervisor.trajectory.joint_path import JointPath

FEEDBACK_NS = 50_000_000
"""ns between two feedbacks: 20 Hz, the default of JointTrajectoryController."""

TOLERANCE = 0.01
"""rad or m: goal tolerance of each joint if the goal has none."""

ERASED = -1.0
"""A goal tolerance with which the joint may deviate without restriction (control_msgs/JointTolerance)."""

LATE_S = 1.0
"""s after its planned end at which a motion has failed, if the goal does not say it."""


class Motion(NamedTuple):
    """A goal that has passed the gate."""

    path: JointPath
    begin_ns: int
    text: str  # what was reduced


class FollowServer:
    """Serves one goal at a time; a new command, on any interface, ends the one before."""

    def __init__(self, node: LifecycleNode, action: Any, gate: CommandGate, supervisor: Supervisor) -> None:
        """action: the type control_msgs.action.FollowJointTrajectory, which not every machine has."""
        self._node, self._action, self._gate, self._supervisor = node, action, gate, supervisor
        self._goal: Any = None
        self._number = 0  # of the goal's command at the gate
        self._outcome: Outcome | None = None  # set by the gate's thread
        self._motion: Motion | None = None
        self._told_ns = 0
        self._server = ActionServer(
            node,
            action,
            "~/follow_joint_trajectory",
            lambda goal: None,  # never called: `_end` brings its own
            goal_callback=lambda request: GoalResponse.ACCEPT,  # a rejection could not say why
            handle_accepted_callback=self._accept,
            cancel_callback=lambda goal: CancelResponse.ACCEPT,
        )

    def beat(self, seen_ns: int) -> None:
        """Supervise the goal; called with every heartbeat."""
        goal = self._goal
        if goal is None:
            return
        result = self._action.Result
        view = self._supervisor.view
        if goal.is_cancel_requested and self._gate.commands == self._number:
            self._gate.halt(GateReason.CANCELLED)
            self._end("canceled", result.SUCCESSFUL, "cancelled: the robot is held")
        elif goal.is_cancel_requested:
            self._end("canceled", result.SUCCESSFUL, "cancelled: another command came")
        elif self._gate.commands != self._number:
            self._end("abort", result.INVALID_GOAL, "another command came")
        elif self._outcome is None:
            return
        elif self._outcome.path is None:
            self._end("abort", result.INVALID_GOAL, self._outcome.answer.text)
        elif view is None or (view.judgement.level >= Level.STOP and self._outcome.stops != self._gate.stops):
            why = "; ".join(finding.text for finding in view.judgement.findings) if view else "the state is not known"
            self._end("abort", result.PATH_TOLERANCE_VIOLATED, f"held: {why}")
        else:
            if self._motion is None:
                self._motion = Motion(self._outcome.path, seen_ns, self._outcome.answer.text)
            self._follow(self._motion, view.at.joints, view.velocity, seen_ns)

    def close(self) -> None:
        """End the goal because the gate has closed."""
        if self._goal is not None:
            self._end("abort", self._action.Result.INVALID_GOAL, "the supervisor is not active any more")

    def _accept(self, goal: Any) -> None:
        if self._goal is not None:
            self._end("abort", self._action.Result.INVALID_GOAL, "another goal came")
        self._goal, self._outcome, self._motion, self._told_ns = goal, None, None, 0
        if not self._gate.is_open:
            self._end("abort", self._action.Result.INVALID_GOAL, "the supervisor is not active")
            return
        if not goal.request.trajectory.points:
            self._end("abort", self._action.Result.INVALID_GOAL, "a goal needs points")
            return

        def answered(outcome: Outcome) -> None:
            if self._goal is goal:
                self._outcome = outcome

        self._number = self._gate.command(goal.request.trajectory, answered)

    def _follow(self, motion: Motion, joints: Floats, rates: Floats, seen_ns: int) -> None:
        after_s = (seen_ns - motion.begin_ns) / NS_PER_S
        if seen_ns - self._told_ns >= FEEDBACK_NS:
            self._told_ns = seen_ns
            self._goal.publish_feedback(self._feedback(motion, joints, rates, after_s))
        if after_s < motion.path.duration_s:
            return
        wanted, result = motion.path.positions[-1], self._action.Result
        shortened = self._outcome is not None and self._outcome.answer.outcome == GateOutcome.SHORTENED
        near = all(abs(a - b) <= most for a, b, most in zip(joints, wanted, self._tolerances(), strict=True))
        if near and self._supervisor.standing and shortened:
            self._end("abort", result.GOAL_TOLERANCE_VIOLATED, motion.text)
        elif near and self._supervisor.standing:
            self._end("succeed", result.SUCCESSFUL, motion.text)
        elif after_s - motion.path.duration_s > self._patience_s():
            apart = ", ".join(f"{name} {a - b:+.4g}" for name, a, b in zip(self._names(), joints, wanted, strict=True))
            self._end("abort", result.GOAL_TOLERANCE_VIOLATED, f"the drives did not get there: {apart}")

    def _feedback(self, motion: Motion, joints: Floats, rates: Floats, after_s: float) -> Any:
        planned = motion.path.at(min(after_s, motion.path.duration_s))
        feedback = self._action.Feedback(joint_names=list(self._names()))
        feedback.header.stamp = self._node.get_clock().now().to_msg()
        feedback.desired = point_msg(planned.position, planned.velocity, after_s)
        feedback.actual = point_msg(joints, rates, after_s)
        feedback.error = point_msg(_minus(planned.position, joints), _minus(planned.velocity, rates), after_s)
        return feedback

    def _names(self) -> tuple[str, ...]:
        return self._supervisor.settings.joint_names

    def _tolerances(self) -> list[float]:
        """Tolerance per joint, rad or m, from the goal; no number above 0 means not given."""
        stated = {tolerance.name: tolerance.position for tolerance in self._goal.request.goal_tolerance}
        found = (inf if stated.get(name) == ERASED else stated.get(name, 0.0) for name in self._names())
        return [tolerance if tolerance > 0.0 else TOLERANCE for tolerance in found]

    def _patience_s(self) -> float:
        span = self._goal.request.goal_time_tolerance
        return nanoseconds(span.sec, span.nanosec) / NS_PER_S or LATE_S

    def _end(self, outcome: str, code: int, text: str) -> None:
        """outcome: name of the method of the goal handle that reports it."""
        goal, self._goal = self._goal, None
        self._node.get_logger().info(f"follow_joint_trajectory: {outcome}: {text or 'done'}")

        def finish(handle: Any) -> Any:
            getattr(handle, outcome)()
            return self._action.Result(error_code=code, error_string=text)

        goal.execute(finish)


def action_type() -> Any:
    """control_msgs/FollowJointTrajectory, or None where control_msgs is not installed."""
    try:
        from control_msgs.action import FollowJointTrajectory
    except ImportError:
        return None
    return FollowJointTrajectory


def _minus(a: Sequence[float], b: Sequence[float]) -> list[float]:
    return [one - other for one, other in zip(a, b, strict=True)]
