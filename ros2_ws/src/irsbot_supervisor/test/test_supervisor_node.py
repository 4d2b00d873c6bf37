"""supervisor_node in a process of its own, over DDS: what it makes of data, silence and time, and what it publishes."""

from __future__ import annotations

import math
import signal
import time
from collections.abc import Callable
from itertools import count
from pathlib import Path

import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from builtin_interfaces.msg import Time
from cell import GOOD, HIGH, NAMES, STANDS, STRICT, Cell, Wire, bad, check_at_rest, going, resting, sample
from few_states import STATES_AT_ONCE, STATES_HZ
from irsbot_msgs.msg import Verdict as VerdictMessage
from lifecycle_msgs.msg import Transition
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from irsbot_msgs_py.records import Cause, JointSample, Level
from irsbot_supervisor.core.settings import Settings

pytestmark = pytest.mark.ros


STALE_NS = 50_000_000
"""What is shipped as stale_s."""


# --- data ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "cause"),
    [
        (lambda t: bad(t, position=(math.nan, math.nan)), Cause.NONFINITE),
        (lambda t: bad(t, position=(math.inf, GOOD[1])), Cause.NONFINITE),
        (lambda t: bad(t, names=("joint_1",), position=GOOD[:1], velocity=(0.0,)), Cause.NAMES),
        (lambda t: bad(t, names=("joint_1", "joint_1")), Cause.NAMES),
        (lambda t: bad(t, position=GOOD[:1]), Cause.NAMES),
        (lambda t: bad(t, names=()), Cause.NAMES),
        (lambda t: bad(t + 10**10), Cause.STAMP),
        (lambda t: bad(0), Cause.STAMP),
    ],
    ids=["NaN", "infinite", "missing name", "doubled name", "short", "nameless", "future", "stamp zero"],
)
def test_ten_bad_samples_are_never_called_ok_and_good_ones_are_again(
    cell: Cell, make: Callable[[int], JointSample], cause: Cause
):
    turns = count()
    before = len(cell.states)
    # A busy machine may skip all ten for a newer one: then ten more come, after half a second of good ones.
    cell.say = lambda t: make(t) if next(turns) % 250 < 10 else sample(t, GOOD)
    heard = cell.heard(lambda verdict: bool(verdict.causes & cause), str(cause))
    assert heard[-1].level == Level.UNKNOWN
    after = cell.heard(lambda verdict: verdict.level == Level.OK, "recovery")
    cell.say = resting(GOOD)
    assert all(verdict.level == Level.UNKNOWN for verdict in after[:-1])
    cell.wire.until(lambda: any(state.causes & cause for state in cell.states[before:]))
    judged = [state for state in cell.states[before:] if state.causes & cause]
    assert all(state.level == Level.UNKNOWN for state in judged)
    assert all(math.isnan(state.type2_margin) for state in judged)
    assert after[-1].stamp_ns > judged[-1].stamp_ns or cause == Cause.STAMP  # what is OK is the sample, not the burst


def test_joints_in_another_order_and_among_others_are_taken_by_name(cell: Cell):
    there = cell.states[-1]
    mixed = ("joint_2", "gripper", "joint_1")
    cell.say = lambda t: JointSample(t, 0, 0, mixed, (GOOD[1], 9.0, GOOD[0]), (0.0, 5.0, 0.0))
    start = len(cell.states)

    def good(begin: int) -> int:
        return [state.level for state in cell.states[begin:]].count(Level.OK)

    cell.wire.until(lambda: good(start) > 100)
    turned = len(cell.states)
    cell.say = lambda t: sample(t, GOOD[::-1], names=NAMES[::-1])
    cell.wire.until(lambda: good(turned) > 100)
    for state in cell.states[start:]:
        if state.causes == Cause.STAMP:  # after a pause of the machine a sample may be too old to be judged
            assert state.level == Level.UNKNOWN
            continue
        assert state.joint_position == GOOD
        assert state.pose == pytest.approx(there.pose, abs=1e-12)
        assert state.level == Level.OK or state.causes == Cause.STALE  # a busy machine may be late


