"""kinematics_node in a process of its own, over DDS: its services answer whatever they are asked."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

import rclpy
from irsbot_msgs.srv import EvaluateJoints, SolveDirect, SolveInverse
from rclpy.executors import SingleThreadedExecutor

from irsbot_msgs_py.records import Cause, Level
from irsbot_supervisor.processes.suite import free_domain

pytestmark = pytest.mark.ros

PATIENCE_S = 120.0
"""Longest wait for an answer: far more than it takes, on the slowest machine."""

AGAIN_S = 2.0
"""s without an answer after which a service is called again."""

SOLVED, UNREACHABLE, SINGULAR, INVALID = 0, 1, 2, 3

W1 = 0.3, -0.75
W1_JOINTS = 2.544003124, -0.190028776
"""The worked example of the robot's sheet, working mode +-, printed digits."""

NAN, INF = math.nan, math.inf
ORACLES = str(Path(__file__).parent / "oracles")


class Client:
    """Asks the node of a process of ours; every question has an answer, or the test ends."""

    def __init__(self, robot: str, module: str = "irsbot_kinematics.nodes.kinematics") -> None:
        domain = free_domain()
        path = os.pathsep.join([ORACLES, *os.environ.get("PYTHONPATH", "").split(os.pathsep)])
        self.process = subprocess.Popen(
            [sys.executable, "-m", module, "--ros-args", "-p", f"robot:={robot}"],
            env={**os.environ, "ROS_DOMAIN_ID": str(domain), "PYTHONPATH": path},
            stderr=subprocess.PIPE,
            text=True,
        )
        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=domain)
        self._node = rclpy.create_node("client", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        kinds = {"inverse": SolveInverse, "direct": SolveDirect, "evaluate": EvaluateJoints}
        self._clients = {name: self._node.create_client(kind, f"kinematics/{name}") for name, kind in kinds.items()}

    def inverse(self, *poses: float, mode: tuple[int, ...] = ()) -> Any:
        return self._ask("inverse", SolveInverse.Request(poses=poses, working_mode=mode))

    def direct(self, *joints: float, mode: int = 0, seed: tuple[float, ...] = ()) -> Any:
        return self._ask("direct", SolveDirect.Request(joints=joints, assembly_mode=mode, seed=seed))

    def evaluate(self, *joints: float, mode: int = 0) -> Any:
        return self._ask("evaluate", EvaluateJoints.Request(joints=joints, assembly_mode=mode))

    def close(self) -> tuple[int, str]:
        """Exit code and what was printed on stderr."""
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)
        self.process.send_signal(signal.SIGINT)
        try:
            _, printed = self.process.communicate(timeout=PATIENCE_S)
        finally:
            self.process.kill()
        return self.process.returncode, printed

    def _ask(self, name: str, request: Any) -> Any:
        client, deadline = self._clients[name], time.monotonic() + PATIENCE_S
        assert client.wait_for_service(timeout_sec=PATIENCE_S), f"no service '{name}'"
        calls = []
        while not any(call.done() for call in calls):  # the middleware may drop the answer to a new client
            assert time.monotonic() < deadline, f"no answer from '{name}'; the process: {self.process.poll()}"
            calls.append(client.call_async(request))
            self._executor.spin_until_future_complete(calls[-1], timeout_sec=AGAIN_S)
        return next(call.result() for call in calls if call.done())


@contextmanager
def served(robot: str) -> Iterator[Client]:
    client = Client(robot)
    yield client
    code, printed = client.close()
    assert code == 0
    assert "Traceback" not in printed
    assert "ERROR" not in printed


@pytest.fixture(scope="module")
def irsbot2() -> Iterator[Client]:
    with served("irsbot2") as client:
        yield client


@pytest.fixture(scope="module")
def orthoglide() -> Iterator[Client]:
    """Three slides: unlike those of the IRSBot-2, its legs cannot be assembled at every joint position."""
    with served("orthoglide") as client:
        yield client


def test_one_pose_has_the_joint_positions_that_the_sheet_prints(irsbot2: Client):
    answer = irsbot2.inverse(*W1, mode=(1, -1))
    assert list(answer.status) == [SOLVED]
    assert list(answer.joints) == pytest.approx(W1_JOINTS, abs=1e-9)
    assert answer.reach[0] > 0.0
    assert answer.message == ""


