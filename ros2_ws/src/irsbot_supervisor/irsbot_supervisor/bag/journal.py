"""Inputs of the supervisor other than samples, as lines of JSON: settings, restarts, late brakes, resets and bypasses.
They make a bag replayable."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Any, NamedTuple

from irsbot_kinematics import Robot
from irsbot_kinematics.description.robot_record import robot_record
from irsbot_msgs_py.records import Bypass, LateBrakes, Reset, Restart
from irsbot_supervisor.core.settings import Settings


class JournalError(ValueError):
    """A line that is not a journal entry."""


class Configuration(NamedTuple):
    """Settings that came into force, as plain values, so that entries of other versions can be read and checked."""

    received_ns: int
    seen_ns: int
    values: dict[str, Any]  # of `Settings`, by name
    machine: dict[str, Any]  # complete record of their robot


Entry = Configuration | Restart | LateBrakes | Reset | Bypass

ENTRY_KINDS: dict[type[Entry], str] = {
    Configuration: "configure",
    Restart: "restart",
    LateBrakes: "late_brakes",
    Reset: "reset",
    Bypass: "bypass",
}
"""Kinds of entries, by the name in a line."""


def configured(settings: Settings, robot: Robot, received_ns: int, seen_ns: int) -> Configuration:
    """The journal's entry for settings that come into force for a robot."""
    return Configuration(received_ns, seen_ns, asdict(settings), robot_record(robot))


def write_entry(entry: Entry) -> str:
    """One line for one entry."""
    return json.dumps({"kind": ENTRY_KINDS[type(entry)], **entry._asdict()}, sort_keys=True)


def read_entry(line: str) -> Entry:
    """The entry of a line. Raises JournalError."""
    try:
        stated = json.loads(line)
        kind = stated.pop("kind")
        if kind == "configure":
            return Configuration(**stated)
        if kind == "restart":
            return Restart(*(int(stated[name]) for name in Restart._fields))
        if kind == "late_brakes":
            return LateBrakes(*(int(stated[name]) for name in LateBrakes._fields))
        if kind == "reset":
            return Reset(**{**stated, "seed_pose": tuple(stated["seed_pose"])})
        if kind == "bypass":
            received_ns, seen_ns, event, cause = (int(stated[k]) for k in ("received_ns", "seen_ns", "event", "cause"))
            words = str(stated["operator"]), str(stated["reason"])
            return Bypass(received_ns, seen_ns, event, cause, float(stated["duration_s"]), *words)
        raise JournalError(f"not a journal entry: kind '{kind}'")
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise JournalError(f"not a journal entry: {line[:80]!r} ({error})") from None
