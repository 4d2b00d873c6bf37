"""Summary of a recorded run: times of the judged sample, of the STOP and of standstill, and the smallest margins."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite
from typing import NamedTuple

from irsbot_msgs_py.records import Cause, Level, SingularityState
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.bag.journal import Configuration
from irsbot_supervisor.core.margins import MARGIN_CAUSES, MARGIN_NAMES, MARGIN_TEXTS
from irsbot_supervisor.replay.judged import SILENCE_NS
from irsbot_supervisor.replay.recording import Recording


@dataclass(frozen=True)
class ExpectedOutcome:
    """The verdict that is expected of a run."""

    stop: bool
    causes: Cause = Cause.NONE
    """Possible causes of the stop; NONE: any."""
    unknown: bool | None = None
    """True if the level must become UNKNOWN during the work, False if it must not; None: only where a stop is expected
    it may."""


class Nearest(NamedTuple):
    """The smallest value of one margin during a run."""

    kind: Cause
    value: float
    stop_limit: float
    time_s: float  # since the first joint state

    def __str__(self) -> str:
        return f"{MARGIN_TEXTS[self.kind]} {self.value:.4f} at {self.time_s:.3f} s, stop limit {self.stop_limit:.4f}"


class Outcome(NamedTuple):
    """Times in ns, ROS clock; None if the event did not happen."""

    begin_ns: int
    judged_ns: int | None  # stamp of the first sample that is judged STOP
    stopped_ns: int | None  # when the STOP verdict reached the recorder
    stood_ns: int | None  # stamp of the first sample of the standstill that followed
    stop_causes: int
    stop_text: str
    nearest: tuple[Nearest, ...]
    unknown_ns: int | None  # when the first UNKNOWN after work had begun reached the recorder
    unknown_text: str
    fault: str  # empty, or the difference from the expectation


def outcome(recording: Recording, expect: ExpectedOutcome) -> Outcome:
    """Times and margins of a run, compared with the expectation of its scenario."""
    settings = next((entry.values for entry in recording.journal if isinstance(entry, Configuration)), {})
    states = [state for state in recording.states if isfinite(state.type2_margin)]
    begin_ns = recording.begin_ns
    working = next((log for log, verdict in recording.verdicts if verdict.level < Level.STOP), inf)
    later = [(log, verdict) for log, verdict in recording.verdicts if log > working]
    stopped_ns, verdict = next((heard for heard in later if heard[1].level == Level.STOP), (None, None))
    unknown_ns, doubt = next((heard for heard in later if heard[1].level == Level.UNKNOWN), (None, None))
    judged = next((state for state in states if state.level == Level.STOP and state.stamp_ns > working), None)
    stood = _standstill(states, stopped_ns, float(settings.get("standstill_speed", 0.0)))
    found = Outcome(
        begin_ns,
        judged.stamp_ns if judged else None,
        stopped_ns,
        stood.stamp_ns if stood else None,
        verdict.causes & ~int(Cause.LATCHED) if verdict else 0,
        verdict.text if verdict else "",
        _nearest(states, settings, begin_ns),
        unknown_ns,
        doubt.text if doubt else "",
        "",
    )
    return found._replace(fault=_fault(found, expect, bool(states)))


def _standstill(states: list[SingularityState], after_ns: int | None, slow: float) -> SingularityState | None:
    """The first sample after the STOP at which all joints rest."""
    if after_ns is None:
        return None
    return next((s for s in states if s.stamp_ns >= after_ns and max(map(abs, s.joint_velocity)) <= slow), None)


class Span(NamedTuple):
    """A time with one verdict in force, ns, as the recorder received it. level: None after a silence that a consumer
    takes as a stop."""

    begin_ns: int
    end_ns: int
    level: Level | None


def spans_heard(recording: Recording, end_ns: int) -> list[Span]:
    """Verdicts that a consumer received from the first joint state until a time; empty if the bag has no verdicts."""
    heard = [(log, verdict.level) for log, verdict in recording.verdicts if log < end_ns]
    if not heard:
        return []
    late = heard[0][0] > recording.begin_ns + SILENCE_NS
    found = [Span(recording.begin_ns, heard[0][0], None if late else heard[0][1])]
    for (log_ns, level), (next_ns, _level) in zip(heard, [*heard[1:], (end_ns, None)], strict=True):
        silent_ns = min(log_ns + SILENCE_NS, next_ns)
        for span in (Span(log_ns, silent_ns, level), Span(silent_ns, next_ns, None)):
            if span.end_ns > max(span.begin_ns, recording.begin_ns):
                if span.level == found[-1].level:
                    found[-1] = found[-1]._replace(end_ns=span.end_ns)
                else:
                    found.append(span._replace(begin_ns=max(span.begin_ns, recording.begin_ns)))
    return [span for span in found if span.end_ns > span.begin_ns]


def _nearest(states: list[SingularityState], settings: dict[str, object], begin_ns: int) -> tuple[Nearest, ...]:
    found = []
    for kind, name in zip(MARGIN_CAUSES, MARGIN_NAMES, strict=True):
        values = [(margin_of(state, kind), state.stamp_ns) for state in states]
        value, stamp_ns = min(values, default=(inf, begin_ns))
        if isfinite(value):
            limit = settings.get(f"{name}_stop", 0.0)
            found.append(Nearest(kind, value, float(str(limit)), (stamp_ns - begin_ns) / NS_PER_S))
    return tuple(found)


def margin_of(state: SingularityState, kind: Cause) -> float:
    """One of the four margins of a state; infinite if the robot does not have it."""
    if kind == Cause.TYPE1:
        return min(state.type1_margin)
    if kind == Cause.TYPE2:
        return state.type2_margin
    if kind == Cause.CONSTRAINT:
        return state.constraint_margin if isfinite(state.constraint_margin) else inf
    return min(state.limb_margin, default=inf)


def _fault(found: Outcome, expect: ExpectedOutcome, any_state: bool) -> str:
    if not any_state:
        return "the supervisor never judged a posture"
    beyond = [nearest for nearest in found.nearest if not nearest.value >= nearest.stop_limit]
    if not expect.stop and found.stopped_ns is not None:
        return f"a stop was called although the scenario expects none: {found.stop_text}"
    allowed = expect.stop if expect.unknown is None else expect.unknown
    if found.unknown_ns is not None and not allowed:
        return f"the state of the robot was UNKNOWN although the scenario does not expect it: {found.unknown_text}"
    if found.unknown_ns is None and expect.unknown:
        return "the state of the robot was never UNKNOWN although the scenario expects it"
    if not expect.stop:
        return ""
    if found.stopped_ns is None:
        return "the robot was not stopped"
    if expect.causes and not found.stop_causes & expect.causes:
        return f"the stop has another cause than expected: {found.stop_text}"
    if found.stood_ns is None:
        return "the robot did not come to a standstill"
    if beyond:
        return f"the robot got too near: {beyond[0]}"
    return ""
