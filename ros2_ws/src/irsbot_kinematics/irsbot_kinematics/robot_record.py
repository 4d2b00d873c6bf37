"""A robot as plain data and back, so that a recorded run names its machine completely, whatever files change later."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from irsbot_kinematics.errors import BadInput
from irsbot_kinematics.robot import Robot
from irsbot_kinematics.topologies import built, reference, referenced


def robot_record(robot: Robot) -> dict[str, Any]:
    """Name, topology, geometry (SI) and usual modes: everything `robot_from_record` needs, fit for JSON."""
    mechanism = robot.mechanism
    return {
        "name": robot.name,
        **reference(mechanism),
        "geometry": asdict(mechanism.geometry),
        "working_mode": list(mechanism.usual_working_mode),
        "assembly_mode": mechanism.usual_assembly_mode,
    }


def robot_from_record(said: Mapping[str, Any], files: Iterable[Path] = ()) -> Robot:
    """The robot of a record. files: where the file of its mechanism may lie, if not where it was.

    Raises BadInput for a malformed record and for a mechanism that is not as it was recorded, InvalidGeometry for
    impossible lengths.
    """
    try:
        found = referenced(said, files)
        lengths = {key: tuple(v) if isinstance(v, list) else v for key, v in said["geometry"].items()}
        mechanism = built(found, lengths)
        mechanism.usual_working_mode = tuple(said["working_mode"])
        mechanism.usual_assembly_mode = int(said["assembly_mode"])
        return Robot(mechanism, str(said["name"]))
    except (KeyError, TypeError, AttributeError) as error:
        raise BadInput(f"not the record of a robot: {type(error).__name__} {error}") from None
