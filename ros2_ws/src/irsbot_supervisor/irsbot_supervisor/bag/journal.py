"""Inputs of the supervisor other than samples, as lines of JSON: settings, restarts, late brakes, resets and bypasses.
They make a bag replayable."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Any, NamedTuple

from irsbot_kinematics import Robot
from irsbot_kinematics.description import json_text
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
        stated = json_text.parsed(line)
        kind = stated["kind"]
        times = _whole(stated["received_ns"]), _whole(stated["seen_ns"])
        if kind == "configure":
            return Configuration(*times, _mapping(stated["values"]), _mapping(stated["machine"]))
        if kind == "restart":
            return Restart(*times, _whole(stated["event"]))
        if kind == "late_brakes":
            return LateBrakes(*times, _whole(stated["brakes_ns"]))
        if kind == "reset":
            seed = tuple(float(value) for value in stated["seed_pose"])
            return Reset(*times, _whole(stated["event"]), str(stated["text"]), seed)
        if kind == "bypass":
            words = str(stated["operator"]), str(stated["reason"])
            event, cause, duration_s = _whole(stated["event"]), _whole(stated["cause"]), float(stated["duration_s"])
            return Bypass(*times, event, cause, duration_s, *words)
        raise ValueError(f"kind '{kind}'")
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError) as error:
        raise JournalError(f"not a journal entry: {line[:80]!r} ({type(error).__name__} {error})") from None


def _whole(stated: Any) -> int:
    """A time or a count. Raises TypeError, ValueError."""
    if not isinstance(stated, int):
        raise TypeError(f"{stated!r} is no whole number")
    if abs(stated) >= 2**63:
        raise ValueError(f"{stated} needs more than 64 bits")
    return stated


def _mapping(stated: Any) -> dict[str, Any]:
    """Raises TypeError."""
    if not isinstance(stated, dict):
        raise TypeError(f"{stated!r:.40} is no mapping")
    return stated
