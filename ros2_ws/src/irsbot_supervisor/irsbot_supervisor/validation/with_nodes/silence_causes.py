"""Causes of silence: requests, settings, life cycles of others, stalled disks and pipes."""

from __future__ import annotations

import signal
from collections.abc import Callable
from math import pi, sin
from typing import Any

from irsbot_supervisor.validation.with_nodes.silence_cell import Cell

LOOK_S = 0.25
"""s of observation for events without an end of their own."""

STALL_S = 0.5
"""s for which a disk stalls."""

POINTS = 200
"""Number of points of the trajectory that is checked or commanded."""

SHARES = (2.2, 10.0, 1.0, 3.0)
"""Velocity limits as multiples of the shipped ones: accepted after a search, refused after one, and accepted at
once."""

RESETS_AT_ONCE = 20
"""Number of requests for a reset that wait at the same time."""


def _nothing(cell: Cell) -> str:
    cell.tester.look(LOOK_S)
    return ""


def _parameters(cell: Cell) -> str:
    """Set velocity limits that need the feasibility check."""
    from rcl_interfaces.srv import SetParameters
    from rclpy.parameter import Parameter

    share = SHARES[cell.turn % len(SHARES)] * (1.0 + 1e-3 * (cell.turn % 100))  # new ones every time
    values = [share * limit for limit in cell.settings.velocity_limit]
    request = SetParameters.Request(parameters=[Parameter("velocity_limit", value=values).to_parameter_msg()])
    (result,) = cell.ask(SetParameters, "supervisor/set_parameters", request).results
    due = share < max(SHARES)
    return "" if result.successful == due else f"velocity_limit {values}: {result.successful}, {result.reason}"


def _resets(cell: Cell) -> str:
    from irsbot_msgs.srv import ResetStop

    client = cell.client(ResetStop, "supervisor/reset")
    answers = [client.call_async(ResetStop.Request(event=1)) for _ in range(RESETS_AT_ONCE)]
    cell.tester.until(lambda: all(answer.done() for answer in answers), "all answers")
    accepted = sum(answer.result().accepted for answer in answers)
    return f"{accepted} resets without a stop" if accepted else ""


def _check(cell: Cell) -> str:
    from irsbot_msgs.srv import CheckTrajectory

    request = CheckTrajectory.Request(trajectory=_trajectory(cell))
    answer = cell.ask(CheckTrajectory, "supervisor/check_trajectory", request)
    return "" if answer.safe else f"not safe: {answer.message}"


def _command(cell: Cell) -> str:
    """A trajectory through the command gate, until the answer."""
    from trajectory_msgs.msg import JointTrajectory

    node, answers = cell.tester.node, list[Any]()
    publisher = node.create_publisher(JointTrajectory, "command_in", 10)
    subscription = node.create_subscription(JointTrajectory, "command_out", answers.append, 10)
    try:
        cell.tester.until(
            lambda: publisher.get_subscription_count() > 1 and subscription.get_publisher_count(), "the command gate"
        )
        publisher.publish(_trajectory(cell))
        cell.tester.until(lambda: answers, "an answer of the command gate")
    finally:
        node.destroy_publisher(publisher)
        node.destroy_subscription(subscription)
    return ""


def _life_cycle(cell: Cell) -> str:
    """Another supervisor is deactivated and activated, and a node comes and goes."""
    import rclpy
    from lifecycle_msgs.msg import Transition
    from lifecycle_msgs.srv import ChangeState
    from sensor_msgs.msg import JointState

    guest = rclpy.create_node(f"guest_{cell.turn}", context=cell.tester.context)
    guest.create_publisher(JointState, "others/joint_states", 10)
    for transition in (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_ACTIVATE):
        request = ChangeState.Request()
        request.transition.id = transition
        if not cell.ask(ChangeState, "others/supervisor/change_state", request).success:
            return f"transition {transition} of another supervisor is refused"
    guest.destroy_node()
    return ""


def _disk(cell: Cell) -> str:
    """A recorder whose disk stalls."""
    process = cell.tester.suite.processes["recorder"]
    process.send_signal(signal.SIGSTOP)
    try:
        cell.tester.look(STALL_S)
    finally:
        process.send_signal(signal.SIGCONT)
    return ""


def _print(cell: Cell) -> str:
    """The output of the supervisor is not read while settings changes make it log."""
    from rcl_interfaces.srv import SetParameters
    from rclpy.parameter import Parameter

    request = SetParameters.Request(
        parameters=[Parameter("load_force_n", value=50.0 + cell.turn % 10).to_parameter_msg()]
    )
    client = cell.client(SetParameters, "supervisor/set_parameters")
    cell.log.stall()
    try:
        answer = client.call_async(request)
        cell.tester.look(STALL_S)
    finally:
        cell.log.flow()
    cell.tester.until(answer.done, "an answer")
    (result,) = answer.result().results
    return "" if result.successful else result.reason


CAUSES: dict[str, Callable[[Cell], str]] = {
    "quiet": _nothing,
    "parameters": _parameters,
    "resets": _resets,
    "check_trajectory": _check,
    "command": _command,
    "life cycle of others": _life_cycle,
    "recorder's disk stalls": _disk,
    "log stalls": _print,
}
"""Events by name; each is caused in a cell and returns its fault, or an empty text. `quiet` is the control."""


def _trajectory(cell: Cell) -> Any:
    """A motion back and forth about the present posture, at a tenth of full speed."""
    from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

    start = cell.robot.inverse(cell.pose).tolist()
    size, period_s = 0.02, 0.02
    message = JointTrajectory(joint_names=list(cell.settings.joint_names))
    for k in range(POINTS):
        way = size * sin(2.0 * pi * k / POINTS)
        point = JointTrajectoryPoint(positions=[q + way for q in start])
        point.time_from_start.sec, point.time_from_start.nanosec = divmod(round(k * period_s * 1e9), 10**9)
        message.points.append(point)
    return message
