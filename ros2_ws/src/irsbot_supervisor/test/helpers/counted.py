"""A mechanism whose work is counted in boxes, which no machine makes faster or slower."""

from __future__ import annotations

from typing import Any

import irsbot_kinematics as irs


class Counted:
    """A mechanism that counts the boxes that are bounded, and keeps between which postures it was followed."""

    def __init__(self, mechanism: irs.Mechanism) -> None:
        self._mechanism, self.boxes = mechanism, 0
        self.ways: list[tuple[irs.Posture, irs.Posture]] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._mechanism, name)

    def certified_bounds(self, *args: Any) -> irs.CertifiedBounds:
        self.boxes += 1
        return self._mechanism.certified_bounds(*args)

    def track(self, joints: tuple[float, ...], previous: irs.Posture) -> irs.Posture:
        found = self._mechanism.track(joints, previous)
        self.ways.append((previous, found))
        return found
