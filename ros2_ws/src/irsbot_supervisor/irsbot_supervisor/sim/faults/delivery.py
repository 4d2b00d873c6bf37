"""Faults of delivery and time. The first line of each docstring is its manual."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field

from irsbot_msgs_py.records import JointSample
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.sim.faults.base import Fault, Sent, setting

LAST_STAMP_NS = (2**31 - 1) * 10**9
"""A stamp counts seconds in 32 bits."""

FARTHEST_S = 4e9
"""s: more than the whole range of stamps."""


@dataclass
class Drop(Fault):
    """Samples are not sent."""

    def act(self, sent: Sent, since_s: float) -> Iterable[Sent]:
        return ()


@dataclass
class Loss(Fault):
    """Samples get lost at random."""

    share: float = setting(0.05, "share of the samples", 0.0, 1.0)

    def act(self, sent: Sent, since_s: float) -> Iterable[Sent]:
        return () if self.random.random() < self.share else (sent,)


@dataclass
class Reorder(Fault):
    """Two samples in a row change places."""

    held: Sent | None = field(default=None, init=False)

    def act(self, sent: Sent, since_s: float) -> Iterable[Sent]:
        if self.held is None:
            self.held = sent
            return ()
        before, self.held = self.held, None
        return (sent, before)

    def spare(self, sent: Sent) -> Iterable[Sent]:
        before, self.held = self.held, None
        return (sent, before) if before is not None else (sent,)


@dataclass
class Latency(Fault):
    """Samples arrive late."""

    by: float = setting(0.02, "s", 0.0, 60.0)
    queue: deque[Sent] = field(default_factory=deque, init=False)

    def act(self, sent: Sent, since_s: float) -> Iterable[Sent]:
        self.queue.append(sent)
        return self._due(sent.sample.seen_ns - round(self.by * NS_PER_S))

    def spare(self, sent: Sent) -> Iterable[Sent]:
        late = self._due(sent.sample.seen_ns - round(self.by * NS_PER_S))
        return (*late, sent)

    def _due(self, until_ns: int) -> list[Sent]:
        due = []
        while self.queue and self.queue[0].sample.seen_ns <= until_ns:
            due.append(self.queue.popleft())
        return due


@dataclass
class Flood(Fault):
    """Every sample is sent many times, with stamps between the last one and its own."""

    times: int = setting(5, "messages instead of one", 1, 1000)
    last_ns: int = field(default=0, init=False)

    def act(self, sent: Sent, since_s: float) -> Iterable[Sent]:
        sample = sent.sample
        gap = sample.stamp_ns - self.last_ns if self.last_ns else 0
        self.last_ns = sample.stamp_ns
        early = range(self.times - 1, -1, -1)
        return [sent._replace(sample=sample._replace(stamp_ns=sample.stamp_ns - gap * k // self.times)) for k in early]


@dataclass
class SecondPublisher(Fault):
    """A second source publishes the same joints, somewhere else."""

    by: float = setting(0.1, "rad or m away")

    def act(self, sent: Sent, since_s: float) -> Iterable[Sent]:
        return (
            sent,
            Sent(sent.sample._replace(position=tuple(q + self.by for q in sent.sample.position)), publisher=1),
        )


@dataclass
class StampShift(Fault):
    """Stamps lie in the future or the past."""

    by: float = setting(1.0, "s, negative: in the past", -FARTHEST_S, FARTHEST_S)

    def rewrite(self, sample: JointSample, since_s: float) -> JointSample:
        shifted = sample.stamp_ns + round(self.by * NS_PER_S)
        return sample._replace(stamp_ns=max(-LAST_STAMP_NS, min(shifted, LAST_STAMP_NS)))


@dataclass
class StampZero(Fault):
    """Stamps are zero."""

    def rewrite(self, sample: JointSample, since_s: float) -> JointSample:
        return sample._replace(stamp_ns=0)


@dataclass
class StampRepeated(Fault):
    """Stamps stay what they were when the fault began."""

    stamp_ns: int | None = field(default=None, init=False)

    def rewrite(self, sample: JointSample, since_s: float) -> JointSample:
        if self.stamp_ns is None:
            self.stamp_ns = sample.stamp_ns
        return sample._replace(stamp_ns=self.stamp_ns)


@dataclass
class StampSwapped(Fault):
    """Two samples in a row arrive together, each with the stamp of the other."""

    held: Sent | None = field(default=None, init=False)

    def act(self, sent: Sent, since_s: float) -> Iterable[Sent]:
        if self.held is None:
            self.held = sent
            return ()
        before, self.held = self.held, None
        first = before._replace(sample=before.sample._replace(stamp_ns=sent.sample.stamp_ns))
        return (first, sent._replace(sample=sent.sample._replace(stamp_ns=before.sample.stamp_ns)))

    def spare(self, sent: Sent) -> Iterable[Sent]:
        before, self.held = self.held, None
        return (before, sent) if before is not None else (sent,)
