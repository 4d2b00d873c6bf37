"""One fault on one robot at work: how long motion stays allowed, and when it is allowed again."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from irsbot_supervisor.campaign.line import PERIOD_NS, ROBOTS, WARM_UP, Line
from irsbot_supervisor.campaign.rows import FALSE_STOPS, RECOVERY_S, TO_STOP_S, Job, Row, Tally
from irsbot_supervisor.core.intake import S

RECOVERY_LIMIT_S = 0.5
"""s after a fault in which motion must be allowed again."""

Fault = tuple[str, str]
"""What was unsafe, and what failed; empty for nothing."""


def take_turns(name: str, job: Job, kinds: Sequence[Callable[[Case], Fault]]) -> Row:
    """A row of several kinds of cases, as many of each, spread over the robots and over what each kind can be."""
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
    """One line, what has been seen to go wrong on it, and how far in the range of its kind it lies (0..1)."""

    def __init__(self, name: str, share: float, rng: np.random.Generator, tally: Tally) -> None:
        self.line, self.share, self.rng, self.tally = Line(name, rng), share, rng, tally
        settings = self.line.settings
        self.limit_ns = round((settings.stale_s + settings.heartbeat_s) * S)
        self.unsafe = ""
        self.stopped = False
        """Motion was forbidden at some time while watching."""

    def watch(self, blind_ns: int) -> None:
        """Look at the verdict after a period. blind_ns: when what is delivered last was true (steady clock)."""
        line = self.line
        late_ns = line.now_ns - blind_ns
        if not line.moves:
            if not self.stopped:
                self.tally.largest(TO_STOP_S, late_ns / S)
            self.stopped = True
        elif late_ns > self.limit_ns:
            self.unsafe = self.unsafe or f"{line.level.name} {late_ns / S:.3f} s after the last true sample"

    def recovered(self) -> str:
        """Good samples again: why motion is not allowed in time, or empty. What is latched is reset at standstill."""
        line, begin_ns = self.line, self.line.now_ns
        for _ in range(round(RECOVERY_LIMIT_S * S / PERIOD_NS)):
            if line.moves:
                break
            line.run(1)
            if line.verdict is not None and line.verdict.latched and not line.standing:
                line.standing = True
                line.run(WARM_UP)
                begin_ns = line.now_ns
                if refusal := line.reset():
                    return f"a reset is refused: {refusal}"
        self.tally.largest(RECOVERY_S, (line.now_ns - begin_ns) / S)
        return "" if line.moves else f"still {line.level.name} after {RECOVERY_LIMIT_S} s"
