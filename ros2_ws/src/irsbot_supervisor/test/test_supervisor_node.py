"""supervisor_node in a process of its own, over DDS: what it makes of bad data, of silence and of its operators."""

from __future__ import annotations

import math
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from builtin_interfaces.msg import Time
from cell import GOOD, NAMES, NEAR, PATIENCE_S, PERIOD_S, Cell, Wire, going, resting, sample, swinging
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from irsbot_msgs.msg import Verdict as VerdictMessage
from irsbot_msgs.srv import BypassStop, CheckTrajectory
from lifecycle_msgs.msg import Transition
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.parameter import get_parameter_value, parameter_dict_from_yaml_file, parameter_value_to_python
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from rclpy.utilities import get_rmw_implementation_identifier
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, String
from trajectory_msgs.msg import JointTrajectoryPoint

import irsbot_kinematics as irs
from irsbot_msgs_py.records import Bypass, Cause, JointSample, Level
from irsbot_supervisor.bag.journal import read_entry
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.core.stop_monitor import MeasuredStop
from irsbot_supervisor.nodes.diagnostics import DiagnosticsPublisher

pytestmark = pytest.mark.ros

STALE_NS = 50_000_000
"""What is shipped as stale_s."""


@pytest.fixture
def wire(tmp_path: Path) -> Iterator[Wire]:
    with Wire(tmp_path / "logs") as wire:
        yield wire


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cell]:
    """One supervisor for all tests that leave it as it was; nothing may have failed inside when they are over."""
    with Wire(tmp_path_factory.mktemp("shared")) as wire:
        cell = Cell(wire)
        yield cell
        assert cell.suite.stop() == {"supervisor": 0}
        assert "Traceback" not in cell.printed
        assert not any(verdict.causes & Cause.INTERNAL for verdict in cell.verdicts)


@pytest.fixture
def cell(shared: Cell) -> Cell:
    """A robot at rest whose supervisor says OK."""
    shared.say = resting(GOOD)
    shared.heard_level(Level.OK)
    return shared


# --- data ----------------------------------------------------------------------------------------------------------


def bad(stamp_ns: int, **changes: object) -> JointSample:
    return sample(stamp_ns, GOOD)._replace(**changes)


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
        assert state.joint_position == GOOD
        assert state.pose == pytest.approx(there.pose, abs=1e-12)
        assert state.level == Level.OK or state.causes == Cause.STALE  # a busy machine may be late


def test_silence_is_unknown_from_the_stale_limit_on_and_ends_with_the_next_good_samples(cell: Cell):
    cell.say = lambda t: None
    (*_, stale) = cell.heard(lambda verdict: bool(verdict.causes & Cause.STALE), "STALE")
    assert stale.level == Level.UNKNOWN
    assert stale.since_ns == cell.states[-1].seen_ns + STALE_NS  # when silence began to count, not when it was noticed
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


# --- operators -----------------------------------------------------------------------------------------------------


def test_a_change_of_parameters_is_refused_as_a_whole_or_comes_into_force_as_a_whole(cell: Cell):
    before = cell.heard_many(1)[-1].config_hash
    accepted, reason = cell.set(type1_warn=0.1)
    assert not accepted
    assert "type1_warn (0.1)" in reason
    assert "type1_stop (0.15)" in reason
    accepted, reason = cell.set(type2_warn=0.9, type1_stop=0.3)
    assert not accepted
    assert "type1_stop (0.3)" in reason
    assert {verdict.config_hash for verdict in cell.heard_many(20)} == {before}
    assert cell.set(joint_names=["a", "b"])[0] is False  # read only
    assert cell.set(latency_s=-1.0)[0] is False
    assert cell.set(type1_stop=0.3, type1_warn=0.4) == (True, "")  # either alone would be refused
    changed = cell.heard(lambda verdict: verdict.config_hash != before)[-1]
    assert {verdict.config_hash for verdict in cell.heard_many(20)} == {changed.config_hash}
    assert cell.set(type2_warn=0.9) == (True, "")
    warned = cell.heard_level(Level.WARN)
    assert warned.causes == Cause.TYPE2
    assert cell.set(type1_stop=0.15, type1_warn=0.25, type2_warn=0.25) == (True, "")


