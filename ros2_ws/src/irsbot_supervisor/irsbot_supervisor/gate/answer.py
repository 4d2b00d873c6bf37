"""The answers of the command gate and their wording; no other module puts them into words."""

from __future__ import annotations

from typing import NamedTuple

from irsbot_msgs_py.gate_status import GateOutcome, GateReason
from irsbot_msgs_py.records import Cause
from irsbot_supervisor.core.margins import MARGIN_TEXTS

OUTCOMES = {
    GateOutcome.PASSED: "",
    GateOutcome.SLOWED: "slowed down to {share:.3g}",
    GateOutcome.LIMITED: "limited",
    GateOutcome.SHORTENED: "ends early",
    GateOutcome.HELD: "held",
}

REASONS = {
    GateReason.NONE: "as commanded",
    GateReason.INACTIVE: "the supervisor is not active",
    GateReason.NO_COMMAND: "no command, or none for command_timeout_s",
    GateReason.CANCELLED: "the goal was cancelled",
    GateReason.INVALID: "not a command of these joints",
    GateReason.UNKNOWN: "the state of the robot is not known",
    GateReason.STOP: "a stop came, and the robot has not been at rest since",
    GateReason.SPEED: "limits of speed and acceleration",
    GateReason.LIMIT: "",  # the cause names it
    GateReason.STOPPING: "the robot could not be stopped in time if it were faster",
    GateReason.JOINING: "it cannot be joined from the present speed within the joints' limits",
    GateReason.INTERNAL: "an error inside",
}

LIMITS = {**MARGIN_TEXTS, Cause.POSITION: "range of a joint", Cause.BRANCH: "another branch"}
"""Text for the limit that a command would cross, by cause."""


class Answer(NamedTuple):
    """Result of a command, and the reason."""

    outcome: GateOutcome
    reason: GateReason = GateReason.NONE
    cause: int = 0  # with LIMIT a Cause bit
    share: float = 0.0  # of the commanded speed that passes, 0..1
    detail: str = ""  # in place of the general words for the reason

    @property
    def text(self) -> str:
        """One sentence; empty if nothing was reduced."""
        if self.outcome == GateOutcome.PASSED:
            return ""
        outcome = OUTCOMES[self.outcome].format(share=self.share)
        why = self.detail or (LIMITS[Cause(self.cause)] if self.reason == GateReason.LIMIT else REASONS[self.reason])
        slower = self.outcome == GateOutcome.SHORTENED and self.share < 1.0
        return f"{outcome}: {why}" + (f"; {OUTCOMES[GateOutcome.SLOWED].format(share=self.share)}" if slower else "")


PASSED = Answer(GateOutcome.PASSED, share=1.0)


def held(reason: GateReason, detail: str = "", cause: int = 0) -> Answer:
    """The answer that nothing passes."""
    return Answer(GateOutcome.HELD, reason, cause, 0.0, detail)
