"""Reads ROS parameter files as the nodes do, but refuses unknown names, which ROS ignores."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

from irsbot_supervisor.configuration.loading import PARAMETERS, read_mapping
from irsbot_supervisor.core.settings import InvalidSettings

OF_EVERY_NODE = ("use_sim_time", "start_type_description_service")
QOS_OVERRIDES = "qos_overrides."


def read_parameters(path: Path, nodes: Mapping[str, Collection[str]]) -> dict[str, dict[str, Any]]:
    """Parameters that a file sets for each node. nodes: full name -> names of its parameters, nested ones joined by
    dots.

    Raises InvalidSettings for what is no file of parameters, and for a section or a parameter of none of the nodes.
    A section of a node with the same name in another namespace is passed over, if there is one for us.
    """
    told: dict[str, dict[str, Any]] = {node: {} for node in nodes}
    kin = {"*", "**", *(node.rsplit("/", 1)[1] for node in nodes)}
    ours = 0
    for section, values in _sections(path, read_mapping(path), ""):
        hearers = [node for node in nodes if re.fullmatch(_pattern(section), node)]
        if section.rsplit("/", 1)[1] not in kin:
            raise InvalidSettings(f"{path}: '{section}' is none of the nodes {', '.join(nodes)}")
        ours += len(hearers)
        known = [name for node in hearers for name in nodes[node]]
        for name, value in _flat(values):
            if hearers and name not in {*known, *OF_EVERY_NODE} and not name.startswith(QOS_OVERRIDES):
                raise InvalidSettings(f"{path}: '{section}' has no parameter '{name}'; known are {', '.join(known)}")
            for node in hearers:
                if name in nodes[node]:
                    told[node][name] = value
    if not ours:
        raise InvalidSettings(f"{path}: has parameters for none of the nodes {', '.join(nodes)}")
    return told


def robot_in(path: Path, nodes: Collection[str]) -> str:
    """The robot that a file sets for one or more of the nodes, "" if for none. nodes: full names.

    Raises InvalidSettings for what is no file of parameters, and if the file sets several robots.
    """
    robots = {}
    for node, name, value in _values_for(path, nodes):
        if name == "robot" and not isinstance(value, str):
            raise InvalidSettings(f"{path}: robot is {value!r} for {node}, must be a text")
        if name == "robot":
            robots[value] = node
    if len(robots) > 1:
        stated = " and ".join(f"{robot!r} for {node}" for robot, node in robots.items())
        raise InvalidSettings(f"{path}: the robot is {stated}, must be the same for all nodes")
    return next(iter(robots), "")


def require_agreement(path: Path, given: Mapping[str, Mapping[str, Any]]) -> None:
    """Raise InvalidSettings where a file sets another value than the command line: which of the two a node takes
    depends on the order of the sections. given: full name of a node -> parameters that the command line sets."""
    for node, name, value in _values_for(path, given):
        wanted = given[node].get(name, value)
        if value != wanted:
            raise InvalidSettings(
                f"{path}: {name} is {value!r} for {node}, but {wanted!r} on the command line: remove one of the two"
            )


def _values_for(path: Path, nodes: Collection[str]) -> Iterator[tuple[str, str, Any]]:
    """Full name of a node, name of a parameter and its value, for every section that one of the nodes reads."""
    for section, values in _sections(path, read_mapping(path), ""):
        for node in nodes:
            if re.fullmatch(_pattern(section), node):
                yield from ((node, name, value) for name, value in _flat(values))


def _sections(path: Path, tree: Mapping[Any, Any], above: str) -> Iterator[tuple[str, dict[Any, Any]]]:
    """Full names of nodes, wildcards included, and the parameters of each."""
    for key, below in tree.items():
        name = f"{above}/{str(key).strip('/')}"
        values = below.get(PARAMETERS) if isinstance(below, dict) else None
        if isinstance(below, dict) and below and PARAMETERS not in below:
            yield from _sections(path, below, name)
        elif isinstance(values, dict) and len(below) == 1:
            yield name, values
        else:
            raise InvalidSettings(f"{path}: '{name}' must hold parameters, as in '/**: {{{PARAMETERS}: ...}}'")


def _flat(values: Mapping[Any, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in values.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value


def _pattern(section: str) -> str:
    """A regular expression for the nodes of a section: * matches one part of a name, ** any number of parts."""
    parts = {"*": "/[^/]+", "**": "(/[^/]+)*"}
    return "".join(parts.get(part, f"/{re.escape(part)}") for part in section.split("/")[1:])