def test_every_pose_of_many_has_its_own_status(irsbot2: Client):
    poses = (*W1, 0.0, -1.25, NAN, -0.75, INF, 0.0, *W1)
    answer = irsbot2.inverse(*poses, mode=(1, -1))
    assert list(answer.status) == [SOLVED, UNREACHABLE, INVALID, INVALID, SOLVED]
    assert list(answer.joints[:2]) == list(answer.joints[8:]) == pytest.approx(W1_JOINTS, abs=1e-9)
    assert all(map(math.isnan, answer.joints[2:8]))
    assert answer.reach[1] == pytest.approx(-0.05008, abs=5e-6)  # m, as the sheet says of (0, -1.25)


def test_a_pose_comes_back_through_the_direct_kinematics_in_either_assembly_mode(irsbot2: Client):
    there = irsbot2.inverse(*W1)
    labels = [irsbot2.direct(*there.joints, mode=mode) for mode in (-1, 1)]
    back = [answer for answer in labels if list(answer.poses) == pytest.approx(W1, abs=1e-9)]
    assert len(back) == 1
    assert all(list(answer.status) == [SOLVED] for answer in labels)
    seeded = irsbot2.direct(*there.joints, seed=(0.29, -0.74))
    assert list(seeded.poses) == pytest.approx(W1, abs=1e-9)
    assert list(seeded.assembly_mode) == list(back[0].assembly_mode)


def test_joints_without_a_pose_without_an_answer_or_without_sense_each_get_their_status(orthoglide: Client):
    equal, far, crossed = (1.0, 1.0, 1.0), (5.0, 5.0, 5.0), (0.0, 0.0, 1.0)  # two slides of `crossed` are in one point
    answer = orthoglide.direct(*equal, *far, *crossed, 1.0, NAN, 1.0, *equal)
    assert list(answer.status) == [SOLVED, UNREACHABLE, SINGULAR, INVALID, SOLVED]
    assert answer.gap[0] > 0.0 > answer.gap[1]
    x, y, z = answer.poses[:3]
    assert [x, y] == pytest.approx([z, z], abs=1e-12)  # as symmetric as the joints
    assert all(map(math.isnan, answer.poses[3:12]))
    assert list(answer.poses[:3]) == list(answer.poses[12:])
    apart = orthoglide.evaluate(*far).states[0]
    assert (apart.level, apart.causes) == (Level.UNKNOWN, Cause.NOT_ASSEMBLED)


@pytest.mark.parametrize(
    ("poses", "mode", "words"),
    [
        ((), (), "multiple of 2"),
        ((0.3,), (), "multiple of 2"),
        ((0.3, -0.75, 0.1), (), "multiple of 2"),
        (W1, (1,), "working mode"),
        (W1, (0, 0), "working mode"),
        (W1, (1, -1, 1), "working mode"),
    ],
)
def test_a_malformed_inverse_request_is_invalid_with_a_reason(irsbot2: Client, poses, mode, words):
    answer = irsbot2.inverse(*poses, mode=mode)
    assert set(answer.status) == {INVALID}
    assert all(map(math.isnan, answer.joints))
    assert words in answer.message


@pytest.mark.parametrize(
    ("joints", "mode", "seed", "words"),
    [
        ((), 0, (), "multiple of 2"),
        ((0.1, 0.2, 0.3), 0, (), "multiple of 2"),
        ((2.5, -0.2), 7, (), "assembly mode 7"),
        ((2.5, -0.2), 0, (0.3,), "seed"),
        ((2.5, -0.2), 0, (NAN, 0.0), "seed"),
    ],
)
def test_a_malformed_direct_request_is_invalid_with_a_reason(irsbot2: Client, joints, mode, seed, words):
    answer = irsbot2.direct(*joints, mode=mode, seed=seed)
    assert set(answer.status) == {INVALID}
    assert all(map(math.isnan, answer.poses))
    assert words in answer.message


def test_margins_of_many_postures_are_states_without_limits(irsbot2: Client):
    there = irsbot2.inverse(*W1)
    answer = irsbot2.evaluate(*there.joints, NAN, 0.0, 2e6, 0.0, *there.joints)
    good, nonsense, far, last = answer.states
    assert (good.level, good.causes) == (Level.OK, Cause.NONE)
    assert list(good.pose) == pytest.approx(W1, abs=1e-9)
    assert all(0.0 < margin <= 1.0 for margin in (*good.type1_margin, good.type2_margin, good.constraint_margin))
    assert (nonsense.level, nonsense.causes) == (Level.UNKNOWN, Cause.NONFINITE)
    assert math.isnan(nonsense.type2_margin)
    assert (far.level, far.causes) == (Level.UNKNOWN, Cause.IMPLAUSIBLE)
    assert math.isnan(far.type2_margin)
    assert (last.level, list(last.pose)) == (Level.OK, list(good.pose))
    assert answer.message == ""


