"""Proposes limits from the data of a machine: speed, brakes, latency, rate, encoders, forces.

docs/how_to/limits.md describes the method.
"""

from __future__ import annotations

from math import ceil, floor, inf, log10
from typing import Any, NamedTuple

from irsbot_kinematics import Mechanism, Robot
from irsbot_kinematics.mechanism import Floats
from irsbot_supervisor.configuration.feasibility import infeasibilities
from irsbot_supervisor.configuration.near_limits import NearLimit, near_limits
from irsbot_supervisor.configuration.stoppable_speed import postures
from irsbot_supervisor.configuration.stopping_cost import Cost, costs, free_time, prediction_delay
from irsbot_supervisor.configuration.stopping_room import Stopping, room_to_stop
from irsbot_supervisor.core.estimation.observer import excess
from irsbot_supervisor.core.margins import MARGIN_NAMES
from irsbot_supervisor.core.settings import LEAST_LIMIT, InvalidSettings, Settings, completed

SAFETY = 2.0
"""1: factor on the stated errors, for play and elasticity, which are not stated."""


LOST = 2
"""Number of consecutive samples whose loss must have no effect."""

LATE_S = 0.02
"""s: delay of an ordinary kernel and network that occurs now and then. A real-time system may set stale_s lower."""

HEARTBEAT_S = (0.002, 0.02)
"""s: shortest and longest proposed heartbeat; a shorter one only adds traffic, a longer one is too slow (50 Hz)."""

LEAST_HYSTERESIS = 0.02
"""1: with less hysteresis a warning flickers with the motion itself."""

LEAST_STANDSTILL = 1e-3
"""rad/s or m/s: motion of a standing joint by its control loop, also with perfect encoders."""


class Plant(NamedTuple):
    """Data of a machine in addition to its geometry."""

    speed: Floats  # rad/s or m/s, one per joint or one for all
    deceleration: Floats  # rad/s2 or m/s2
    latency_s: float  # from the arrival of a sample to the first braking
    rate_hz: float  # samples per second
    encoder_resolution: float  # rad or m
    encoder_offset: float  # rad or m
    geometry_tolerance_m: float
    force_ratio: float  # how many times the load a leg may carry
    acceleration: Floats = ()  # rad/s2 or m/s2; empty: as deceleration
    stamp_jitter_s: float = Settings.stamp_jitter_s  # by which a stamp differs from when positions were read
    judging_s: float = Settings.judging_s  # longest time to judge a sample, as stated
    bounding_s: float = Settings.bounding_s  # its part for one box, as stated


class Proposal(NamedTuple):
    """One setting, and the reason for its value. value: a number, or one per joint."""

    name: str
    value: Any
    why: str


class LimitProposal(NamedTuple):
    """Proposed settings, their reasons, and whether they are consistent."""

    proposals: list[Proposal]
    stopping: list[Stopping]
    together: float  # share of all velocity limits at once, in the worst combination, that could be stopped
    fault: str  # empty, or why the limits contradict each other
    costs: list[Cost]


def propose(robot: Robot, name: str, plant: Plant) -> LimitProposal:
    """Propose every setting for a machine, each with its reason.

    name: of the robot in the settings. Raises InvalidSettings for numbers outside their ranges. Limits that contradict
    each other are no error: `LimitProposal.fault` says so.
    """
    base, mechanism = _base(robot, name, plant), robot.mechanism
    tops = postures(base, mechanism).margins.max(axis=0, initial=-inf)
    ratio = plant.force_ratio
    forces = [
        top / ratio if kind == "constraint" else 1.0 / ratio for kind, top in zip(MARGIN_NAMES, tops, strict=True)
    ]
    ways = _heeding(base, plant)
    on = " and ".join(dict.fromkeys(f"{w:.3g} {joint.unit}" for w, joint in zip(ways, mechanism.joints, strict=True)))
    nears = near_limits(base, mechanism, forces, ways)
    proposals = _copied(base, plant)
    for kind, top, force, near in zip(MARGIN_NAMES, tops, forces, nears, strict=True):
        if 0.0 < top < inf:
            stop = _stop(kind, float(top), force, near, ratio)
            proposals += [stop, _warn(kind, stop.value, float(top), near.lost, on)]
    proposals += [*_times(base, mechanism, plant), _standstill(plant)]
    proposals.append(_hysteresis(base, plant, proposals, nears))
    settings = completed({"robot": name, **{one.name: one.value for one in proposals}}, robot)
    faults = infeasibilities(settings, mechanism)
    rows, together = room_to_stop(settings, mechanism, prediction_delay(settings, 1.0 / plant.rate_hz))
    return LimitProposal(proposals, rows, together, "; ".join(faults), costs(settings, mechanism, plant.rate_hz))