def test_a_parameter_dump_of_the_ros2_tools_is_accepted_and_changes_nothing(cell: Cell, tmp_path: Path):
    """`ros2 param dump` writes values as YAML, `ros2 param load` guesses types with rclpy's own functions."""
    names = cell.call(ListParameters, "supervisor/list_parameters", ListParameters.Request()).result.names
    request = GetParameters.Request(names=names)

    def values() -> dict[str, Any]:
        return dict(zip(names, cell.call(GetParameters, "supervisor/get_parameters", request).values, strict=True))

    before, plain = values(), {}
    for name, value in before.items():
        python = parameter_value_to_python(value)
        plain[name] = python if isinstance(python, (str, int, float)) else list(python)
    file = tmp_path / "dump.yaml"
    file.write_text(yaml.dump({"/supervisor": {"ros__parameters": plain}}, default_flow_style=False))
    loaded = parameter_dict_from_yaml_file(str(file))
    answer = cell.call(
        SetParameters, "supervisor/set_parameters", SetParameters.Request(parameters=list(loaded.values()))
    )
    refused = [r.reason for r in answer.results if not r.successful and "read-only" not in r.reason]
    assert refused == []
    assert values() == before


@pytest.mark.parametrize(
    ("name", "text", "kept"),
    [
        ("reaction_check", "off", "none"),
        ("reaction_check", "none", "none"),
        ("load_force_n", "10", 10.0),
        ("encoder_resolution", "1e-05", 1e-5),
        ("velocity_limit", "[12, 12]", [12.0, 12.0]),
    ],
)
def test_a_typed_value_of_the_ros2_tools_is_accepted(cell: Cell, name: str, text: str, kept: Any):
    request = SetParameters.Request(parameters=[ParameterMessage(name=name, value=get_parameter_value(text))])
    (result,) = cell.call(SetParameters, "supervisor/set_parameters", request).results
    assert (result.successful, result.reason) == (True, "")
    (value,) = cell.call(GetParameters, "supervisor/get_parameters", GetParameters.Request(names=[name])).values
    found = parameter_value_to_python(value)
    assert (found if isinstance(found, (str, float)) else list(found)) == kept


@pytest.mark.parametrize(
    ("name", "text"), [("latency_s", "soon"), ("latency_s", "nan"), ("reaction_check", "true"), ("dwell_s", "true")]
)
def test_a_typed_value_that_means_nothing_is_refused(cell: Cell, name: str, text: str):
    request = SetParameters.Request(parameters=[ParameterMessage(name=name, value=get_parameter_value(text))])
    (result,) = cell.call(SetParameters, "supervisor/set_parameters", request).results
    assert not result.successful
    assert result.reason


def test_counted_bending_is_computed_at_the_start_and_cannot_grow_unstated(wire: Wire):
    mine = {"compliance": True, "tubes": "five_bar_table1", "reaction_check": False}  # as YAML reads `on` and `off`
    cell = Cell(wire, robot="five_bar", **mine)
    cell.say = resting(tuple(irs.make_robot("five_bar").inverse((0.1, -0.7)).tolist()))
    cell.heard_level(Level.OK)
    request = GetParameters.Request(names=["compliance_slack_m", "reaction_check"])
    found, word = cell.call(GetParameters, "supervisor/get_parameters", request).values
    assert word.string_value == "none"
    assert found.double_value == pytest.approx(read_settings("five_bar", mine)[0].slack_m)
    stated = "load_force_n lets the robot bend more: set compliance_slack_m in the same call"
    assert cell.set(load_force_n=20.0) == (False, stated)
    assert cell.set(load_force_n=20.0, compliance_slack_m=2.0 * found.double_value) == (True, "")
    assert cell.set(load_force_n=10.0) == (True, "")
    accepted, reason = cell.set(compliance_slack_m=0.0)
    assert not accepted
    assert "compliance_slack_m is 0.0" in reason
    assert cell.set(compliance="none")[0] is False  # only at the start


