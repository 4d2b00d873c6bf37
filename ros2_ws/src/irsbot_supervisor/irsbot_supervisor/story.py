"""What a person expects of a recorded run: an expectation file, and the numbers that it can bound."""

from __future__ import annotations

import json
from collections.abc import Sequence
from math import inf, nan
from pathlib import Path
from typing import Any, NamedTuple

from irsbot_msgs_py.records import Cause, Level
from irsbot_supervisor.core.intake import S
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.journal import Configuration
from irsbot_supervisor.mcap_writer import BagError
from irsbot_supervisor.replay import Assumption, Chapter, Judged, Recording, cause_names

MEASURES = {
    "time_to_stop_s": "from the first STOP or UNKNOWN after work began until the joints stand, s",
    "hold_share": "share of the time after work began in which the level was STOP or UNKNOWN",
    "time_to_resume_s": "the longest STOP or UNKNOWN that ended, from its begin to OK or WARN, s",
    "false_stops": "times that STOP or UNKNOWN began after work had begun, beyond those that the story tells",
}
"""Numbers of a run that an expectation file may bound. Work begins with the first OK or WARN."""

DRAFT = (
    "Written from what was recorded, which may be wrong. Read it, correct it, widen what may vary, delete this line."
)
"""What makes a draft of an expectation file."""

TOLERANCE_S = 0.01
"""s: how far the bounds of a draft are from what was found."""


class Bounds(NamedTuple):
    """Both ends belong to it."""

    low: float
    high: float


class Expected(NamedTuple):
    """One level of a story."""

    level: Level
    causes: int
    since_s: Bounds
    optional: bool


class Story(NamedTuple):
    """An expectation file."""

    levels: tuple[Expected, ...] | None  # None: whatever comes
    measures: dict[str, Bounds]
    draft: bool
    told: Assumption | None = None  # the robot of a bag that does not say it
    namespace: str | None = None  # whose run it is, in a bag of several robots


class Told(NamedTuple):
    """One level of a run, whatever its causes were in the meantime."""

    level: Level
    since_ns: int
    causes: int


def levels_of(chapters: Sequence[Chapter]) -> list[Told]:
    """The levels of a run in order; a chapter in which only causes change belongs to the one before."""
    told: list[Told] = []
    for chapter in chapters:
        if told and told[-1].level == chapter.level:
            told[-1] = told[-1]._replace(causes=told[-1].causes | chapter.causes)
        else:
            told.append(Told(chapter.level, chapter.since_ns, chapter.causes))
    return told


def measures_of(recording: Recording, judged: Judged, story: Story | None = None) -> dict[str, float]:
    """MEASURES of a run; NaN where there was none. story: whose stops are no false ones."""
    told = levels_of(judged.chapters)
    work = next((k for k, entry in enumerate(told) if entry.level < Level.STOP), len(told))
    ends = [entry.since_ns for entry in told[1:]] + [_end_ns(recording, judged)]
    spans = [(entry, end) for entry, end in zip(told, ends, strict=True)][work:] if told else []
    halts = [(entry, end) for entry, end in spans if entry.level >= Level.STOP]
    lasting = sum(end - entry.since_ns for entry, end in spans)
    expected = (story.levels if story else None) or ()
    begun = next((k for k, entry in enumerate(expected) if entry.level < Level.STOP), len(expected))
    due = sum(entry.level >= Level.STOP for entry in expected[begun:])
    return {
        "time_to_stop_s": _time_to_stop(recording, halts[0][0].since_ns) if halts else nan,
        "hold_share": sum(end - entry.since_ns for entry, end in halts) / lasting if lasting > 0 else nan,
        "time_to_resume_s": max([(end - halt.since_ns) / S for halt, end in _ended(spans)], default=nan),
        "false_stops": float(max(len(halts) - due, 0)),
    }


def _ended(spans: list[tuple[Told, int]]) -> list[tuple[Told, int]]:
    """Halts and when work went on; STOP that becomes UNKNOWN, or the reverse, is one halt."""
    found: list[tuple[Told, int]] = []
    begin: Told | None = None
    for entry, _end in spans:
        if entry.level >= Level.STOP:
            begin = begin or entry
        elif begin is not None:
            found.append((begin, entry.since_ns))
            begin = None
    return found


def _time_to_stop(recording: Recording, since_ns: int) -> float:
    """s until the joints first report that they stand, whatever the supervisor makes of it; infinite if never."""
    values = next((entry.values for entry in recording.journal if isinstance(entry, Configuration)), {})
    slow = float(values.get("standstill_speed", Settings.standstill_speed))
    for sample in recording.samples:
        after_ns = sample.seen_ns - since_ns
        if after_ns >= 0 and sample.velocity and all(abs(rate) <= slow for rate in sample.velocity):
            return after_ns / S
    return inf


def _end_ns(recording: Recording, judged: Judged) -> int:
    last = recording.supervisions[-1].end_ns if recording.states else recording.samples[-1].seen_ns
    return max([last, *(chapter.since_ns for chapter in judged.chapters[-1:])])


# --- the file ---------------------------------------------------------------------------------------------------


def read_story(path: Path) -> Story:
    """An expectation file, see bags/README.md. Raises BagError: what is wrong, where, and what would be right."""
    try:
        said = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BagError(f"{path}: {error.strerror}") from None
    except ValueError as error:
        raise BagError(f"{path}: not JSON: {error}") from None
    try:
        return _story(said)
    except _Wrong as wrong:
        raise BagError(f"{path}: {wrong}") from None


