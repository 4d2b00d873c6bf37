"""What a recorded run came to: when the limit was crossed, when STOP came, when the robot stood, how near it got."""

from __future__ import annotations

from math import inf, isfinite
from typing import NamedTuple

from irsbot_msgs_py.records import Cause, Configure, Level, SingularityState
from irsbot_supervisor.core.intake import S
from irsbot_supervisor.core.policy import KINDS, WORDS
from irsbot_supervisor.replay import Recording
from irsbot_supervisor.sim.scenarios import Expectation

NAMES = ("type1", "type2", "constraint", "limb")
"""How the settings call the margins, in the order of `policy.KINDS`."""


class Nearest(NamedTuple):
    """The smallest value of one margin during a run."""

    kind: Cause
    value: float
    stop_limit: float
    time_s: float  # since the first sample

    def __str__(self) -> str:
        return f"{WORDS[self.kind]} {self.value:.4f} at {self.time_s:.3f} s, stop limit {self.stop_limit:.4f}"


class Outcome(NamedTuple):
    """Times in ns, ROS clock; None where it did not happen."""

    begin_ns: int
    crossed_ns: int | None  # stamp of the first sample from which braking would end beyond a stop limit
    stopped_ns: int | None  # when the STOP verdict reached the recorder
    stood_ns: int | None  # stamp of the first sample of the standstill that followed
    stop_causes: int
    stop_text: str
    nearest: tuple[Nearest, ...]
    false_stop: bool  # a STOP or UNKNOWN after work had begun
    fault: str  # empty, or what was not as expected


def outcome(recording: Recording, expect: Expectation) -> Outcome:
    """Times and margins of a run, held against what its scenario expects."""
    settings = next((entry.values for entry in recording.journal if isinstance(entry, Configure)), {})
    states = [state for state in recording.states if isfinite(state.type2_margin)]
    begin_ns = recording.samples[0].stamp_ns
    working = next((log for log, verdict in recording.verdicts if verdict.level < Level.STOP), None)
    halts = [
        (log, v) for log, v in recording.verdicts if working is not None and log > working and v.level > Level.WARN
    ]
    stops = [(log, verdict) for log, verdict in halts if verdict.level == Level.STOP]
    stopped_ns, verdict = stops[0] if stops else (None, None)
    crossed = next((state for state in states if state.level == Level.STOP), None)
    stood = _standstill(states, stopped_ns, float(settings.get("standstill_speed", 0.0)))
    found = Outcome(
        begin_ns,
        crossed.stamp_ns if crossed else None,
        stopped_ns,
        stood.stamp_ns if stood else None,
        verdict.causes & ~int(Cause.LATCHED) if verdict else 0,
        verdict.text if verdict else "",
        _nearest(states, settings, begin_ns),
        bool(halts),
        "",
    )
    return found._replace(fault=_fault(found, expect, bool(states)))


def _standstill(states: list[SingularityState], after_ns: int | None, slow: float) -> SingularityState | None:
    """The first sample of the last rest: all later ones are slow too."""
    rest = None
    for state in reversed(states):
        if after_ns is None or state.stamp_ns < after_ns or max(map(abs, state.joint_velocity)) > slow:
            break
        rest = state
    return rest


def _nearest(states: list[SingularityState], settings: dict[str, object], begin_ns: int) -> tuple[Nearest, ...]:
    found = []
    for kind, name in zip(KINDS, NAMES, strict=True):
        values = [(margin_of(state, kind), state.stamp_ns) for state in states]
        value, stamp_ns = min(values, default=(inf, begin_ns))
        if isfinite(value):
            limit = settings.get(f"{name}_stop", 0.0)
            found.append(Nearest(kind, value, float(str(limit)), (stamp_ns - begin_ns) / S))
    return tuple(found)


def margin_of(state: SingularityState, kind: Cause) -> float:
    """One of the four margins of a state; infinite where the robot has none."""
    if kind == Cause.TYPE1:
        return min(state.type1_margin)
    if kind == Cause.TYPE2:
        return state.type2_margin
    if kind == Cause.CONSTRAINT:
        return state.constraint_margin if isfinite(state.constraint_margin) else inf
    return min(state.limb_margin, default=inf)


def _fault(found: Outcome, expect: Expectation, any_state: bool) -> str:
    if not any_state:
        return "the supervisor never judged a posture"
    beyond = [nearest for nearest in found.nearest if not nearest.value >= nearest.stop_limit]
    if not expect.stop:
        return "a stop was called although the run is free of singularities" if found.false_stop else ""
    if found.stopped_ns is None:
        return "the robot was not stopped"
    if expect.causes and not found.stop_causes & expect.causes:
        return f"the stop has another cause than expected: {found.stop_text}"
    if found.stood_ns is None:
        return "the robot did not come to a standstill"
    if beyond:
        return f"the robot got too near: {beyond[0]}"
    return ""
