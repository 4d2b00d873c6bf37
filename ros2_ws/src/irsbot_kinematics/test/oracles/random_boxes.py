"""Boxes of joints around platforms on rods of any place and direction: what `boxes.reached` is given, and more."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from rod_machines import Array, Machine, Met, closed, units

from irsbot_kinematics.bounds.boxes import Rod

PLATFORMS = {"two rods": (2, 2), "three in space": (3, 3), "turning": (3, 2), "turning in space": (4, 3)}
"""Number of rods, dimensions."""
WAYS = (
    "ends",
    "swings",
    "pulls",
    "lengths",
    "ends aside",
    "curves",
    "thirds",
    "lengths aside",
    "off alone",
    "elsewhere",
    "all",
)


class Box(NamedTuple):
    """What happens to the rods of a machine, as `Rod` says it, of all of them."""

    machine: Machine
    near: Array
    curve: Array
    growth: Array
    growth_curve: Array
    growth_aside: Array
    aside: Array
    third: Array
    growth_third: Array
    arm: float
    """m by which the rods may hold a platform that turns elsewhere"""

    def rods(self) -> list[Rod]:
        columns = self.growth, self.growth_aside, self.curve, self.growth_curve, self.third, self.growth_third
        lists = [column.tolist() for column in (self.machine.length, self.near, self.aside + self.arm, *columns)]
        return [
            Rod(length, tuple(near), aside, growth, more, tuple(curve), bend, tuple(third), twist)
            for length, near, aside, growth, more, curve, bend, third, twist in zip(*lists, strict=True)
        ]

    def met(self, s: Array, e: Array, g: Array, a: Array) -> tuple[Met, Array]:
        """s (N, n) in -1..1; e (N, n, m), g (N, n) and a (N, n, 2) of size 1 at most: shares of what may come on
        top."""
        shift = s[..., None] * self.near + (s * s)[..., None] * self.curve + (s**3)[..., None] * self.third
        shift = shift + self.aside[:, None] * e
        longer = s * self.growth + s * s * self.growth_curve + s**3 * self.growth_third + self.growth_aside * g
        return closed(self.machine, shift, longer, self.arm * a), self.machine.length + longer


def random_box(rng: np.random.Generator, rods: int, dims: int, way: str) -> Box:
    """Lengths, arms and motions of very different sizes; of half of them the arms lie along the rods, one leg like the
    other, so that the platform turns much and its arms push or pull the rods."""
    while True:
        attachments = rng.normal(size=(rods, 2)) * 10.0 ** rng.uniform(-1.0, 1.0) * (rods > dims)
        r, length = units(rng.normal(size=(rods, dims))), 10.0 ** rng.uniform(-1.0, 1.0, rods)
        if rods > dims and rng.uniform() < 0.5:
            angles = rng.uniform(0.0, 7.0) + 2.0 * np.pi * np.arange(rods) / rods
            attachments = np.stack([np.cos(angles), np.sin(angles)], axis=1) * 10.0 ** rng.uniform(-0.1, 0.1, (rods, 1))
            angles = angles + rng.uniform(0.0, 7.0) + rng.normal(size=rods) * 0.2
            r[:, :2] = np.stack([np.cos(angles), np.sin(angles)], axis=1) * np.hypot(*r[:, :2].T)[:, None] ** (dims - 2)
        machine = Machine(units(r), attachments, length)
        if abs(np.linalg.det(np.array(machine.posture.screws))) > 1e-2:
            break
    size = 10.0 ** rng.uniform(-3.5, -0.7) * machine.length
    some: Any = lambda *ways: (way in ways) * size * (rng.uniform(size=rods) < 0.7)  # noqa: E731
    share: Any = lambda: 10.0 ** rng.uniform(-2.0, 0.5)  # noqa: E731
    near = (
        rng.normal(size=(rods, dims))
        * some("ends", "swings", "pulls", "ends aside", "curves", "thirds", "all")[:, None]
    )
    along = np.sum(near * machine.r, axis=1, keepdims=True) * machine.r
    near = near - along if way == "swings" else along if way == "pulls" else near
    curve = share() * rng.normal(size=(rods, dims)) * some("curves", "all")[:, None]
    third = share() * rng.normal(size=(rods, dims)) * some("thirds", "all")[:, None]
    growth = rng.normal(size=rods) * some("lengths", "lengths aside", "all")
    growth_curve = share() * rng.normal(size=rods) * some("lengths", "all")
    growth_third = share() * rng.normal(size=rods) * some("thirds", "all")
    growth_aside, aside = share() * some("lengths aside", "all"), share() * some("ends aside", "off alone", "all")
    arm = float((rods > dims) * share() * some("elsewhere", "all").max())
    return Box(machine, near, curve, growth, growth_curve, growth_aside, aside, third, growth_third, arm)
