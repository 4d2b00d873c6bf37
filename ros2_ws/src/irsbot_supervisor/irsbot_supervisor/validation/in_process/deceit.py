"""Samples of a motion for a supervisor: positions and stamps within their errors, and arbitrary velocities."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from irsbot_msgs_py.records import JointSample
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.validation.harness.oracle import Array, stamp_jitter_s
from irsbot_supervisor.validation.in_process.hostile import DrivenMotion

BEGIN_NS = 10**15
"""ns: ROS time of time 0; the steady clock shows one second then."""

APART_S = 1e-6
"""s between the arrivals of two samples of a burst."""

LAG_S = 0.008
"""s: delay of filtered or late velocities."""

NOISE = 0.5
"""1: relative standard deviation of a noisy velocity; no noise at rest."""

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
"""Kinds of false velocities; `held`: they keep their values from the begin of the attack."""

ERRORS = ("rounded", "white", "worst")
"""Errors of positions and stamps: encoder steps without jitter, random within their bounds, or chosen to hide an
attack."""


class Timing(NamedTuple):
    """Timing of samples."""

    period_s: float
    burst: int  # samples that arrive together, with the last of them
    age_s: float  # of the last one of a burst on arrival

    def arrival_s(self, k: int, warm: int) -> float:
        """s at which sample k arrives; sample `warm` is taken at time 0."""
        first = k // self.burst * self.burst
        return (first + self.burst - 1 - warm) * self.period_s + self.age_s + (k - first) * APART_S


class Deceit(NamedTuple):
    """Errors of the samples. All numbers are drawn beforehand, so that a run can be repeated up to its attack."""

    lie: str  # of LIES
    errors: str  # of ERRORS
    offset: Array  # (n,) -1..1: of the encoders' zeros, constant
    white: Array  # (N, n) -1..1
    jitter: Array  # (N,) -1..1
    gauss: Array  # (N, n)

    @staticmethod
    def drawn(lie: str, errors: str, samples: int, joints: int, rng: np.random.Generator) -> Deceit:
        """Random numbers for this number of samples and joints."""
        offset = rng.uniform(-1.0, 1.0, joints)
        white, gauss = rng.uniform(-1.0, 1.0, (samples, joints)), rng.standard_normal((samples, joints))
        return Deceit(lie, errors, offset, white, rng.uniform(-1.0, 1.0, samples), gauss)


class Attack(NamedTuple):
    """Time and direction in which the joints are let loose; it determines the errors that hide it best."""

    begin_s: float
    signs: Array  # (n,) -1, 0, 1


def told(
    driven: DrivenMotion,
    attack: Attack,
    deceit: Deceit,
    timing: Timing,
    settings: Settings,
    warm: int,
    first: int,
    last: int,
) -> list[JointSample]:
    """Samples first..last - 1 of a motion; sample `warm` is taken at time 0."""
    rows, k = slice(first, last), np.arange(first, last)
    times: Array = np.asarray((k - warm) * timing.period_s, dtype=np.float64)
    position, speed = driven.at(times)
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
    velocity = _velocities(driven, attack, deceit, times, speed, rows)
    stamps = BEGIN_NS + np.round((times + late) * NS_PER_S).astype(np.int64)
    samples = []
    for i, (stamp, q, v) in enumerate(zip(stamps.tolist(), position.tolist(), velocity.tolist(), strict=True)):
        arrival_ns = round(timing.arrival_s(first + i, warm) * NS_PER_S)
        stated = () if deceit.lie == "missing" else tuple(v)
        samples.append(
            JointSample(stamp, BEGIN_NS + arrival_ns, NS_PER_S + arrival_ns, settings.joint_names, tuple(q), stated)
        )
    return samples


def _velocities(driven: DrivenMotion, attack: Attack, deceit: Deceit, times: Array, speed: Array, rows: slice) -> Array:
    lie = deceit.lie
    if lie == "filtered":
        return _filtered(driven, times)
    if lie == "late":
        return driven.at(times - LAG_S)[1]
    if lie == "held":
        return driven.at(np.minimum(times, attack.begin_s))[1]
    if lie == "noisy":
        return np.asarray(speed * (1.0 + NOISE * deceit.gauss[rows]))
    bent = speed * {"zero": 0.0, "halved": 0.5, "doubled": 2.0, "reversed": -1.0}.get(lie, 1.0)
    if lie == "one not a number":
        bent[:, 0] = np.nan
    return np.asarray(bent)


def _filtered(driven: DrivenMotion, times: Array) -> Array:
    """Velocities through a first-order filter: the weighted mean over the past, by the middle of many short
    intervals."""
    ages = (np.arange(40) + 0.5) * (5.0 * LAG_S / 40)
    weights = np.exp(-ages / LAG_S)
    _, speeds = driven.at((times[:, None] - ages).ravel())
    return np.asarray(np.einsum("a,kan->kn", weights / weights.sum(), speeds.reshape(len(times), len(ages), -1)))
