"""supervisor_node and its operators: parameters, resets, bypasses, checks of trajectories, strangers."""

from __future__ import annotations

import math
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

import rclpy
from cell import GOOD, HIGH, NEAR, STRICT, Cell, Wire, check, check_at_rest, going, resting, statuses_of, swinging
from diagnostic_msgs.msg import DiagnosticArray
from irsbot_msgs.srv import BypassStop
from lifecycle_msgs.msg import Transition
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters
from rclpy.parameter import Parameter, get_parameter_value, parameter_dict_from_yaml_file, parameter_value_to_python
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String

import irsbot_kinematics as irs
from irsbot_msgs_py.records import Bypass, Cause, Level
from irsbot_supervisor.bag.journal import read_entry
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.nodes.callers import Callers
from irsbot_supervisor.nodes.parameters import ChangingSettings, declare_settings

pytestmark = pytest.mark.ros


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
        ("velocity_limit", "8.0", [8.0]),  # one value for all joints
        ("velocity_limit", "8", [8.0]),
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


@pytest.mark.parametrize("stated", [{}, {"acceleration_limit": [50.0, 60.0]}], ids=["left out", "stated"])
def test_an_acceleration_that_is_left_out_follows_the_brakes_that_are_stated(wire: Wire, stated: dict[str, Any]):
    given = {"deceleration_limit": [300.0, 200.0]} | stated
    overrides = [Parameter(name, value=value) for name, value in given.items()]
    node = rclpy.create_node("declaring", context=wire.context, parameter_overrides=overrides)
    settings, _robot = declare_settings(node)
    assert list(node.get_parameter("acceleration_limit").value) == stated.get("acceleration_limit", [300.0, 200.0])
    node.destroy_node()
    assert settings == read_settings("irsbot2", given)[0]


def test_a_value_at_the_start_is_taken_as_in_a_set_call(wire: Wire):
    """`up --params` accepts these, and must not start a suite that ends at once."""
    given = {
        "payload_kg": (2, 2.0),
        "latency_s": (0, 0.0),
        "velocity_limit": (6.0, [6.0]),
        "reaction_check": (False, "none"),
    }
    cell = Cell(wire, **{name: value for name, (value, _taken) in given.items()})
    request = GetParameters.Request(names=list(given))
    values = [
        parameter_value_to_python(v) for v in cell.call(GetParameters, "supervisor/get_parameters", request).values
    ]
    taken = [value if isinstance(value, (str, float)) else list(value) for value in values]
    assert taken == [wanted for _value, wanted in given.values()]


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
    cell = Cell(wire, **STRICT)
    cell.say = resting(HIGH)
    stop = cell.heard_level(Level.STOP)
    assert stop.latched
    assert stop.event == 1
    cell.logged("a stop is latched, event 1, level ")
    assert "Type 1 margin 0.6669, limit 0.7000" in cell.printed
    assert stop.causes & Cause.TYPE1

    answer = cell.reset(1)
    assert not answer.accepted
    assert "cause is still there" in answer.message

    assert cell.set(type1_stop=0.01, type2_stop=0.01) == (True, "")
    cell.logged("type1_stop 0.7 -> 0.01, type2_stop 0.15 -> 0.01")
    cell.heard(lambda verdict: verdict.config_hash != stop.config_hash)
    kept = cell.heard_many(20)
    assert all(verdict.latched and verdict.event == 1 for verdict in kept)
    assert all(v.level == Level.STOP or (v.level == Level.UNKNOWN and v.causes & Cause.STALE) for v in kept)
    assert cell.set(type1_stop=0.7, type2_stop=0.15) == (True, "")

    cell.say = going(HIGH, GOOD, time.time_ns(), 1.0)
    cell.wire.until(lambda: cell.states[-1].level == Level.OK and cell.states[-1].joint_position == GOOD)
    begin_ns = time.time_ns()
    cell.say = swinging(GOOD, begin_ns)
    cell.wire.until(lambda: any(abs(rate) > 0.1 for rate in cell.states[-1].joint_velocity))
    answers = [cell.reset(cell.verdicts[-1].event) for _ in range(3)]  # a busy machine may lose the branch: event 2
    assert not any(answer.accepted for answer in answers)
    assert "not standing" in answers[-1].message
    assert cell.heard_many(1)[-1].latched

    cell.say = swinging(GOOD, begin_ns, time.time_ns() + 10**9)
    cell.wire.until(lambda: cell.states[-1].joint_velocity == (0.0, 0.0) and cell.states[-1].joint_position == GOOD)
    wrong = cell.reset(99)
    assert not wrong.accepted
    assert "event 99" in wrong.message
    event = cell.heard_many(1)[-1].event
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
    cell = Cell(wire, **STRICT)
    heard = statuses_of(cell)
    journal: list[str] = []
    latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    cell.node.create_subscription(String, "supervisor/journal", lambda message: journal.append(message.data), latched)
    cell.say = resting(HIGH)
    assert cell.heard_level(Level.STOP).event == 1

    def ask(**changes: object) -> BypassStop.Response:
        wish = {"event": 1, "cause": int(Cause.TYPE1), "duration_s": 3.0, "operator_name": "Ada", "reason": "free it"}
        return cell.call(BypassStop, "supervisor/bypass", BypassStop.Request(**{**wish, **changes}))

    for changes, words in (
        ({"duration_s": math.nan}, "duration"),
        ({"event": 7}, "event 7"),
        ({"reason": ""}, "reason"),
    ):
        while "good sample" in (answer := ask(**changes)).message:  # one was late, on a busy machine
            cell.heard_level(Level.STOP)
        assert not answer.accepted
        assert words in answer.message or "known" in answer.message

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
    assert "free it: Type 1 margin 0.6669, limit 0.7000" in passed[0].text
    again = cell.heard_level(Level.STOP)
    before = next(verdict for verdict in reversed(cell.verdicts) if verdict.bypassed)
    assert (again.event, again.latched, again.bypassed) == (before.event + 1, True, 0)
    cell.logged(f"bypass of cause 1 of event {before.event} for 3 s by 'Ada', 'free it', ")
    entries = [entry for entry in map(read_entry, journal) if isinstance(entry, Bypass)]
    assert {math.isnan(entry.duration_s) for entry in entries} == {True, False}
    assert (entries[-1].operator, entries[-1].reason, entries[-1].duration_s) == ("Ada", "free it", 3.0)


