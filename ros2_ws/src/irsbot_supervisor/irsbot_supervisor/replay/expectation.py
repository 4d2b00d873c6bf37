"""Expectation files: the verdicts that a person expects of a recorded run, and bounds for its numbers."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from math import inf, nan
from pathlib import Path
from sys import float_info
from typing import Any, NamedTuple

from irsbot_kinematics import BadInput
from irsbot_kinematics.description import json_text
from irsbot_msgs_py.records import Cause, Level, cause_names
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.replay.judged import Interval, Judged
from irsbot_supervisor.replay.recording import Recording
from irsbot_supervisor.replay.rejudge import Assumption

MEASURES = {
    "time_to_stop_s": "from the first STOP or UNKNOWN after work began until the joints stand, s",
    "hold_share": "share of the time after work began in which the level was STOP or UNKNOWN",
    "time_to_resume_s": "the longest STOP or UNKNOWN that ended, from its begin to OK or WARN, s",
    "false_stops": "times that STOP or UNKNOWN began after work had begun, beyond those that the story tells",
}
"""Numbers of a run that an expectation file may bound. Work begins with the first OK or WARN."""

DRAFT = "Written from the recording, which may be wrong. Read and correct it, widen the bounds, delete this line."
"""Key that marks a draft of an expectation file."""

TOLERANCE_S = 0.01
"""s: distance of the bounds of a draft from the found values."""


class Bounds(NamedTuple):
    """Bounds; both ends are included."""

    low: float
    high: float


class Expected(NamedTuple):
    """One level of a story."""

    level: Level
    causes: int
    since_s: Bounds
    optional: bool


class Expectation(NamedTuple):
    """An expectation file."""

    levels: tuple[Expected, ...] | None  # None: any levels
    measures: dict[str, Bounds]
    draft: bool
    assumption: Assumption | None = None  # the robot of a bag that does not say it
    namespace: str | None = None  # whose run it is, in a bag of several robots
    topic: str | None = None  # of the joint states, in a bag with several topics of them


class LevelSpan(NamedTuple):
    """One level of a run, whatever its causes are."""

    level: Level
    since_ns: int
    causes: int


def levels_of(intervals: Sequence[Interval]) -> list[LevelSpan]:
    """The levels of a run in order; an interval in which only causes change belongs to the one before."""
    heard: list[LevelSpan] = []
    for interval in intervals:
        if heard and heard[-1].level == interval.level:
            heard[-1] = heard[-1]._replace(causes=heard[-1].causes | interval.causes)
        else:
            heard.append(LevelSpan(interval.level, interval.since_ns, interval.causes))
    return heard


def measures_of(recording: Recording, judged: Judged, expectation: Expectation | None = None) -> dict[str, float]:
    """MEASURES of a run; NaN where there is none. story: its stops do not count as false stops."""
    heard = levels_of(judged.intervals)
    work = next((k for k, entry in enumerate(heard) if entry.level < Level.STOP), len(heard))
    ends = [entry.since_ns for entry in heard[1:]] + [_end_ns(recording, judged)]
    spans = [(entry, end) for entry, end in zip(heard, ends, strict=True)][work:] if heard else []
    halts = [(entry, end) for entry, end in spans if entry.level >= Level.STOP]
    lasting = sum(end - entry.since_ns for entry, end in spans)
    expected = (expectation.levels if expectation else None) or ()
    begun = next((k for k, entry in enumerate(expected) if entry.level < Level.STOP), len(expected))
    due = sum(entry.level >= Level.STOP for entry in expected[begun:])
    return {
        "time_to_stop_s": _time_to_stop(recording, judged, halts[0][0].since_ns) if halts else nan,
        "hold_share": sum(end - entry.since_ns for entry, end in halts) / lasting if lasting > 0 else nan,
        "time_to_resume_s": max([(end - halt.since_ns) / NS_PER_S for halt, end in _ended(spans)], default=nan),
        "false_stops": float(max(len(halts) - due, 0)),
    }


def _ended(spans: list[tuple[LevelSpan, int]]) -> list[tuple[LevelSpan, int]]:
    """Halts, and the times when work continued; STOP that becomes UNKNOWN, or the reverse, is one halt."""
    found: list[tuple[LevelSpan, int]] = []
    begin: LevelSpan | None = None
    for entry, _end in spans:
        if entry.level >= Level.STOP:
            begin = begin or entry
        elif begin is not None:
            found.append((begin, entry.since_ns))
            begin = None
    return found


def _time_to_stop(recording: Recording, judged: Judged, since_ns: int) -> float:
    """s until the joints of the robot first report that they stand, independent of the supervisor; infinite if
    never."""
    settings = judged.settings[0][1]
    for sample in recording.samples:
        after_ns = sample.seen_ns - since_ns
        if after_ns >= 0 and len(sample.velocity) == len(sample.names):
            rates = dict(zip(sample.names, sample.velocity, strict=True))
            if all(abs(rates.get(name, inf)) <= settings.standstill_speed for name in settings.joint_names):
                return after_ns / NS_PER_S
    return inf


def _end_ns(recording: Recording, judged: Judged) -> int:
    last = recording.sessions[-1].end_ns if recording.states else recording.samples[-1].seen_ns
    return max([last, *(interval.since_ns for interval in judged.intervals[-1:])])


# --- the file ---------------------------------------------------------------------------------------------------


def read_expectation(path: Path) -> Expectation:
    """Read an expectation file, see bags/README.md. Raises BagError: what is wrong, where, and what would be right."""
    try:
        stated = json_text.parsed(path.read_bytes(), path)
    except OSError as error:
        raise BagError(f"{path}: {error.strerror}") from None
    except BadInput as error:
        raise BagError(str(error)) from None
    try:
        return _expectation(stated, path.parent)
    except _Wrong as wrong:
        raise BagError(f"{path}: {wrong}") from None


def write_draft(
    recording: Recording,
    judged: Judged,
    path: Path,
    assumed: Assumption | None = None,
    namespace: str | None = None,
    topic: str | None = None,
) -> None:
    """Write a run as the draft of an expectation file, which a person has to read first. assumed, namespace, topic: as
    given to `judge_again` and `read_recording`; the file repeats them, the path of a robot relative to itself. Raises
    BagError if there is a file."""
    heard = levels_of(judged.intervals)
    found = {name: value for name, value in measures_of(recording, judged).items() if abs(value) < inf}
    stops = found.pop("false_stops", 0.0)
    lines = [f'  "draft": {json.dumps(DRAFT)}']
    for key, value in (("namespace", namespace), ("topic", topic)):
        if value is not None:
            lines.append(f'  "{key}": {json.dumps(value)}')
    if assumed is not None:
        named = str(assumed.robot)
        robot = os.path.relpath(named, path.parent) if _is_file(named) else named
        lines.append(f'  "robot": {json.dumps(robot)}')
    if assumed is not None and assumed.settings:
        lines.append(f'  "settings": {json.dumps(assumed.settings)}')
    lines += [
        '  "story": [\n' + ",\n".join(_draft_line(t, recording.begin_ns) for t in heard) + "\n  ]",
    ]
    lines += [f'  "{name}": {json.dumps(_around(value, 0.0))}' for name, value in found.items()]
    if not stops:
        lines.append('  "false_stops": 0')
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write("{\n" + ",\n".join(lines) + "\n}\n")
    except FileExistsError:
        raise BagError(f"{path} exists already; expectations are written by people and never replaced") from None


def _draft_line(heard: LevelSpan, begin_ns: int) -> str:
    stated: dict[str, Any] = {"level": heard.level.name}
    if heard.causes:
        stated["causes"] = cause_names(heard.causes).split(", ")
    return "    " + json.dumps({**stated, "since_s": _around((heard.since_ns - begin_ns) / NS_PER_S, -inf)})


def _around(value: float, least: float) -> list[float]:
    return [round(max(value - TOLERANCE_S, least), 3), round(value + TOLERANCE_S, 3)]


class _Wrong(Exception):
    """Not an expectation."""


def _expectation(stated: Any, folder: Path) -> Expectation:
    _known(stated, {"draft", "namespace", "topic", "robot", "settings", "story", *MEASURES}, "the file")
    expectation = stated.get("story")
    if expectation is not None and not isinstance(expectation, list):
        raise _Wrong("story must be a list of levels")
    if expectation == []:
        raise _Wrong("story is empty, but a run has at least one level; leave story out to expect none in particular")
    levels = None if expectation is None else tuple(_level(entry, f"story[{k}]") for k, entry in enumerate(expectation))
    measures = {name: _bounds(stated[name], name) for name in MEASURES if name in stated}
    if negative := [name for name, bounds in measures.items() if bounds.low < 0.0]:
        raise _Wrong(f"{negative[0]} is never negative, got {stated[negative[0]]!r}")
    if levels is None and not measures:
        raise _Wrong(f"nothing is expected: give story, or one of {', '.join(MEASURES)}")
    namespace, topic = (
        _text(stated, "namespace", "a namespace of the bag"),
        _text(stated, "topic", "a topic of the bag"),
    )
    return Expectation(levels, measures, "draft" in stated, _assumption(stated, folder), namespace, topic)


def _assumption(stated: Any, folder: Path) -> Assumption | None:
    robot, settings = _text(stated, "robot", "the name of a preset or YAML file"), stated.get("settings", {})
    if not isinstance(settings, dict):
        raise _Wrong(f"settings must be a mapping of settings, got {settings!r}")
    if robot is None and settings:
        raise _Wrong("settings need robot")
    if robot is not None and _is_file(robot):
        robot = str(folder.absolute() / robot)
    return Assumption(robot, settings) if robot is not None else None


def _is_file(robot: str | Path) -> bool:
    """True for the path of a robot's file, False for the name of a preset."""
    return Path(robot).suffix in (".yaml", ".yml")


