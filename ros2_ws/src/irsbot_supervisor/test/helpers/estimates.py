"""Estimates of an estimator: samples in, and what is asked of the answers."""

from __future__ import annotations

import numpy as np
from supervised import settings_of

from irsbot_msgs_py.records import Cause
from irsbot_supervisor.core.estimation.estimate import Estimate
from irsbot_supervisor.core.estimation.estimator import Estimator
from irsbot_supervisor.core.validation import Accepted, Rejected

BEGIN_NS = 10**15
BRAKE = 400.0  # rad/s2, shipped
SPEED = 12.0  # rad/s, shipped
STALE_MS, LATENCY_MS, HEARTBEAT_MS = 50, 10, 10  # shipped


def estimator(robot: str = "irsbot2", **changes) -> Estimator:
    settings, machine = settings_of(robot, **changes)
    return Estimator(settings, machine.mechanism.joints)


def accepted(ms: float, position, velocity=(0.0, 0.0), *, age_ms: float = 0.0, seen_ms: float | None = None):
    """A sample stamped at `ms`; it arrives age_ms later, on the steady clock at `seen_ms` if that is given."""
    stamp_ns = BEGIN_NS + round(ms * 1e6)
    seen_ns = round(((ms + age_ms) if seen_ms is None else seen_ms) * 1e6) + 10**9
    return Accepted(stamp_ns, stamp_ns + round(age_ms * 1e6), seen_ns, tuple(position), tuple(velocity), ())


def watch(filter_: Estimator, samples) -> list[Estimate | Rejected]:
    return [filter_.update(one) for one in samples]


def good(answer: Estimate | Rejected) -> Estimate:
    assert isinstance(answer, Estimate), f"rejected: {answer}"
    return answer


def implausible(answer: Estimate | Rejected) -> bool:
    return isinstance(answer, Rejected) and answer.cause == Cause.IMPLAUSIBLE and not answer.harmless


def moving(rates, stated, begin_ms=0, end_ms=50, start=(0.0, 1.0), period_ms=1.0):
    """Samples of joints at constant rates, rad/s, that report other ones."""
    times = np.arange(begin_ms, end_ms, period_ms)
    return [
        accepted(t, [q + r * (t - begin_ms) / 1e3 for q, r in zip(start, rates, strict=True)], stated) for t in times
    ]


def holds(estimate: Estimate, *rates: float) -> bool:
    """Whether the bounds hold these rates."""
    joints = zip(rates, estimate.speeds.forward, estimate.speeds.backward, strict=True)
    return all(-down - 1e-9 <= rate <= up + 1e-9 for rate, up, down in joints)
