"""A supervised robot in tests: its events at chosen times, and what the supervisor makes of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from math import inf, nan
from typing import Any

import pytest

import irsbot_kinematics as irs
from irsbot_msgs_py.records import Cause, Floats, JointSample, Level, Reset, Tick, Verdict
from irsbot_supervisor.configuration.feasibility import settings_from
from irsbot_supervisor.configuration.loading import read_settings, robot_of, shipped_values
from irsbot_supervisor.core.events import Configure, Event, Step
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.replay.judged import Interval

MS = 1_000_000
"""ns in a millisecond."""
ROS_NS = 1_700_000_000 * 10**9
"""ROS clock at the time 0 of a test; the steady clock shows one hour then, and the two must not be mixed up."""
STEADY_NS = 3600 * 10**9

DRIVES: dict[str, Any] = {"velocity_limit": 2.0, "deceleration_limit": 40.0}
"""Limits for robots without shipped settings, rad or m."""


def supervisor_of(robot: str = "irsbot2", **changes: Any) -> Supervisor:
    """A new supervisor with the shipped settings, some of them changed."""
    return Supervisor(*settings_of(robot, **changes))


def settings_of(robot: str = "irsbot2", **changes: Any) -> tuple[Settings, irs.Robot]:
    """The shipped settings of a robot, some of them changed."""
    limits = {} if shipped_values(robot_of(robot)) else DRIVES
    return read_settings(robot, {**limits, **changes})


def joints_of(supervisor: Supervisor, *pose: float) -> Floats:
    """Joint positions of a pose in the usual working mode."""
    return tuple(supervisor.robot.inverse(pose).tolist())


def at_ns(ms: float) -> tuple[int, int]:
    """ROS and steady clock at a time of the test."""
    return ROS_NS + round(ms * MS), STEADY_NS + round(ms * MS)


def sample(
    ms: float,
    position: Sequence[float],
    velocity: Sequence[float] | None = None,
    *,
    age_ms: float = 0.0,
    names: Sequence[str] | None = None,
    effort: Sequence[float] = (),
) -> JointSample:
    """A sample that arrives at a time. velocity: at rest if left out. age_ms: how long before it was stamped."""
    received_ns, seen_ns = at_ns(ms)
    n = len(position)
    joints = tuple(names) if names is not None else {2: JOINTS}.get(n, SLIDES)
    rates = (0.0,) * n if velocity is None else tuple(velocity)
    stamp_ns = received_ns - round(age_ms * MS)
    return JointSample(stamp_ns, received_ns, seen_ns, joints, tuple(position), rates, tuple(effort))


JOINTS = ("joint_1", "joint_2")
SLIDES = ("slide_1", "slide_2", "slide_3")


def tick(ms: float) -> Tick:
    return Tick(*at_ns(ms))


def reset(ms: float, event: int) -> Reset:
    return Reset(*at_ns(ms), event, "tested")


def configure(ms: float, supervisor: Supervisor, **changes: Any) -> Configure:
    """The event that changes some settings."""
    return Configure(*at_ns(ms), settings_from({**asdict(supervisor.settings), **changes}, supervisor.robot))


def resting(begin_ms: int, end_ms: int, position: Floats) -> list[JointSample]:
    """Samples of a robot that stands still, one per millisecond, the end not included."""
    return [sample(ms, position) for ms in range(begin_ms, end_ms)]


def feed(supervisor: Supervisor, events: Iterable[Event]) -> list[Step]:
    return [supervisor.step(event) for event in events]


def ready(robot: str = "irsbot2", pose: Sequence[float] = (0.0, -0.85), **changes: Any) -> tuple[Supervisor, Floats]:
    """A supervisor that has watched a standing robot for 200 ms, until time 0, and where the robot stands."""
    supervisor = supervisor_of(robot, **changes)
    joints = joints_of(supervisor, *pose)
    steps = feed(supervisor, resting(-200, 0, joints))
    last = steps[-1].state
    assert last is not None
    assert last.level == 0, f"the robot does not stand well: {supervisor.step(tick(-0.5)).verdict}"
    return supervisor, joints


def expectation(steps: Iterable[Step]) -> list[Interval]:
    """Every judgement that came into force, as a replay tells it."""
    return [
        Interval(turn.since_ns, turn.level, turn.causes, turn.latched, turn.event, "")
        for step in steps
        for turn in step.transitions
    ]


STALE_MS, DWELL_MS, HEARTBEAT_MS = 50, 50, 10
"""ms: shipped settings, which the tests write out."""

SETTLING_MS = 2 * STALE_MS
"""ms for which samples must have come after a silence, as docs/explanation/verdicts.md says."""


BOUNDARY = (1.04, -0.49)
"""m: leg I of irsbot2 is 0.6 rad from straight, and gets nearer while q_1 falls."""


def level_in_force(steps: list[Step]) -> Level:
    """Of the newest verdict."""
    return [step.verdict for step in steps if step.verdict is not None][-1].level


def newest(steps: list[Step]) -> Verdict:
    """The newest verdict of the steps."""
    return [step.verdict for step in steps if step.verdict is not None][-1]


def approach(q, ms: int, rates=(6.0, -6.0), begin_ms: int = 0) -> JointSample:
    """A sample of joints that move steadily from q since `begin_ms`."""
    return sample(ms, [a + v * (ms - begin_ms) / 1e3 for a, v in zip(q, rates, strict=True)], rates)


BAD = {
    "a NaN position": (lambda ms, q: sample(ms, (nan, q[1])), Cause.NONFINITE),
    "an infinite position": (lambda ms, q: sample(ms, (q[0], -inf)), Cause.NONFINITE),
    "a position beyond all reason": (lambda ms, q: sample(ms, (q[0], 1e308)), Cause.IMPLAUSIBLE),
    "no names": (lambda ms, q: JointSample(*sample(ms, q)[:3], (), ()), Cause.NAMES),
    "a missing joint": (lambda ms, q: sample(ms, q[:1], names=JOINTS[:1]), Cause.NAMES),
    "a doubled joint": (lambda ms, q: sample(ms, (*q, q[0]), names=(*JOINTS, JOINTS[0])), Cause.NAMES),
    "too few positions": (lambda ms, q: sample(ms, q[:1], names=JOINTS), Cause.NAMES),
    "too many velocities": (lambda ms, q: sample(ms, q, (0.0, 0.0, 0.0)), Cause.NAMES),
    "an old stamp": (lambda ms, q: sample(ms, q, age_ms=201.0), Cause.STAMP),
    "a stamp of the future": (lambda ms, q: sample(ms, q, age_ms=-21.0), Cause.STAMP),
    "a stamp of zero": (lambda ms, q: sample(ms, q)._replace(stamp_ns=0), Cause.STAMP),
    "a jump": (lambda ms, q: sample(ms, (q[0] + 0.5, q[1])), Cause.IMPLAUSIBLE),
}
"""Samples that give no knowledge, at a time in ms and joint positions, and the cause of their rejection."""

bad = pytest.mark.parametrize(("make", "cause"), BAD.values(), ids=BAD)
"""Runs a test with each of them."""


def stopped() -> tuple[Supervisor, tuple[float, ...], Verdict]:
    """A supervisor that has stopped a run at the boundary, and where the robot then rests, well inside again."""
    supervisor, q = ready(pose=BOUNDARY)
    steps = feed(supervisor, [approach(q, ms, (-6.0, 0.0)) for ms in range(1, 75)])
    verdict = newest(steps)
    assert verdict.level == Level.STOP, "the run was not stopped: the fixture proves nothing"
    steps = feed(supervisor, resting(2000, 2400, q))  # the operator has moved it back meanwhile
    assert newest(steps).latched
    return supervisor, q, newest(steps)
