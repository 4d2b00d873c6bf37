"""What a supervisor is told of a motion: positions and stamps within their errors, velocities that are no promise."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from irsbot_msgs_py.records import JointSample
from irsbot_supervisor.campaign.hostile import Course
from irsbot_supervisor.campaign.truth import Array, stamp_jitter_s
from irsbot_supervisor.core.intake import S
from irsbot_supervisor.core.settings import Settings

BEGIN_NS = 10**15
"""ns: ROS time of time 0; the steady clock shows one second plus what has passed."""

APART_S = 1e-6
"""s between the arrivals of two samples of a burst."""

LAG_S = 0.008
"""s by which filtered or late velocities lag behind."""

NOISE = 0.5
"""1: share of itself by which a noisy velocity is off, one standard deviation. It is quiet at rest."""

LIES = (
    "right",
    "zero",
    "halved",
    "doubled",
    "reversed",
    "filtered",
    "late",
    "missing",
    "noisy",
    "one not a number",
    "held",
)
"""What the velocities of the messages are; `held`: they stay what they were when the attack began."""

ERRORS = ("rounded", "white", "worst")
"""Errors of positions and stamps: encoder steps and no jitter, random in their bounds, or chosen to hide an attack."""


class Timing(NamedTuple):
    """How samples come."""

    period_s: float
    burst: int  # samples that arrive together, with the last of them
    age_s: float  # of the last one of a burst on arrival

    def arrival_s(self, k: int, warm: int) -> float:
        """s at which sample k arrives; sample `warm` is taken at time 0."""
        first = k // self.burst * self.burst
        return (first + self.burst - 1 - warm) * self.period_s + self.age_s + (k - first) * APART_S


class Deceit(NamedTuple):
    """How the truth is bent. All numbers are drawn before, so that a run can be repeated up to its attack."""

    lie: str  # of LIES
    errors: str  # of ERRORS
    offset: Array  # (n,) -1..1: of the encoders' zeros, constant
    white: Array  # (N, n) -1..1
    jitter: Array  # (N,) -1..1
    gauss: Array  # (N, n)

    @staticmethod
    def drawn(lie: str, errors: str, samples: int, joints: int, rng: np.random.Generator) -> Deceit:
        """Random numbers for so many samples of so many joints."""
        offset = rng.uniform(-1.0, 1.0, joints)
        white, gauss = rng.uniform(-1.0, 1.0, (samples, joints)), rng.standard_normal((samples, joints))
        return Deceit(lie, errors, offset, white, rng.uniform(-1.0, 1.0, samples), gauss)


class Attack(NamedTuple):
    """When and whereto the joints are let loose; what hides it best is known to who does it."""

    begin_s: float
    signs: Array  # (n,) -1, 0, 1


def told(
    course: Course, attack: Attack, deceit: Deceit, timing: Timing, settings: Settings, warm: int, first: int, last: int
) -> list[JointSample]:
    """Samples first..last - 1 of a motion; sample `warm` is taken at time 0."""
    rows, k = slice(first, last), np.arange(first, last)
    times: Array = np.asarray((k - warm) * timing.period_s, dtype=np.float64)
    position, speed = course.at(times)
    after = times > attack.begin_s
    step, tau = settings.encoder_resolution, stamp_jitter_s(settings)
    position = position + deceit.offset * settings.encoder_offset
    if deceit.errors == "rounded":
        late: Array = np.zeros(len(k))
        position = np.round(position / step) * step if step > 0.0 else position
    elif deceit.errors == "white":
        late = tau * deceit.jitter[rows]
        position = position + 0.5 * step * deceit.white[rows]
    else:  # ahead before it begins and behind afterwards: the way looks shorter, and by the stamps it took longer
        late = np.where(after, tau, -tau)
        position = position - 0.5 * step * np.where(after, 1.0, -1.0)[:, None] * attack.signs
    velocity = _velocities(course, attack, deceit, times, speed, rows)
    stamps = BEGIN_NS + np.round((times + late) * S).astype(np.int64)
    samples = []
    for i, (stamp, q, v) in enumerate(zip(stamps.tolist(), position.tolist(), velocity.tolist(), strict=True)):
        arrival_ns = round(timing.arrival_s(first + i, warm) * S)
        said = () if deceit.lie == "missing" else tuple(v)
        samples.append(JointSample(stamp, BEGIN_NS + arrival_ns, S + arrival_ns, settings.joint_names, tuple(q), said))
    return samples


def _velocities(course: Course, attack: Attack, deceit: Deceit, times: Array, speed: Array, rows: slice) -> Array:
    lie = deceit.lie
    if lie == "filtered":
        return _filtered(course, times)
    if lie == "late":
        return course.at(times - LAG_S)[1]
    if lie == "held":
        return course.at(np.minimum(times, attack.begin_s))[1]
    if lie == "noisy":
        return np.asarray(speed * (1.0 + NOISE * deceit.gauss[rows]))
    bent = speed * {"zero": 0.0, "halved": 0.5, "doubled": 2.0, "reversed": -1.0}.get(lie, 1.0)
    if lie == "one not a number":
        bent[:, 0] = np.nan
    return np.asarray(bent)


def _filtered(course: Course, times: Array) -> Array:
    """Through a filter of first order: the weighted mean over what was, by the middle of many short spells."""
    ages = (np.arange(40) + 0.5) * (5.0 * LAG_S / 40)
    weights = np.exp(-ages / LAG_S)
    _, speeds = course.at((times[:, None] - ages).ravel())
    return np.asarray(np.einsum("a,kan->kn", weights / weights.sum(), speeds.reshape(len(times), len(ages), -1)))
