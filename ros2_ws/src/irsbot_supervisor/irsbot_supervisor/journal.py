"""Inputs of the supervisor other than samples, as lines of JSON: settings, restarts, resets and bypasses. They make a
bag replayable."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Any, NamedTuple

from irsbot_kinematics import Robot
from irsbot_kinematics.robot_record import robot_record
from irsbot_msgs_py.records import Bypass, Reset, Restart
from irsbot_supervisor.core.settings import Settings


class JournalError(ValueError):
    """A line that is no journal entry."""


class Configuration(NamedTuple):
    """Settings that came into force, as plain values: what another version has written can be read, and checked."""

    received_ns: int
    seen_ns: int
    values: dict[str, Any]  # of `Settings`, by name
    machine: dict[str, Any]  # what robot they are for, complete


Entry = Configuration | Restart | Reset | Bypass

KINDS: dict[type[Entry], str] = {Configuration: "configure", Restart: "restart", Reset: "reset", Bypass: "bypass"}
"""What kind of entry a line says it is."""


def configured(settings: Settings, robot: Robot, received_ns: int, seen_ns: int) -> Configuration:
    """What the journal says of settings that come into force for a robot."""
    return Configuration(received_ns, seen_ns, asdict(settings), robot_record(robot))


def write_entry(entry: Entry) -> str:
    """One line for one entry."""
    return json.dumps({"kind": KINDS[type(entry)], **entry._asdict()}, sort_keys=True)


def read_entry(line: str) -> Entry:
    """The entry of a line. Raises JournalError."""
    try:
        said = json.loads(line)
        kind = said.pop("kind")
        if kind == "configure":
            return Configuration(**said)
        if kind == "restart":
            return Restart(*(int(said[name]) for name in Restart._fields))
        if kind == "reset":
            return Reset(**{**said, "seed_pose": tuple(said["seed_pose"])})
        if kind == "bypass":
            received_ns, seen_ns, event, cause = (int(said[k]) for k in ("received_ns", "seen_ns", "event", "cause"))
            words = str(said["operator"]), str(said["reason"])
            return Bypass(received_ns, seen_ns, event, cause, float(said["duration_s"]), *words)
        raise JournalError(f"not a journal entry: kind '{kind}'")
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise JournalError(f"not a journal entry: {line[:80]!r} ({error})") from None
