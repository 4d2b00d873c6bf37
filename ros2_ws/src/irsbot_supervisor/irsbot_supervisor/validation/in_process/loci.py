"""Working modes that flip, and postures on and next to singular loci.

A locus is found by moving straight in joint space from a good posture until a leg changes its mode, the legs come
apart, or a margin vanishes, and by bisection. The robot stands 1e-12 to 1e-2 rad or m before it, on it, or behind it.
"""

from __future__ import annotations

from math import exp, isfinite, log

import numpy as np
from numpy.typing import NDArray

from irsbot_kinematics import Robot, Status, Unreachable
from irsbot_kinematics.batch import evaluate_many
from irsbot_kinematics.mechanism import Floats
from irsbot_msgs_py.records import Cause, JointSample, Level, Reset, SingularityState, Verdict
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.validation.harness.motion import PERIOD_S
from irsbot_supervisor.validation.harness.oracle import (
    MARGINS,
    Array,
    good_postures,
    joint_ranges,
    limits,
    margins,
    supervised,
)
from irsbot_supervisor.validation.harness.rows import Job, Row, Tally
from irsbot_supervisor.validation.harness.stream import PERIOD_NS
from irsbot_supervisor.validation.in_process.reachable import CLEAR_OF_STOP, boxes, least_margins, until_judged_s

NAME = "loci"
MUST = "mode flips, and postures on and near loci, 1e-12..1e-2: detected and latched; finite; right cause"

NEAREST, FARTHEST = 1e-12, 1e-2
"""rad or m from a locus."""
LOOKS = 200
"""Number of points at which the path through the joint ranges is evaluated."""
HALVINGS = 60
"""Halvings of the path between two of them: to the last digit."""
SHALLOW = 0.05
"""1: a margin with a minimum on a path below this may vanish there; closer points decide."""
VANISHED = 1e-6
"""1: a margin that is smaller has vanished."""
ROUNDING = 1e-6
"""1: next to a locus margins change as the root of the distance, and so do the rounding errors of two solvers."""
STARTS = 16
"""Number of good postures that are searched at once."""

BEGIN_NS = 10**15
RESTS = 220
"""ms that a robot stands: longer than a silence, the learning after it, and the dwell time."""

CAUSES = dict(zip(MARGINS, (Cause.TYPE1, Cause.TYPE2, Cause.CONSTRAINT, Cause.LIMB), strict=True))


class Stand:
    """A supervised robot that stands in given postures, one sample per millisecond."""

    def __init__(self, robot: Robot, settings: Settings) -> None:
        self._supervisor, self._names, self._ms = Supervisor(settings, robot), settings.joint_names, 0
        self.verdict: Verdict | None = None
        self.fault = ""

    def stand(self, joints: Floats) -> bool:
        """Stand there for a while; returns True if motion was allowed at any time."""
        allowed = False
        for _ in range(RESTS):
            self._ms += 1
            times = BEGIN_NS + self._ms * PERIOD_NS, BEGIN_NS + self._ms * PERIOD_NS, NS_PER_S + self._ms * PERIOD_NS
            step = self._supervisor.step(JointSample(*times, self._names, joints, (0.0,) * len(joints)))
            self.verdict = step.verdict or self.verdict
            allowed = allowed or (self.verdict is not None and self.verdict.level <= Level.WARN)
            if step.state is not None and step.state.level < Level.UNKNOWN and not _is_finite(step.state):
                self.fault = f"{step.state.level.name} with numbers that are not finite"
        return allowed

    def reset(self) -> str:
        """Reset a latched stop; returns the reason for a refusal."""
        times = BEGIN_NS + self._ms * PERIOD_NS, NS_PER_S + self._ms * PERIOD_NS
        return self._supervisor.step(Reset(*times, self.verdict.event if self.verdict else 0, "campaign")).refusal

    @property
    def stated(self) -> str:
        """The verdict as text."""
        return f"{self.verdict.level.name}: {self.verdict.text}"[:160] if self.verdict else "no verdict"


