"""Base of all faults: when a fault acts, its settings, and its effect on a sample."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from math import inf
from random import Random
from typing import Any, NamedTuple

from irsbot_kinematics import Mechanism
from irsbot_msgs_py.records import JointSample

FOR_EVER = 10**18
"""Samples: more than any stream has."""


class Sent(NamedTuple):
    """A sample in transit, and its publisher: 0, or 1 for a second one."""

    sample: JointSample
    publisher: int = 0


class Setting(NamedTuple):
    """A setting of a fault, as error messages and the manual need it."""

    text: str
    low: float = -inf
    high: float = inf
    words: tuple[str, ...] = ()
    whole: bool = False


def setting(default: Any, text: str, low: float = -inf, high: float = inf, words: tuple[str, ...] = ()) -> Any:
    """A field of a fault that a user can set; the range includes its ends."""
    rule = Setting(text, low, high, words, whole=isinstance(default, int))
    return field(default=default, metadata={"setting": rule}, kw_only=True)


@dataclass
class Fault:
    """One fault: when it acts, and in subclasses its effect on the samples."""

    at: float = setting(0.0, "s after the line was given", 0.0)
    lasting: float = setting(inf, "s", 0.0)
    count: int = setting(FOR_EVER, "samples", 1)
    every: int = setting(1, "only each n-th sample", 1)

    def begin(self, mechanism: Mechanism, random: Random) -> None:
        """Called once before the first sample."""
        self.mechanism, self.random = mechanism, random
        self.acted = self.met = 0

    def strike(self, sent: Sent, elapsed_s: float) -> Iterable[Sent]:
        """A sample after the faults, `elapsed_s` after the line was set."""
        if not (self.at <= elapsed_s < self.at + self.lasting and self.acted < self.count):
            return self.spare(sent)
        self.met += 1
        if (self.met - 1) % self.every:
            return self.spare(sent)
        self.acted += 1
        return self.act(sent, elapsed_s - self.at)

    def act(self, sent: Sent, since_s: float) -> Iterable[Sent]:
        """Apply the fault to a sample, `since_s` after it began."""
        return (sent._replace(sample=self.rewrite(sent.sample, since_s)),)

    def rewrite(self, sample: JointSample, since_s: float) -> JointSample:
        """The same for faults that only change a sample."""
        raise NotImplementedError

    def spare(self, sent: Sent) -> Iterable[Sent]:
        """Pass a sample that the fault does not change."""
        return (sent,)
