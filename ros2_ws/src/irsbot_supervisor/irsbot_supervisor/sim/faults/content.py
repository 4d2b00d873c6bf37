"""Faults of what a sample says. The first line of each docstring is its manual."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from math import degrees, inf, nan
from typing import Any

from irsbot_kinematics import Mechanism, Status
from irsbot_kinematics.mechanism import Floats
from irsbot_kinematics.numerics.arithmetic import FLOATS
from irsbot_msgs_py.records import JointSample
from irsbot_supervisor.sim.faults.base import Fault, setting
from irsbot_supervisor.sim.trajectory import nearest_turn

MOST_JOINTS = 100_000
"""Extra joints of one message: about 4 MB, far beyond any driver."""

FIELDS = ("position", "velocity", "effort")
JOINTS = 16
"""Highest joint number a fault can be given."""


def _joint(text: str = "number of the joint, 0: all") -> Any:
    return setting(0, text, 0, JOINTS)


def _field(default: str = "position", words: tuple[str, ...] = FIELDS) -> Any:
    return setting(default, "which numbers", words=words)


def _with(sample: JointSample, which: str, joint: int, change: Callable[[float], float]) -> JointSample:
    """A sample with one array changed, for one joint or, with joint 0, all."""
    values: Floats = getattr(sample, which)
    changed = tuple(change(value) if joint in (0, k) else value for k, value in enumerate(values, 1))
    return _replaced(sample, {which: changed})


def _replaced(sample: JointSample, arrays: dict[str, Any]) -> JointSample:
    return sample._replace(**arrays)


def _picked(sample: JointSample, order: Iterable[int]) -> JointSample:
    """A sample with joints picked, repeated or left out by index."""
    chosen = list(order)
    return _replaced(sample, {key: tuple(getattr(sample, key)[i] for i in chosen) for key in ("names", *FIELDS)})


# --- numbers ----------------------------------------------------------------------------------------------------


@dataclass
class _Poison(Fault):
    joint: int = _joint()
    which: str = _field()
    poison = nan

    def rewrite(self, sample: JointSample, since_s: float) -> JointSample:
        return _with(sample, self.which, self.joint, lambda value: self.poison)


@dataclass
class Nan(_Poison):
    """Numbers are not numbers."""


@dataclass
class Inf(_Poison):
    """Numbers are infinite."""

    poison = inf


@dataclass
class Huge(_Poison):
    """Numbers are 1e308, finite but beyond all sums."""

    poison = 1e308


@dataclass
class Denormal(_Poison):
    """Numbers are 5e-324, the smallest there is."""

    poison = 5e-324


# --- names and lengths ------------------------------------------------------------------------------------------


@dataclass
class MissingName(Fault):
    """A joint is left out."""

    joint: int = setting(1, "number of the joint", 1, JOINTS)

    def rewrite(self, sample: JointSample, since_s: float) -> JointSample:
        return _picked(sample, (i for i in range(len(sample.names)) if i != self.joint - 1))


@dataclass
class WrongName(Fault):
    """A joint has another name."""

    joint: int = setting(1, "number of the joint", 1, JOINTS)

    def rewrite(self, sample: JointSample, since_s: float) -> JointSample:
        names = (f"{name}_of_another_robot" if k == self.joint else name for k, name in enumerate(sample.names, 1))
        return sample._replace(names=tuple(names))


@dataclass
class DuplicateName(Fault):
    """A joint is listed twice."""

    joint: int = setting(1, "number of the joint", 1, JOINTS)

    def rewrite(self, sample: JointSample, since_s: float) -> JointSample:
        return _picked(sample, (*range(len(sample.names)), min(self.joint, len(sample.names)) - 1))


@dataclass
class ExtraName(Fault):
    """Joints that are not the robot's are listed first."""

    joints: int = setting(1, "how many", 1, MOST_JOINTS)

    def rewrite(self, sample: JointSample, since_s: float) -> JointSample:
        names = tuple(f"extra_{k}" for k in range(1, self.joints + 1))
        zeros = (0.0,) * self.joints
        return _replaced(sample._replace(names=names + sample.names), {k: zeros + getattr(sample, k) for k in FIELDS})


