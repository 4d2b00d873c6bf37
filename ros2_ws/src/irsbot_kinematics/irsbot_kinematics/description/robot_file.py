"""Robots as YAML: a topology, its lengths with their sources, and the modes it usually runs in.

mechanism: irsbot2    # or a class of the user's, see `topologies`
description: one line
geometry:
  l1: {value: 0.375, source: "where the number comes from"}    # or a list of numbers, where the topology has one
usual: {working_mode: [1, -1], assembly_mode: -1}
supervision: {velocity_limit: [12.0], deceleration_limit: [400.0]}    # for irsbot_supervisor, which checks it
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import MISSING, asdict, dataclass, fields
from importlib import resources
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from irsbot_kinematics import arguments
from irsbot_kinematics.description import yaml_text
from irsbot_kinematics.description.topologies import built, set_usual_modes, topology
from irsbot_kinematics.errors import BadInput, InvalidGeometry, KinematicsError, UnknownRobot
from irsbot_kinematics.mechanism import Mechanism
from irsbot_kinematics.mechanisms import TOPOLOGIES

Number = float | tuple[float, ...]
KEYS = {"mechanism", "description", "geometry", "usual", "supervision"}
"""Keys of a robot file."""


@dataclass(frozen=True)
class RobotFile:
    """Content of a robot file, checked; `mechanism` is built from it."""

    name: str
    description: str
    sources: Mapping[str, str]
    mechanism: Mechanism
    supervision: Mapping[str, Any]
    """Settings of the supervisor that belong to this machine, as the file has them."""


def preset_names() -> tuple[str, ...]:
    """Names of the shipped robots, the topologies' defaults first."""
    files = resources.files("irsbot_kinematics").joinpath("presets").iterdir()
    names = {Path(file.name).stem for file in files if file.name.endswith(".yaml")}
    return tuple(name for name in TOPOLOGIES if name in names) + tuple(sorted(names - set(TOPOLOGIES)))


def read_robot(name_or_path: str | Path, overrides: Mapping[str, Any] | None = None) -> RobotFile:
    """A shipped robot by name, or one from a YAML file; `overrides` replace single geometry numbers.

    Raises UnknownRobot for a name that is neither, BadInput for a malformed file, InvalidGeometry for lengths that no
    machine can have.
    """
    arguments.instance(name_or_path, "robot", (str, PathLike), "the name of a shipped robot or the path of a YAML file")
    path = Path(name_or_path)
    if path.suffix in (".yaml", ".yml"):
        try:
            if not path.is_file():
                raise BadInput(f"{path}: there is no such file")
            text, name, where = path.read_text(encoding="utf-8"), path.stem, str(path)
            stated = yaml_text.parsed(text, where)
        except OSError as error:
            raise BadInput(f"{path}: cannot be read: {error.strerror or error}") from None
        except UnicodeDecodeError as error:
            raise BadInput(f"{path}: not YAML: {error}") from None
    else:
        name = where = str(name_or_path)
        if name not in preset_names():
            raise UnknownRobot(name, preset_names())
        text = resources.files("irsbot_kinematics").joinpath(f"presets/{name}.yaml").read_text(encoding="utf-8")
        stated = yaml_text.shipped(text)
    return _checked(name, stated, where, overrides or {})


def fingerprint(mechanism: Mechanism) -> str:
    """Short hash of topology and geometry: equal for equal machines, independent of the file name."""
    facts = {"mechanism": mechanism.kind, "geometry": asdict(mechanism.geometry)}
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()[:12]


def _checked(name: str, stated: object, where: str, overrides: Mapping[str, Any]) -> RobotFile:
    if not isinstance(stated, dict) or not isinstance(stated.get("geometry"), dict):
        got = f", got {', '.join(map(str, stated))}" if isinstance(stated, dict) and stated else ""
        raise BadInput(f"{where}: expected a mapping with the keys {', '.join(sorted(KEYS))}{got}")
    if unknown := set(stated) - KEYS:
        raise BadInput(f"{where}: unknown key '{sorted(map(str, unknown))[0]}'; known are {', '.join(sorted(KEYS))}")
    try:
        found = topology(stated.get("mechanism"), Path(where).parent)
    except BadInput as error:
        raise BadInput(f"{where}: {error}") from None
    kind = found.mechanism.kind
    numbers, sources = _numbers(stated["geometry"], where)
    known = [field.name for field in fields(found.geometry)]
    for key in (*numbers, *overrides):
        if key not in known:
            raise InvalidGeometry(f"{where}: {kind} has no '{key}'; it has {', '.join(known)}")
    given = numbers | {key: _number(value, f"{where}: {key}") for key, value in overrides.items()}
    if missing := [f.name for f in fields(found.geometry) if f.name not in given and f.default is MISSING]:
        raise InvalidGeometry(f"{where}: geometry lacks {', '.join(missing)}")
    supervision = stated.get("supervision", {})
    if not isinstance(supervision, dict):
        raise BadInput(f"{where}: supervision is {supervision!r}; it must be a mapping of settings")
    try:
        mechanism = built(found, given)
    except KinematicsError as error:
        raise type(error)(f"{where}: {error}") from None
    _set_usual(mechanism, stated.get("usual", {}), where)
    return RobotFile(name, str(stated.get("description", "")), sources, mechanism, supervision)


def _numbers(geometry: Mapping[str, Any], where: str) -> tuple[dict[str, Number], dict[str, str]]:
    numbers, sources = {}, {}
    for key, entry in geometry.items():
        numbers[key] = _number(entry.get("value") if isinstance(entry, dict) else entry, f"{where}: geometry.{key}")
        sources[key] = str(entry.get("source", "")) if isinstance(entry, dict) else ""
    return numbers, sources


def _number(value: Any, what: str) -> Number:
    if isinstance(value, (list, tuple)) or (isinstance(value, np.ndarray) and value.ndim):
        return tuple(arguments.number(entry, what, error=InvalidGeometry) for entry in value)
    return arguments.number(value, what, error=InvalidGeometry)


def _set_usual(mechanism: Mechanism, usual: Any, where: str) -> None:
    if not isinstance(usual, dict) or not set(usual) <= {"working_mode", "assembly_mode"}:
        raise BadInput(f"{where}: usual is {usual!r}; it may hold working_mode and assembly_mode")
    working = usual.get("working_mode", mechanism.usual_working_mode)
    assembly = usual.get("assembly_mode", mechanism.usual_assembly_mode)
    set_usual_modes(mechanism, working, assembly, f"{where}: usual.")
