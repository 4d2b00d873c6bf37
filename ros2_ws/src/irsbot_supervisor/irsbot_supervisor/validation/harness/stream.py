"""A robot at work whose samples reach a supervisor; the campaign decides which samples are delivered."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import islice
from typing import NamedTuple

import numpy as np

from irsbot_kinematics import Robot
from irsbot_kinematics.conformance.samples import apart
from irsbot_kinematics.mechanism import Floats
from irsbot_msgs_py.records import JointSample, Level, Reset, Tick, Verdict
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.core.events import Event, Step
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.validation.harness.motion import PERIOD_S, measured, work
from irsbot_supervisor.validation.harness.oracle import followed

ROBOTS = ("irsbot2", "orthoglide", "rrr3")
"""Robots in these rows: rods in a plane, slides, a platform that turns."""

BEGIN_NS = 1_700_000_000 * NS_PER_S
"""ns: ROS time at the begin of a stream; the steady clock shows one hour then, so that a mix-up of the two is
noticed."""
STEADY_NS = 3600 * NS_PER_S
PERIOD_NS = round(PERIOD_S * NS_PER_S)

CYCLE = 2000
"""Number of prepared periods of work, up to the last rest; a stream begins at any of them and turns back at the end."""
WARM_UP = 220
"""Number of periods of good samples before any fault: longer than a silence, the learning after it, and the dwell
time."""
SAME = 1e-6
"""m or rad: two poses of the same joints that differ by less are of the same branch."""

APART = 20
"""Number of periods between two points that are tried as begins where the branch has to be followed."""


class Prepared(NamedTuple):
    """A robot and its work."""

    settings: Settings
    robot: Robot
    points: tuple[tuple[Floats, Floats], ...]  # positions (as measured) and rates, period by period
    begins: tuple[int, ...]  # numbers of points at which the configured assembly mode names the true branch


@lru_cache(maxsize=8)
def prepared(name: str) -> Prepared:
    """A robot and its work, up to the last rest."""
    settings, robot = read_settings(name)
    points = [(measured(q, settings), v) for q, v in islice(work(robot, settings), CYCLE)]
    last = max(k for k, (_q, v) in enumerate(points) if max(map(abs, v)) <= settings.standstill_speed)
    points = points[: last + 1]
    return Prepared(settings, robot, tuple(points), tuple(_begins(settings, robot, [q for q, _v in points])))


def _begins(settings: Settings, robot: Robot, way: Sequence[Floats]) -> Iterator[int]:
    """Numbers of points, but the last, at which a supervisor that is switched on finds the branch of the first."""
    mechanism = robot.mechanism
    if mechanism.label_is_invariant:
        yield from range(len(way) - 1)
        return
    first = mechanism.posture(way[0], settings.assembly_mode)
    numbers = range(0, len(way) - 1, APART)
    for k, true in zip(numbers, followed(robot, np.array(way[:-1:APART]), first), strict=True):
        named = mechanism.posture(way[k], settings.assembly_mode)
        if apart(mechanism.task, named.pose, true.pose) <= SAME:
            yield k


class InputStream:
    """One robot, the motion of its drives, its supervisor, and both clocks. Time advances period by period."""

    def __init__(self, name: str, rng: np.random.Generator, settings: Settings | None = None) -> None:
        shipped, self.robot, self._points, begins = prepared(name)
        self.settings = settings or shipped
        self.supervisor = Supervisor(self.settings, self.robot)
        self.verdict: Verdict | None = None
        """The newest verdict, which a consumer obeys."""
        self.changes: list[tuple[int, Level]] = []
        """Times at which the level in force changed (steady clock), and the new levels."""
        self.now_ns = STEADY_NS
        self.ros_shift_ns = 0
        """ns by which the ROS clock has been set forward."""
        self.standing = False
        self._at, self._way = begins[int(rng.integers(len(begins)))], 1
        self._beat_ns = round(self.settings.heartbeat_s * NS_PER_S)
        self._due_ns = STEADY_NS + int(rng.integers(self._beat_ns))

    @property
    def level(self) -> Level:
        """Level in force: UNKNOWN before the first verdict."""
        return self.verdict.level if self.verdict is not None else Level.UNKNOWN

    @property
    def moves(self) -> bool:
        """True if motion is allowed."""
        return self.level <= Level.WARN

    # --- what is true ----------------------------------------------------------------------------------------------

    @property
    def position(self) -> Floats:
        """Joint positions as encoders show them."""
        return self._points[self._at][0]

    @property
    def velocity(self) -> Floats:
        rates = self._points[self._at][1]
        return (0.0,) * len(rates) if self.standing else tuple([self._way * rate for rate in rates])

    @property
    def received_ns(self) -> int:
        """The ROS clock."""
        return BEGIN_NS + self.now_ns - STEADY_NS + self.ros_shift_ns

    def sample(self) -> JointSample:
        """Encoder readings with the present stamp."""
        ros_ns = self.received_ns
        return JointSample(ros_ns, ros_ns, self.now_ns, self.settings.joint_names, self.position, self.velocity)

    # --- what happens ------------------------------------------------------------------------------------------------

    def advance(self) -> None:
        """Advance by a period: the robot moves, the heartbeat comes, nothing is delivered."""
        if not self.standing:
            if not 0 <= self._at + self._way < len(self._points):
                self._way = -self._way
            self._at += self._way
        self.now_ns += PERIOD_NS
        while self._due_ns <= self.now_ns:
            shift_ns = self.received_ns - self.now_ns
            self.feed(Tick(self._due_ns + shift_ns, self._due_ns))
            self._due_ns += self._beat_ns

    def feed(self, event: Event) -> Step:
        """Deliver an event."""
        step = self.supervisor.step(event)
        if step.verdict is not None:
            before, self.verdict = self.level, step.verdict
            if self.level != before:
                self.changes.append((event.seen_ns, self.level))
        return step

    def deliver(self, samples: Sequence[JointSample]) -> None:
        """Deliver samples now, with any stamps."""
        for sample in samples:
            self.feed(sample._replace(received_ns=self.received_ns, seen_ns=self.now_ns))

    def run(self, periods: int) -> None:
        """Run this number of periods without a fault."""
        for _ in range(periods):
            self.advance()
            self.feed(self.sample())

    def lose_track(self) -> None:
        """Let the encoders jump, stay there, and come back: the result is a latched stop."""
        for far in (1.0, 0.0):
            for _ in range(WARM_UP):
                self.advance()
                sample = self.sample()
                self.deliver([sample._replace(position=tuple(q + far for q in sample.position))])

    def reset(self) -> str:
        """Reset the stop in force as an operator; returns the reason for a refusal."""
        number = self.verdict.event if self.verdict is not None else 0
        return self.feed(Reset(self.received_ns, self.now_ns, number, "campaign")).refusal
