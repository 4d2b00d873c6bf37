"""One fault on one robot at work: how long motion stays allowed, and when it is allowed again."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.validation.harness.rows import FALSE_STOPS, RECOVERY_S, TO_STOP_S, Job, Row, Tally
from irsbot_supervisor.validation.harness.stream import PERIOD_NS, ROBOTS, WARM_UP, InputStream

RECOVERY_LIMIT_S = 0.5
"""s after a fault in which motion must be allowed again."""

Fault = tuple[str, str]
"""What was unsafe, and what failed; empty if nothing."""


def take_turns(name: str, job: Job, kinds: Sequence[Callable[[Case], Fault]]) -> Row:
    """A row of several kinds of cases, the same number of each, spread over the robots and over the range of each
    kind."""
    tally = Tally(name, job)
    tally.figures.update({FALSE_STOPS: 0.0, TO_STOP_S: 0.0, RECOVERY_S: 0.0})
    for k in range(job.amount):
        kind, turn = kinds[k % len(kinds)], k // len(kinds)
        share = (turn + 0.5) / -(-job.amount // len(kinds))
        robot = ROBOTS[turn % len(ROBOTS)]
        unsafe, failed = kind(Case(robot, share, np.random.default_rng([job.seed, k]), tally))
        where = f"{robot}, {kind.__name__} {share:.3f}"
        tally.case(unsafe and f"{where}: {unsafe}", failed and f"{where}: {failed}")
    return tally.row()


class Case:
    """One input stream, its faults so far, and the place of the case in the range of its kind (0..1)."""

    def __init__(self, name: str, share: float, rng: np.random.Generator, tally: Tally) -> None:
        self.stream, self.share, self.rng, self.tally = InputStream(name, rng), share, rng, tally
        settings = self.stream.settings
        self.limit_ns = round((settings.stale_s + settings.heartbeat_s) * NS_PER_S)
        self.unsafe = ""
        self.stopped = False
        """True if motion was forbidden at some time while watching."""

    def watch(self, blind_ns: int) -> None:
        """Examine the verdict after a period. blind_ns: time at which the last delivered data was true (steady
        clock)."""
        stream = self.stream
        late_ns = stream.now_ns - blind_ns
        if not stream.moves:
            if not self.stopped:
                self.tally.largest(TO_STOP_S, late_ns / NS_PER_S)
            self.stopped = True
        elif late_ns > self.limit_ns:
            self.unsafe = self.unsafe or f"{stream.level.name} {late_ns / NS_PER_S:.3f} s after the last true sample"

    def recovered(self) -> str:
        """Feed good samples again. Returns why motion is not allowed in time, or empty. A latched stop is reset at
        standstill."""
        stream, begin_ns = self.stream, self.stream.now_ns
        for _ in range(round(RECOVERY_LIMIT_S * NS_PER_S / PERIOD_NS)):
            if stream.moves:
                break
            stream.run(1)
            if stream.verdict is not None and stream.verdict.latched and not stream.standing:
                stream.standing = True
                stream.run(WARM_UP)
                begin_ns = stream.now_ns
                if refusal := stream.reset():
                    return f"a reset is refused: {refusal}"
        self.tally.largest(RECOVERY_S, (stream.now_ns - begin_ns) / NS_PER_S)
        return "" if stream.moves else f"still {stream.level.name} after {RECOVERY_LIMIT_S} s"