def write_draft(
    recording: Recording, judged: Judged, path: Path, assumed: Assumption | None = None, namespace: str | None = None
) -> None:
    """What a run was, as an expectation file that a person has to read first. assumed, namespace: as told to
    `judge_again` and `read_recording`; the file says it from now on. Raises BagError if there is a file."""
    told = levels_of(judged.chapters)
    found = {name: value for name, value in measures_of(recording, judged).items() if abs(value) < inf}
    stops = found.pop("false_stops", 0.0)
    lines = [f'  "draft": {json.dumps(DRAFT)}']
    if namespace is not None:
        lines.append(f'  "namespace": {json.dumps(namespace)}')
    if assumed is not None:
        lines.append(f'  "robot": {json.dumps(assumed.robot)}')
    if assumed is not None and assumed.settings:
        lines.append(f'  "settings": {json.dumps(assumed.settings)}')
    lines += [
        '  "story": [\n' + ",\n".join(_draft_line(t, recording.begin_ns) for t in told) + "\n  ]",
    ]
    lines += [f'  "{name}": {json.dumps(_around(value, 0.0))}' for name, value in found.items()]
    if not stops:
        lines.append('  "false_stops": 0')
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write("{\n" + ",\n".join(lines) + "\n}\n")
    except FileExistsError:
        raise BagError(f"{path} exists already; expectations are written by people and never replaced") from None


def _draft_line(told: Told, begin_ns: int) -> str:
    said: dict[str, Any] = {"level": told.level.name}
    if told.causes:
        said["causes"] = cause_names(told.causes).split(", ")
    return "    " + json.dumps({**said, "since_s": _around((told.since_ns - begin_ns) / S, -inf)})


def _around(value: float, least: float) -> list[float]:
    return [round(max(value - TOLERANCE_S, least), 3), round(value + TOLERANCE_S, 3)]


class _Wrong(Exception):
    """Not an expectation."""


def _story(said: Any) -> Story:
    _known(said, {"draft", "namespace", "robot", "settings", "story", *MEASURES}, "the file")
    story = said.get("story")
    if story is not None and not isinstance(story, list):
        raise _Wrong("story must be a list of levels")
    if story == []:
        raise _Wrong("story is empty, but a run has at least one level; leave story out to expect none in particular")
    levels = None if story is None else tuple(_level(entry, f"story[{k}]") for k, entry in enumerate(story))
    measures = {name: _bounds(said[name], name) for name in MEASURES if name in said}
    if negative := [name for name, bounds in measures.items() if bounds.low < 0.0]:
        raise _Wrong(f"{negative[0]} is never negative, got {said[negative[0]]!r}")
    if levels is None and not measures:
        raise _Wrong(f"nothing is expected: give story, or one of {', '.join(MEASURES)}")
    return Story(
        levels, measures, "draft" in said, _assumption(said), _text(said, "namespace", "a namespace of the bag")
    )


def _assumption(said: Any) -> Assumption | None:
    robot, settings = _text(said, "robot", "the name of a preset or YAML file"), said.get("settings", {})
    if not isinstance(settings, dict):
        raise _Wrong(f"settings must be a mapping of settings, got {settings!r}")
    if robot is None and settings:
        raise _Wrong("settings need robot, whose they are")
    return Assumption(robot, settings) if robot is not None else None


def _text(said: Any, key: str, what: str) -> str | None:
    if not isinstance(text := said.get(key), str | None):
        raise _Wrong(f"{key} must be {what}, got {text!r}")
    return text


def _level(said: Any, where: str) -> Expected:
    _known(said, {"level", "causes", "since_s", "optional"}, where)
    if said.get("level") not in Level.__members__:
        raise _Wrong(f"{where}.level must be one of {', '.join(Level.__members__)}, got {said.get('level')!r}")
    causes = said.get("causes", [])
    if not isinstance(causes, list) or any(name not in Cause.__members__ for name in causes):
        raise _Wrong(f"{where}.causes must be a list of {', '.join(Cause.__members__)}, got {causes!r}")
    mask = 0
    for name in causes:
        mask |= int(Cause[name])
    since = _bounds(said["since_s"], f"{where}.since_s") if "since_s" in said else Bounds(-inf, inf)
    if not isinstance(optional := said.get("optional", False), bool):
        raise _Wrong(f"{where}.optional must be true or false, got {optional!r}")
    return Expected(Level[said["level"]], mask, since, optional)


def _bounds(said: Any, where: str) -> Bounds:
    pair = said if isinstance(said, list) else [said, said]
    if len(pair) != 2 or not all(isinstance(end, (int, float)) and not isinstance(end, bool) for end in pair):
        raise _Wrong(f"{where} must be [low, high], or one number, got {said!r}")
    if not pair[0] <= pair[1]:
        raise _Wrong(f"{where} must be [low, high] with low not above high, got {said!r}")
    return Bounds(float(pair[0]), float(pair[1]))


def _known(said: Any, keys: set[str], where: str) -> None:
    if not isinstance(said, dict):
        raise _Wrong(f"{where} must be a mapping with the keys {', '.join(sorted(keys))}")
    if unknown := sorted(set(said) - keys):
        raise _Wrong(f"{where} has the unknown key '{unknown[0]}'; known are {', '.join(sorted(keys))}")
