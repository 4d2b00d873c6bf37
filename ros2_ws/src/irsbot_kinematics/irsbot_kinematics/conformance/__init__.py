"""Checks that a mechanism keeps the laws that supervision needs. Values in, values out.

The laws compare the methods of a mechanism with each other: derivatives with differences, bounds with samples, one
posture with many. They cannot know the intended machine: compare one measured posture with `Robot.direct`.
"""

from __future__ import annotations

import inspect
import traceback
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import NamedTuple

from irsbot_kinematics.conformance import declared, declared_rods, gaps, margins, motion, singular, wrong
from irsbot_kinematics.conformance.samples import JOINTS, Check, Law, Machine
from irsbot_kinematics.errors import BadInput
from irsbot_kinematics.robot import Robot

__all__ = ["JOINTS", "LAWS", "Check", "conformance"]

LEAST_POSTURES = 10
"""Least number of regular postures for a conclusion."""


class _Entry(NamedTuple):
    name: str
    law: Law
    allowed: float
    unit: str


DIFFERENCES = 1e-6
"""1: five-point differences have far smaller errors at regular postures."""
ROUNDING = 1e-9
"""m or 1: rounding errors are far smaller, those of a wrong formula far larger."""
PROPORTION = 20.0
"""1: share of the largest gap, over the Type 2 margin. Near a singularity it is at most about 3; a wrong gap stays
while the margin vanishes."""
LAWS: tuple[_Entry, ...] = (
    _Entry("inverse closes", motion.inverse_closes, ROUNDING, "m"),
    _Entry("inverse keeps its mode", motion.inverse_keeps_mode, 0.0, "1"),
    _Entry("direct gives back", motion.direct_gives_back, 1e-7, "m, rad"),
    _Entry("direct closes", motion.direct_closes, ROUNDING, "m"),
    _Entry("gaps refuse what does not close", gaps.gaps_refuse, 0.0, "1"),
    _Entry("gaps vanish with Type 2", gaps.gaps_vanish, PROPORTION, "1"),
    _Entry("Jacobian by pose", motion.jacobian_pose, DIFFERENCES, "1, m"),
    _Entry("Jacobian by joints", motion.jacobian_joints, DIFFERENCES, "m/rad, 1"),
    _Entry("inverse rates", motion.inverse_rates, DIFFERENCES, "m/s"),
    _Entry("direct rates and bias", motion.direct_rates, 1e-5, "m/s, m/s2"),
    _Entry("virtual work", motion.virtual_work, DIFFERENCES, "1"),
    _Entry("largest reaction", motion.load_maximum, ROUNDING, "1"),
    _Entry("posture is legs", margins.posture_is_legs, ROUNDING, "1, m"),
    _Entry("unit screws", margins.unit_screws, ROUNDING, "1"),
    _Entry("Type 1 is the lever", margins.sines_are_levers, ROUNDING, "1"),
    _Entry("margins in 0..1", margins.in_range, 1e-12, "1"),
    _Entry("unknown is unknown", margins.unknown_is_unknown, 0.0, "1"),
    _Entry("refusals", margins.refusals, 0.0, "1"),
    _Entry("many are single", margins.many_are_single, ROUNDING, "m, rad, 1"),
    _Entry("sizes are as declared", declared.sizes_declared, ROUNDING, "1"),
    _Entry("turn rate is as declared", declared.turn_rate_declared, 1e-6, "1"),
    _Entry("errors are as declared", declared_rods.errors_declared, ROUNDING, "1"),
    _Entry("drives are as declared", declared_rods.drives_declared, ROUNDING, "1"),
    _Entry("rods are as declared", declared_rods.rods_declared, ROUNDING, "1"),
    _Entry("sines are as declared", declared_rods.sines_declared, ROUNDING, "1"),
    _Entry("guarantee is kept", margins.promises_kept, ROUNDING, "1"),
    _Entry("sharp guarantee is kept", margins.sharp_promises_kept, ROUNDING, "1"),
    _Entry("guarantee of wrong machines is kept", wrong.wrong_machines_kept, ROUNDING, "1"),
    _Entry("guarantee says something", margins.promises_something, 1e-3, "1"),
    _Entry("clearance is kept", margins.clearance_kept, 1e-6, "m, rad"),
    _Entry("branch goes on", margins.labels_stay, ROUNDING, "m, rad"),
    _Entry("singular postures are answered", singular.singular_answered, ROUNDING, "1"),
)
"""Every law: name, function, largest allowed error and its unit."""


def conformance(robot: Robot, *, joints: int = JOINTS, seed: int = 1, only: Collection[str] = ()) -> Iterator[Check]:
    """Check every law, one after the other; `Check.broken` is empty if the law holds.

    joints: number of random joint positions. only: names of `LAWS` to check alone; all of them if empty. Raises
    BadInput for a law that is none. Never raises for errors of the mechanism.
    """
    names = [entry.name for entry in LAWS]
    if unknown := sorted(set(only) - set(names)):
        raise BadInput(f"no law '{unknown[0]}'; there are {', '.join(names)}")
    machine = Machine(robot, joints, seed)
    try:
        good = len(machine.regular)
        few = f"{len(machine.postures)} postures at {joints} random joint positions, {good} with margins above 0.1"
        broken = (
            "" if good >= LEAST_POSTURES else f"{few}; {LEAST_POSTURES} are needed: see ranges, `direct` and `legs`"
        )
    except Exception as error:  # a mechanism of the user may raise anything
        good, broken = 0, f"`posture` raises {_stated(error, robot)}"
    words = "Random joints give postures, many of them far from singularities"
    yield Check("postures", words, good, 0.0, 0.0, "1", broken)
    if not broken:
        for entry in LAWS:
            if not only or entry.name in only:
                yield _tried(entry, machine)


def _tried(entry: _Entry, machine: Machine) -> Check:
    """The worst case of a law."""
    worst, tried, broken = 0.0, 0, ""
    try:
        for case in entry.law(machine):
            tried += 1
            if not case.error <= entry.allowed and (not broken or case.error > worst):
                broken = f"{case.stated}; error {case.error:.3g} {entry.unit}, allowed {entry.allowed:.3g}"
            worst = max(worst, case.error) if case.error == case.error else float("inf")
    except Exception as error:  # a mechanism of the user may raise anything
        broken = f"after {tried} trials it raises {_stated(error, machine.robot)}"
    if not tried and not broken:
        broken = "it could not be tried anywhere"
    words = " ".join((entry.law.__doc__ or "").split())
    return Check(entry.name, words, tried, worst, entry.allowed, entry.unit, broken)


def _stated(error: Exception, robot: Robot) -> str:
    """The error, and the last line of the mechanism's own file in its traceback."""
    own = inspect.getfile(type(robot.mechanism))
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == own]
    where = f" ({Path(own).name}, line {lines[-1]})" if lines else ""
    return f"{type(error).__name__}: {' '.join(str(error).split())}{where}"
