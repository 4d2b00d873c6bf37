"""What a replay is held against: the recorded verdicts, and the story that a person expects."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from irsbot_msgs_py.records import Cause, Level
from irsbot_supervisor.core.intake import S
from irsbot_supervisor.mcap_writer import BagError
from irsbot_supervisor.replay import Chapter, Judged, Recording, cause_names


class Check(NamedTuple):
    """One thing that was checked: its name, and what is wrong with it (empty: nothing)."""

    name: str
    faults: tuple[str, ...]


def against_recording(recording: Recording, judged: Judged) -> list[Check]:
    """Verdicts and states as recorded, against those judged again. Faults name the sample, earliest first."""
    if not recording.states:
        return []
    return [
        Check("recorded verdicts", tuple(_verdict_faults(recording, judged))),
        Check("recorded states", tuple(_state_faults(recording, judged))),
    ]


def _verdict_faults(recording: Recording, judged: Judged) -> list[str]:
    """Every recorded verdict must be a chapter of the replay, begun at the same time."""
    known: dict[int, list[Chapter]] = {}
    for chapter in judged.chapters:
        known.setdefault(chapter.since_ns, []).append(chapter)
    faults = []
    first_ns = judged.chapters[0].since_ns if judged.chapters else 0
    for _log_ns, verdict in recording.verdicts:
        said = Chapter(verdict.since_ns, verdict.level, verdict.causes, verdict.latched, verdict.event, verdict.text)
        if verdict.since_ns < first_ns or any(said.same_as(chapter) for chapter in known.get(verdict.since_ns, ())):
            continue
        again = [chapter for chapter in judged.chapters if chapter.since_ns <= verdict.since_ns]
        now = str(again[-1]) if again else "nothing"
        sample = f"sample stamped {verdict.stamp_ns / S:.6f}"
        faults.append(f"verdict {verdict.sequence} at {sample}: recorded {said}, judged again {now}")
    return faults


def _state_faults(recording: Recording, judged: Judged) -> list[str]:
    faults = []
    for state in recording.states:
        again = judged.levels.get(state.sequence)
        if again is not None and again != (state.level, state.causes):
            recorded = f"{state.level.name} ({cause_names(state.causes) or 'no cause'})"
            now = f"{again[0].name} ({cause_names(again[1]) or 'no cause'})"
            faults.append(
                f"sample {state.sequence} stamped {state.stamp_ns / S:.6f}: recorded {recorded}, judged again {now}"
            )
    return faults


def against_story(judged: Judged, story: Mapping[str, Any]) -> Check:
    """The chapters' levels, in order, against the story of an expectation file (see `read_story`).

    A chapter in which only causes change belongs to the one before. Times count from the first sample's chapter.
    """
    told = _levels(judged.chapters)
    expected = story["story"]
    begin = judged.chapters[0].since_ns if judged.chapters else 0
    faults = []
    if len(told) != len(expected):
        found = ", ".join(level.name for level, _since, _causes in told)
        faults.append(f"expected {', '.join(str(entry['level']) for entry in expected)}; found {found}")
    for number, (entry, (level, since_ns, causes)) in enumerate(zip(expected, told, strict=False), 1):
        since_s = (since_ns - begin) / S
        low, high = entry.get("since_s", (float("-inf"), float("inf")))
        wanted = _mask(entry.get("causes", ()))
        if level.name != entry["level"]:
            faults.append(f"chapter {number} at {since_s:.3f} s is {level.name}, expected {entry['level']}")
        elif causes & wanted != wanted:
            faults.append(f"chapter {number} has {cause_names(causes)}, expected {cause_names(wanted)} among them")
        elif not low <= since_s <= high:
            faults.append(f"chapter {number} ({level.name}) begins at {since_s:.3f} s, expected {low} to {high} s")
    return Check("expected story", tuple(faults))


def read_story(path: Path) -> dict[str, Any]:
    """An expectation file: {"story": [{"level": "STOP", "causes": ["TYPE2"], "since_s": [low, high]}, ...]}.

    `causes` must be among those found, `since_s` bounds the begin; both may be left out. Raises BagError.
    """
    try:
        said = json.loads(path.read_text(encoding="utf-8"))
        for entry in said["story"]:
            Level[entry["level"]]
            _mask(entry.get("causes", ()))
            low, high = entry.get("since_s", (0.0, 0.0))
            float(low), float(high)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise BagError(f"{path} is no expectation file: {type(error).__name__} {error}") from None
    return dict(said)


def _levels(chapters: Sequence[Chapter]) -> list[tuple[Level, int, int]]:
    merged: list[tuple[Level, int, int]] = []
    for chapter in chapters:
        if merged and merged[-1][0] == chapter.level:
            level, since_ns, causes = merged[-1]
            merged[-1] = level, since_ns, causes | chapter.causes
        else:
            merged.append((chapter.level, chapter.since_ns, chapter.causes))
    return merged


def _mask(names: Sequence[str]) -> int:
    mask = 0
    for name in names:
        mask |= int(Cause[name])
    return mask
