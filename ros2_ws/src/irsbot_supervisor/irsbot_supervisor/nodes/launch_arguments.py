"""Arguments of the launch file, read once with the rules of YAML; every fault is one sentence."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from irsbot_msgs_py.process.usage import USAGE
from irsbot_supervisor.configuration.ros_parameter_file import require_agreement, robot_in
from irsbot_supervisor.processes.suite import BYSTANDERS

TOPICS = ("joint_states", "command_in", "velocity_in", "command_out", "velocity_out")
"""Topics whose names can be set, for instance to those of ros2_control controllers."""

ARGUMENTS = (
    ("robot", "", "preset name or YAML file of the robot; empty: that of params_file, or irsbot2"),
    ("namespace", "", "namespace of all nodes and topics"),
    ("params_file", "", "ROS parameter file for all nodes, for instance with limits of the supervisor"),
    ("use_sim_time", "false", "time of /clock in place of the system's"),
    ("log_level", "info", "of all nodes: debug, info, warn, error or fatal"),
    ("respawn", "false", "a node that ends is started again, unless it refuses to start"),
    ("simulate", "true", "simulated joints in place of hardware"),
    (
        "scenario",
        "",
        "scenario of the simulated joints; empty: with gate:=true stand, else that of params_file or pick_and_place",
    ),
    ("gate", "false", "the simulated joints take commands through the command gate alone"),
    ("record", "true", "record the run"),
    ("output", "", "new folder for the bag; empty: that of params_file, or one named after the time"),
    *((topic, topic, f"topic that is used as {topic}") for topic in TOPICS),
)
"""Name, default and meaning."""

TRUE, FALSE = ("true", "yes", "on", "1"), ("false", "no", "off", "0")
LOG_LEVELS = ("debug", "info", "warn", "error", "fatal")


RESTARTED: dict[str, dict[str, Any]] = {"supervisor": {"start_latched": True}, "recorder": {"numbered": True}}
"""Parameters of nodes that are started again: an earlier stop may have been in force, and an earlier bag is there."""


class BadArgument(ValueError):
    """An invalid launch argument."""


class NodeEnded(RuntimeError):
    """A node did not start as requested, or failed."""


class Given(NamedTuple):
    """All arguments, parsed."""

    robot: str
    namespace: str
    params_file: str
    use_sim_time: bool
    log_level: str
    respawn: bool
    simulate: bool
    scenario: str
    gate: bool
    record: bool
    output: str
    topics: dict[str, str]
    """Remaps: topic -> topic that is used instead."""


def given(texts: Mapping[str, str]) -> Given:
    """Parse the texts of the arguments. Raises BadArgument."""
    stated = {name: text.strip() for name, text in texts.items()}
    level, file = stated["log_level"].lower(), stated["params_file"]
    if level not in LOG_LEVELS:
        raise BadArgument(f"log_level:={level} must be one of {', '.join(LOG_LEVELS)}")
    if file and not Path(file).is_file():
        raise BadArgument(f"params_file:={file} is no file")
    gate = flag("gate", stated["gate"])
    return Given(
        stated["robot"],
        stated["namespace"],
        file,
        flag("use_sim_time", stated["use_sim_time"]),
        level,
        flag("respawn", stated["respawn"]),
        flag("simulate", stated["simulate"]),
        stated["scenario"] or ("stand" if gate else ""),
        gate,
        flag("record", stated["record"]),
        stated["output"],
        {topic: stated[topic] for topic in TOPICS if stated[topic] not in ("", topic)},
    )


def parameters_of(stated: Given, namespace: str = "") -> dict[str, dict[str, Any]]:
    """The nodes to start, in this order, each with the parameters that the arguments set.

    namespace: in which the launch file is included. Raises InvalidSettings where the parameter file contradicts the
    arguments or itself.
    """
    names = ["recorder"] * stated.record + ["kinematics", "supervisor"] + ["simulated_joints"] * stated.simulate
    place = stated.namespace if stated.namespace.startswith("/") else f"{namespace}/{stated.namespace}"
    full = {name: "/" + "/".join(filter(None, (*place.split("/"), name))) for name in names}
    file = Path(stated.params_file) if stated.params_file else None
    robot = stated.robot or (robot_in(file, full.values()) if file else "")
    of_node: dict[str, dict[str, Any]] = {
        "recorder": {"output": stated.output},
        "kinematics": {"robot": robot},
        "supervisor": {"robot": robot},
        "simulated_joints": {"robot": robot, "scenario": stated.scenario, "gated": stated.gate},
    }
    of_all = {"use_sim_time": True} if stated.use_sim_time else {}
    given = {n: {**{key: value for key, value in of_node[n].items() if value != ""}, **of_all} for n in names}
    if file:
        later = RESTARTED if stated.respawn else {}
        require_agreement(file, {full[n]: {**given[n], **later.get(n, {})} for n in names})
    return given


def flag(name: str, text: str) -> bool:
    """A boolean as YAML 1.1 reads it, or a digit. Raises BadArgument."""
    word = text.lower()
    if word not in TRUE + FALSE:
        raise BadArgument(f"{name}:={text} must be {' or '.join((TRUE[0], FALSE[0]))}")
    return word in TRUE


class End(NamedTuple):
    """What follows the end of a node."""

    text: str = ""
    """What to report."""
    again: bool = False
    """True if the node is started again."""
    changes: Mapping[str, Any] = {}
    """Parameters that are set then."""


def ended(name: str, stated: Given, code: int, asked: bool) -> End:
    """Handle the end of a node. asked: the launch is ending. A node that refuses to start is not started again.

    Raises NodeEnded, which ends the launch with exit code 1, if supervision needs this node and it refuses to start.
    """
    if asked:
        return End()
    if code == USAGE and name not in BYSTANDERS:
        raise NodeEnded(f"{name} refused to start; its last line has the reason")
    if stated.respawn and code != USAGE:
        return End("", True, RESTARTED.get(name, {}))
    text = f"{name} ended with exit code {code}: supervision goes on without it; its last line has the reason"
    return End(text if name in BYSTANDERS else "")