@dataclass
class Permuted(Fault):
    """The joints are listed in the opposite order, names and numbers alike."""

    def rewrite(self, sample: JointSample, since_s: float) -> JointSample:
        return _picked(sample, reversed(range(len(sample.names))))


@dataclass
class Miswired(Fault):
    """The names are in the opposite order and the numbers are not."""

    def rewrite(self, sample: JointSample, since_s: float) -> JointSample:
        return sample._replace(names=sample.names[::-1])


@dataclass
class WrongLength(Fault):
    """An array is longer or shorter than the list of names."""

    by: int = setting(-1, "entries more, or fewer", -JOINTS, MOST_JOINTS)
    which: str = _field()

    def rewrite(self, sample: JointSample, since_s: float) -> JointSample:
        values: Floats = getattr(sample, self.which)
        end = max(len(values) + self.by, 0)
        return _replaced(sample, {self.which: (values + (0.0,) * max(self.by, 0))[:end]})


# --- motion that is not the robot's -----------------------------------------------------------------------------


@dataclass
class Freeze(Fault):
    """Numbers stay what they were when the fault began; stamps go on."""

    which: str = _field("all", ("all", *FIELDS))
    frozen: JointSample | None = field(default=None, init=False)

    def rewrite(self, sample: JointSample, since_s: float) -> JointSample:
        if self.frozen is None:
            self.frozen = sample
        names = FIELDS if self.which == "all" else (self.which,)
        return _replaced(sample, {name: getattr(self.frozen, name) for name in names})


@dataclass
class Glitch(Fault):
    """A position jumps; with count=1 for one sample."""

    by: float = setting(0.5, "rad or m")
    joint: int = setting(1, "number of the joint, 0: all", 0, JOINTS)

    def rewrite(self, sample: JointSample, since_s: float) -> JointSample:
        return _with(sample, "position", self.joint, lambda value: value + self.by)


@dataclass
class Drift(Fault):
    """Positions run away steadily."""

    rate: float = setting(0.05, "rad/s or m/s")
    joint: int = _joint()

    def rewrite(self, sample: JointSample, since_s: float) -> JointSample:
        return _with(sample, "position", self.joint, lambda value: value + self.rate * since_s)


@dataclass
class Noise(Fault):
    """Numbers are noisy, normally distributed."""

    sigma: float = setting(0.001, "standard deviation, in the unit of the numbers", 0.0)
    joint: int = _joint()
    which: str = _field()

    def rewrite(self, sample: JointSample, since_s: float) -> JointSample:
        return _with(sample, self.which, self.joint, lambda value: self.random.gauss(value, self.sigma))


@dataclass
class Sign(Fault):
    """Numbers have the wrong sign."""

    joint: int = setting(1, "number of the joint, 0: all", 0, JOINTS)
    which: str = _field()

    def rewrite(self, sample: JointSample, since_s: float) -> JointSample:
        return _with(sample, self.which, self.joint, lambda value: -value)


@dataclass
class Degrees(Fault):
    """Angles and their rates come in degrees."""

    joint: int = _joint()

    def rewrite(self, sample: JointSample, since_s: float) -> JointSample:
        return _with(_with(sample, "position", self.joint, degrees), "velocity", self.joint, degrees)


@dataclass
class ModeFlip(Fault):
    """Positions jump to another working mode of the same pose, where there is one."""

    leg: int = setting(1, "number of the leg that flips", 1, JOINTS)

    def rewrite(self, sample: JointSample, since_s: float) -> JointSample:
        return sample._replace(position=_flipped(self.mechanism, sample.position, self.leg - 1))


def _flipped(mechanism: Mechanism, joints: Floats, leg: int) -> Floats:
    at = mechanism.posture(joints, mechanism.usual_assembly_mode) if len(joints) == len(mechanism.joints) else None
    if at is None or at.status != Status.SOLVED or leg >= len(joints):
        return joints
    mode = tuple(-sign if k == leg else sign for k, sign in enumerate(at.working_mode))
    if mode not in mechanism.working_modes:
        return joints
    return nearest_turn(mechanism, mechanism.inverse(FLOATS, at.pose, mode)[0], joints)
