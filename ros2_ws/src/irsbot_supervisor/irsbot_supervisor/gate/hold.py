"""The hold: one point at which a moving robot comes to rest, for controllers that follow trajectories.

Such a controller (JointTrajectoryController of ros2_control) connects its present state and the point by a cubic. It
does so when the message arrives, at a time that is not known exactly: the point must be suitable for every arrival
time.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, sqrt
from typing import NamedTuple

from irsbot_msgs_py.records import Floats


class Hold(NamedTuple):
    """Positions in which the joints come to rest (rad or m, robot order), and the time from the message to rest (s)."""

    after_s: float
    position: Floats


def hold(
    position: Sequence[float],
    velocity: Sequence[float],
    deceleration: Sequence[float],
    age_s: float,
    latency_s: float,
    shortest_s: float,
) -> Hold:
    """The soonest rest for which no joint has to brake harder than it can, or to turn round.

    position, velocity: as measured `age_s` ago; the joints have gone on like that. deceleration: of each joint, > 0.
    latency_s: longest from now until the controller has the point. shortest_s: a controller's steps fit into it.

    From rate v a cubic takes a share u = way / (v T) of the way that v would take in its time T. It brakes from
    (4 - 6u) v/T to (6u - 2) v/T. A message that comes c after now leaves u = 1/2 + (L/2 - c)/T of a way v (T + L)/2, so
    that u is within 1/2 +- L/(2T) for every c in 0..L, and nothing exceeds (1 + 3L/T) v/T. With t = v/d this is within
    d if T^2 - t T - 3 L t >= 0. Both ends brake, and nothing turns round, if T >= 3 L.
    """
    rates = [rate if isfinite(rate) else 0.0 for rate in velocity]
    stops = [abs(rate) / limit for rate, limit in zip(rates, deceleration, strict=True)]
    after_s = max(3.0 * latency_s, shortest_s, *(0.5 * (t + sqrt(t * t + 12.0 * latency_s * t)) for t in stops))
    prediction_delay_s = max(age_s, 0.0) + 0.5 * (after_s + latency_s)
    return Hold(after_s, tuple(q + rate * prediction_delay_s for q, rate in zip(position, rates, strict=True)))
