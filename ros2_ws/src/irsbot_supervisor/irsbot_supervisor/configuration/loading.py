"""Settings from YAML: the shipped file of a robot, a user's file, or both; the user's numbers take precedence."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from irsbot_kinematics import BadInput, Robot, load_robot
from irsbot_kinematics.description import yaml_text
from irsbot_kinematics.description.robot_file import preset_names, read_robot
from irsbot_supervisor.configuration.compliance import with_bending
from irsbot_supervisor.configuration.feasibility import settings_from
from irsbot_supervisor.core.settings import InvalidSettings, Settings

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
            return {**yaml_text.shipped(file.read_text(encoding="utf-8")), **robot.supervision}
    return dict(robot.supervision)


def read_settings(
    robot_name: str | Path | Robot, changes: Mapping[str, Any] | None = None, where: object = "", **overrides: Any
) -> tuple[Settings, Robot]:
    """Checked settings and their robot: `read_settings("irsbot2", latency_s=0.004)`.

    robot_name: preset name, YAML file, or a Robot.
    changes: settings by name that replace shipped ones; if they name a robot, it must be this one.
    where: file of the changes, for messages.
    overrides: the same as changes, by keyword; they take precedence.

    The slack by bending is computed here. Raises InvalidSettings, or the errors of the robot's file.
    """
    robot = robot_name if isinstance(robot_name, Robot) else robot_of(robot_name)
    name = robot.name if isinstance(robot_name, Robot) else str(robot_name)
    changes = {**(changes or {}), **overrides}
    values = {**shipped_values(robot), **changes, "robot": name}
    try:
        if "robot" in changes and not _is_of(str(changes["robot"]), robot_name):
            raise InvalidSettings(f"these are settings of robot '{changes['robot']}', not of '{name}'")
        return settings_from(with_bending(values, robot), robot), robot
    except InvalidSettings as error:
        file = where or (name if name.endswith((".yaml", ".yml")) else "")
        raise InvalidSettings(f"{file}: {error}" if file else str(error)) from None


def _is_of(stated: str, robot: str | Path | Robot) -> bool:
    """True if a settings file that states this robot is of a robot. Files are the same if their names are: a path may
    be written from another folder."""
    is_file = stated.endswith((".yaml", ".yml"))
    if isinstance(robot, Robot):
        return robot.name == (Path(stated).stem if is_file else stated)
    return stated == str(robot) or (is_file and Path(stated).name == Path(robot).name)


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
        values = yaml_text.parsed(path.read_text(encoding="utf-8"), path)
    except OSError as error:
        raise InvalidSettings(f"{path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise InvalidSettings(f"{path}: not a text in UTF-8") from None
    except BadInput as error:
        raise InvalidSettings(str(error)) from None
    if not isinstance(values, dict):
        raise InvalidSettings(f"{path}: expected a mapping of settings")
    return values
