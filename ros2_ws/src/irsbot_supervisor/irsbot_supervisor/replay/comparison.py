"""Comparison of a replay with the recorded verdicts, and with the expectation of a person."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from irsbot_msgs_py.records import cause_names
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.replay.expectation import MEASURES, Expectation, Expected, LevelSpan, levels_of, measures_of
from irsbot_supervisor.replay.judged import Interval, Judged
from irsbot_supervisor.replay.recording import Recording, SupervisorSession


class Check(NamedTuple):
    """One check: its name and its fault (empty: none)."""

    name: str
    faults: tuple[str, ...]


def against_recording(recording: Recording, judged: Judged) -> list[Check]:
    """Compare recorded verdicts and states with those judged again; also internal errors. Faults name the sample,
    earliest first."""
    inside = [Check("errors inside", tuple(judged.errors))] if judged.errors else []
    if not recording.states:
        return inside
    return [
        *inside,
        Check("recorded verdicts", tuple(_verdict_faults(recording, judged))),
        Check("recorded states", tuple(_state_faults(recording, judged))),
    ]


def _verdict_faults(recording: Recording, judged: Judged) -> list[str]:
    """Every recorded verdict must be an interval of the replay with the same begin."""
    parts = zip(recording.sessions, judged.parts, strict=True)
    return [fault for session, intervals in parts for fault in _unlike(session, intervals)]


def _unlike(session: SupervisorSession, intervals: Sequence[Interval]) -> list[str]:
    known: dict[int, list[Interval]] = {}
    for interval in intervals:
        known.setdefault(interval.since_ns, []).append(interval)
    faults = []
    # Neither the verdict in force before the recording nor the held findings are known.
    heard = intervals[1:] if session.begun_late else intervals
    first_ns = heard[0].since_ns if heard else 0
    for _log_ns, verdict in session.verdicts:
        since_ns = verdict.since_ns + session.ahead_ns
        stated = Interval(since_ns, verdict.level, verdict.causes, verdict.latched, verdict.event, verdict.text)
        if since_ns < first_ns or any(stated.same_as(interval) for interval in known.get(since_ns, ())):
            continue
        again = [interval for interval in intervals if interval.since_ns <= since_ns]
        now = str(again[-1]) if again else "nothing"
        sample = f"sample stamped {verdict.stamp_ns / NS_PER_S:.6f}"
        faults.append(f"verdict {verdict.sequence} at {sample}: recorded {stated}, judged again {now}")
    return faults


def _state_faults(recording: Recording, judged: Judged) -> list[str]:
    faults = []
    states = [(number, state) for number, one in enumerate(recording.sessions) for state in one.states]
    for number, state in states:
        again = judged.levels.get((number, state.sequence))
        if again is not None and again != (state.level, state.causes):
            recorded = f"{state.level.name} ({cause_names(state.causes) or 'no cause'})"
            now = f"{again[0].name} ({cause_names(again[1]) or 'no cause'})"
            stamped = f"sample {state.sequence} stamped {state.stamp_ns / NS_PER_S:.6f}"
            faults.append(f"{stamped}: recorded {recorded}, judged again {now}")
    return faults


def against_expectation(recording: Recording, judged: Judged, expectation: Expectation) -> list[Check]:
    """Compare the levels of a run and its measures with an expectation file. Times count from the first joint state."""
    if expectation.draft:
        fault = 'this is a draft, written by a program: a person has to read it and delete its line "draft"'
        return [Check("expected story", (fault,))]
    checks = []
    if expectation.levels is not None:
        checks.append(Check("expected story", tuple(_level_faults(recording, judged, expectation.levels))))
    if expectation.measures:
        checks.append(Check("expected measures", tuple(_measure_faults(recording, judged, expectation))))
    return checks


def _level_faults(recording: Recording, judged: Judged, expected: Sequence[Expected]) -> list[str]:
    heard = levels_of(judged.intervals)
    wanted = _without_missing(expected, heard)
    faults = []
    if len(heard) != len(wanted):
        due, found = ", ".join(want.level.name for _, want in wanted), ", ".join(have.level.name for have in heard)
        faults.append(f"expected {due}; found {found}")
    for (number, want), have in zip(wanted, heard, strict=False):
        since_s, (low, high) = (have.since_ns - recording.begin_ns) / NS_PER_S, want.since_s
        if have.level != want.level:
            faults.append(f"story[{number}] at {since_s:.3f} s is {have.level.name}, expected {want.level.name}")
        elif have.causes & want.causes != want.causes:
            causes = cause_names(want.causes)
            faults.append(f"story[{number}] has {cause_names(have.causes)}, expected {causes} among them")
        elif not low <= since_s <= high:
            faults.append(f"story[{number}] ({have.level.name}) begins at {since_s:.3f} s, expected {low} to {high} s")
    return faults


def _without_missing(expected: Sequence[Expected], heard: Sequence[LevelSpan]) -> list[tuple[int, Expected]]:
    """The expected levels with their numbers in the story, without the optional ones that are missing."""
    found: list[tuple[int, Expected]] = []
    for number, want in enumerate(expected):
        here = heard[len(found)].level if len(found) < len(heard) else None
        if not want.optional or want.level == here:
            found.append((number, want))
    return found


def _measure_faults(recording: Recording, judged: Judged, expectation: Expectation) -> list[str]:
    found = measures_of(recording, judged, expectation)
    return [
        f"{name} is {found[name]:.4g}, expected {low:g} to {high:g}: {MEASURES[name]}"
        for name, (low, high) in expectation.measures.items()
        if not low <= found[name] <= high
    ]