def _base(robot: Robot, name: str, plant: Plant) -> Settings:
    """Settings with the machine's numbers and the smallest limits."""
    for what, value, low, high in (
        ("rate", plant.rate_hz, 1.0, 20000.0),
        ("force ratio", plant.force_ratio, 1.01, 1.0 / LEAST_LIMIT),
    ):
        if not low <= value <= high:
            raise InvalidSettings(f"the {what} is {value!r}, must be in {low:g}..{high:g}")
    values: dict[str, Any] = {f"{kind}_{which}": LEAST_LIMIT for kind in MARGIN_NAMES for which in ("stop", "warn")}
    values |= {"velocity_limit": plant.speed, "deceleration_limit": plant.deceleration, "latency_s": plant.latency_s}
    values |= {"encoder_resolution": plant.encoder_resolution, "encoder_offset": plant.encoder_offset}
    values |= {"acceleration_limit": plant.acceleration, "stamp_jitter_s": plant.stamp_jitter_s}
    values |= {"judging_s": plant.judging_s, "bounding_s": plant.bounding_s}
    values["stale_s"] = max(Settings.stale_s, plant.judging_s)
    return completed({"robot": name, **values, "geometry_tolerance_m": plant.geometry_tolerance_m}, robot)


def _heeding(base: Settings, plant: Plant) -> Floats:
    """rad or m that the far end of what a joint can reach goes on after a warning is due, although it is heeded.

    The warning comes up to one period late, and brakes act after latency_s: V (1/rate + latency_s). While the joint
    brakes from V to V - u it goes u (2 V - u)/(2 d), but could speed up again. At V - u, which the observer takes for
    up to x more, it reaches (u - x)^2/(2 a) less than at V. The difference is largest at u = (a V + d x)/(a + d); from
    u = x + a T on the joint cannot get back to V any more, and what it can reach shrinks.
    """
    period_s = 1.0 / plant.rate_hz
    free_s = free_time(base, period_s)
    drives = zip(base.velocity_limit, base.acceleration_limit, base.deceleration_limit, strict=True)
    ways = []
    for (v, a, d), x in zip(drives, excess(base, period_s), strict=True):
        u = min((a * v + d * x) / (a + d), x + a * free_s, v)
        more = 0.5 * u * (2.0 * v - u) / d - 0.5 * max(u - x, 0.0) ** 2 / a
        ways.append(v * (period_s + base.latency_s) + more)
    return tuple(ways)


def _copied(base: Settings, plant: Plant) -> list[Proposal]:
    guessed = "as deceleration_limit, as none is given: a smaller measured value makes limits less strict"
    reasons = {
        "velocity_limit": "as given: the fastest motion for which stopping is computed",
        "acceleration_limit": "as given: no drive speeds a joint up harder" if plant.acceleration else guessed,
        "deceleration_limit": "as given: deceleration of every drive, loaded and warm, at any time",
        "latency_s": "as given: from the arrival of a sample to the first braking",
        "stamp_jitter_s": "as given: a position may have been read so much before or after its stamp",
        "encoder_resolution": "as given: half of it may be wrong in every position",
        "encoder_offset": "as given: error of a joint's zero",
        "geometry_tolerance_m": "as given: error of a leg's length and place",
    }
    if plant.judging_s > 0.0:
        reasons["judging_s"] = "as stated: longest time to judge a sample"
    if plant.bounding_s > 0.0:
        reasons["bounding_s"] = "as stated: the part of that time for each box, from which the number of cuts follows"
    return [Proposal(key, getattr(base, key), why) for key, why in reasons.items()]


