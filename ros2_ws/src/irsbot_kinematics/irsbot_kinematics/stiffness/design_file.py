"""Elastic designs as YAML: numbers with units and sources.

family: irsbot2                       # or five_bar, or chains (see docs/explanation/stiffness.md)
description: one line
robot: irsbot2                        # preset or YAML file that gives the geometry; or `geometry` below, or both
geometry:
  l1: {value: 0.375 m, source: "where the number comes from"}
  beta: {value: 45 deg, source: "...", assumed: true}
sections:
  proximal: {outer: 60 mm, inner: 50 mm, material: aluminium, source: "..."}
materials:                            # if the shipped ones do not do
  mine: {young: 70 GPa, poisson: 0.33, density: 2700 kg/m3, source: "..."}
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields, replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from irsbot_kinematics.arguments import checked, number, shown
from irsbot_kinematics.description import yaml_text
from irsbot_kinematics.description.robot_file import read_robot
from irsbot_kinematics.description.topologies import built
from irsbot_kinematics.errors import BadInput, KinematicsError
from irsbot_kinematics.mechanism import Mechanism
from irsbot_kinematics.mechanisms import TOPOLOGIES
from irsbot_kinematics.stiffness.chain_file import read_chains
from irsbot_kinematics.stiffness.chains import ChainStructure
from irsbot_kinematics.stiffness.errors import InvalidDesign
from irsbot_kinematics.stiffness.five_bar import FiveBarStructure
from irsbot_kinematics.stiffness.irsbot2 import Irsbot2Structure
from irsbot_kinematics.stiffness.quantities import quantity
from irsbot_kinematics.stiffness.response import Design
from irsbot_kinematics.stiffness.section_file import mapping, read_sections
from irsbot_kinematics.stiffness.structure import Structure

_FOLDER = "stiffness/presets"
_KEYS = {"family", "description", "robot", "geometry", "sections", "materials", "working_mode"}
_ENTRY = {"value", "source", "assumed"}
"""Keys of a number of the geometry."""
_FAMILIES: dict[str, tuple[type[Irsbot2Structure] | type[FiveBarStructure], tuple[str, ...]]] = {
    "irsbot2": (Irsbot2Structure, ("parallelogram", "direction", "spacing")),
    "five_bar": (FiveBarStructure, ("platform_joint",)),
}
"""Class of each family, and the geometry that it has in addition to the rigid robot's."""
_DEFAULTS: dict[str, Any] = {"direction": [0.0, 1.0], "spacing": "0 m", "platform_joint": "revolute"}


def presets() -> tuple[str, ...]:
    """Names of the shipped designs."""
    files = resources.files("irsbot_kinematics").joinpath(_FOLDER).iterdir()
    return tuple(sorted(Path(file.name).stem for file in files if file.name != "materials.yaml"))


