"""The settings of the simulated joints as ROS parameters, declared from the schema of `Simulation`."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

from irsbot_kinematics import Robot
from irsbot_supervisor.configuration.loading import robot_of, shipped_values
from irsbot_supervisor.sim.simulation import Simulation, simulation_from


def declare_simulation(node: Node) -> tuple[Simulation, Robot]:
    """Declare every setting, read-only, and read them back; limits default to what is shipped for the robot.

    Raises BadSetting, or what the robot's file raises.
    """
    stated = {entry.name: entry.metadata for entry in fields(Simulation)}

    def declare(name: str, default: Any) -> Any:
        unit, text = stated[name]["unit"], stated[name]["text"]
        described = ParameterDescriptor(description=f"{text} [{unit}]" if unit else text, read_only=True)
        value = node.declare_parameter(name, default, described).value
        return tuple(value) if isinstance(default, list) else value

    robot_name = declare("robot", "irsbot2")
    robot = robot_of(robot_name)
    shipped = shipped_values(robot)
    limits = {name: shipped.get(name) for name in ("velocity_limit", "deceleration_limit")}
    defaults = simulation_from({"robot": robot_name, **limits}, robot)
    values = {"robot": robot_name}
    for name in stated:
        if name != "robot":
            default = getattr(defaults, name)
            values[name] = declare(name, list(default) if isinstance(default, tuple) else default)
    return simulation_from(values, robot), robot
