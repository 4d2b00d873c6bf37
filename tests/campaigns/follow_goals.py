"""Random goals of FollowJointTrajectory through the command gate, over DDS: no robot may get beyond a stop limit.

    nice ./irsbot python tests/campaigns/follow_goals.py --goals 200

Needs control_msgs, of which there are no wheels: run it on a sourced ROS 2 machine that has it. A goal that is held
because a busy machine was late with its samples is sent again; a stop is counted and reset.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rclpy
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from irsbot_msgs.msg import SingularityState, Verdict
from irsbot_msgs.srv import ResetStop
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from trajectory_msgs.msg import JointTrajectoryPoint

from irsbot_msgs_py.cdr import decode_state, decode_verdict
from irsbot_msgs_py.records import Floats, Level
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.processes.asking import Asking
from irsbot_supervisor.processes.suite import GATED, JOINTS, SUPERVISOR, Node, Suite, free_domain
from irsbot_supervisor.sim.simulation import STANDING

PATIENCE_S = 60.0
LATE = "not known"
"""Of the reason, where samples were late."""

SPEED, ACCELERATION = 2.0, 20.0
"""rad/s or m/s, and per s2: limits of the drives. At 200 Hz, and with the late samples of an ordinary computer, faster
drives could leave every place for a singularity before the next sample is judged, and the gate would hold them."""

FARTHEST = 2.5
"""rad or m: how far from its home each joint of a goal may lie."""


class Client:
    """Sends goals, and remembers the least margins that the robot had, relative to their stop limits."""

    def __init__(self, domain: int, robot: str) -> None:
        self.settings, self.robot = read_settings(robot)
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node("moveit", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.client = ActionClient(self.node, FollowJointTrajectory, "supervisor/follow_joint_trajectory")
        self.operator = self.node.create_client(ResetStop, "supervisor/reset")
        self._reset: Asking | None = None
        self.joints: Floats = ()
        self.level, self.events, self.least = Level.UNKNOWN, 0, float("inf")
        self.node.create_subscription(SingularityState, "supervisor/state", self._state, 100, raw=True)
        self.node.create_subscription(Verdict, "supervisor/verdict", self._verdict, 10, raw=True)

    def _state(self, data: bytes) -> None:
        state, limits = decode_state(data), self.settings
        if state.level < Level.UNKNOWN:
            self.joints = state.joint_position
            spare = [value / limits.type1_stop for value in state.type1_margin]
            spare += [state.type2_margin / limits.type2_stop, state.constraint_margin / limits.constraint_stop]
            spare += [value / limits.limb_stop for value in state.limb_margin]
            self.least = min(self.least, *(share for share in spare if share == share))  # NaN: the robot has none

    def _verdict(self, data: bytes) -> None:
        verdict = decode_verdict(data)
        self.level, self.events = verdict.level, verdict.event

    def until(self, happened: Callable[[], Any], what: str) -> None:
        deadline = time.monotonic() + PATIENCE_S
        while not happened():
            if time.monotonic() > deadline:
                raise RuntimeError(f"in vain: {what}")
            self.executor.spin_once(timeout_sec=0.01)

    def go(self, joints: Floats, seconds: float) -> Any:
        """The result of a goal that was judged."""
        while True:
            self.until(self._may_move, "leave to move")
            result = self._send(joints, seconds)
            if LATE not in result.error_string:
                return result

    def _may_move(self) -> bool:
        """Reset a stop, as an operator would who has looked."""
        due = self._reset is None or self._reset.answered()
        if self.level == Level.STOP and due:
            self._reset = Asking(self.operator, ResetStop.Request(event=self.events, operator_text="campaign"))
        return self.level <= Level.WARN and bool(self.joints)

    def _send(self, joints: Floats, seconds: float) -> Any:
        goal = FollowJointTrajectory.Goal()
        goal.trajectory.joint_names = list(self.settings.joint_names)
        after = Duration(sec=int(seconds), nanosec=int(seconds % 1.0 * 1e9))
        goal.trajectory.points = [JointTrajectoryPoint(positions=list(joints), time_from_start=after)]
        self.until(self.client.server_is_ready, "an action server")
        sent = self.client.send_goal_async(goal)
        self.until(sent.done, "an answer")
        answer = sent.result().get_result_async()
        self.until(answer.done, "a result")
        return answer.result().result

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


def run(goals: int, robot: str, seed: int) -> tuple[Counter[str], float, int]:
    """Results by their text up to the first colon, the least margin in stop limits, and the number of stops."""
    chance, found, domain = random.Random(seed), Counter[str](), free_domain()
    with tempfile.TemporaryDirectory() as logs, Suite(Path(logs), domain) as suite:
        client = Client(domain, robot)
        try:
            drives = {"robot": robot, "velocity_limit": [SPEED], "acceleration_limit": [ACCELERATION]}
            suite.start(Node("supervisor", SUPERVISOR, drives))
            drives |= {"scenario": STANDING, "gated": True, "rate_hz": 200.0}
            suite.start(Node("simulated_joints", JOINTS, drives, GATED))
            client.until(lambda: client.joints, "a state")
            home = client.joints
            for _ in range(goals):
                goal = tuple(q + chance.uniform(-FARTHEST, FARTHEST) for q in home)
                result = client.go(goal, chance.uniform(0.3, 1.5))
                found[f"{result.error_code} {result.error_string.split(':')[0]}"] += 1
        finally:
            client.close()
    return found, client.least, client.events


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--goals", type=int, default=200)
    parser.add_argument("--robot", default="irsbot2")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    results, least, stops = run(given.goals, given.robot, given.seed)
    for text, count in results.most_common():
        print(f"{count:5d}  {text}")
    print(f"least margin: {least:.3f} of its stop limit; stops: {stops}")
    sys.exit(least < 1.0)
