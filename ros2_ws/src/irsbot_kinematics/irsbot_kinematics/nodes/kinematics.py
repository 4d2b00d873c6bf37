"""kinematics_node: IKM, DKM and evaluation as services. A shell: request, mathematics, response."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Sequence
from itertools import chain
from typing import Any, TypeVar

from irsbot_msgs.srv import EvaluateJoints, SolveDirect, SolveInverse
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

from irsbot_kinematics import arguments
from irsbot_kinematics.errors import BadInput, KinematicsError, NotAssembled
from irsbot_kinematics.mechanism import meant
from irsbot_kinematics.requests import DirectAnswer, InverseAnswer, solve_direct, solve_inverse
from irsbot_kinematics.robot import Robot, load_robot, make_robot
from irsbot_msgs_py.convert import state_msg
from irsbot_msgs_py.process.run import run
from irsbot_msgs_py.records import Cause, Level, SingularityState, unknown_state
from irsbot_msgs_py.stamps import NS_PER_S

MOST = 20_000
"""Largest number of postures or poses of one request: other requests wait, and a state takes 2 kB."""

BUSY_S = 1.0
"""s: longest time for one request, because the others wait for it."""

SLICE = 100
"""Postures or poses that are solved between two looks at the clock."""

Solved = TypeVar("Solved", InverseAnswer, DirectAnswer)


class KinematicsNode(Node):
    """Serves one robot, named by the read-only parameter `robot`."""

    def __init__(self) -> None:
        super().__init__("kinematics")
        described = ParameterDescriptor(description="preset name or YAML file of the robot", read_only=True)
        name = self.declare_parameter("robot", "irsbot2", described).value
        self._robot = load_robot(name) if name.endswith((".yaml", ".yml")) else make_robot(name)
        self.create_service(SolveInverse, "~/inverse", self._answered(self._inverse))
        self.create_service(SolveDirect, "~/direct", self._answered(self._direct))
        self.create_service(EvaluateJoints, "~/evaluate", self._answered(self._evaluate))
        self.get_logger().info(f"kinematics of {self._robot.name} ready")

    def _answered(self, service: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
        """A service that answers every request: after an internal error, with an empty answer and the error."""

        def answer(request: Any, response: Any) -> Any:
            try:
                return service(request, response)
            except Exception as error:
                response = type(response)()
                response.message = self._told("an error occurred inside", error)
                return response

        return answer

    def _told(self, where: str, error: Exception) -> str:
        text = f"{where}: {type(error).__name__}: {error}"
        self.get_logger().error(text, throttle_duration_sec=1.0)
        return text

    def _inverse(self, request: SolveInverse.Request, response: SolveInverse.Response) -> SolveInverse.Response:
        response.message = too_many(len(request.poses), len(self._robot.mechanism.task), "poses")
        if response.message:
            return response
        mode, width = tuple(request.working_mode), len(self._robot.mechanism.task)
        answer = in_time(lambda poses: solve_inverse(self._robot, poses, mode), request.poses, width, "poses")
        response.joints, response.status = answer.joints, answer.status
        response.reach, response.message = answer.reach, answer.message
        return response

    def _direct(self, request: SolveDirect.Request, response: SolveDirect.Response) -> SolveDirect.Response:
        response.message = too_many(len(request.joints), len(self._robot.mechanism.joints), "postures")
        if response.message:
            return response
        mode, seed, width = request.assembly_mode, tuple(request.seed), len(self._robot.mechanism.joints)
        answer = in_time(
            lambda joints: solve_direct(self._robot, joints, mode, seed), request.joints, width, "postures"
        )
        response.poses, response.status, response.gap = answer.poses, answer.status, answer.gap
        response.assembly_mode, response.message = answer.assembly_mode, answer.message
        return response

    def _evaluate(self, request: EvaluateJoints.Request, response: EvaluateJoints.Response) -> EvaluateJoints.Response:
        now_ns, seen_ns = self.get_clock().now().nanoseconds, time.monotonic_ns()
        width = len(self._robot.mechanism.joints)
        response.message = too_many(len(request.joints), width, "postures")
        if response.message:
            return response
        joints = tuple(request.joints)
        if not joints or len(joints) % width:
            response.message = f"joints must hold a multiple of {width} numbers, got {len(joints)}"
            return response
        try:
            assembly = arguments.assembly_mode(self._robot.mechanism, request.assembly_mode or None)
        except BadInput as error:
            response.message = str(error)
            return response
        rows = [joints[i : i + width] for i in range(0, len(joints), width)]
        times, states, failed = (now_ns, now_ns, seen_ns), [], ""
        for number, row in enumerate(rows):
            if time.monotonic_ns() - seen_ns > BUSY_S * NS_PER_S:
                response.message = too_slow(number, len(rows), "postures")
                return response
            try:
                states.append(evaluation(self._robot, row, assembly, times, number))
            except Exception as error:  # one posture silences neither the others nor the service
                failed = self._told(f"posture {number}", error)
                states.append(_unknown(self._robot, row, times, number, Cause.INTERNAL))
        response.states, response.message = [state_msg(state) for state in states], failed
        return response


def too_many(numbers: int, width: int, what: str) -> str:
    """Reason to refuse a request that is too large; else empty. numbers: the flat list, `width` per item."""
    if numbers <= MOST * width:
        return ""
    return f"at most {MOST} {what} in one request, got {-(-numbers // width)}: ask in parts"


def too_slow(done: int, number: int, what: str) -> str:
    """Message of a request that has taken BUSY_S."""
    return f"{BUSY_S:g} s were enough for {done} of {number} {what}: ask for fewer"


def in_time(solve: Callable[[Sequence[float]], Solved], numbers: Sequence[float], width: int, what: str) -> Solved:
    """The answer to a flat list with `width` numbers per item; empty, with a message, if it takes longer than
    BUSY_S."""
    begin_ns, step = time.monotonic_ns(), SLICE * width
    if len(numbers) <= step or len(numbers) % width:
        return solve(numbers)
    parts: list[Solved] = [solve(numbers[:step])]
    for first in range(step, len(numbers), step):
        if time.monotonic_ns() - begin_ns > BUSY_S * NS_PER_S:
            message = too_slow(first // width, len(numbers) // width, what)
            return type(parts[0])._make([*([] for _ in parts[0][:-1]), message])
        parts.append(solve(numbers[first : first + step]))
    *columns, messages = zip(*parts, strict=True)
    return type(parts[0])._make([*(list(chain.from_iterable(column)) for column in columns), messages[0]])


def evaluation(
    robot: Robot, joints: tuple[float, ...], assembly_mode: int, times: tuple[int, int, int], sequence: int
) -> SingularityState:
    """Margins of one posture as a state, without limits (level OK) and without a stopping prediction.

    Joint positions that are no numbers, or farther than any joint gets, are UNKNOWN. Raises BadInput for an assembly
    mode that the robot does not have.
    """
    if not all(map(math.isfinite, joints)):
        return _unknown(robot, joints, times, sequence, Cause.NONFINITE)
    if not meant(joints):
        return _unknown(robot, joints, times, sequence, Cause.IMPLAUSIBLE)
    blank = _unknown(robot, joints, times, sequence, Cause.NOT_ASSEMBLED)
    try:
        found = robot.evaluate(joints, assembly_mode)
    except NotAssembled:
        return blank
    return blank._replace(
        level=Level.OK,
        causes=Cause.NONE,
        pose=found.pose,
        working_mode=found.working_mode,
        assembly_mode=found.assembly_mode,
        type1_margin=found.type1_margin,
        type2_margin=found.type2_margin,
        constraint_margin=found.constraint_margin,
        limb_margin=found.limb_margin,
        clearance=found.clearance,
        pressure_angle=found.pressure_angle,
        reaction_max=found.reaction_max,
        closure_residual=found.closure_residual,
    )


def _unknown(
    robot: Robot, joints: tuple[float, ...], times: tuple[int, int, int], sequence: int, cause: Cause
) -> SingularityState:
    size = len(robot.mechanism.task), robot.mechanism.limb_count
    return unknown_state(times, robot.name, sequence, cause, (joints, (0.0,) * len(joints)), size)


def main() -> None:
    """Entry point of `ros2 run irsbot_kinematics kinematics_node`."""
    sys.exit(run(KinematicsNode, usage_errors=(KinematicsError,)))


if __name__ == "__main__":
    main()
