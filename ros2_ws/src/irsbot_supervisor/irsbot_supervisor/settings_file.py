"""Settings as YAML: the shipped file of a robot, a user's file, or both; the user's numbers replace ours."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

import yaml

from irsbot_kinematics import Robot, load_robot, make_robot
from irsbot_supervisor.bending import with_bending
from irsbot_supervisor.core.limits import settings_from
from irsbot_supervisor.core.settings import InvalidSettings, Settings

PARAMETERS = "ros__parameters"
"""Key below the name of a node in a file of ROS parameters."""


def robot_of(name: str) -> Robot:
    """A robot by preset name or YAML file. Raises what `make_robot` and `load_robot` raise."""
    return load_robot(name) if name.endswith((".yaml", ".yml")) else make_robot(name)


def shipped_values(robot: Robot) -> dict[str, Any]:
    """The settings that come with a robot: its own file's over the shipped ones, or those of its topology's default."""
    folder = resources.files("irsbot_supervisor").joinpath("settings")
    for name in (robot.name, robot.mechanism.kind):
        file = folder.joinpath(f"{name}.yaml")
        if file.is_file():
            return {**_mapping(file.read_text(encoding="utf-8"), f"{name}.yaml"), **robot.supervision}
    return dict(robot.supervision)


def read_settings(
    robot_name: str, changes: Mapping[str, Any] | None = None, where: object = ""
) -> tuple[Settings, Robot]:
    """Checked settings and the robot they are for; `changes` replace shipped values. where: the file of the changes.
    What bending adds is found here.

    Raises InvalidSettings, or what the robot's file raises.
    """
    robot = robot_of(robot_name)
    values = {**shipped_values(robot), **(changes or {}), "robot": robot_name}
    try:
        return settings_from(with_bending(values, robot), robot), robot
    except InvalidSettings as error:
        file = where or (robot_name if robot_name.endswith((".yaml", ".yml")) else "")
        raise InvalidSettings(f"{file}: {error}" if file else str(error)) from None


def read_values(path: Path) -> dict[str, Any]:
    """The mapping in a user's settings file, plain or as ROS parameters of one node. Raises InvalidSettings."""
    values = read_mapping(path)
    nodes = [node[PARAMETERS] for node in values.values() if isinstance(node, dict) and PARAMETERS in node]
    if not nodes:
        return values
    if len(values) > 1 or not isinstance(nodes[0], dict):
        raise InvalidSettings(f"{path}: expected the settings of one node, as in '/**: {{{PARAMETERS}: ...}}'")
    return dict(nodes[0])


def read_mapping(path: Path) -> dict[str, Any]:
    """The mapping in a YAML file. Raises InvalidSettings."""
    try:
        return _mapping(path.read_text(encoding="utf-8"), str(path))
    except OSError as error:
        raise InvalidSettings(f"{path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise InvalidSettings(f"{path}: not a text in UTF-8") from None


def _mapping(text: str, where: str) -> dict[str, Any]:
    try:
        values = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError) as error:  # a ValueError for a date that does not exist
        raise InvalidSettings(f"{where}: not YAML: {' '.join(str(error).split())}") from None
    if not isinstance(values, dict):
        raise InvalidSettings(f"{where}: expected a mapping of settings")
    return values