def test_a_latched_stop_survives_a_change_of_settings_and_ends_by_the_right_reset_alone(wire: Wire):
    cell = Cell(wire)
    cell.say = resting(NEAR)
    stop = cell.heard_level(Level.STOP)
    assert stop.latched
    assert stop.event == 1
    cell.logged("a stop is latched, event 1, level ")
    assert "Type 1 margin 0.1215, limit 0.1500" in cell.printed
    assert stop.causes & (Cause.TYPE1 | Cause.TYPE2)

    answer = cell.reset(1)
    assert not answer.accepted
    assert "cause is still there" in answer.message

    assert cell.set(type1_stop=0.01, type2_stop=0.01) == (True, "")
    cell.logged("type1_stop 0.15 -> 0.01, type2_stop 0.15 -> 0.01")
    cell.heard(lambda verdict: verdict.config_hash != stop.config_hash)
    kept = cell.heard_many(20)
    assert all(verdict.latched and verdict.event == 1 for verdict in kept)
    assert all(v.level == Level.STOP or (v.level == Level.UNKNOWN and v.causes & Cause.STALE) for v in kept)
    assert cell.set(type1_stop=0.15, type2_stop=0.15) == (True, "")

    cell.say = going(NEAR, GOOD, time.time_ns(), 1.0)
    cell.wire.until(lambda: cell.states[-1].level == Level.OK and cell.states[-1].joint_position == GOOD)
    cell.say = swinging(GOOD)
    cell.wire.until(lambda: any(abs(rate) > 0.1 for rate in cell.states[-1].joint_velocity))
    event = cell.heard_level(Level.STOP).event  # a busy machine may have lost the branch meanwhile: that is event 2
    answers = [cell.reset(event) for _ in range(3)]
    assert all("not standing" in answer.message for answer in answers)
    assert cell.heard_many(1)[-1].latched

    cell.say = resting(GOOD)
    cell.wire.until(lambda: cell.states[-1].joint_velocity == (0.0, 0.0))
    wrong = cell.reset(99)
    assert not wrong.accepted
    assert "event 99" in wrong.message
    event = cell.heard_level(Level.STOP).event  # again, where the joints have stopped at once
    right = cell.reset_at_rest(event)
    assert right.accepted, right.message
    assert right.message == ""
    cell.logged(f"reset of event {event}, 'tested', called by /robot: accepted")
    assert cell.printed.count("a stop is latched") == event
    ended = cell.heard_level(Level.OK)
    assert not ended.latched
    again = cell.reset(event)
    assert not again.accepted
    assert "nothing to reset" in again.message


def test_an_operator_bypasses_one_cause_by_the_service_for_a_while(wire: Wire):
    cell = Cell(wire, type2_stop=0.01, type2_warn=0.02, constraint_stop=0.001, constraint_warn=0.002)
    heard = statuses_of(cell)
    journal: list[str] = []
    latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    cell.node.create_subscription(String, "supervisor/journal", lambda message: journal.append(message.data), latched)
    cell.say = resting(NEAR)
    assert cell.heard_level(Level.STOP).event == 1

    def ask(**changes: object) -> BypassStop.Response:
        wish = {"event": 1, "cause": int(Cause.TYPE1), "duration_s": 3.0, "operator_name": "Ada", "reason": "free it"}
        return cell.call(BypassStop, "supervisor/bypass", BypassStop.Request(**{**wish, **changes}))

    for changes, words in (
        ({"duration_s": math.nan}, "duration"),
        ({"event": 7}, "event 7"),
        ({"reason": ""}, "reason"),
    ):
        answer = ask(**changes)
        assert not answer.accepted
        assert words in answer.message or "known" in answer.message  # a sample may be late on a busy machine

    def lasts() -> bool:
        """Whether the diagnostics have seen it; a bypass is asked for again where a late sample has ended it."""
        if not cell.verdicts[-1].bypassed:
            ask(event=cell.verdicts[-1].event)
        return any("TYPE1 is bypassed for " in status["supervisor"][1] for status in heard)

    cell.wire.until(lasts, "a bypass in the diagnostics")
    passed = [verdict for verdict in cell.verdicts if verdict.bypassed]
    for verdict in passed:
        assert (verdict.level, verdict.bypassed, verdict.latched) == (Level.WARN, Cause.TYPE1, False)
        assert 0.0 <= verdict.bypass_left <= 3.0
        assert verdict.speed_scale == 0.05
    assert "bypassed by Ada until " in passed[0].text
    assert "free it: Type 1 margin 0.1215, limit 0.1500" in passed[0].text
    again = cell.heard_level(Level.STOP)
    before = next(verdict for verdict in reversed(cell.verdicts) if verdict.bypassed)
    assert (again.event, again.latched, again.bypassed) == (before.event + 1, True, 0)
    cell.logged(f"bypass of cause 1 of event {before.event} for 3 s by 'Ada', 'free it', ")
    entries = [entry for entry in map(read_entry, journal) if isinstance(entry, Bypass)]
    assert [math.isnan(entry.duration_s) for entry in entries[:2]] == [True, False]
    assert (entries[-1].operator, entries[-1].reason, entries[-1].duration_s) == ("Ada", "free it", 3.0)


