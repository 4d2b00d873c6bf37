"""What a replay is held against: the recorded verdicts, and the story that a person expects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from irsbot_supervisor.core.intake import S
from irsbot_supervisor.replay import Chapter, Judged, Recording, Supervision, cause_names
from irsbot_supervisor.story import MEASURES, Expected, Story, Told, levels_of, measures_of


class Check(NamedTuple):
    """One thing that was checked: its name, and what is wrong with it (empty: nothing)."""

    name: str
    faults: tuple[str, ...]


def against_recording(recording: Recording, judged: Judged) -> list[Check]:
    """Verdicts and states as recorded, against those judged again, and errors on the way if there were any. Faults name
    the sample, earliest first."""
    inside = [Check("errors inside", tuple(judged.errors))] if judged.errors else []
    if not recording.states:
        return inside
    return [
        *inside,
        Check("recorded verdicts", tuple(_verdict_faults(recording, judged))),
        Check("recorded states", tuple(_state_faults(recording, judged))),
    ]


def _verdict_faults(recording: Recording, judged: Judged) -> list[str]:
    """Every recorded verdict must be a chapter of the replay, begun at the same time."""
    parts = zip(recording.supervisions, judged.parts, strict=True)
    return [fault for supervision, chapters in parts for fault in _unlike(supervision, chapters)]


def _unlike(supervision: Supervision, chapters: Sequence[Chapter]) -> list[str]:
    known: dict[int, list[Chapter]] = {}
    for chapter in chapters:
        known.setdefault(chapter.since_ns, []).append(chapter)
    faults = []
    # What was before the recording is not known: neither the verdict then in force, nor what was held for a while.
    heard = chapters[1:] if supervision.begun_late else chapters
    first_ns = heard[0].since_ns if heard else 0
    for _log_ns, verdict in supervision.verdicts:
        since_ns = verdict.since_ns + supervision.ahead_ns
        said = Chapter(since_ns, verdict.level, verdict.causes, verdict.latched, verdict.event, verdict.text)
        if since_ns < first_ns or any(said.same_as(chapter) for chapter in known.get(since_ns, ())):
            continue
        again = [chapter for chapter in chapters if chapter.since_ns <= since_ns]
        now = str(again[-1]) if again else "nothing"
        sample = f"sample stamped {verdict.stamp_ns / S:.6f}"
        faults.append(f"verdict {verdict.sequence} at {sample}: recorded {said}, judged again {now}")
    return faults


def _state_faults(recording: Recording, judged: Judged) -> list[str]:
    faults = []
    states = [(number, state) for number, one in enumerate(recording.supervisions) for state in one.states]
    for number, state in states:
        again = judged.levels.get((number, state.sequence))
        if again is not None and again != (state.level, state.causes):
            recorded = f"{state.level.name} ({cause_names(state.causes) or 'no cause'})"
            now = f"{again[0].name} ({cause_names(again[1]) or 'no cause'})"
            faults.append(
                f"sample {state.sequence} stamped {state.stamp_ns / S:.6f}: recorded {recorded}, judged again {now}"
            )
    return faults


def against_story(recording: Recording, judged: Judged, story: Story) -> list[Check]:
    """The levels of a run and its measures against an expectation file. Times count from the first joint state."""
    if story.draft:
        fault = 'this is a draft, written by a program: a person has to read it and delete its line "draft"'
        return [Check("expected story", (fault,))]
    checks = []
    if story.levels is not None:
        checks.append(Check("expected story", tuple(_level_faults(recording, judged, story.levels))))
    if story.measures:
        checks.append(Check("expected measures", tuple(_measure_faults(recording, judged, story))))
    return checks


def _level_faults(recording: Recording, judged: Judged, expected: Sequence[Expected]) -> list[str]:
    told = levels_of(judged.chapters)
    wanted = _without_missing(expected, told)
    faults = []
    if len(told) != len(wanted):
        names = (", ".join(entry.level.name for entry in entries) for entries in (wanted, told))
        faults.append("expected {}; found {}".format(*names))
    for number, (want, have) in enumerate(zip(wanted, told, strict=False), 1):
        since_s, (low, high) = (have.since_ns - recording.begin_ns) / S, want.since_s
        if have.level != want.level:
            faults.append(f"chapter {number} at {since_s:.3f} s is {have.level.name}, expected {want.level.name}")
        elif have.causes & want.causes != want.causes:
            causes = cause_names(want.causes)
            faults.append(f"chapter {number} has {cause_names(have.causes)}, expected {causes} among them")
        elif not low <= since_s <= high:
            faults.append(f"chapter {number} ({have.level.name}) begins at {since_s:.3f} s, expected {low} to {high} s")
    return faults


def _without_missing(expected: Sequence[Expected], told: Sequence[Told]) -> list[Expected]:
    """The expected levels, less those that may be missing and are."""
    found: list[Expected] = []
    for want in expected:
        here = told[len(found)].level if len(found) < len(told) else None
        if not want.optional or want.level == here:
            found.append(want)
    return found


def _measure_faults(recording: Recording, judged: Judged, story: Story) -> list[str]:
    found = measures_of(recording, judged, story)
    return [
        f"{name} is {found[name]:.4g}, expected {low:g} to {high:g}: {MEASURES[name]}"
        for name, (low, high) in story.measures.items()
        if not low <= found[name] <= high
    ]