@pytest.mark.parametrize(("joints", "mode"), [((), 0), ((1.0,), 0), ((1.0, 2.0, 3.0), 0), ((2.5, -0.2), 7)])
def test_a_malformed_evaluation_has_no_states_and_a_reason(irsbot2: Client, joints, mode):
    answer = irsbot2.evaluate(*joints, mode=mode)
    assert not answer.states
    assert answer.message


def test_one_posture_that_fails_inside_silences_neither_the_others_nor_the_service():
    client = Client("irsbot2", "fake_failing_kinematics")
    try:
        answer = client.evaluate(*W1_JOINTS, 3.0, -0.2, *W1_JOINTS)
        assert [(state.level, state.causes) for state in answer.states] == [
            (Level.OK, Cause.NONE),
            (Level.UNKNOWN, Cause.INTERNAL),
            (Level.OK, Cause.NONE),
        ]
        assert "posture 1: ArithmeticError: a fake error of the mechanism" in answer.message
        refused = client.inverse(0.0, 0.5)
        assert not refused.joints
        assert "a fake error of the mechanism" in refused.message
        assert list(client.inverse(*W1).joints) == pytest.approx(W1_JOINTS, abs=1e-8)
    finally:
        code, _ = client.close()
    assert code == 0


def test_the_service_answers_where_a_leg_is_folded_to_nothing():
    with served("rrr3_base") as client:
        (state,) = client.evaluate(0.0, -2.0042699833528625, -0.9570724321562651, mode=1).states
        assert (state.level, state.causes) == (Level.OK, Cause.NONE)
        assert state.type1_margin[0] < 1e-9
        assert 0.0 <= state.clearance < 1e-15


def test_a_thousand_poses_in_one_call_are_a_thousand_answers(irsbot2: Client):
    poses = [coordinate for k in range(1000) for coordinate in (-0.3 + 6e-4 * k, -0.8)]
    there = irsbot2.inverse(*poses)
    assert set(there.status) == {SOLVED}
    back = irsbot2.direct(*there.joints, seed=(0.0, -0.8))
    assert list(back.poses) == pytest.approx(poses, abs=1e-9)
    assert len(irsbot2.evaluate(*there.joints).states) == 1000


def test_a_robot_that_does_not_exist_is_one_line_and_exit_code_2():
    client = Client("irsbot9")
    try:
        _, printed = client.process.communicate(timeout=PATIENCE_S)
    finally:
        client.process.kill()
        client.close()
    assert client.process.returncode == 2
    (line,) = printed.splitlines()
    assert "irsbot9" in line


@pytest.mark.parametrize("service", ["inverse", "direct", "evaluate"])
def test_a_request_that_is_too_large_is_refused_at_once_with_the_limit(irsbot2: Client, service: str):
    answer = getattr(irsbot2, service)(*([0.1] * (2 * 300_000)))
    assert answer.message.startswith("at most 20000 po")
    assert answer.message.endswith("got 300000: ask in parts")
    results = answer.states if service == "evaluate" else answer.status
    assert len(results) == 0
    odd = getattr(irsbot2, service)(*([0.1] * 40_001))
    assert odd.message.endswith("got 20001: ask in parts")


def test_a_request_that_takes_too_long_ends_with_its_progress():
    """A node for which every request takes too long: whether a real one does depends on the computer."""
    client = Client("irsbot2", "impatient_kinematics")
    try:
        joints = W1_JOINTS * 300
        judged = client.evaluate(*joints)
        assert judged.message.endswith("were enough for 0 of 300 postures: ask for fewer")
        assert len(judged.states) == 0
        solved = client.direct(*joints)
        assert solved.message.endswith("were enough for 100 of 300 postures: ask for fewer")
        assert (len(solved.poses), len(solved.status), len(solved.gap), len(solved.assembly_mode)) == (0, 0, 0, 0)
        placed = client.inverse(*(W1 * 300))
        assert placed.message.endswith("were enough for 100 of 300 poses: ask for fewer")
        assert (len(placed.joints), len(placed.status), len(placed.reach)) == (0, 0, 0)
        assert list(client.direct(*W1_JOINTS).poses) == pytest.approx(W1, abs=1e-8)
    finally:
        code, printed = client.close()
    assert code == 0
    assert "Traceback" not in printed
