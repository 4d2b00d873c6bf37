"""The settings as ROS parameters: declared from the schema of `Settings`, checked as a whole in the set call.

The check whether the robot can be stopped from its velocity limits takes long. A worker process does it before the
parameters are set; the parameter callbacks, which rclpy calls within the set call, find the result.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, fields
from typing import Any

from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter

from irsbot_kinematics import Robot
from irsbot_supervisor.configuration.compliance import require_bending_said
from irsbot_supervisor.configuration.feasibility import infeasibilities
from irsbot_supervisor.configuration.loading import read_settings, robot_of, shipped_values
from irsbot_supervisor.core.settings import InvalidSettings, Settings, completed
from irsbot_supervisor.nodes.callers import Callers
from irsbot_supervisor.nodes.declared import as_declared, declare, descriptor
from irsbot_supervisor.nodes.later import Later, Steps
from irsbot_supervisor.processes.worker import Task, WorkerError

LOCKED = "lock_settings is set, and the supervisor has been active: settings change with a new start alone"
"""Reason why a setting does not change."""

NAMES = frozenset(entry.name for entry in fields(Settings))


def declare_settings(node: Node) -> tuple[Settings, Robot]:
    """Declare every setting with its shipped value for the robot that the parameter `robot` names; read them back.

    Raises InvalidSettings, or what the robot's file raises.
    """
    entries = {entry.name: entry for entry in fields(Settings)}
    robot_name = declare(node, "robot", Settings.robot, _descriptor(entries["robot"].metadata))
    robot = robot_of(robot_name)
    shipped = {**shipped_values(robot), "robot": robot_name}
    changes: dict[str, Any] = {}
    for left_out in (False, True):  # a setting that may be left out follows another one, as acceleration_limit does
        defaults = asdict(completed({**shipped, **changes}, robot))
        for name, entry in entries.items():
            if name != "robot" and bool(entry.metadata.get("optional")) == left_out:
                default = defaults[name]
                declared = list(default) if isinstance(default, tuple) else default
                changes[name] = _plain(declare(node, name, declared, _descriptor(entry.metadata)))
    settings, robot = read_settings(robot_name, changes)
    found = ("compliance_slack_m", "reaction_check")  # from the tubes, and the word for what may have been a boolean
    node.set_parameters([Parameter(name, value=getattr(settings, name)) for name in found])
    return settings, robot


class ChangingSettings:
    """The settings of a node in force; its parameter services change them in one call and as a whole."""

    def __init__(
        self,
        node: Node,
        later: Later,
        settings: Settings,
        robot: Robot,
        apply: Callable[[Settings], None],
        callers: Callers,
    ) -> None:
        """settings: checked. apply: called with checked settings when they come into force."""
        self.now = settings
        self.locked = False
        """True if settings no longer change."""
        self._callers = callers
        self._node, self._robot, self._apply = node, robot, apply
        self._looked: tuple[Settings, list[str]] = settings, []
        """The last settings that were checked, and their faults."""
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._set)
        for service in node.services:
            if service.srv_type is SetParameters:
                later.serve(service, _one_by_one(service.callback, self._look, self._told))
            elif service.srv_type is SetParametersAtomically:
                later.serve(service, _at_once(service.callback, self._look, self._told))

    def _wanted(self, parameters: list[Parameter]) -> Settings:
        """The settings with some parameters replaced, each valid, without the check of stopping. Raises
        InvalidSettings."""
        changes = {parameter.name: _plain(parameter.value) for parameter in parameters if parameter.name in NAMES}
        if not changes:
            return self.now
        wanted = completed({**asdict(self.now), **changes}, self._robot)
        require_bending_said(self.now, wanted, changes)
        return wanted

    def _look(self, messages: list[Any]) -> Steps:
        """Check the settings that a call requests. If another call changes the settings in force in this time, the
        check is repeated."""
        parameters = as_declared(self._node, [Parameter.from_parameter_msg(message) for message in messages])
        try:
            while not self.locked and (wanted := self._wanted(parameters)) not in (self.now, self._looked[0]):
                try:
                    faults = yield Task(infeasibilities, (wanted, self._robot.mechanism))
                except WorkerError as error:
                    faults = [f"the check whether the robot can be stopped has failed: {error}"]
                self._looked = wanted, faults
        except InvalidSettings:
            pass  # the set call says so

    def _told(self, parameters: list[ParameterMessage], result: SetParametersResult) -> None:
        """Report that a call has been answered."""
        calls = "parameter calls"
        self._callers.count(calls, result.successful)
        if not result.successful and self._callers.is_due(calls):
            names = ", ".join(parameter.name for parameter in parameters)
            who = self._callers.who("~/set_parameters", "~/set_parameters_atomically")
            self._node.get_logger().warning(f"{names} refused, {who}: {result.reason}")

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            wanted = self._wanted(parameters)
        except InvalidSettings as error:
            return SetParametersResult(successful=False, reason=str(error))
        if self.locked and wanted != self.now:
            return SetParametersResult(successful=False, reason=LOCKED)
        looked, faults = self._looked
        if wanted == self.now:
            faults = []
        elif wanted != looked:  # set from within this process, without an earlier check
            faults = infeasibilities(wanted, self._robot.mechanism)
        return SetParametersResult(successful=not faults, reason="; ".join(faults))

    def _set(self, parameters: list[Parameter]) -> None:
        if any(parameter.name in NAMES for parameter in parameters):
            settings = self._wanted(parameters)
            self._apply(settings)
            self.now = settings


Call = Callable[[Any, Any], Any]
"""A callback of rclpy's parameter services."""


Told = Callable[[list[ParameterMessage], SetParametersResult], None]


def _one_by_one(set_parameters: Call, look: Callable[[list[Any]], Steps], told: Told) -> Callable[[Any, Any], Steps]:
    def answer(request: SetParameters.Request, response: SetParameters.Response) -> Steps:
        for parameter in request.parameters:
            yield from look([parameter])
            set_parameters(SetParameters.Request(parameters=[parameter]), response)
            told([parameter], response.results[-1])
        return response

    return answer


def _at_once(set_parameters: Call, look: Callable[[list[Any]], Steps], told: Told) -> Callable[[Any, Any], Steps]:
    def answer(request: SetParametersAtomically.Request, response: SetParametersAtomically.Response) -> Steps:
        yield from look(request.parameters)
        answered = set_parameters(request, response)
        told(list(request.parameters), answered.result)
        return answered

    return answer


def _plain(value: Any) -> Any:
    return list(value) if hasattr(value, "__iter__") and not isinstance(value, str) else value


def _descriptor(metadata: Any) -> ParameterDescriptor:
    unit, words = metadata["unit"], metadata.get("words")
    text = metadata["text"] + (f" [{unit}]" if unit else "")
    each_joint = metadata.get("each_joint")
    limits = (metadata["low"], metadata["high"]) if "low" in metadata and not each_joint else None
    described = descriptor(text, limits, read_only=bool(metadata.get("read_only")))
    described.dynamic_typing = bool(words)  # YAML reads `on` and `off` as booleans
    if words:
        described.additional_constraints = "one of " + ", ".join(words)
    elif each_joint:
        low, high = metadata["low"], metadata["high"]
        described.additional_constraints = f"one value for all joints or one per joint, in {low:g}..{high:g}"
    return described