def _text(stated: Any, key: str, what: str) -> str | None:
    if not isinstance(text := stated.get(key), str | None):
        raise _Wrong(f"{key} must be {what}, got {text!r}")
    return text


def _level(stated: Any, where: str) -> Expected:
    _known(stated, {"level", "causes", "since_s", "optional"}, where)
    if not isinstance(level := stated.get("level"), str) or level not in Level.__members__:
        raise _Wrong(f"{where}.level must be one of {', '.join(Level.__members__)}, got {level!r}")
    causes = stated.get("causes", [])
    if not isinstance(causes, list) or any(
        not isinstance(name, str) or name not in Cause.__members__ for name in causes
    ):
        raise _Wrong(f"{where}.causes must be a list of {', '.join(Cause.__members__)}, got {causes!r}")
    mask = 0
    for name in causes:
        mask |= int(Cause[name])
    since = _bounds(stated["since_s"], f"{where}.since_s") if "since_s" in stated else Bounds(-inf, inf)
    if not isinstance(optional := stated.get("optional", False), bool):
        raise _Wrong(f"{where}.optional must be true or false, got {optional!r}")
    return Expected(Level[level], mask, since, optional)


def _bounds(stated: Any, where: str) -> Bounds:
    pair = stated if isinstance(stated, list) else [stated, stated]
    if len(pair) != 2 or not all(isinstance(end, (int, float)) and not isinstance(end, bool) for end in pair):
        raise _Wrong(f"{where} must be [low, high], or one number, got {stated!r}")
    if not pair[0] <= pair[1]:
        raise _Wrong(f"{where} must be [low, high] with low not above high, got {stated!r}")
    try:
        return Bounds(float(pair[0]), float(pair[1]))
    except OverflowError:
        raise _Wrong(f"{where} must be [low, high], or one number, got a number above {float_info.max:.1g}") from None


def _known(stated: Any, keys: set[str], where: str) -> None:
    if not isinstance(stated, dict):
        raise _Wrong(f"{where} must be a mapping with the keys {', '.join(sorted(keys))}")
    if unknown := sorted(set(stated) - keys):
        raise _Wrong(f"{where} has the unknown key '{unknown[0]}'; known are {', '.join(sorted(keys))}")
