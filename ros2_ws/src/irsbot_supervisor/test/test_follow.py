"""Goals of FollowJointTrajectory through a real gate of a supervised robot. control_msgs has no wheels: action type,
action server and goal handles are stand-ins. tests/campaigns/follow_goals.py does it over DDS where control_msgs is."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from builtin_interfaces.msg import Duration, Time
from gated import Opened, set_clock
from std_msgs.msg import Header
from supervised import at_ns, feed, joints_of, ready, sample
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from irsbot_msgs_py.records import Floats
from irsbot_supervisor.nodes import follow as module
from irsbot_supervisor.nodes.follow import FollowServer

pytestmark = pytest.mark.ros


class FakeResult(SimpleNamespace):
    """The result of control_msgs/FollowJointTrajectory; numbers as published there."""

    SUCCESSFUL, INVALID_GOAL, INVALID_JOINTS = 0, -1, -2
    PATH_TOLERANCE_VIOLATED, GOAL_TOLERANCE_VIOLATED = -4, -5


class FakeFeedback(SimpleNamespace):
    def __init__(self, **fields: Any) -> None:
        super().__init__(header=Header(), **fields)


FAKE_ACTION = SimpleNamespace(Result=FakeResult, Feedback=FakeFeedback)


class FakeGoal:
    """A goal handle: keeps how it ended, and with which result."""

    def __init__(self, *points: Floats, names: tuple[str, ...] = ("joint_1", "joint_2"), seconds: float = 1.0) -> None:
        trajectory = JointTrajectory(joint_names=list(names))
        for number, point in enumerate(points, 1):
            after = Duration(sec=int(number * seconds))
            trajectory.points.append(JointTrajectoryPoint(positions=list(point), time_from_start=after))
        self.request = SimpleNamespace(trajectory=trajectory, goal_tolerance=[], goal_time_tolerance=Duration())
        self.is_cancel_requested = False
        self.outcome, self.result = "", FakeResult()
        self.feedback: list[Any] = []

    def execute(self, finish: Any) -> None:
        self.result = finish(self)

    def publish_feedback(self, feedback: Any) -> None:
        self.feedback.append(feedback)

    def succeed(self) -> None:
        self.outcome = "succeed"

    def abort(self) -> None:
        self.outcome = "abort"

    def canceled(self) -> None:
        self.outcome = "canceled"


class Served:
    """An open gate with an action server in front of it, and a robot that does what passes."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_ms = 0.0
        set_clock(monkeypatch, lambda: at_ns(self.now_ms)[1])
        accepted: dict[str, Any] = {}
        monkeypatch.setattr(module, "ActionServer", lambda *_args, **callbacks: accepted.update(callbacks))
        supervisor, self.here = ready()
        self.opened, self.supervisor = Opened(supervisor), supervisor
        node: Any = self.opened.node
        node.get_clock = lambda: SimpleNamespace(now=lambda: SimpleNamespace(to_msg=lambda: Time(), nanoseconds=0))
        self.server = FollowServer(node, FAKE_ACTION, self.opened.gate, supervisor)
        self._accept = accepted["handle_accepted_callback"]
        self.beat()

    def beat(self) -> None:
        seen_ns = at_ns(self.now_ms)[1]
        self.opened.gate.beat(seen_ns)
        self.server.beat(seen_ns)

    def send(self, goal: FakeGoal) -> None:
        """Accept a goal; returns when the gate has answered to it."""
        stated = len(self.opened.motions)
        self._accept(goal)
        if not goal.outcome:
            self.opened.until_said(stated + 1)

    def drive(self, goal: FakeGoal, *, until_ms: float = 4000.0, stuck: bool = False) -> None:
        """The robot follows what passed, 1 kHz, a beat every 10 ms, until the goal has ended."""
        begin_ms, outcome = self.now_ms, self.server._outcome
        path = outcome.path if outcome else None
        while not goal.outcome and self.now_ms < begin_ms + until_ms:
            self.now_ms += 1.0
            if path is not None and not stuck:
                at = path.at((self.now_ms - begin_ms) * 1e-3)
                feed(self.supervisor, [sample(self.now_ms, at.position, at.velocity)])
            else:
                feed(self.supervisor, [sample(self.now_ms, self.here)])
            if self.now_ms % 10.0 == 0.0:
                self.beat()


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> Iterator[Served]:
    served = Served(monkeypatch)
    yield served
    served.opened.gate.close()
    served.server.close()
    served.opened.gate.end()
    assert served.opened.errors == []
    follows, rates = served.opened.obeyed()
    assert follows is not None
    assert len(follows.points) == 1  # a hold is the last word
    assert not any(rates)


def test_a_goal_that_can_be_reached_succeeds_with_feedback_on_the_way(served: Served):
    goal = FakeGoal(joints_of(served.supervisor, 0.05, -0.82))
    served.send(goal)
    served.drive(goal)
    assert (goal.outcome, goal.result.error_code, goal.result.error_string) == ("succeed", 0, "")
    assert len(goal.feedback) >= 15
    assert max(abs(error) for message in goal.feedback for error in message.error.positions) < 0.05


