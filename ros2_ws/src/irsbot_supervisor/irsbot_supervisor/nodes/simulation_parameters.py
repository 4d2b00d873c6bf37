"""The settings of the simulated joints as ROS parameters, declared from the schema of `Simulation`."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from rclpy.node import Node

from irsbot_kinematics import Robot
from irsbot_supervisor.configuration.loading import robot_of, shipped_values
from irsbot_supervisor.nodes.declared import declare, descriptor
from irsbot_supervisor.sim.simulation import Simulation, simulation_from


def declare_simulation(node: Node) -> tuple[Simulation, Robot]:
    """Declare every setting, read-only, and read them back; limits default to what is shipped for the robot.

    Raises BadSetting, or what the robot's file raises.
    """
    stated = {entry.name: entry.metadata for entry in fields(Simulation)}

    def value(name: str, default: Any) -> Any:
        unit, text, limits = (stated[name][key] for key in ("unit", "text", "limits"))
        found = declare(node, name, default, descriptor(f"{text} [{unit}]" if unit else text, limits))
        return tuple(found) if isinstance(default, list) else found

    robot_name = value("robot", Simulation.robot)
    robot = robot_of(robot_name)
    shipped = shipped_values(robot)
    limits = {name: shipped.get(name) for name in ("velocity_limit", "deceleration_limit")}
    defaults = simulation_from({"robot": robot_name, **limits}, robot)
    values = {"robot": robot_name}
    for name in stated:
        if name != "robot":
            default = getattr(defaults, name)
            values[name] = value(name, list(default) if isinstance(default, tuple) else default)
    return simulation_from(values, robot), robot
