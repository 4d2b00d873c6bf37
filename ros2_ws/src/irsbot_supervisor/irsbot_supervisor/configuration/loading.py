"""Settings from YAML: the shipped file of a robot, a user's file, or both; the user's numbers take precedence."""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

import yaml

from irsbot_kinematics import Robot, load_robot
from irsbot_kinematics.description.robot_file import preset_names, read_robot
from irsbot_supervisor.configuration.compliance import with_bending
from irsbot_supervisor.configuration.feasibility import settings_from
from irsbot_supervisor.core.settings import InvalidSettings, Settings


class _Loader(yaml.SafeLoader):
    """Reads 1e-2 as a number, as ROS does; for YAML 1.1 it is a text."""


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)[eE][-+]?[0-9]+$"), list("-+.0123456789")
)

PARAMETERS = "ros__parameters"
"""Key below the name of a node in a ROS parameter file."""


def robot_of(name: str | Path) -> Robot:
    """A robot by preset name or YAML file. Raises what `load_robot` raises."""
    return load_robot(name)


def shipped_values(robot: Robot) -> dict[str, Any]:
    """The settings shipped for a robot, below those of its own file. They are those of the preset that has its name and
    its topology, or those of its topology: a file that only has the name of a preset is another machine."""
    folder = resources.files("irsbot_supervisor").joinpath("settings")
    kind = robot.mechanism.kind
    names = [kind]
    if robot.name != kind and robot.name in preset_names() and read_robot(robot.name).mechanism.kind == kind:
        names.insert(0, robot.name)
    for name in names:
        file = folder.joinpath(f"{name}.yaml")
        if file.is_file():
            return {**_mapping(file.read_text(encoding="utf-8"), f"{name}.yaml"), **robot.supervision}
    return dict(robot.supervision)


def read_settings(
    robot_name: str | Path | Robot, changes: Mapping[str, Any] | None = None, where: object = "", **overrides: Any
) -> tuple[Settings, Robot]:
    """Checked settings and their robot: `read_settings("irsbot2", latency_s=0.004)`.

    robot_name: preset name, YAML file, or a Robot.
    changes: settings by name that replace shipped ones.
    where: file of the changes, for messages.
    overrides: the same as changes, by keyword; they take precedence.

    The slack by bending is computed here. Raises InvalidSettings, or the errors of the robot's file.
    """
    robot = robot_name if isinstance(robot_name, Robot) else robot_of(robot_name)
    name = robot.name if isinstance(robot_name, Robot) else str(robot_name)
    values = {**shipped_values(robot), **(changes or {}), **overrides, "robot": name}
    try:
        return settings_from(with_bending(values, robot), robot), robot
    except InvalidSettings as error:
        file = where or (name if name.endswith((".yaml", ".yml")) else "")
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
        values = yaml.load(text, _Loader)
    except (yaml.YAMLError, ValueError) as error:  # a ValueError for a date that does not exist
        raise InvalidSettings(f"{where}: not YAML: {' '.join(str(error).split())}") from None
    if not isinstance(values, dict):
        raise InvalidSettings(f"{where}: expected a mapping of settings")
    return values
