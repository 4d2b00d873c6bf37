"""Result of the certification of a motion: smallest margins, and the first violation."""

from __future__ import annotations

from typing import NamedTuple

from irsbot_msgs_py.records import Floats


class Violation(NamedTuple):
    """The first point at which a margin falls below its stop limit, or cannot be proved to be above it; also a joint
    that leaves its range, or a motion that begins in another branch."""

    time_s: float  # of the motion
    cause: int  # one bit of `Cause`
    value: float  # of the margin, 1; of the joint, rad or m; NaN for the branch
    limit: float  # that the value falls below or leaves
    joints: Floats  # rad or m
    pose: Floats  # of the platform, m and rad; NaN where no pose is known
    text: str  # the same for people


Minima = tuple[tuple[float, float], ...]
"""Smallest certified value and its time, s, per margin, in the order of `margins.MARGIN_KINDS`; infinite for margins
that the robot does not have."""


class Certificate(NamedTuple):
    """Result of a certification."""

    violation: Violation | None
    minima: Minima
    """Minima until the violation, if there is one: the motion after it was not examined. `survey` examines it."""

    @property
    def safe(self) -> bool:
        """True if the whole motion is in the configured branch and is proved to keep every stop limit and joint range.
        The speeds of the joints do not count."""
        return self.violation is None