def test_silence_is_unknown_from_the_stale_limit_on_and_ends_with_the_next_good_samples(cell: Cell):
    cell.say = lambda t: None
    (*_, stale) = cell.heard(lambda verdict: bool(verdict.causes & Cause.STALE), "STALE")
    assert stale.level == Level.UNKNOWN
    began = {state.seen_ns + STALE_NS for state in cell.states}  # when silence began to count, not when it was noticed
    assert stale.since_ns in began
    assert all(verdict.level == Level.UNKNOWN for verdict in cell.heard_many(20))  # 0.2 s of heartbeats
    cell.say = resting(GOOD)
    *silent, again = cell.heard(lambda verdict: verdict.level == Level.OK, "recovery")
    assert all(verdict.level == Level.UNKNOWN for verdict in silent)
    assert again.stamp_ns > stale.stamp_ns


def test_before_the_first_sample_nothing_is_known(wire: Wire):
    cell = Cell(wire)
    cell.say = lambda t: None
    heard = cell.heard_many(5)
    assert all((verdict.level, verdict.causes) == (Level.UNKNOWN, Cause.NO_DATA) for verdict in heard)
    cell.say = resting(GOOD)
    cell.heard_level(Level.OK)


# --- time and company ----------------------------------------------------------------------------------------------


def test_three_robots_side_by_side_are_each_judged_for_themselves(wire: Wire):
    cells = [Cell(wire, f"robot_{number}", **STRICT) for number in (1, 2, 3)]
    cells[1].say = resting(HIGH)
    cells[2].say = lambda t: bad(t, position=(math.nan, math.nan))
    wire.until(lambda: all(cell.states for cell in cells))
    cells[0].heard_level(Level.OK)
    near = cells[1].heard(lambda v: v.latched and bool(v.causes & Cause.TYPE1))[-1]
    unknown = cells[2].heard(lambda v: bool(v.causes & Cause.NONFINITE))[-1]
    assert near.level >= Level.STOP  # UNKNOWN while a sample is late
    assert unknown.level == Level.UNKNOWN
    assert not any(verdict.level == Level.OK for cell in cells[1:] for verdict in cell.verdicts)
    assert not any(verdict.latched for cell in (cells[0], cells[2]) for verdict in cell.verdicts)
    assert not cells[1].reset(near.event).accepted
    assert cells[0].reset(near.event).message.startswith("nothing to reset")


def test_simulated_time_may_pause_and_start_again(wire: Wire):
    cell = Cell(wire, use_sim_time=True)
    clock = cell.node.create_publisher(Clock, "/clock", 10)
    begin_ns, now_ns, running = 100 * 10**9, [100 * 10**9], [True]

    def turn() -> None:
        now_ns[0] += 2_000_000 * running[0]
        sec, nanosec = divmod(now_ns[0], 10**9)
        clock.publish(Clock(clock=Time(sec=sec, nanosec=nanosec)))

    cell.node.create_timer(0.002, turn)
    cell.clock = lambda: now_ns[0]
    cell.heard_level(Level.OK)
    wire.until(lambda: now_ns[0] > begin_ns + 10**9)

    running[0] = False
    stale = cell.heard(lambda verdict: bool(verdict.causes & Cause.STALE), "STALE")[-1]
    assert stale.level == Level.UNKNOWN
    cell.say = lambda t: None
    assert all(verdict.level == Level.UNKNOWN for verdict in cell.heard_many(20))  # the heart beats on
    cell.say, running[0] = resting(GOOD), True
    cell.heard_level(Level.OK)

    def recovers(paused_before: bool) -> bool:
        """Whether it is OK again within half a second of a loop, by the steady clock, which processes share."""
        running[0] = not paused_before
        if paused_before:
            cell.heard_level(Level.UNKNOWN)
        end_ns, now_ns[0], running[0] = now_ns[0], now_ns[0] - 10 * 10**9, True
        looped_ns = time.monotonic_ns()
        begin, most_ns = len(cell.verdicts), end_ns - 5 * 10**9
        wire.until(lambda: now_ns[0] > end_ns - 9 * 10**9, "a second of the loop")
        good = [v for v in cell.verdicts[begin:] if v.level == Level.OK and 0 < v.stamp_ns < most_ns]
        cell.heard_level(Level.OK)
        return bool(good) and good[0].since_ns - looped_ns <= 500_000_000

    for paused_before in (False, True):  # a busy machine may be silent in between, but not time and again
        assert any(recovers(paused_before) for _ in range(4))


