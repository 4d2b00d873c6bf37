"""All settings of the supervision in one frozen object, declared once with unit, range and meaning."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from sys import float_info
from typing import Any

from irsbot_kinematics import Robot
from irsbot_supervisor.core.margins import MARGIN_NAMES

LEAST_LIMIT = 1e-3
"""1: least value of a limit. A limit of 0 would accept a margin of 0, which is singular; as a bound, 0 means that
nothing is proved."""


OVERSPEED = 1.25
"""1: if a joint seems this much faster than its limit between two samples, the reading is wrong."""


UNTRUSTED = 1e4
"""rad/s or m/s: a tolerance this large means that reported velocities are not used."""


UNLIMITED = 1e6
"""rad or m: a limit this large means no limit."""

BOXES_WITHOUT_CUTS = 3
"""1: a sample without cuts takes no longer than so many boxes: the reachable box, a wider one, and all else of the
step."""


class InvalidSettings(ValueError):
    """Settings that cannot be used; the message names every fault with its values."""


def _number(default: float, unit: str, text: str, low: float, high: float) -> Any:
    return field(default=default, metadata={"unit": unit, "text": text, "low": low, "high": high})


def _each_joint(unit: str, text: str, low: float, high: float, *, optional: bool = False) -> Any:
    metadata = {"unit": unit, "text": text, "low": low, "high": high, "each_joint": True, "optional": optional}
    return field(default=(), metadata=metadata)


def _word(default: str, text: str, words: tuple[str, ...] = (), on: str = "") -> Any:
    """on: the word for `on`, which YAML reads as a boolean."""
    metadata = {"unit": "", "text": text, "words": words, "on": on, "read_only": bool(on) or not words}
    return field(default=default, metadata=metadata)


@dataclass(frozen=True)
class Settings:
    """Limits and timing of one supervised robot. Field metadata: unit, text, low, high, read_only, each_joint.

    Margins are numbers without unit, and limits lie in 0..1. No margin may reach `*_stop`; the supervisor warns below
    `*_warn`.
    """

    robot: str = _word("irsbot2", "preset name or YAML file of the robot")
    joint_names: tuple[str, ...] = field(
        default=(), metadata={"unit": "", "text": "names in JointState, robot order", "read_only": True}
    )
    working_mode: tuple[int, ...] = field(
        default=(), metadata={"unit": "", "text": "sign per leg; empty: the usual mode", "read_only": True}
    )
    assembly_mode: int = field(default=0, metadata={"unit": "", "text": "label; 0: the usual mode", "read_only": True})
    type1_warn: float = _number(
        0.25, "1", "warn below this Type 1 margin (a leg near straight or folded)", LEAST_LIMIT, 1.0
    )
    type1_stop: float = _number(0.15, "1", "stop before a Type 1 margin falls to this", LEAST_LIMIT, 1.0)
    type2_warn: float = _number(0.25, "1", "warn below this Type 2 margin (cos of a pressure angle)", LEAST_LIMIT, 1.0)
    type2_stop: float = _number(0.15, "1", "stop before the Type 2 margin falls to this", LEAST_LIMIT, 1.0)
    constraint_warn: float = _number(0.05, "1", "warn below this constraint margin", LEAST_LIMIT, 1.0)
    constraint_stop: float = _number(0.03, "1", "stop before the constraint margin falls to this", LEAST_LIMIT, 1.0)
    limb_warn: float = _number(0.25, "1", "warn below this limb margin", LEAST_LIMIT, 1.0)
    limb_stop: float = _number(0.15, "1", "stop before a limb margin falls to this", LEAST_LIMIT, 1.0)
    hysteresis: float = _number(0.05, "1", "a warning ends when the margin is this share above its limit", 0.0, 1.0)
    dwell_s: float = _number(0.05, "s", "a level falls only after it has been lower for this long", 0.0, 10.0)
    velocity_limit: tuple[float, ...] = _each_joint("rad/s or m/s", "largest speed of each joint", 1e-6, 1e4)
    acceleration_limit: tuple[float, ...] = _each_joint(
        "rad/s2 or m/s2",
        "largest acceleration of each joint; empty: as deceleration_limit, as it is at the start of a node",
        1e-6,
        1e6,
        optional=True,
    )
    deceleration_limit: tuple[float, ...] = _each_joint(
        "rad/s2 or m/s2", "least deceleration of each joint when braking", 1e-6, 1e6
    )
    position_lower: tuple[float, ...] = _each_joint(
        "rad or m",
        "lowest position of each joint, whose reading then may not wrap; -1e6: no limit",
        -UNLIMITED,
        UNLIMITED,
        optional=True,
    )
    position_upper: tuple[float, ...] = _each_joint(
        "rad or m",
        "highest position of each joint, whose reading then may not wrap; 1e6: no limit",
        -UNLIMITED,
        UNLIMITED,
        optional=True,
    )
    velocity_tolerance: tuple[float, ...] = _each_joint(
        "rad/s or m/s", "largest error of reported velocities; 10000: not used", 0.0, UNTRUSTED, optional=True
    )
    latency_s: float = _number(0.01, "s", "longest time from the arrival of a sample to the first braking", 0.0, 1.0)
    stamp_jitter_s: float = _number(5e-5, "s", "largest error of a stamp: stamp minus time of reading", 0.0, 0.1)
    recovery_share: float = _number(0.05, "1", "share of the velocity limits for motion away from a stop", 1e-3, 0.5)
    command_timeout_s: float = _number(
        0.1, "s", "time for which a velocity command through the gate is valid", 1e-3, 1.0
    )
    stale_s: float = _number(0.05, "s", "longest time without a good sample; then UNKNOWN", 0.001, 10.0)
    sample_gap_s: float = _number(
        0.0, "s", "interval between samples that is always expected, at least judging_s; 0: as learned", 0.0, 10.0
    )
    judging_s: float = _number(
        0.0,
        "s",
        "longest time to judge a sample; at least the interval between samples, or 5 ms if that is less, counts",
        0.0,
        1.0,
    )
    bounding_s: float = _number(
        0.0,
        "s",
        "time of a sample per box, 3 + 2 for each cut; cuts are those that fit in judging_s. 0: all",
        0.0,
        0.1,
    )
    heartbeat_s: float = _number(0.01, "s", "time after which a verdict is repeated", 0.001, 0.02)
    age_limit_s: float = _number(0.05, "s", "oldest acceptable stamp on arrival", 0.001, 10.0)
    future_limit_s: float = _number(0.02, "s", "how far ahead of our clock a stamp may be", 0.0, 10.0)
    standstill_speed: float = _number(0.02, "rad/s or m/s", "a joint below this speed stands", 0.0, 10.0)
    encoder_resolution: float = _number(
        1e-5, "rad or m", "smallest step, and largest noise, of a joint position", 0.0, 0.1
    )
    encoder_offset: float = _number(0.0, "rad or m", "largest error of a joint's zero", 0.0, 0.1)
    geometry_tolerance_m: float = _number(0.0, "m", "largest error of a leg's length and place", 0.0, 0.1)
    load_force_n: float = _number(10.0, "N", "largest force on the platform, in addition to the payload", 0.0, 1e6)
    payload_kg: float = _number(0.0, "kg", "mass of platform and payload; its weight adds to the load", 0.0, 1e4)
    gravity_m_s2: float = _number(9.80665, "m/s2", "gravity acting on the payload", 0.0, 100.0)
    load_moment_nm: float = _number(0.0, "N m", "moment on the platform", 0.0, 1e6)
    platform_acceleration_m_s2: float = _number(
        0.0, "m/s2", "largest acceleration of the platform, braking included", 0.0, 1e4
    )
    compliance: str = _word(
        "none", "whether bending under load counts as an error of the geometry", ("none", "counted"), on="counted"
    )
    tubes: str = _word("none", "elastic design of the robot, preset or YAML file; none: not known")
    compliance_slack_m: float = _number(
        0.0, "m", "error of a leg's length and place by bending; 0: from the tubes", 0.0, 0.1
    )
    reaction_check: str = _word("none", "reaction to a leg force above its limit", ("none", "warn", "stop"))
    reaction_limit_n: float = _number(1000.0, "N", "largest admissible leg force", 0.0, 1e9)

    @property
    def slack_m(self) -> float:
        """m: error of lengths and places of a leg, for certified bounds: `slack_m` of `Mechanism.certified_bounds`."""
        return self.geometry_tolerance_m + (self.compliance_slack_m if self.compliance == "counted" else 0.0)

    @property
    def least_gap_s(self) -> float:
        """s: interval between samples that is always expected: while a sample is judged, the next one waits."""
        return max(self.sample_gap_s, self.judging_s)

    def has_time_for(self, cuts: int) -> bool:
        """True if a sample with so many cuts is judged in `judging_s`."""
        return is_time_for(cuts, self.bounding_s, self.judging_s)

    @property
    def config_hash(self) -> str:
        """Equal for equal settings; part of every verdict."""
        return hashlib.sha256(json.dumps(asdict(self), sort_keys=True).encode()).hexdigest()[:16]


def time_for_cuts(bounding_s: float, cuts: int) -> float:
    """s: longest time to judge a sample with so many cuts, each of two boxes. bounding_s: its part for each box."""
    return (BOXES_WITHOUT_CUTS + 2 * cuts) * bounding_s


def is_time_for(cuts: int, bounding_s: float, time_s: float) -> bool:
    """True if a sample with so many cuts is judged in `time_s`."""
    return time_for_cuts(bounding_s, cuts) <= time_s * (1.0 + 1e-9)  # the last digits of decimal fractions differ


def completed(values: Mapping[str, Any], robot: Robot) -> Settings:
    """Settings from a mapping (YAML, parameters, journal), completed for a robot and checked one by one. `feasible`
    also checks whether the robot can be stopped in time.

    Empty names and modes become those of the robot; one limit for all joints is repeated. Raises InvalidSettings.
    """
    known = {entry.name: entry for entry in fields(Settings)}
    if unknown := sorted(set(values) - set(known), key=str):
        raise InvalidSettings(f"unknown setting '{unknown[0]}'; known are {', '.join(known)}")
    n = len(robot.mechanism.joints)
    given: dict[str, Any] = {}
    for name, value in values.items():
        given[name] = _read(value, known[name].metadata, n)
    usual = {
        "joint_names": tuple(joint.name for joint in robot.mechanism.joints),
        "working_mode": robot.mechanism.usual_working_mode,
        "assembly_mode": robot.mechanism.usual_assembly_mode,
        "acceleration_limit": given.get("deceleration_limit", ()),
        "velocity_tolerance": (UNTRUSTED,) * n,
        "position_lower": (-UNLIMITED,) * n,
        "position_upper": (UNLIMITED,) * n,
    }
    given.update({name: value for name, value in usual.items() if _is_open(given.get(name))})
    settings = Settings(**given)
    if faults := _single_faults(settings, n) or _cross_faults(settings, robot):
        raise InvalidSettings("; ".join(faults))
    return settings


def refuse_other_robot(now: Settings, then: Settings) -> None:
    """Raises InvalidSettings if a read-only setting changes: it says which robot is supervised."""
    for entry in fields(Settings):
        was, would_be = getattr(now, entry.name), getattr(then, entry.name)
        if entry.metadata.get("read_only") and was != would_be:
            raise InvalidSettings(f"{entry.name} is {was!r} and cannot become {would_be!r} while supervising")


def _is_open(value: Any) -> bool:
    """True if a value is left to the robot or to another setting: nothing, an empty list, or the number 0."""
    return value is None or value == () or (type(value) is int and value == 0)


def _read(value: Any, metadata: Mapping[str, Any], n: int) -> Any:
    """A value in the form of the settings: tuples, floats, one per joint. Invalid values are returned unchanged for the
    check."""
    value = _without_numpy(value)
    if metadata.get("words") and (value is False or value == "off"):
        return "none"  # as recorded bags and files of users say it; YAML reads the bare word `off` as a boolean
    if metadata.get("on") and (value is True or value == "on"):
        return metadata["on"]
    each = tuple(value) if isinstance(value, (list, tuple)) else (value,)
    if "low" in metadata:
        each = tuple(float(number) if _is_number(number) else number for number in each)
    if metadata.get("each_joint"):
        return each * n if len(each) == 1 else each
    return each if isinstance(value, (list, tuple)) else each[0]


def _without_numpy(value: Any) -> Any:
    """A number, a text or a list of them as Python has them."""
    plain = value.tolist() if hasattr(value, "tolist") else value
    return [_without_numpy(one) for one in plain] if isinstance(plain, (list, tuple)) else plain


def _single_faults(settings: Settings, n: int) -> list[str]:
    faults = []
    for entry in fields(settings):
        value = getattr(settings, entry.name)
        each = value if isinstance(value, tuple) else (value,)
        words, low, high, unit = (entry.metadata.get(key) for key in ("words", "low", "high", "unit"))
        if entry.metadata.get("optional") and value == ():
            continue
        if entry.metadata.get("each_joint") and len(each) != n:
            faults.append(f"{entry.name} has {len(each)} values, must have {n}, one per joint")
        elif isinstance(value, tuple) != isinstance(entry.default, tuple):
            faults.append(f"{entry.name} is {value!r}, must be {'a list' if entry.default == () else 'one value'}")
        elif words and value not in words:
            faults.append(f"{entry.name} is {value!r}, must be one of {', '.join(words)}")
        elif low is not None:
            wrong = [number for number in each if not (_is_number(number) and low <= number <= high)]
            stated = dict.fromkeys(map(repr, wrong))  # a fault that all joints share is reported once
            faults += [
                f"{entry.name} is {number}, must be in {low:g}..{high:g}{'' if unit == '1' else f' {unit}'}"
                for number in stated
            ]
        else:
            kind = int if entry.name.endswith("_mode") else str
            wrong = [item for item in each if not isinstance(item, kind)]
            faults += [f"{entry.name} holds {item!r}, must be {kind.__name__}" for item in wrong]
    return faults


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= float_info.max


def _cross_faults(settings: Settings, robot: Robot) -> list[str]:
    faults = []
    for kind in MARGIN_NAMES:
        warn, stop = getattr(settings, f"{kind}_warn"), getattr(settings, f"{kind}_stop")
        if not warn >= stop:
            faults.append(f"{kind}_warn ({warn!r}) must be at least {kind}_stop ({stop!r})")
    if not settings.heartbeat_s <= settings.stale_s:
        faults.append(f"heartbeat_s ({settings.heartbeat_s!r}) must not exceed stale_s ({settings.stale_s!r})")
    faults += [
        f"{name} ({getattr(settings, name)!r}) must not exceed stale_s ({settings.stale_s!r})"
        for name in ("sample_gap_s", "judging_s")
        if not getattr(settings, name) <= settings.stale_s
    ]
    if not settings.has_time_for(0):
        boxes = f"{BOXES_WITHOUT_CUTS} times bounding_s ({settings.bounding_s!r}): a sample takes that without cuts"
        faults.append(f"judging_s ({settings.judging_s!r}) must be at least {boxes}")
    if not all(low < high for low, high in zip(settings.position_lower, settings.position_upper, strict=True)):
        faults.append(
            f"position_lower {settings.position_lower} must be below position_upper {settings.position_upper}"
        )
    names = settings.joint_names
    if len(names) != len(robot.mechanism.joints) or len(set(names)) != len(names):
        faults.append(f"joint_names {list(names)} must be {len(robot.mechanism.joints)} different names")
    if settings.working_mode not in robot.mechanism.working_modes:
        faults.append(f"working_mode {settings.working_mode} must be one of {robot.mechanism.working_modes}")
    if settings.assembly_mode not in robot.mechanism.assembly_modes:
        faults.append(f"assembly_mode {settings.assembly_mode} must be one of {robot.mechanism.assembly_modes}")
    return faults
