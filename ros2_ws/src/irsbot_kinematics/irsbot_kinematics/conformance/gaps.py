"""Laws of the assembly clearances of `direct`: they refuse what does not close, and what the joints do not
determine."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from irsbot_kinematics.conformance.samples import Case, Machine, numbers, place
from irsbot_kinematics.mechanism import Posture, Status
from irsbot_kinematics.numerics.arithmetic import Array

WALKS = 2
"""Number of directions per posture in which Type 2 is searched."""
WALKED = 40
"""Largest number of postures at which the search starts."""
STRIDE = 0.02
"""1: first step, over the range of the joints."""
STEPS = 30
NEAR = 0.05
"""1: Type 2 margins below which gaps are compared with it."""


def gaps_refuse(machine: Machine) -> Iterator[Case]:
    """Joints within their ranges have a pose that closes, or a clearance says why not: status INVALID is for NaN."""
    for q, label, at in machine.asked:
        stated = f"joints {numbers(q)}, mode {label:+d}: assembly clearances {numbers(at.gaps)} m"
        yield Case(float(at.status == Status.INVALID), f"{stated} promise a pose, and it does not close")


def gaps_vanish(machine: Machine) -> Iterator[Case]:
    """Where the Type 2 margin vanishes, assembly modes meet or the pose is not determined: a clearance vanishes."""
    rng = machine.random()
    lower, upper = machine.ranges
    largest = np.max([at.gaps for at in machine.postures], axis=0)
    for at in machine.regular[:WALKED]:
        for _ in range(WALKS):
            met = _downhill(machine, at, rng.normal(size=len(lower)) * (upper - lower) * STRIDE)
            share = float(np.min(np.divide(met.gaps, largest)))
            clearances = f"assembly clearances {numbers(met.gaps)} m of {numbers(largest)}"
            stated = f"{place(met)}: Type 2 margin {met.type2:.3g}, {clearances}"
            yield Case(share / (met.type2 + 1e-9) if met.type2 < NEAR else 0.0, stated)


def _downhill(machine: Machine, at: Posture, way: Array) -> Posture:
    """The posture of the least Type 2 margin on a straight motion of the joints."""
    for _ in range(STEPS):
        there = machine.mechanism.track(tuple(np.add(at.joints, way).tolist()), at)
        if there.status == Status.SOLVED and there.type2 <= at.type2:
            at = there
        else:
            way = -0.5 * way
    return at