def test_plain_listeners_hear_whether_motion_is_safe_and_notice_silence(wire: Wire):
    """A gateway that knows no irsbot_msgs, and asks for a deadline and for signs of life."""
    cell = Cell(wire, autostart=False, **STANDS)
    heard: list[bool] = []
    missed: list[object] = []
    promise = Duration(seconds=0.1)
    qos = QoSProfile(
        depth=1,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
        deadline=promise,
        liveliness=LivelinessPolicy.MANUAL_BY_TOPIC,
        liveliness_lease_duration=promise,
    )
    lost: list[object] = []
    events = SubscriptionEventCallbacks(deadline=missed.append, liveliness=lost.append)
    cell.node.create_subscription(Bool, "supervisor/safe", lambda m: heard.append(m.data), qos, event_callbacks=events)
    verdicts: list[VerdictMessage] = []
    cell.node.create_subscription(VerdictMessage, "supervisor/verdict", verdicts.append, qos)
    wire.until(lambda: heard, "a supervisor that was never active")
    assert (heard, verdicts) == ([False], [])
    assert cell.change(Transition.TRANSITION_CONFIGURE)
    assert cell.change(Transition.TRANSITION_ACTIVATE)
    cell.heard_level(Level.OK)
    wire.until(lambda: heard and heard[-1] and verdicts)
    cell.say = lambda t: None
    wire.until(lambda: not heard[-1], "false at UNKNOWN")
    cell.say = resting(GOOD)
    wire.until(lambda: heard[-1], "true again")
    process = cell.suite.processes["supervisor"]
    seen = len(missed), len(lost)
    process.send_signal(signal.SIGSTOP)
    wire.until(lambda: len(missed) > seen[0] and len(lost) > seen[1], "a frozen supervisor is noticed")
    process.send_signal(signal.SIGCONT)
    wire.until(lambda: heard[-1])
    assert cell.change(Transition.TRANSITION_DEACTIVATE)
    wire.until(lambda: not heard[-1], "false as the last word")
    late: list[bool] = []
    cell.node.create_subscription(Bool, "supervisor/safe", lambda m: late.append(m.data), qos)
    wire.until(lambda: late, "who comes late")
    assert late == [False]


def test_best_effort_joint_states_are_received_on_request(wire: Wire):
    cell = Cell(wire, **{"qos_overrides./joint_states.subscription.reliability": "best_effort"})
    cell.node.destroy_publisher(cell.joints)
    best_effort = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
    cell.joints = cell.node.create_publisher(JointState, "joint_states", best_effort)
    cell.heard_level(Level.OK)


def test_states_are_published_at_their_most(wire: Wire, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent / "helpers"), prepend=":")
    cell = Cell(wire, module="few_states")
    wire.until(lambda: len(cell.states) >= 20, "states")
    passed_s = (cell.states[-1].seen_ns - cell.states[0].seen_ns) * 1e-9
    states_hz = STATES_HZ + 1.0 / Settings.heartbeat_s  # with each heartbeat the newest
    assert len(cell.states) <= states_hz * passed_s + STATES_AT_ONCE + 1
    numbers = [state.sequence for state in cell.states]
    assert sorted(set(numbers)) == numbers
    assert numbers[-1] > 2 * len(numbers), "hardly more samples than states: the test proves nothing"