def test_a_trajectory_is_checked_while_the_robot_stands(cell: Cell):
    near_by = GOOD[0] - 0.1, GOOD[1] + 0.1
    safe = check_at_rest(cell, GOOD, near_by)
    assert safe.safe
    assert all(map(math.isfinite, safe.margin_min))  # of the margins that this robot has
    assert len(safe.margin_cause) == len(safe.margin_min) == len(safe.margin_min_time) > 0
    assert math.isnan(safe.violation_time)
    violated = check_at_rest(cell, GOOD, NEAR)
    assert not violated.safe
    assert 0.0 < violated.violation_time <= 1.0
    assert violated.violation_cause in (Cause.TYPE1, Cause.TYPE2)
    assert violated.message
    assert "positions" in check_at_rest(cell, GOOD[:1], GOOD[:1]).message
    cell.say = swinging(GOOD, time.time_ns())
    cell.wire.until(lambda: any(abs(rate) > 0.1 for rate in cell.states[-1].joint_velocity))
    moving = check(cell, GOOD, near_by)
    assert not moving.safe
    assert "moving" in moving.message
    assert all(map(math.isnan, (moving.violation_time, moving.violation_value, moving.violation_limit)))


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


def test_a_client_that_is_refused_again_and_again_does_not_have_the_graph_searched_each_time():
    searched: list[str] = []
    log: list[str] = []
    node: Any = SimpleNamespace(
        resolve_service_name=str,
        get_node_names_and_namespaces=lambda: searched.append("the graph") or [],
        get_logger=lambda: SimpleNamespace(warning=lambda text, **_: log.append(text)),
    )
    changing = ChangingSettings.__new__(ChangingSettings)
    changing._node, changing._callers = node, Callers(node)
    for _ in range(100):
        changing._told([ParameterMessage(name="type2_stop")], SetParametersResult(successful=False, reason="too large"))
    assert changing._callers.counts["parameter calls refused"] == 100
    assert log[0].startswith("type2_stop refused, called by ")
    assert 1 <= len(searched) < 50


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