def run(job: Job) -> Row:
    """The row: a case is a posture at a locus or a flip, half of each, the same number for every robot."""
    tally = Tally(NAME, job)
    names = job.robots or supervised()
    for k, name in enumerate(names):
        settings, robot = read_settings(name)
        rng = np.random.default_rng([job.seed, k])
        wanted, flips = -(-job.amount // len(names)), len(robot.mechanism.working_modes) > 1
        done = 0
        while done < wanted:
            for start in good_postures(robot, settings, min(STARTS, wanted), rng):
                found = _flip(robot, settings, start, rng) if flips and done % 2 else None
                if found is None:
                    found = _near_locus(robot, settings, start, rng, tally)
                if found is None or done == wanted:
                    continue
                done += 1
                unsafe, failed = found
                tally.case(unsafe and f"{name}: {unsafe}", failed and f"{name}: {failed}")
    return tally.row()


# --- postures at a locus --------------------------------------------------------------------------------------------


def _near_locus(
    robot: Robot, settings: Settings, start: Array, rng: np.random.Generator, tally: Tally
) -> tuple[str, str] | None:
    """A posture next to a locus, and its verdict; None if the path meets no locus."""
    direction = rng.normal(size=len(start))
    direction /= np.abs(direction).max()
    distance = _locus(robot, settings, start, direction)
    if distance is None:
        return None
    away = float(rng.choice([-1.0, -1.0, 0.0, 1.0])) * exp(rng.uniform(log(NEAREST), log(FARTHEST)))
    joints = tuple((start + (distance + away) * direction).tolist())
    found = robot.evaluate_many(np.array([joints]), settings.assembly_mode)
    solved, mode = found.status[0] == Status.SOLVED, tuple(found.working_mode[0].tolist())
    there = margins(robot, settings, np.array([joints]))[0]
    below = [
        margin for margin, value, stop in zip(MARGINS, there, limits(settings, "stop"), strict=True) if value < stop
    ]
    tally.add("not assembled" if not solved else "behind Type 1" if _flipped(mode, settings) else "before")
    put = Stand(robot, settings)
    allowed = put.stand(joints)
    verdict = put.verdict
    assert verdict is not None, "a stand leads to a verdict"
    where = f"{away:.1e} from a locus {dict(zip(MARGINS, there.round(6).tolist(), strict=True))}, {put.stated}"
    wrong = not solved or _flipped(mode, settings)
    if allowed:
        bad = wrong or (there < limits(settings, "stop") - ROUNDING).any()
        return (where if bad else ""), put.fault
    right = Cause.BRANCH | (Cause.NOT_ASSEMBLED if not solved else Cause.NONE)
    if not wrong:
        for margin in below:
            right |= CAUSES[margin]
    if (wrong or below) and not verdict.latched:
        return "", f"not latched {where}"
    if (wrong or below) and not verdict.causes & right:
        return "", f"another cause {where}"
    return "", put.fault


def _locus(robot: Robot, settings: Settings, start: Array, direction: Array) -> float | None:
    """Distance from a posture to the first locus in a direction, rad or m; None if there is none."""
    low, high = joint_ranges(robot)
    ways = np.linspace(0.0, float((high - low).max()), LOOKS)
    looks = start + ways[:, None] * direction
    same = _is_same(robot, settings, looks)
    least = margins(robot, settings, looks).min(axis=1)
    for k in range(1, LOOKS - 1):
        if not same[k]:
            return _halved(robot, settings, start, direction, (ways[k - 1], ways[k]))
        if least[k] < min(SHALLOW, least[k - 1]) and least[k] <= least[k + 1] and same[k + 1]:
            way = _lowest(robot, settings, start, direction, (ways[k - 1], ways[k + 1]))
            if way is not None:
                return way
    return None


def _halved(robot: Robot, settings: Settings, start: Array, direction: Array, between: tuple[float, float]) -> float:
    """The point at which the robot leaves its mode or its legs come apart, by bisection."""
    low, high = between
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if _is_same(robot, settings, (start + middle * direction)[None])[0]:
            low = middle
        else:
            high = middle
    return low


def _lowest(
    robot: Robot, settings: Settings, start: Array, direction: Array, between: tuple[float, float]
) -> float | None:
    """The point at which a margin vanishes without a change of mode; None if it does not."""
    low, high = between
    value = 1.0
    for _ in range(HALVINGS):
        ways = np.linspace(low, high, 5)
        least = margins(robot, settings, start + ways[:, None] * direction).min(axis=1)
        k = int(least.argmin())
        low, high, value = ways[max(k - 1, 0)], ways[min(k + 1, 4)], float(least[k])
    return 0.5 * (low + high) if value < VANISHED else None


def _is_same(robot: Robot, settings: Settings, Q: Array) -> NDArray[np.bool_]:
    """(N,) True for postures that are assembled in the configured working mode."""
    found = evaluate_many(robot.mechanism, Q, settings.assembly_mode)
    return np.asarray((found.status == Status.SOLVED) & (found.working_mode == settings.working_mode).all(axis=1))


# --- flips ------------------------------------------------------------------------------------------------------


def _flip(robot: Robot, settings: Settings, start: Array, rng: np.random.Generator) -> tuple[str, str] | None:
    """A robot whose encoders jump to another working mode of the same pose, and back; None if that is out of reach, or
    if a robot at rest there could not be stopped."""
    others = [mode for mode in robot.mechanism.working_modes if mode != settings.working_mode]
    pose = robot.direct(start, settings.assembly_mode)
    try:
        flipped = np.array(robot.inverse(pose, others[int(rng.integers(len(others)))]), dtype=float)
    except Unreachable:
        return None
    put = Stand(robot, settings)
    if not put.stand(tuple(start.tolist())):
        stated = f"a good posture is not allowed: {put.stated}"
        return ("", stated) if _can_be_stopped(robot, settings, start) else None
    if put.stand(tuple(flipped.tolist())):
        return f"flipped, and motion was allowed; at last {put.stated}", ""
    assert put.verdict is not None, "a stand leads to a verdict"
    if not (put.verdict.latched and put.verdict.causes & Cause.BRANCH):
        return "", f"flipped, not latched for the branch: {put.stated}"
    visible = not _is_same(robot, settings, np.array([flipped]))[
        0
    ]  # else it is another pose in the right mode, for encoders
    if visible and not put.reset():
        return "a flipped mode was reset", ""
    if put.stand(tuple(start.tolist())) or not put.verdict.latched:
        return "what was latched is gone", ""
    refusal = put.reset()
    return "", put.fault or (f"a reset in the right mode is refused: {refusal}" if refusal else "")


def _can_be_stopped(robot: Robot, settings: Settings, start: Array) -> bool:
    """True if no limit is near where the drives of a robot at rest can get until it stands."""
    stamps, positions = PERIOD_S * np.arange(RESTS, dtype=float), np.tile(start, (RESTS, 1))
    low, high = (bound[-1:] for bound in boxes(stamps, positions, settings, until_judged_s(PERIOD_S)))
    at = robot.mechanism.posture(tuple(start.tolist()), settings.assembly_mode)
    least = least_margins(robot, settings, low, high, [at])[0]
    return bool((least >= CLEAR_OF_STOP * limits(settings, "stop")).all())


def _flipped(mode: tuple[int, ...], settings: Settings) -> bool:
    return any(now == -usual for now, usual in zip(mode, settings.working_mode, strict=True))


def _is_finite(state: SingularityState) -> bool:
    numbers = [*state.pose, *state.type1_margin, state.type2_margin, *state.limb_margin, state.stop_margin]
    return all(map(isfinite, numbers))
