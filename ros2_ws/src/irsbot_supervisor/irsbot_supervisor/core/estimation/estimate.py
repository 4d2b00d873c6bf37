"""What is known of the joints after a sample."""

from __future__ import annotations

from typing import NamedTuple

from irsbot_msgs_py.records import Floats


class Speeds(NamedTuple):
    """Largest possible speeds of the joints, rad/s or m/s, not negative: forward and backward."""

    forward: Floats
    backward: Floats


class Silence(NamedTuple):
    """Where the joints may have been between two samples that are farther apart than the braking path reaches."""

    low: Floats  # rad or m
    high: Floats


class Estimate(NamedTuple):
    """Where the joints are, how fast they may move, and when the next sample will have been judged."""

    stamp_ns: int
    received_ns: int
    seen_ns: int
    position: Floats  # rad or m, as measured
    velocity: Floats  # rad/s or m/s: as reported where positions allow it, else from positions; NaN if neither is known
    effort: Floats  # N m or N; empty when not measured
    speeds: Speeds  # certain
    degraded: str = ""  # empty, or which statement about the message is not true
    ahead_s: float = 0.0  # s that the robot goes on unseen: the age of the sample, and until the next has been judged
    expected_s: float = 0.0  # s of these until the next sample has come and been judged
    steady_s: float = 0.0  # s for which samples have come without a silence; infinite if there was none
    standing_s: float = 0.0  # s for which no joint has moved faster than the standstill speed
    branch_lost: str = ""  # empty, or why nobody knows the branch from this sample on
    silence: Silence | None = None  # what has to be free of Type 2 if the branch is to be known still
    in_time_s: float | None = None  # where samples have come late: `ahead_s` if they came as they are sent now
