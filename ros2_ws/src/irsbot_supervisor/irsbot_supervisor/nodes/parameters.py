"""The settings as ROS parameters: declared from the schema of `Settings`, checked as a whole in the set call."""

from __future__ import annotations

from dataclasses import asdict, fields
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter

from irsbot_kinematics import Robot
from irsbot_supervisor.core.settings import Settings, settings_from
from irsbot_supervisor.settings_file import read_settings, robot_of, shipped_values


def declare_settings(node: Node) -> tuple[Settings, Robot]:
    """Declare every setting with its shipped value for the robot that the parameter `robot` names; read them back.

    Raises InvalidSettings, or what the robot's file raises.
    """
    entries = {entry.name: entry for entry in fields(Settings)}
    robot_name = node.declare_parameter("robot", "irsbot2", _descriptor(entries["robot"].metadata)).value
    robot = robot_of(robot_name)
    defaults = asdict(settings_from({**shipped_values(robot), "robot": robot_name}, robot))
    changes = {}
    for name, entry in entries.items():
        if name != "robot":
            default = defaults[name]
            declared = list(default) if isinstance(default, tuple) else default
            changes[name] = node.declare_parameter(name, declared, _descriptor(entry.metadata)).value
    return read_settings(robot_name, {name: _plain(value) for name, value in changes.items()})


def changed_settings(settings: Settings, robot: Robot, parameters: list[Parameter]) -> Settings | None:
    """The settings with some parameters replaced; None if none of them is a setting. Raises InvalidSettings."""
    names = {entry.name for entry in fields(Settings)}
    changes = {parameter.name: _plain(parameter.value) for parameter in parameters if parameter.name in names}
    return settings_from({**asdict(settings), **changes}, robot) if changes else None


def _plain(value: Any) -> Any:
    return list(value) if hasattr(value, "__iter__") and not isinstance(value, str) else value


def _descriptor(metadata: Any) -> ParameterDescriptor:
    unit, words = metadata["unit"], metadata.get("words")
    text = metadata["text"] + (f" [{unit}]" if unit else "")
    descriptor = ParameterDescriptor(description=text, read_only=bool(metadata.get("read_only")))
    if words:
        descriptor.additional_constraints = "one of " + ", ".join(words)
    elif metadata.get("each_joint"):
        low, high = metadata["low"], metadata["high"]
        descriptor.additional_constraints = f"one value for all joints or one per joint, in {low:g}..{high:g}"
    elif "low" in metadata:
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=metadata["low"], to_value=metadata["high"], step=0.0)
        ]
    return descriptor
