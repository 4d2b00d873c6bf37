"""A robot as plain data and back, so that a recorded run contains its machine completely."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from irsbot_kinematics.description.topologies import built, reference, referenced, set_usual_modes
from irsbot_kinematics.errors import BadInput, KinematicsError
from irsbot_kinematics.robot import Robot


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


def robot_from_record(stated: Mapping[str, Any], files: Iterable[Path] = ()) -> Robot:
    """The robot of a record. files: other places of the file of its mechanism.

    Raises BadInput for a malformed record, for modes that the mechanism does not have, and for a mechanism that differs
    from the recorded one, InvalidGeometry for impossible lengths.
    """
    try:
        found = referenced(stated, files)
        lengths = {key: tuple(v) if isinstance(v, list) else v for key, v in stated["geometry"].items()}
        mechanism = built(found, lengths)
        set_usual_modes(mechanism, stated["working_mode"], stated["assembly_mode"], "the record of a robot: ")
        return Robot(mechanism, str(stated["name"]))
    except KinematicsError:
        raise
    except (KeyError, TypeError, AttributeError, ValueError, OSError) as error:
        raise BadInput(f"not the record of a robot: {type(error).__name__} {error}") from None