def silent(cell: Cell) -> bool:
    """Whether the supervisor has nothing to speak with."""
    return not any(cell.node.count_publishers(f"supervisor/{topic}") for topic in ("verdict", "state", "journal"))


ANEW = (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP, Transition.TRANSITION_CONFIGURE)
"""From active to inactive by the longer way."""


def test_only_an_active_supervisor_publishes_and_every_activation_begins_with_unknown(wire: Wire):
    cell = Cell(wire)
    cell.heard_level(Level.OK)

    def begins_with_unknown() -> bool:
        """As after a silence: as long as no joint states come, no verdict can be another."""
        begin = cell.heard_many(10)
        cell.say = resting(GOOD)
        cell.heard_level(Level.OK)
        return all((verdict.level, verdict.causes) == (Level.UNKNOWN, Cause.STALE) for verdict in begin)

    cell.say = lambda t: None
    cell.heard_level(Level.UNKNOWN)
    assert cell.change(Transition.TRANSITION_DEACTIVATE)
    cell.wire.until(lambda: silent(cell), "silence")
    assert not cell.change(Transition.TRANSITION_DEACTIVATE)  # it is not active
    for answer in (cell.reset(0), check(cell, GOOD)):
        assert answer.message == "the supervisor is not active"
    assert cell.set(type1_warn=0.3) == (True, "")  # for the next activation
    before = cell.verdicts[-1].config_hash
    assert cell.change(Transition.TRANSITION_ACTIVATE)
    assert begins_with_unknown()
    assert cell.verdicts[-1].config_hash != before
    cell.say = lambda t: None
    cell.heard_level(Level.UNKNOWN)
    assert all(map(cell.change, ANEW))
    cell.wire.until(lambda: silent(cell), "silence")
    assert cell.change(Transition.TRANSITION_ACTIVATE)
    assert begins_with_unknown()
    assert cell.change(Transition.TRANSITION_ACTIVE_SHUTDOWN)
    cell.wire.until(lambda: silent(cell), "silence")


def test_a_latched_stop_and_its_number_outlive_every_transition(wire: Wire):
    cell = Cell(wire)
    cell.say = resting(NEAR)
    assert cell.heard_level(Level.STOP).event == 1
    cell.say = going(NEAR, GOOD, time.time_ns(), 1.0)
    cell.wire.until(lambda: cell.states[-1].level == Level.OK and cell.states[-1].joint_position == GOOD)
    start, sequence = len(cell.verdicts), cell.states[-1].sequence
    for way in (ANEW[:1], ANEW):
        assert all(map(cell.change, way))
        cell.wire.until(lambda: silent(cell), "silence")
        assert cell.change(Transition.TRANSITION_ACTIVATE)
        judged = len(cell.states)
        cell.wire.until(lambda judged=judged: len(cell.states) > judged + 10)
    assert all(verdict.latched and verdict.event == 1 for verdict in cell.verdicts[start:])
    assert all(verdict.level >= Level.STOP for verdict in cell.verdicts[start:])
    assert cell.states[-1].sequence > sequence  # a bag of it all is one story
    cell.heard_level(Level.STOP)  # what was not known a moment ago is over
    right = cell.reset_at_rest(1)
    assert right.accepted, right.message
    cell.heard_level(Level.OK)
    cell.say = going(GOOD, NEAR, time.time_ns(), 1.0)
    cell.heard_level(Level.STOP)
    assert all(map(cell.change, ANEW))
    assert cell.change(Transition.TRANSITION_ACTIVATE)
    assert cell.heard_many(1)[-1].event == 2
    cell.heard_level(Level.STOP)
    assert "event 1 is not the stop in force" in cell.reset(1).message