@checked
def load(name_or_path: str | Path, *, robot: str | None = None, **changes: Any) -> Design:
    """A shipped design by name, or one from a YAML file.

    robot: preset or YAML file of a robot whose lengths replace those of the design. changes: single numbers that
    replace those of the file, SI and radians (`beta`, `spacing`, `parallelogram`, ...), and `platform_joint`,
    `direction`, `rigid` (names of tubes that do not deform, for example `("elbow",)`).
    Raises InvalidDesign, InvalidGeometry, UnknownRobot.
    """
    path = Path(name_or_path)
    if path.suffix in (".yaml", ".yml"):
        try:
            text, name, where = path.read_text(encoding="utf-8"), path.stem, str(path)
            stated = yaml_text.parsed(text, where)
        except (OSError, UnicodeDecodeError) as error:
            raise InvalidDesign(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
        except BadInput as error:
            raise InvalidDesign(str(error)) from None
    elif str(name_or_path) in presets():
        name = where = str(name_or_path)
        text = resources.files("irsbot_kinematics").joinpath(f"{_FOLDER}/{name}.yaml").read_text(encoding="utf-8")
        stated = yaml_text.shipped(text)
    else:
        raise InvalidDesign(
            f"no elastic design '{name_or_path}'; known are {', '.join(presets())}, or give a YAML file"
        )
    if not isinstance(stated, dict) or stated.get("family") not in (*_FAMILIES, ChainStructure.family):
        families = ", ".join((*_FAMILIES, ChainStructure.family))
        raise InvalidDesign(f"{where}: expected a mapping with a family, one of {families}")
    try:
        if stated["family"] == ChainStructure.family:
            if robot is not None or changes:
                raise InvalidDesign("a design of chains has points of its own: change its file")
            return read_chains(stated, name)
        return _structure(stated, name, robot, changes, Path(where).parent)
    except InvalidDesign as error:
        raise InvalidDesign(f"{where}: {error}") from None


@checked
def text_of(design: Structure) -> str:
    """The design as a YAML file that `load` reads back exactly.

    Raises InvalidDesign if two different materials have the same name.
    """
    geometry: dict[str, Any] = {}
    for key, value in vars(design.mechanism.geometry).items():
        geometry[key] = {"value": f"{value!r} {'rad' if key == 'beta' else 'm'}"}
    for key in _FAMILIES[design.family][1]:
        value = getattr(design, key)
        geometry[key] = {"value": list(value) if isinstance(value, tuple) else f"{value!r} m"}
        if isinstance(value, str):
            geometry[key] = {"value": value}
    for key, entry in geometry.items():
        entry |= {"source": design.sources[key]} if design.sources.get(key) else {}
        entry |= {"assumed": True} if key in design.assumed else {}
    sections: dict[str, Any] = {}
    materials: dict[str, Any] = {}
    for kind, s in design.sections.items():
        sections[kind] = {"outer": f"{s.outer!r} m", "inner": f"{s.inner!r} m", "material": s.material.name or kind}
        sections[kind] |= {"source": s.source, "rigid": s.rigid, "assumed": s.assumed}
        m = s.material
        entry = {
            "young": f"{m.young!r} Pa",
            "poisson": f"{m.poisson!r}",
            "density": f"{m.density!r} kg/m3",
            "source": m.source,
        }
        if materials.setdefault(m.name or kind, entry) != entry:
            raise InvalidDesign(f"two different materials are named '{m.name or kind}'; a file needs a name for each")
    stated: dict[str, Any] = {"family": design.family, "description": design.description, "geometry": geometry}
    stated |= {"sections": sections, "materials": materials, "working_mode": list(design.working_mode)}
    return yaml.safe_dump(stated, sort_keys=False, width=120, allow_unicode=True)


def _structure(
    stated: Mapping[str, Any], name: str, robot: str | None, changes: Mapping[str, Any], folder: Path
) -> Structure:
    family = stated["family"]
    made, extra = _FAMILIES[family]
    if unknown := set(stated) - _KEYS:
        raise InvalidDesign(f"unknown key '{sorted(map(str, unknown))[0]}'; known are {', '.join(sorted(_KEYS))}")
    geometry = mapping(stated.get("geometry", {}), "geometry")
    entries = {key: entry if isinstance(entry, dict) else {"value": entry} for key, entry in geometry.items()}
    for key, entry in entries.items():
        if "value" not in entry or not set(entry) <= _ENTRY:
            raise InvalidDesign(f"geometry.{key} needs a value and may have source, assumed, got {entry!r}")
    known = [field.name for field in fields(TOPOLOGIES[family].geometry)]
    if unknown := set(entries) - {*known, *extra}:
        raise InvalidDesign(
            f"the family {family} has no length '{sorted(map(str, unknown))[0]}'; it has {', '.join([*known, *extra])}"
        )
    if unknown := set(changes) - {*known, *extra, "rigid"}:
        raise InvalidDesign(
            f"the family {family} has no '{sorted(unknown)[0]}' to change; it has {', '.join([*known, *extra])}, rigid"
        )
    numbers = {key: _length(key, entry["value"]) for key, entry in entries.items() if key in known}
    numbers |= {key: value for key, value in changes.items() if key in known}
    rest = {key: _extra(key, entries.get(key, {}).get("value", _DEFAULTS.get(key)), changes) for key in extra}
    sections = read_sections(stated)
    rigid = changes.get("rigid", ())
    if isinstance(rigid, (str, bytes)) or not isinstance(rigid, Iterable):
        raise InvalidDesign(f"rigid must be names of tubes, such as ('elbow',), got {shown(rigid)}")
    for kind in rigid:
        if kind not in list(sections):
            raise InvalidDesign(f"there is no tube '{kind}' to be rigid; there are {', '.join(sections)}")
        sections[kind] = replace(sections[kind], rigid=True)
    mechanism = _mechanism(
        family, robot or stated.get("robot"), numbers if robot is None else dict(changes), folder, known
    )
    assumed = [key for key, entry in entries.items() if entry.get("assumed") and key not in changes]
    assumed += [f"{kind} section" for kind, section in sections.items() if section.assumed]
    mode = stated.get("working_mode", mechanism.usual_working_mode)
    mode = tuple(mode) if isinstance(mode, (list, tuple)) else (mode,)
    sources = {key: str(entry.get("source", "")) for key, entry in entries.items()}
    common = (name, str(stated.get("description", "")), mechanism, sections, mode, sources, tuple(assumed))
    structure: Structure = made(*common, **rest)
    return structure


def _mechanism(family: str, robot: Any, numbers: Mapping[str, float], folder: Path, known: list[str]) -> Mechanism:
    """The rigid robot: from its own file with single lengths replaced, or from lengths alone."""
    given = {key: value for key, value in numbers.items() if key in known}
    try:
        if robot is None:
            missing = [f for f in known if f not in given and f != "e"]
            if missing:
                raise InvalidDesign(f"geometry lacks {', '.join(missing)}")
            return built(TOPOLOGIES[family], given)
        beside = folder / str(robot)
        which = beside if beside.is_file() else str(robot)
        kind = read_robot(which).mechanism.kind
        if kind != family:
            raise InvalidDesign(f"robot '{robot}' is a {kind}, the design is of the family {family}")
        return read_robot(which, given).mechanism
    except InvalidDesign:
        raise
    except (KinematicsError, OSError) as error:  # OSError: a path that no system can open
        raise InvalidDesign(str(error)) from None


def _length(key: str, value: Any) -> float:
    return quantity(value, "angle" if key == "beta" else "length", f"geometry.{key}")


def _extra(key: str, value: Any, changes: Mapping[str, Any]) -> Any:
    """A number of the geometry of the elastic model alone; changes are in SI."""
    if key == "platform_joint":
        return changes.get(key, value)
    if key == "direction":
        stated = changes.get(key, value)
        if isinstance(stated, np.ndarray):
            stated = stated.tolist()
        if not isinstance(stated, (list, tuple)) or len(stated) != 2:
            raise InvalidDesign(f"geometry.direction must be [x, z], got {stated!r}")
        x, z = (quantity(part, "ratio", "geometry.direction") for part in stated)
        return x, z
    if key in changes:
        return number(changes[key], key, error=InvalidDesign)
    if value is None:
        raise InvalidDesign(f"geometry lacks {key}")
    return _length(key, value)
