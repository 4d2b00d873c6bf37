"""Arguments of the launch file, read once with the rules of YAML; every fault is one sentence."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from irsbot_msgs_py.process.usage import USAGE

TOPICS = ("joint_states", "command_in", "velocity_in", "command_out", "velocity_out")
"""Topics whose names can be set, for instance to those of ros2_control controllers."""

ARGUMENTS = (
    ("robot", "irsbot2", "preset name or YAML file of the robot"),
    ("namespace", "", "namespace of all nodes and topics"),
    ("params_file", "", "ROS parameter file for all nodes, for instance with limits of the supervisor"),
    ("use_sim_time", "false", "time of /clock in place of the system's"),
    ("log_level", "info", "of all nodes: debug, info, warn, error or fatal"),
    ("respawn", "false", "a node that ends is started again, unless its parameters were refused"),
    ("simulate", "true", "simulated joints in place of hardware"),
    ("scenario", "", "scenario of the simulated joints; empty: pick_and_place, with gate:=true stand"),
    ("gate", "false", "the simulated joints take commands through the command gate alone"),
    ("record", "true", "record the run"),
    ("output", "", "new folder for the bag; empty: one named after the time"),
    *((topic, topic, f"topic that is used as {topic}") for topic in TOPICS),
)
"""Name, default and meaning."""

TRUE, FALSE = ("true", "yes", "on", "1"), ("false", "no", "off", "0")
LOG_LEVELS = ("debug", "info", "warn", "error", "fatal")


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
        stated["scenario"] or ("stand" if gate else "pick_and_place"),
        gate,
        flag("record", stated["record"]),
        stated["output"],
        {topic: stated[topic] for topic in TOPICS if stated[topic] not in ("", topic)},
    )


def flag(name: str, text: str) -> bool:
    """A boolean as YAML 1.1 reads it, or a digit. Raises BadArgument."""
    word = text.lower()
    if word not in TRUE + FALSE:
        raise BadArgument(f"{name}:={text} must be {' or '.join((TRUE[0], FALSE[0]))}")
    return word in TRUE


def ended(name: str, code: int, asked: bool) -> None:
    """Handle the end of a node. asked: the launch is ending. Raises NodeEnded, which ends the launch with exit code
    1."""
    if not asked and code == USAGE:
        raise NodeEnded(f"{name} refused its parameters; its last line has the reason")