def _stop(kind: str, top: float, force: float, near: NearLimit, ratio: float) -> Proposal:
    """The stop limit that forces allow, or that errors need."""
    need = SAFETY * near.error
    value = _up(max(force, need, LEAST_LIMIT))
    errors = f"encoder and geometry errors typically change it by {near.error:.2g} there"
    if need > force:
        return Proposal(f"{kind}_stop", value, f"{errors}, and {SAFETY:g} times that has to be left")
    reason = {
        "type1": f"at {force:.3g} a motor runs {ratio:.3g} times as fast as at best while the platform does not",
        "type2": f"at {force:.3g} a leg carries up to {ratio:.3g} times the force on the platform",
        "constraint": f"{force:.3g} is the largest, {top:.3g}, over {ratio:.3g}: rods carry that many times more there",
        "limb": f"at {force:.3g} the joints of a limb carry {ratio:.3g} times what they carry at best",
    }[kind]
    return Proposal(f"{kind}_stop", value, f"{reason}; {errors}")


def _warn(kind: str, stop: float, top: float, lost: float, on: str) -> Proposal:
    """The warning limit. The stopping distance is already included in STOP; the warning comes so much earlier that an
    operator can slow down. on: result of `_heeding`, as text."""
    half = max(0.5 * (top - stop), 0.0)
    why = f"if joints at full speed brake latency_s after the warning, their reach still goes on by {on}; the "
    why += f"margin loses {lost:.2g} on that: a robot that slows down at the warning is not stopped"
    if lost > half:
        why += f"; cut to half way from the stop limit to the largest value, {top:.3g}"
    return Proposal(f"{kind}_warn", _up(stop + min(lost, half)), why)


def _times(base: Settings, mechanism: Mechanism, plant: Plant) -> list[Proposal]:
    period_s = 1.0 / plant.rate_hz
    stale = _up(max((LOST + 2) * period_s + LATE_S, base.judging_s))
    ways = [f"{v * stale:.3g} {joint.unit}" for v, joint in zip(base.velocity_limit, mechanism.joints, strict=True)]
    unseen = " and ".join(dict.fromkeys(ways))
    spared = f"{LOST} lost samples, {period_s * 1e3:.3g} ms apart, and {LATE_S * 1e3:g} ms of delay go unpunished"
    heartbeat = min(max(plant.latency_s, HEARTBEAT_S[0]), HEARTBEAT_S[1])
    low, high = (1e3 * limit for limit in HEARTBEAT_S)
    return [
        Proposal("stale_s", stale, f"{spared}; joints at full speed go {unseen} unseen in that time"),
        Proposal("age_limit_s", stale, "as stale_s: an older sample is worth no more than silence"),
        Proposal(
            "heartbeat_s",
            heartbeat,
            f"as latency_s, within {low:g}..{high:g} ms: silence is noticed as fast as an order takes effect",
        ),
    ]


def _standstill(plant: Plant) -> Proposal:
    step = SAFETY * plant.encoder_resolution * plant.rate_hz
    why = f"a resting encoder that flickers by one step seems to move at up to {step:.3g}: {SAFETY:g} steps in a period"
    if step < LEAST_STANDSTILL:
        why += f"; not below {LEAST_STANDSTILL:g}, motion of a standing joint by its control loop"
    return Proposal("standstill_speed", min(_up(max(step, LEAST_STANDSTILL)), 10.0), why)


def _hysteresis(base: Settings, plant: Plant, proposals: list[Proposal], nears: list[NearLimit]) -> Proposal:
    """Noise of the margin at the end of the braking path, as a share of its warning limit: one encoder step in the
    position, and in the speed one step per period, whose share in the stop distance is latency_s + v/d."""
    warns = {one.name: one.value for one in proposals}
    step, worst = base.encoder_resolution, 0.0
    for kind, near in zip(MARGIN_NAMES, nears, strict=True):
        noise = sum(
            slope * step * (1.0 + plant.rate_hz * (base.latency_s + speed / brake))
            for slope, speed, brake in zip(near.steep, base.velocity_limit, base.deceleration_limit, strict=True)
        )
        worst = max(worst, SAFETY * noise / warns.get(f"{kind}_warn", inf))
    why = f"{SAFETY:g} times what one encoder step moves a warning limit by is {worst:.2g} of it"
    if worst < LEAST_HYSTERESIS:
        why += f"; not below {LEAST_HYSTERESIS:g}, or the warning flickers with the motion"
    return Proposal("hysteresis", min(_up(max(worst, LEAST_HYSTERESIS)), 1.0), why)


def _up(value: float) -> float:
    """Rounded up to two digits."""
    unit = 10.0 ** (floor(log10(value)) - 1)
    return float(f"{ceil(value / unit - 1e-9) * unit:.12g}")