def test_a_supervisor_that_is_started_again_waits_for_a_reset_and_does_so_once(wire: Wire):
    cell = Cell(wire)
    cell.heard_level(Level.OK)
    cell.suite.end("supervisor", signal.SIGKILL)
    cell.supervisor = cell.supervisor._replace(parameters={"start_latched": True})
    begin = len(cell.verdicts)
    cell.suite.start(cell.supervisor)
    latched = cell.heard(lambda verdict: verdict.latched and verdict.stamp_ns > 0, "a latched verdict")[-1]
    cell.wire.until(lambda: len(cell.states) > 300 and cell.states[-1].sequence > 300)
    heard = cell.verdicts[begin:]  # the first may be older than the restart
    fresh = heard[next(k for k, one in enumerate(heard) if one.event == latched.event) :]
    assert all(one.level == Level.UNKNOWN and one.latched for one in fresh)
    assert not any(one.level < Level.STOP for one in heard[20:])  # 0.2 s of verdicts: more than were on their way
    assert latched.event > 1
    assert not cell.reset(1).accepted
    right = cell.reset_at_rest(latched.event)
    assert right.accepted, right.message
    cell.heard_level(Level.OK)
    assert all(map(cell.change, ANEW[:1]))
    assert cell.change(Transition.TRANSITION_ACTIVATE)
    assert not cell.heard_level(Level.OK).latched


def test_a_deactivation_with_samples_in_the_queue_raises_nothing(wire: Wire):
    cell = Cell(wire)
    cell.clock = lambda: time.time_ns() - 10_000_000  # late: the supervisor looks into its queue for a newer sample
    for _ in range(10):
        cell.heard_level(Level.OK)
        assert cell.change(Transition.TRANSITION_DEACTIVATE)
        assert cell.change(Transition.TRANSITION_ACTIVATE)
    assert cell.suite.stop() == {"supervisor": 0}
    assert "rror" not in cell.printed
    assert "FATAL" not in cell.printed


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_process_with_exit_code_0(wire: Wire, number: signal.Signals):
    cell = Cell(wire)
    cell.heard_level(Level.OK)
    process = cell.suite.processes["supervisor"]
    process.send_signal(number)
    assert process.wait(PATIENCE_S) == 0
    assert "Traceback" not in cell.printed


LEAVING = """
import atexit, pathlib
from irsbot_supervisor.nodes.supervisor import main

def threads():
    return " ".join(comm.read_text().strip() for comm in pathlib.Path("/proc/self/task").glob("*/comm"))

atexit.register(lambda: print(threads(), flush=True))
main()
"""


@pytest.mark.skipif("fastrtps" not in get_rmw_implementation_identifier(), reason="the threads of Fast DDS have names")
@pytest.mark.parametrize(("given", "code"), [("type1_warn:=0.3", 0), ("type1_warn:=0.01", 2)])
def test_a_supervisor_that_ends_or_was_refused_has_left_the_domain(wire: Wire, given: str, code: int):
    """One that has not is seen by others for half a minute, and the next one is the second of its name."""
    command = [sys.executable, "-c", LEAVING, "--ros-args", "-p", given]
    environment = {**os.environ, "ROS_DOMAIN_ID": str(wire.domain)}
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, env=environment) as process:
        assert process.stderr is not None
        stated = next(line for line in process.stderr if "supervising" in line or "type1_warn" in line)
        assert ("supervising" in stated) == (code == 0)
        process.send_signal(signal.SIGINT)
        threads, _ = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == code
        assert "python" in threads
        assert "dds." not in threads


def check(cell: Cell, *goals: tuple[float, ...]) -> CheckTrajectory.Response:
    """What the supervisor says of a motion through these joint positions, one per second."""
    request = CheckTrajectory.Request()
    request.trajectory.joint_names = list(NAMES)
    for number, goal in enumerate(goals):
        point = JointTrajectoryPoint(positions=goal)
        point.time_from_start.sec = number
        request.trajectory.points.append(point)
    return cell.call(CheckTrajectory, "supervisor/check_trajectory", request)


