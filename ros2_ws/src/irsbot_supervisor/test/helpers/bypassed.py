"""A stopped robot whose operator may bypass the cause."""

from __future__ import annotations

from supervised import at_ns, feed, joints_of, resting, sample, supervisor_of, tick

from irsbot_msgs_py.records import Bypass, Cause, Floats, Level, Verdict
from irsbot_supervisor.core.supervisor import Supervisor

BEYOND = 0.6, -1.0273
"""m: the Type 1 margin of the IRSBot-2 is 0.1496 here, the stop limit 0.15; the Type 2 margin is 0.182."""


ALONE = {"type2_warn": 0.02, "type2_stop": 0.01, "constraint_warn": 0.002, "constraint_stop": 0.001}
"""So that Type 1 is the only cause there."""

SHARE = 0.05
"""Shipped recovery_share."""


def stopped(**changes: object) -> tuple[Supervisor, Floats]:
    """A supervisor of a robot that stands beyond the Type 1 limit since -400 ms, and where it stands."""
    supervisor = supervisor_of(**{**ALONE, **changes})
    joints = joints_of(supervisor, *BEYOND)
    feed(supervisor, resting(-400, 0, joints))
    now = verdict(supervisor, 0)
    assert (now.level, now.causes, now.event) == (Level.STOP, Cause.TYPE1 | Cause.LATCHED, 1)
    return supervisor, joints


def verdict(supervisor: Supervisor, ms: float) -> Verdict:
    """What is in force at a time: the next heartbeat says it."""
    found = supervisor.step(tick(ms)).verdict
    return found if found is not None else supervisor._verdict(at_ns(ms)[1])


def bypass(ms: float, **changes: object) -> Bypass:
    wish = Bypass(*at_ns(ms), 1, int(Cause.TYPE1), 10.0, "Ada", "free the gripper")
    return wish._replace(**changes)


def run(supervisor: Supervisor, begin: int, end: int, joints: Floats) -> None:
    feed(supervisor, resting(begin, end, joints))


def leave(supervisor: Supervisor, begin: int, number: int) -> Floats:
    """So many samples of a slow way from there to where no limit is near; where it ends."""
    start, end = (joints_of(supervisor, BEYOND[0], y) for y in (BEYOND[1], -0.96))
    rates = [(b - a) * 1e3 / number for a, b in zip(start, end, strict=True)]
    for k in range(number):
        at = tuple(a + k * 1e-3 * rate for a, rate in zip(start, rates, strict=True))
        supervisor.step(sample(begin + k, at, rates))
    return at
