"""Inputs of the supervisor other than samples, as lines of JSON: settings and resets. They make a bag replayable."""

from __future__ import annotations

import json
from dataclasses import asdict

from irsbot_kinematics import Robot
from irsbot_kinematics.robot_record import robot_record
from irsbot_msgs_py.records import Configure, Reset
from irsbot_supervisor.core.settings import Settings


class JournalError(ValueError):
    """A line that is no journal entry."""


def configured(settings: Settings, robot: Robot, received_ns: int, seen_ns: int) -> Configure:
    """The event that puts settings into force for a robot."""
    return Configure(received_ns, seen_ns, asdict(settings), robot_record(robot))


def write_entry(event: Configure | Reset) -> str:
    """One line for one event."""
    return json.dumps({"kind": type(event).__name__.lower(), **event._asdict()}, sort_keys=True)


def read_entry(line: str) -> Configure | Reset:
    """The event of a line. Raises JournalError."""
    try:
        said = json.loads(line)
        kind = said.pop("kind")
        if kind == "configure":
            return Configure(**said)
        if kind == "reset":
            return Reset(**{**said, "seed_pose": tuple(said["seed_pose"])})
        raise JournalError(f"not a journal entry: kind '{kind}'")
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise JournalError(f"not a journal entry: {line[:80]!r} ({error})") from None