def test_a_trajectory_is_checked_while_the_robot_stands(cell: Cell):
    near_by = GOOD[0] - 0.1, GOOD[1] + 0.1
    safe = check(cell, GOOD, near_by)
    assert safe.safe
    assert all(map(math.isfinite, safe.margin_min))  # of the margins that this robot has
    assert len(safe.margin_cause) == len(safe.margin_min) == len(safe.margin_min_time) > 0
    assert math.isnan(safe.violation_time)
    violated = check(cell, GOOD, NEAR)
    assert not violated.safe
    assert 0.0 < violated.violation_time <= 1.0
    assert violated.violation_cause in (Cause.TYPE1, Cause.TYPE2)
    assert violated.message
    assert "positions" in check(cell, GOOD[:1], GOOD[:1]).message
    cell.say = swinging(GOOD)
    cell.wire.until(lambda: any(abs(rate) > 0.1 for rate in cell.states[-1].joint_velocity))
    moving = check(cell, GOOD, near_by)
    assert not moving.safe
    assert "moving" in moving.message
    assert all(map(math.isnan, (moving.violation_time, moving.violation_value, moving.violation_limit)))


# --- time and company ----------------------------------------------------------------------------------------------


def test_three_robots_side_by_side_are_each_judged_for_themselves(wire: Wire):
    cells = [Cell(wire, f"robot_{number}") for number in (1, 2, 3)]
    cells[1].say = resting(NEAR)
    cells[2].say = lambda t: bad(t, position=(math.nan, math.nan))
    wire.until(lambda: all(cell.states for cell in cells))
    cells[0].heard_level(Level.OK)
    stop, unknown = cells[1].heard_level(Level.STOP), cells[2].heard(lambda v: bool(v.causes & Cause.NONFINITE))[-1]
    assert stop.latched
    assert unknown.level == Level.UNKNOWN
    assert not any(verdict.level == Level.OK for cell in cells[1:] for verdict in cell.verdicts)
    assert not any(verdict.latched for cell in (cells[0], cells[2]) for verdict in cell.verdicts)
    assert cells[1].reset(stop.event).message.startswith("the cause is still there")
    assert cells[0].reset(stop.event).message.startswith("nothing to reset")


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
    paused = cell.heard_level(Level.UNKNOWN)
    assert paused.causes == Cause.STALE
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


Statuses = list[dict[str, tuple[bytes, str]]]
"""Level and sentence of every check, message after message."""


def statuses_of(cell: Cell) -> Statuses:
    """What a supervisor says of its checks, from now on."""
    heard: Statuses = []

    def hear(message: DiagnosticArray) -> None:
        heard.append({status.name.split(": ")[1]: (status.level, status.message) for status in message.status})

    cell.node.create_subscription(DiagnosticArray, "/diagnostics", hear, 10)
    return heard


@pytest.fixture(scope="module")
def diagnostics(shared: Cell) -> Statuses:
    return statuses_of(shared)


def test_diagnostics_have_one_status_per_check(cell: Cell, diagnostics: Statuses):
    checks = ("margins", "motion", "branch", "joint states", "velocities", "supervisor")
    cell.wire.until(lambda: diagnostics)
    others = {
        "joint states rate",
        "joint states units",
        "joint states publishers",
        "verdict subscribers",
        "judging",
        "stops",
        "calls",
    }
    assert set(diagnostics[-1]) == {*checks, *others}
    cell.wire.until(lambda: all(diagnostics[-1][check] == (b"\x00", "OK") for check in checks))
    cell.say = lambda t: bad(t, position=(math.nan, 0.0))
    cell.wire.until(lambda: diagnostics[-1]["joint states"][0] == DiagnosticStatus.ERROR)
    assert "nan" in diagnostics[-1]["joint states"][1]
    assert diagnostics[-1]["margins"] == (b"\x00", "OK")


