"""Events that enter a supervisor, and the result of each."""

from __future__ import annotations

from typing import NamedTuple

from irsbot_msgs_py.records import (
    Bypass,
    JointSample,
    LateBrakes,
    Level,
    Reset,
    Restart,
    SingularityState,
    Tick,
    Verdict,
)
from irsbot_supervisor.core.latch import Judgement
from irsbot_supervisor.core.settings import Settings


class Configure(NamedTuple):
    """New settings come into force. They were checked where they entered (`settings_from`) and are not checked
    again."""

    received_ns: int
    seen_ns: int
    settings: Settings


Event = JointSample | Tick | LateBrakes | Restart | Reset | Bypass | Configure


class Step(NamedTuple):
    """Result of an event; a part is None if there is nothing to publish."""

    state: SingularityState | None
    verdict: Verdict | None  # due now: a transition, or the heartbeat
    refusal: str = ""  # why a reset or a bypass was refused
    transitions: tuple[Judgement, ...] = ()  # every judgement that came into force, in order
    found: tuple[Level, int] | None = None  # of a sample: level and causes of its own findings
