"""Plain records of the messages between processes: immutable, comparable, free of ROS.

Times are integer nanoseconds. `seen_ns` is the steady clock of the receiver, `stamp_ns` the ROS time of the sender,
`received_ns` the ROS time of the receiver. Vectors are tuples in the configured joint or task order.
"""

from __future__ import annotations

from enum import IntEnum, IntFlag
from functools import lru_cache
from math import nan
from typing import NamedTuple

Floats = tuple[float, ...]
Signs = tuple[int, ...]


CONSUMER_TIMEOUT_S = 0.1
"""s without a verdict after which a consumer brakes; the shipped supervisor publishes every 10 ms."""


class Level(IntEnum):
    """Severity; the worst level wins. UNKNOWN stops like STOP, and means that the state of the robot is not known."""

    OK = 0
    WARN = 1
    STOP = 2
    UNKNOWN = 3


class Cause(IntFlag):
    """Bits of `causes`; SingularityState.msg explains each."""

    NONE = 0
    TYPE1 = 1
    TYPE2 = 2
    CONSTRAINT = 4
    LIMB = 8
    REACTION = 16
    BRAKING = 32
    SPEED = 64
    NOT_ASSEMBLED = 128
    BRANCH = 256
    NO_DATA = 512
    STALE = 1024
    STAMP = 2048
    NAMES = 4096
    NONFINITE = 8192
    IMPLAUSIBLE = 16384
    DEGRADED = 32768
    POSITION = 65536
    LATCHED = 262144
    INTERNAL = 524288


@lru_cache(maxsize=1024)
def cause_names(causes: int) -> str:
    """Names of the causes in a bit mask."""
    return ", ".join(cause.name or "" for cause in Cause if cause and causes & cause)


class JointSample(NamedTuple):
    """One JointState as it arrived, unchanged.

    stamp_ns: ns of ROS time when the sender read the positions. received_ns: ROS clock at its arrival. seen_ns: steady
    clock of this computer at its arrival.
    """

    stamp_ns: int
    received_ns: int
    seen_ns: int
    names: tuple[str, ...]  # of the joints; the arrays below are in this order
    position: Floats  # rad or m
    velocity: Floats = ()  # rad/s or m/s; may be empty
    effort: Floats = ()  # N m or N; may be empty


class Tick(NamedTuple):
    """A tick of the timer: time has passed. received_ns: ROS clock. seen_ns: steady clock."""

    received_ns: int
    seen_ns: int


class Finding(NamedTuple):
    """One reason for a level: a value and its limit."""

    cause: Cause
    level: Level
    value: float
    limit: float
    unit: str
    text: str


class SingularityState(NamedTuple):
    """The result for one sample, with the fields of SingularityState.msg, which states their units."""

    stamp_ns: int
    robot: str
    sequence: int
    received_ns: int
    seen_ns: int
    level: Level
    causes: int
    joint_position: Floats
    joint_velocity: Floats
    pose: Floats
    pose_rate: Floats
    working_mode: Signs
    assembly_mode: int
    type1_margin: Floats
    type2_margin: float
    constraint_margin: float
    limb_margin: Floats
    type1_uncertainty: Floats
    type2_uncertainty: float
    constraint_uncertainty: float
    clearance: float
    pressure_angle: Floats
    reaction: Floats
    reaction_max: Floats
    stop_margin: float
    stop_cause: Cause
    stop_limit: float
    time_to_stop: float
    approaching: bool
    closure_residual: float
    sample_age: float
    compute_time: float = nan


def unknown_state(
    times: tuple[int, int, int],
    robot: str,
    sequence: int,
    cause: int,
    joints: tuple[Floats, Floats],
    sizes: tuple[int, int],
) -> SingularityState:
    """The state of a sample that determines no pose: level UNKNOWN, unknown numbers are NaN.

    times: stamp, receive and steady time, ns. joints: positions and velocities as far as they are known. sizes: number
    of task coordinates and of limb margins of the robot.
    """
    stamp_ns, received_ns, seen_ns = times
    each, pose = (nan,) * len(joints[0]), (nan,) * sizes[0]
    return SingularityState(
        stamp_ns=stamp_ns,
        robot=robot,
        sequence=sequence,
        received_ns=received_ns,
        seen_ns=seen_ns,
        level=Level.UNKNOWN,
        causes=cause,
        joint_position=joints[0],
        joint_velocity=joints[1],
        pose=pose,
        pose_rate=pose,
        working_mode=(0,) * len(each),
        assembly_mode=0,
        type1_margin=each,
        type2_margin=nan,
        constraint_margin=nan,
        limb_margin=(nan,) * sizes[1],
        type1_uncertainty=each,
        type2_uncertainty=nan,
        constraint_uncertainty=nan,
        clearance=nan,
        pressure_angle=each,
        reaction=each,
        reaction_max=each,
        stop_margin=nan,
        stop_cause=Cause.NONE,
        stop_limit=nan,
        time_to_stop=nan,
        approaching=False,
        closure_residual=nan,
        sample_age=(received_ns - stamp_ns) / 1e9,
    )


class Verdict(NamedTuple):
    """The order that a consumer obeys, with the fields of Verdict.msg."""

    stamp_ns: int  # ROS time of the last good sample; 0: none yet
    level: Level
    causes: int  # sum of `Cause`
    latched: bool  # true: only a reset of `event` ends the stop
    event: int  # number of the newest stop; 0 before the first
    escape_direction: Floats  # unit vector in joint space, in rad and m; empty: none
    text: str
    sequence: int  # one more than that of the verdict before
    config_hash: str  # of the settings in force
    since_ns: int  # steady clock when this level came into force
    speed_scale: float  # 0..1, share of the speed limits that may be used; at STOP behind the command gate alone
    findings: tuple[Finding, ...]
    bypassed: Cause = Cause.NONE  # the cause that an operator has bypassed
    bypass_left: float = 0.0  # s until the bypass ends
    escape_cause: Cause = Cause.NONE  # what `escape_direction` leads away from


class Reset(NamedTuple):
    """An operator requests the end of the stop number `event`."""

    received_ns: int
    seen_ns: int
    event: int
    text: str
    seed_pose: Floats = ()  # where the platform is, roughly, m and rad; empty: not said


class Restart(NamedTuple):
    """The supervisor was started again after it had ended: the robot was not supervised in between."""

    received_ns: int
    seen_ns: int
    event: int  # number of the stop that this is, larger than those of earlier supervisors


class LateBrakes(NamedTuple):
    """A silence of the joint states was noticed late, because the supervisor itself was silent: until a later time than
    usual, no verdict, and no missing verdict, made the drives brake."""

    received_ns: int
    seen_ns: int
    brakes_ns: int  # that time, steady clock


class Bypass(NamedTuple):
    """An operator requests motion in spite of one cause of the stop number `event` for a limited time."""

    received_ns: int
    seen_ns: int
    event: int
    cause: int  # one Cause bit
    duration_s: float
    operator: str
    reason: str
