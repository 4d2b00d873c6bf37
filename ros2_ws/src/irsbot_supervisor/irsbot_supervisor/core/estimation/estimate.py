"""State of the joints after a sample."""

from __future__ import annotations

from typing import NamedTuple

from irsbot_msgs_py.records import Floats


class Speeds(NamedTuple):
    """Largest possible speeds of the joints, rad/s or m/s, not negative: forward and backward."""

    forward: Floats
    backward: Floats


class Silence(NamedTuple):
    """Region in which the joints may have been between two samples whose stopping prediction does not show that no Type
    2 singularity was met: it covers less time, or may contain one."""

    low: Floats  # rad or m
    high: Floats
    fault: str = ""  # empty, or why the joints cannot have moved as they did
    in_time: bool = False  # True if the prediction covers the time
    fast: bool = False  # True if a robot that a stop should hold is faster than recovery speed


class Estimate(NamedTuple):
    """Positions of the joints, bounds of their speeds, and the latest time at which the next sample is judged."""

    stamp_ns: int
    received_ns: int
    seen_ns: int
    position: Floats  # rad or m, as measured
    velocity: Floats  # rad/s or m/s: as reported where positions allow it, else from positions; NaN if neither is known
    effort: Floats  # N m or N; empty when not measured
    speeds: Speeds  # certified bounds
    prediction_delay_s: float  # s, without latency: age of the sample, and time until the next is judged
    expected_s: float  # s: the part until the next sample has come and is judged
    steady_s: float  # s for which samples have come without a silence; infinite if there was none
    standing_s: float  # s for which no joint has moved faster than the standstill speed
    judging_s: float  # s: the part of `expected_s` for judging
    degraded: str = ""  # empty, or which statement about the message is not true
    branch_lost: str = ""  # empty, or why the branch is unknown from this sample on
    silence: Silence | None = None  # region that must be free of Type 2 for the branch to be known
    in_time_s: float | None = None  # if samples have come late: `prediction_delay_s` if they came as they are sent now