def test_a_goal_beyond_a_singularity_is_aborted_before_it_with_the_reason(served: Served):
    q = served.here
    goal = FakeGoal((q[0] + 1.9, q[1] - 1.9), seconds=2.0)
    served.send(goal)
    served.drive(goal, until_ms=8000.0)
    assert (goal.outcome, goal.result.error_code) == ("abort", FakeResult.GOAL_TOLERANCE_VIOLATED)
    assert goal.result.error_string.startswith("ends early: Type 1 margin")
    assert served.supervisor.view is not None
    assert served.supervisor.view.judgement.level <= 1


@pytest.mark.parametrize(
    ("goal", "words"),
    [
        (FakeGoal((0.1, 0.2), names=("a", "b")), "held: the joints are joint_1, joint_2"),
        (FakeGoal(), "a goal needs points"),
        (FakeGoal((float("nan"), 0.0)), "held: "),
    ],
)
def test_a_goal_that_is_none_is_aborted_with_the_reason(served: Served, goal: FakeGoal, words: str):
    served.send(goal)
    served.drive(goal)
    assert (goal.outcome, goal.result.error_code) == ("abort", FakeResult.INVALID_GOAL)
    assert goal.result.error_string.startswith(words)


def test_a_cancelled_goal_holds_the_robot(served: Served):
    goal = FakeGoal(joints_of(served.supervisor, 0.05, -0.82))
    served.send(goal)
    served.drive(goal, until_ms=200.0)
    stated = len(served.opened.motions)
    goal.is_cancel_requested = True
    served.beat()
    assert (goal.outcome, goal.result.error_code) == ("canceled", 0)
    assert served.opened.motions[stated:] == [1]


def test_a_cancelled_goal_does_not_hold_a_newer_command(served: Served):
    """Both come between two heartbeats."""
    goal = FakeGoal(joints_of(served.supervisor, 0.05, -0.82))
    served.send(goal)
    served.drive(goal, until_ms=200.0)
    stated = len(served.opened.motions)
    goal.is_cancel_requested = True
    served.opened.go(served.here)
    served.opened.until_said(stated + 1)
    assert served.opened.motions[-1] > 1, "the newer command did not pass: the test proves nothing"
    served.beat()
    assert (goal.outcome, goal.result.error_code) == ("canceled", 0)
    assert len(served.opened.motions) == stated + 1


def test_a_stop_aborts_a_goal(served: Served):
    goal = FakeGoal(joints_of(served.supervisor, 0.05, -0.82))
    served.send(goal)
    served.drive(goal, until_ms=200.0)
    served.supervisor.step(sample(served.now_ms + 1.0, (float("nan"),) * 2))
    served.beat()
    assert (goal.outcome, goal.result.error_code) == ("abort", FakeResult.PATH_TOLERANCE_VIOLATED)
    assert goal.result.error_string.startswith("held: ")


def test_a_second_goal_and_a_command_by_topic_end_a_goal(served: Served):
    first, second = (FakeGoal(joints_of(served.supervisor, x, -0.82)) for x in (0.05, -0.05))
    served.send(first)
    served.drive(first, until_ms=20.0)
    served.send(second)
    assert (first.outcome, first.result.error_string) == ("abort", "another goal came")
    served.drive(second, until_ms=20.0)
    served.opened.rates(0.0, 0.0)
    served.beat()
    assert (second.outcome, second.result.error_string) == ("abort", "another command came")


def test_drives_that_do_not_follow_are_reported(served: Served):
    goal = FakeGoal(joints_of(served.supervisor, 0.05, -0.82))
    served.send(goal)
    served.drive(goal, stuck=True)
    assert (goal.outcome, goal.result.error_code) == ("abort", FakeResult.GOAL_TOLERANCE_VIOLATED)
    assert goal.result.error_string.startswith("the drives did not get there: joint_1 ")


@pytest.mark.parametrize(
    ("stated", "outcome"),
    [
        ((0.0, 0.0), "abort"),  # the default
        ((5.0, 5.0), "succeed"),
        ((-1.0, -1.0), "succeed"),  # erased: may deviate without restriction
        ((-1.0, 0.0), "abort"),
        ((-2.0, -2.0), "abort"),
        ((float("nan"), float("nan")), "abort"),
    ],
)
def test_the_goal_says_how_far_from_it_the_robot_may_end(served: Served, stated: Floats, outcome: str):
    goal = FakeGoal(joints_of(served.supervisor, 0.05, -0.82))
    names = goal.request.trajectory.joint_names
    goal.request.goal_tolerance = [
        SimpleNamespace(name=name, position=position) for name, position in zip(names, stated, strict=True)
    ]
    served.send(goal)
    served.drive(goal, stuck=True)
    assert goal.outcome == outcome


def test_a_supervisor_that_is_not_active_takes_no_goal_and_drops_the_one_it_has(served: Served):
    first, second = (FakeGoal(joints_of(served.supervisor, 0.05, -0.82)) for _ in range(2))
    served.send(first)
    served.opened.gate.close()
    served.server.close()
    assert (first.outcome, first.result.error_string) == ("abort", "the supervisor is not active any more")
    served.send(second)
    assert (second.outcome, second.result.error_string) == ("abort", "the supervisor is not active")
