"""Clocks that are set while the robot moves.

Our ROS clock and the steady clock are read together when a sample arrives, so a step of the ROS clock is what one shows
more than the other between two arrivals, however late the samples are. A sender with a clock of its own can set that
one: then the stamps show a silence, or go back, although samples have come all the time.
"""

from __future__ import annotations

from irsbot_supervisor.core.estimation.estimate import Estimate
from irsbot_supervisor.core.intake import Accepted, S

STEP_S = 0.001
"""s: two clocks that are read one after the other differ by less, unless one of them was set; simulated time may run up
to twice as fast as real time at 1 kHz."""


def passed_s(sample: Accepted, last: Estimate) -> float:
    """s between two arrivals, steady clock."""
    return (sample.seen_ns - last.seen_ns) / S


def step_ns(sample: Accepted, last: Estimate) -> int:
    """ns by which our ROS clock, and with it the stamps, was set forward between two arrivals; 0 if it was not."""
    step = (sample.received_ns - last.received_ns) - (sample.seen_ns - last.seen_ns)
    return step if STEP_S * S < step < sample.stamp_ns - last.stamp_ns else 0


def stamped_s(sample: Accepted, last: Estimate) -> float:
    """s between two stamps."""
    return (sample.stamp_ns - last.stamp_ns) / S


def was_set(stamped: float, passed: float, silence_s: float) -> bool:
    """Whether the sender's clock was set: stamps go back, or show a silence in which there was none."""
    return stamped <= 0.0 or stamped > silence_s >= passed
