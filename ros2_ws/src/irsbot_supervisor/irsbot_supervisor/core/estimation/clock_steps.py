"""Detects clocks that are set while the robot moves.

The receiver's ROS clock and its steady clock are read together when a sample arrives. So a step of the ROS clock is the
difference of both clocks between two arrivals, however late the samples are. A sender with its own clock can set that
clock: then the stamps show a silence, or go back, although samples have come all the time.
"""

from __future__ import annotations

from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.core.estimation.estimate import Estimate
from irsbot_supervisor.core.validation import Accepted

STEP_S = 0.001
"""s: two clocks that are read one after the other differ by less, unless one of them was set; simulated time may run up
to twice as fast as real time at 1 kHz."""


def passed_s(sample: Accepted, last: Estimate) -> float:
    """s between two arrivals, steady clock."""
    return (sample.seen_ns - last.seen_ns) / NS_PER_S


def step_ns(sample: Accepted, last: Estimate) -> int:
    """ns by which the receiver's ROS clock, and with it the stamps, was set forward between two arrivals; 0 if it was
    not."""
    step = (sample.received_ns - last.received_ns) - (sample.seen_ns - last.seen_ns)
    return step if STEP_S * NS_PER_S < step < sample.stamp_ns - last.stamp_ns else 0


def stamped_s(sample: Accepted, last: Estimate) -> float:
    """s between two stamps."""
    return (sample.stamp_ns - last.stamp_ns) / NS_PER_S


def was_set(stamped: float, passed: float, silence_s: float) -> bool:
    """True if the sender's clock was set: stamps go back, or show a silence that did not happen."""
    return stamped <= 0.0 or stamped > silence_s >= passed
