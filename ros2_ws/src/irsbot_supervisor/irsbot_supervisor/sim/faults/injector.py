"""Applies faults to a stream of samples."""

from __future__ import annotations

from collections.abc import Sequence
from random import Random

from irsbot_kinematics import Mechanism
from irsbot_msgs_py.records import JointSample
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.sim.faults.base import Fault, Sent


class FaultInjector:
    """Applies the faults of a line to a stream of samples. Times are the caller's: steady nanoseconds."""

    def __init__(self, faults: Sequence[Fault], mechanism: Mechanism, seed: int = 0) -> None:
        self._faults = tuple(faults)
        self._begun_ns: int | None = None
        random = Random(seed)
        for fault in self._faults:
            fault.begin(mechanism, random)

    def send(self, sample: JointSample) -> tuple[Sent, ...]:
        """Samples that are delivered at `sample.seen_ns`, in this order; late samples have the time of their
        delivery."""
        if not self._faults:
            return (Sent(sample),)
        if self._begun_ns is None:
            self._begun_ns = sample.seen_ns
        elapsed_s = (sample.seen_ns - self._begun_ns) / NS_PER_S
        stream: list[Sent] = [Sent(sample)]
        for fault in self._faults:
            stream = [out for sent in stream for out in fault.strike(sent, elapsed_s)]
        received, seen = sample.received_ns, sample.seen_ns
        return tuple(s._replace(sample=s.sample._replace(received_ns=received, seen_ns=seen)) for s in stream)