def test_diagnostics_have_the_figures_as_values(cell: Cell):
    heard: list[DiagnosticArray] = []
    cell.node.create_subscription(DiagnosticArray, "/diagnostics", heard.append, 10)

    def values(check: str) -> dict[str, str]:
        statuses = heard[-1].status if heard else ()
        return {v.key: v.value for status in statuses if status.name.endswith(f": {check}") for v in status.values}

    cell.wire.until(lambda: values("supervisor").get("level") == "OK" and "samples [1/s]" in values("joint states"))
    cell.wire.until(lambda: 0.0 < float(values("joint states")["samples [1/s]"]) < 2.0 / PERIOD_S, "a rate of samples")
    state, margins, supervisor = cell.states[-1], values("margins"), values("supervisor")
    assert float(margins["Type 1"]) == pytest.approx(min(state.type1_margin), abs=1e-5)
    least = float(margins["while stopping"])  # of some sample: how late the next may come changes from one to the next
    assert any(least == pytest.approx(state.stop_margin, abs=1e-5) for state in cell.states)
    assert float(margins["stop limit"]) == state.stop_limit
    assert "constraint" in margins
    assert "limb" not in margins  # this robot has none
    assert supervisor["settings"] == cell.verdicts[-1].config_hash
    assert supervisor["event"] == str(cell.verdicts[-1].event)
    assert float(values("joint states")["since arrival [s]"]) >= 0.0


def test_levels_and_the_life_cycle_are_logged_once(wire: Wire):
    cell = Cell(wire)
    cell.heard_level(Level.OK)
    cell.logged("OK: motion is allowed")
    cell.say = lambda t: None
    cell.heard_level(Level.UNKNOWN)
    cell.logged("UNKNOWN: no usable sample for more than 50 ms")
    for step in (*ANEW, Transition.TRANSITION_ACTIVATE, Transition.TRANSITION_ACTIVE_SHUTDOWN):
        assert cell.change(step)
    for words in ("deactivated", "cleaned up", "configured", "supervising irsbot2", "shut down in state 'active'"):
        cell.logged(words)
    assert "on /supervisor/verdict" in cell.printed
    assert cell.printed.count("UNKNOWN: no usable sample for more than") <= 2


def test_plain_listeners_hear_whether_motion_is_safe_and_notice_silence(wire: Wire):
    """A gateway that knows no irsbot_msgs, and asks for a deadline and for signs of life."""
    cell = Cell(wire)
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


def test_diagnostics_of_a_latched_stop_say_so(wire: Wire):
    cell = Cell(wire)
    heard = statuses_of(cell)
    cell.say = resting(NEAR)
    cell.wire.until(lambda: heard and heard[-1]["supervisor"][0] == b"\x02")
    assert heard[-1]["supervisor"][1].startswith("a stop is latched, event 1: ")
    assert "Type 1 margin 0.1215, limit 0.1500" in heard[-1]["supervisor"][1]
    assert heard[-1]["margins"][0] == b"\x02"


@pytest.mark.parametrize(("way", "level"), [(0.29, b"\x00"), (0.31, b"\x01")])
def test_a_stop_that_went_farther_than_allowed_is_reported(way: float, level: bytes):
    stop = MeasuredStop("joint_1", "rad", way, 0.3, 0.05, 0.04)
    publisher = DiagnosticsPublisher.__new__(DiagnosticsPublisher)
    publisher._supervisor = SimpleNamespace(measured_stop=stop)
    name, stated, text = publisher._stop()
    assert (name, stated) == ("stops", level)
    assert text == f"joint 'joint_1' went {way} rad of 0.3 allowed in the last stop, 0.05 s of 0.04"


def test_a_second_publisher_of_joint_states_is_reported_with_its_name(cell: Cell, diagnostics: Statuses):
    cell.wire.until(lambda: diagnostics and diagnostics[-1]["joint states publishers"] == (b"\x00", "/robot"))
    with cell.company("intruder") as intruder:
        intruder.create_publisher(JointState, "joint_states", 10)
        cell.wire.until(lambda: diagnostics[-1]["joint states publishers"][0] == b"\x01")
        stated = diagnostics[-1]["joint states publishers"][1]
        assert re.fullmatch(r"2 publishers, one is expected: /intruder \([0-9a-f]+\), /robot \([0-9a-f]+\)", stated)
        cell.logged(stated)  # with the number by which the middleware knows the writer
    cell.wire.until(lambda: diagnostics[-1]["joint states publishers"] == (b"\x00", "/robot"))


