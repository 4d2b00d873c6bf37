"""~/follow_joint_trajectory: control_msgs/FollowJointTrajectory in front of the command gate, for MoveIt and its kin.

A goal is a command like any other: certified, perhaps slowed down or ended early, passed on to `command_out`. The
result says what became of it. Goals are looked after by the heartbeat, not by a coroutine: the EventsExecutor calls one
that waits again and again without a pause.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from builtin_interfaces.msg import Duration
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.lifecycle import LifecycleNode
from trajectory_msgs.msg import JointTrajectoryPoint

from irsbot_msgs_py.records import Floats, Level
from irsbot_msgs_py.stamps import NS_PER_S, nanoseconds, sec_nanosec
from irsbot_supervisor.core.motion import JointPath
from irsbot_supervisor.core.pipeline import Supervisor
from irsbot_supervisor.nodes.gate import Answer, CommandGate

FEEDBACK_NS = 50_000_000
"""Between two feedbacks: 20 Hz, as JointTrajectoryController sends them by default."""

TOLERANCE = 0.01
"""rad or m: how near each joint has to come, where the goal does not say it."""

LATE_S = 1.0
"""s after its planned end at which a motion counts as failed, where the goal does not say it."""


class Motion(NamedTuple):
    """A goal that has been let through."""

    path: JointPath
    begin_ns: int
    text: str  # what was taken away


class FollowServer:
    """One goal at a time; a new command, by whichever way, ends the one before."""

    def __init__(self, node: LifecycleNode, action: Any, gate: CommandGate, supervisor: Supervisor) -> None:
        """action: the type control_msgs.action.FollowJointTrajectory, which not every machine has."""
        self._node, self._action, self._gate, self._supervisor = node, action, gate, supervisor
        self._goal: Any = None
        self._number = 0  # of the goal's command at the gate
        self._answer: Answer | None = None  # set by the gate's thread
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
        """With every heartbeat."""
        goal = self._goal
        if goal is None:
            return
        result = self._action.Result
        view = self._supervisor.view
        if goal.is_cancel_requested:
            self._gate.halt("the goal was cancelled")
            self._end("canceled", result.SUCCESSFUL, "cancelled: the robot is held")
        elif self._gate.commands != self._number:
            self._end("abort", result.INVALID_GOAL, "another command came")
        elif self._answer is None:
            return
        elif self._answer.path is None:
            self._end("abort", result.INVALID_GOAL, self._answer.text)
        elif view is None or (view.judgement.level >= Level.STOP and self._answer.stops != self._gate.stops):
            why = "; ".join(finding.text for finding in view.judgement.findings) if view else "the state is not known"
            self._end("abort", result.PATH_TOLERANCE_VIOLATED, f"held: {why}")
        else:
            if self._motion is None:
                self._motion = Motion(self._answer.path, seen_ns, self._answer.text)
            self._follow(self._motion, view.at.joints, view.velocity, seen_ns)

    def close(self) -> None:
        """The gate has closed."""
        if self._goal is not None:
            self._end("abort", self._action.Result.INVALID_GOAL, "the supervisor is not active any more")

    def _accept(self, goal: Any) -> None:
        if self._goal is not None:
            self._end("abort", self._action.Result.INVALID_GOAL, "another goal came")
        self._goal, self._answer, self._motion, self._told_ns = goal, None, None, 0
        if not self._gate.is_open:
            self._end("abort", self._action.Result.INVALID_GOAL, "the supervisor is not active")
            return
        if not goal.request.trajectory.points:
            self._end("abort", self._action.Result.INVALID_GOAL, "a goal needs points")
            return

        def answered(answer: Answer) -> None:
            if self._goal is goal:
                self._answer = answer

        self._number = self._gate.command(goal.request.trajectory, answered)

    def _follow(self, motion: Motion, joints: Floats, rates: Floats, seen_ns: int) -> None:
        after_s = (seen_ns - motion.begin_ns) / NS_PER_S
        if seen_ns - self._told_ns >= FEEDBACK_NS:
            self._told_ns = seen_ns
            self._goal.publish_feedback(self._feedback(motion, joints, rates, after_s))
        if after_s < motion.path.duration_s:
            return
        wanted, result = motion.path.positions[-1], self._action.Result
        near = all(abs(a - b) <= most for a, b, most in zip(joints, wanted, self._tolerances(), strict=True))
        if near and self._supervisor.standing and self._answer is not None and self._answer.shortened:
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
        feedback.desired = _point(planned.position, planned.velocity, after_s)
        feedback.actual = _point(joints, rates, after_s)
        feedback.error = _point(_minus(planned.position, joints), _minus(planned.velocity, rates), after_s)
        return feedback

    def _names(self) -> tuple[str, ...]:
        return self._supervisor.settings.joint_names

    def _tolerances(self) -> list[float]:
        """Per joint, as the goal says them; 0 means not said."""
        said = {tolerance.name: tolerance.position for tolerance in self._goal.request.goal_tolerance}
        return [said[name] if said.get(name, 0.0) > 0.0 else TOLERANCE for name in self._names()]

    def _patience_s(self) -> float:
        span = self._goal.request.goal_time_tolerance
        return nanoseconds(span.sec, span.nanosec) / NS_PER_S or LATE_S

    def _end(self, outcome: str, code: int, text: str) -> None:
        """outcome: the method of the goal handle that says so."""
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


def _point(position: Sequence[float], velocity: Sequence[float], after_s: float) -> JointTrajectoryPoint:
    sec, nanosec = sec_nanosec(round(after_s * NS_PER_S))
    point = JointTrajectoryPoint(positions=list(position), velocities=list(velocity))
    point.time_from_start = Duration(sec=sec, nanosec=nanosec)
    return point


def _minus(a: Sequence[float], b: Sequence[float]) -> list[float]:
    return [one - other for one, other in zip(a, b, strict=True)]
