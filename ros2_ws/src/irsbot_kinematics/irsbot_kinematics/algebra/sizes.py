"""Refuses computations that would be too large, before they start."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from irsbot_kinematics.algebra.model.engine import TooLarge

if TYPE_CHECKING:
    from irsbot_kinematics.algebra.model.system import System


MOST_WALL_DEGREE = 40
"""1: largest total degree of a wall for which a slice takes minutes; a wall of degree 30 takes one."""


def refuse_large_walls(walls: Sequence[Any]) -> None:
    """Raises TooLarge if a wall in two names has so high a degree that its critical values take hours."""
    for wall in walls:
        degree = int(wall.total_degree())
        if degree > MOST_WALL_DEGREE:
            size = degree * (degree - 1)
            raise TooLarge(
                f"a wall of degree {degree} with {len(wall)} terms has critical values of degree {size}, which takes "
                f"hours (degree 30: a minute); say allow_large=True, or choose another slice"
            )


def refuse_large_discriminant(system: System, free: Sequence[str]) -> None:
    """Raises TooLarge if the discriminant of the closing polynomial would have more than two free joints, or angles
    among them."""
    turned = [name for name in free if name in system.angles]
    size = 1
    for name in free:
        size *= 81 if name in system.angles else 13
    if len(free) > 2 or turned:
        raise TooLarge(
            f"the singular surface over {', '.join(free)} has up to {size} terms and takes hours: "
            f"fix {max(len(free) - 2, 1)} more joint(s), such as fixed={{'{system.joints[0]}': ...}}"
            + (f"; the joints {', '.join(turned)} are angles, so take slices of the pose space" if turned else "")
        )