def test_locked_settings_change_before_the_first_activation_alone(wire: Wire):
    cell = Cell(wire, autostart=False, lock_settings=True)
    assert cell.set(type2_stop=0.16) == (True, "")
    assert cell.change(Transition.TRANSITION_CONFIGURE)
    assert cell.set(type2_stop=0.17) == (True, "")
    assert cell.change(Transition.TRANSITION_ACTIVATE)
    cell.heard_level(Level.OK)
    before = cell.verdicts[-1].config_hash
    for values in ({"type2_stop": 0.1}, {"type2_stop": 0.1, "velocity_limit": [20.0, 20.0]}):
        accepted, reason = cell.set(**values)
        assert not accepted
        assert "lock_settings is set" in reason
    assert cell.set(type2_stop=0.17) == (True, "")  # as it is
    assert cell.change(Transition.TRANSITION_DEACTIVATE)
    assert not cell.set(type2_stop=0.1)[0]
    assert cell.change(Transition.TRANSITION_ACTIVATE)
    assert cell.heard_many(3)[-1].config_hash == before
    assert not cell.set(lock_settings=False)[0]


def test_calls_of_strangers_are_logged_with_who_may_have_been_it_and_counted(wire: Wire):
    cell = Cell(wire)
    cell.heard_level(Level.OK)
    values: dict[str, str] = {}

    def keep(message: DiagnosticArray) -> None:
        values.update({pair.key: pair.value for status in message.status for pair in status.values})

    cell.node.create_subscription(DiagnosticArray, "/diagnostics", keep, 10)

    def named() -> bool:
        """A call is answered before the supervisor has discovered its caller by name: then it is called again."""
        assert not cell.reset(7).accepted
        return "reset of event 7, 'tested', called by /robot: " in cell.printed

    cell.wire.until(named, "a log entry with the caller")
    assert not cell.set(type2_stop=5.0)[0]
    cell.logged("type2_stop refused, called by /robot: ")
    with cell.company("intruder") as intruder:
        intruder.create_publisher(JointState, "joint_states", 10)
        cell.wire.until(lambda: values.get("second publishers of joint states") == "1", "the count")
    assert values["resets"] == values["resets refused"] != "0"  # asked again where samples were late
    assert (values["parameter calls"], values["parameter calls refused"]) == ("1", "1")


def test_partners_that_ask_for_or_offer_another_quality_of_service_are_reported(cell: Cell, diagnostics: Statuses):
    best_effort = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    with cell.company("fieldbus") as fieldbus:
        fieldbus.create_publisher(JointState, "joint_states", best_effort)
        cell.wire.until(lambda: diagnostics and diagnostics[-1]["joint states publishers"][0] == b"\x02")
        assert "/fieldbus" in diagnostics[-1]["joint states publishers"][1]
        assert "reliable" in diagnostics[-1]["joint states publishers"][1]
    with cell.company("drive") as drive:
        deadline = QoSProfile(depth=1, deadline=Duration(seconds=0.01))  # sooner than is promised
        drive.create_subscription(VerdictMessage, "supervisor/verdict", lambda message: None, deadline)
        cell.wire.until(lambda: diagnostics[-1]["verdict subscribers"][0] == b"\x02")
        assert "/drive" in diagnostics[-1]["verdict subscribers"][1]
    cell.wire.until(lambda: diagnostics[-1]["verdict subscribers"][0] == b"\x00")
    assert "/fieldbus" in cell.printed
    assert "/drive" in cell.printed


def test_best_effort_joint_states_are_received_on_request(wire: Wire):
    cell = Cell(wire, **{"qos_overrides./joint_states.subscription.reliability": "best_effort"})
    cell.node.destroy_publisher(cell.joints)
    best_effort = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
    cell.joints = cell.node.create_publisher(JointState, "joint_states", best_effort)
    cell.heard_level(Level.OK)


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
    cell = Cell(wire, module="fake_failing_mechanism")
    cell.heard_level(Level.OK)
    start = len(cell.verdicts)
    answers = [check(cell, GOOD, (3.3, GOOD[1]))]
    while "ask while it stands" in answers[-1].message:  # a sample was late, on a busy machine
        cell.heard_level(Level.OK)
        answers.append(check(cell, GOOD, (3.3, GOOD[1])))
    assert not answers[-1].safe
    assert "a fake error of the mechanism" in answers[-1].message
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
    cell.heard_level(Level.OK)