def test_samples_that_change_the_verdict_or_precede_a_silence_have_a_state(wire: Wire, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent / "helpers"), prepend=":")
    cell = Cell(wire, module="few_states")
    cell.heard_level(Level.OK)
    begun_ns, dwell_ns = [], round(Settings.dwell_s * 1e9)
    for _ in range(3):
        cell.say = lambda t: bad(t, position=(math.nan, math.nan))
        begun_ns.append(cell.heard(lambda v: bool(v.causes & Cause.NONFINITE), "NONFINITE")[-1].since_ns)
        cell.say = resting(GOOD)
        again = cell.heard(lambda v: v.level == Level.OK, "recovery")[-1]
        begun_ns.append(again.since_ns - dwell_ns)  # the last sample that was bad
    cell.say = lambda t: None
    (*_, stale) = cell.heard(lambda verdict: bool(verdict.causes & Cause.STALE), "STALE")
    begun_ns.append(stale.since_ns - STALE_NS)
    wire.until(lambda: {state.seen_ns for state in cell.states}.issuperset(begun_ns), f"states seen at {begun_ns}")
    assert len(set(begun_ns)) == 7


def test_passive_joints_are_published_to_subscribers(cell: Cell):
    heard: list[JointState] = []
    told = cell.node.create_subscription(JointState, "supervisor/passive_joint_states", heard.append, 10)
    cell.wire.until(lambda: len(heard) > 3, "passive joints")
    cell.node.destroy_subscription(told)
    positions = dict(zip(heard[-1].name, heard[-1].position, strict=True))
    assert positions["elbow_1"] == pytest.approx(-GOOD[0], abs=1e-12)  # the elbows stay level
    assert len(positions) == 12


def test_an_error_inside_is_an_unknown_verdict_and_the_node_goes_on(wire: Wire, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent / "helpers"), prepend=":")
    monkeypatch.setenv("IRSBOT_PLAIN", "1")  # compiled modules take no mechanism that is derived from theirs
    cell = Cell(wire, module="fake_failing_mechanism")
    cell.heard_level(Level.OK)
    start = len(cell.verdicts)
    answer = check_at_rest(cell, GOOD, (3.3, GOOD[1]))
    assert not answer.safe
    assert "a fake error of the mechanism" in answer.message
    cell.wire.until(lambda: any(verdict.causes & Cause.INTERNAL for verdict in cell.verdicts[start:]))
    cell.heard_level(Level.OK)
    cell.say = going(GOOD, (3.0, GOOD[1]), time.time_ns(), 1.0)
    failed = cell.heard(lambda verdict: bool(verdict.causes & Cause.INTERNAL), "INTERNAL")[-1]
    assert failed.level == Level.UNKNOWN
    assert "a fake error of the mechanism" in failed.text
    # A late sample on a busy machine may have foreseen the error from farther away: what counts is the end of the way.
    cell.wire.until(lambda: min(verdict.level for verdict in cell.verdicts[-100:]) == Level.UNKNOWN)
    assert not any(verdict.level == Level.OK for verdict in cell.heard_many(20))
    cell.say = going((3.0, GOOD[1]), GOOD, time.time_ns(), 1.0)
    judged = cell.heard(lambda verdict: not verdict.causes & Cause.INTERNAL, "a sample that is judged again")[-1]
    cell.wire.until(lambda: cell.states[-1].joint_position == GOOD)
    if cell.verdicts[-1].latched:  # it went on although nobody knew where it was: farther than drives that brake
        assert cell.verdicts[-1].causes & Cause.BRANCH, judged.text
        assert cell.reset_at_rest(cell.verdicts[-1].event).accepted
    cell.heard_level(Level.OK)
