"""Where a section of the loci is taken, and when another one is due. Without contours, which nodes do not load."""

from __future__ import annotations

from collections.abc import Sequence

from irsbot_kinematics.mechanism import Mechanism

AGAIN_S = 5.0
"""s: shortest time between two computations of a section."""

TURN = 0.05
"""rad: change of a coordinate beyond the plane after which a section is found again."""

SHIFT = 0.05
"""The same of a place, in lengths of the mechanism."""


def elsewhere(mechanism: Mechanism, pose: Sequence[float], before: Sequence[float]) -> bool:
    """Whether a pose needs another section than one before: sections lie in the plane of the first two coordinates."""
    steps = [TURN if one.unit == "rad" else SHIFT * mechanism.length_m for one in mechanism.task[2:]]
    return any(abs(new - old) >= step for new, old, step in zip(pose[2:], before[2:], steps, strict=True))


def stated_place(mechanism: Mechanism, pose: Sequence[float], digits: str) -> str:
    """The coordinates beyond the plane, as text. digits: format of a number."""
    others = zip(mechanism.task[2:], pose[2:], strict=True)
    return ", ".join(f"{one.name} = {value:{digits}} {one.unit}" for one, value in others)
