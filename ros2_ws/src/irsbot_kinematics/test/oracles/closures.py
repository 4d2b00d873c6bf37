"""Loop closures f(q, x) = 0 of every topology, written from the drawings: one squared length per leg.

They accept complex numbers, so that derivatives are exact, and numbers of mpmath. Geometry is any object with the
lengths as attributes. Nothing here is taken from the library.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Closure = Callable[[Any, Array, Array], Array]


def _planar_pair(half_base: float, drop: float, crank: float, rod: float, q: Array, x: Array) -> Array:
    """|P - C_k| = rod with C_k = A_k + crank (cos q, -sin q)."""
    legs = []
    for foot, angle in zip((-half_base, half_base), q, strict=True):
        dx = x[0] - foot - crank * np.cos(angle)
        dz = x[1] + drop + crank * np.sin(angle)
        legs.append(dx * dx + dz * dz - rod * rod)
    return np.array(legs)


def irsbot2(g: Any, q: Array, x: Array) -> Array:
    """Seen in the plane of motion: elbow carriers and platform take b - p - a1 sin(beta) off the half base."""
    return _planar_pair(g.b - g.p - g.a1 * np.sin(g.beta), g.e, g.l1, g.l2eq, q, x)


def five_bar(g: Any, q: Array, x: Array) -> Array:
    return _planar_pair(g.b, 0.0, g.l1, g.l2, q, x)


def rrr3(g: Any, q: Array, x: Array) -> Array:
    """Corners at 210, 330, 90 deg; the actuated elbow sets the distance of base and platform corner."""
    legs = []
    c, s = np.cos(x[2]), np.sin(x[2])
    for degrees, elbow in zip((210.0, 330.0, 90.0), q, strict=True):
        ex, ey = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
        dx = x[0] + g.rp * (c * ex - s * ey) - g.rb * ex
        dy = x[1] + g.rp * (s * ex + c * ey) - g.rb * ey
        legs.append(dx * dx + dy * dy - 2.0 * g.l * g.l * (1.0 + np.cos(elbow)))
    return np.array(legs)


def rrr3_base(g: Any, q: Array, x: Array) -> Array:
    """Cranks turn about the base points; a rod of one length joins crank end and platform point."""
    legs = []
    c, s = np.cos(x[2]), np.sin(x[2])
    for i, crank in enumerate(q, 1):
        (ax, ay), (bx, by) = getattr(g, f"a{i}"), getattr(g, f"b{i}")
        dx = x[0] + c * bx - s * by - ax - g.l1 * np.cos(crank)
        dy = x[1] + s * bx + c * by - ay - g.l1 * np.sin(crank)
        legs.append(dx * dx + dy * dy - g.l2 * g.l2)
    return np.array(legs)


def _on_slides(g: Any, starts: list[Any], rails: list[Any], rods: list[Any], q: Array, x: Array) -> Array:
    """Legs of a planar platform: rail None, a strut as long as its joint; else a carriage and a rod of one length."""
    legs = []
    c, s = np.cos(x[2]), np.sin(x[2])
    for i, (start, rail, rod, travel) in enumerate(zip(starts, rails, rods, q, strict=True), 1):
        bx, by = getattr(g, f"b{i}")
        dx, dy = x[0] + c * bx - s * by - start[0], x[1] + s * bx + c * by - start[1]
        if rail is None:
            legs.append(dx * dx + dy * dy - travel * travel)
            continue
        size = np.sqrt(rail[0] * rail[0] + rail[1] * rail[1])
        dx, dy = dx - travel * rail[0] / size, dy - travel * rail[1] / size
        legs.append(dx * dx + dy * dy - rod * rod)
    return np.array(legs)


def rpr3(g: Any, q: Array, x: Array) -> Array:
    return _on_slides(g, [g.a1, g.a2, g.a3], [None] * 3, [None] * 3, q, x)


def rails3(g: Any, q: Array, x: Array) -> Array:
    return _on_slides(g, [g.o1, g.o2, g.o3], [g.u1, g.u2, g.u3], list(g.L), q, x)


def rails2(g: Any, q: Array, x: Array) -> Array:
    return _on_slides(g, [g.o1, g.o2, g.o3], [None, g.u2, g.u3], [None, g.L2, g.L3], q, x)


def ruu4(g: Any, q: Array, x: Array) -> Array:
    """Cranks in the plane z = 0 at every quarter of a turn; the platform stays level and turns about z."""
    legs = []
    for i, crank in enumerate(q):
        foot, corner = i * np.pi / 2, i * np.pi / 2 + x[3]
        dx = x[0] + g.rp * np.cos(corner) - g.rb * np.cos(foot) - g.l1 * np.cos(crank)
        dy = x[1] + g.rp * np.sin(corner) - g.rb * np.sin(foot) - g.l1 * np.sin(crank)
        legs.append(dx * dx + dy * dy + x[2] * x[2] - g.l2 * g.l2)
    return np.array(legs)


def _slides(feet: list[tuple[float, float, float]], rails: str) -> Closure:
    def closure(g: Any, q: Array, x: Array) -> Array:
        legs = []
        for foot, rail, travel in zip(feet, rails, q, strict=True):
            d = [x[i] - foot[i] - (travel if rail == "xyz"[i] else 0.0) for i in range(3)]
            legs.append(d[0] * d[0] + d[1] * d[1] + d[2] * d[2] - g.L * g.L)
        return np.array(legs)

    return closure


def linear_delta(g: Any, q: Array, x: Array) -> Array:
    legs = []
    for i, travel in enumerate(q, 1):
        foot, rail = np.array(getattr(g, f"o{i}")), np.array(getattr(g, f"u{i}"))
        d = x - foot - travel * rail / np.sqrt(rail @ rail)
        legs.append(d @ d - g.L * g.L)
    return np.array(legs)


CLOSURES: dict[str, Closure] = {
    "irsbot2": irsbot2,
    "five_bar": five_bar,
    "rrr3": rrr3,
    "rrr3_base": rrr3_base,
    "ruu4": ruu4,
    "orthoglide": _slides([(0.0, 0.0, 0.0)] * 3, "xyz"),
    "hybridglide": _slides([(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 0.0)], "yyz"),
    "triaglide": _slides([(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 0.0)], "yyy"),
    "uranesx": _slides([(1.0, 0.0, 0.0), (-0.5, np.sqrt(0.75), 0.0), (-0.5, -np.sqrt(0.75), 0.0)], "zzz"),
    "linear_delta": linear_delta,
    "rpr3": rpr3,
    "rails3": rails3,
    "rails2": rails2,
}
PLANAR = (rrr3, rrr3_base, rpr3, rails3, rails2)
"""Three joints, and a platform that turns in the plane."""


def gradients(closure: Closure, g: Any, q: Array, x: Array) -> tuple[Array, Array]:
    """df/dx (n, n) and df/dq (n, n) by complex steps: exact to rounding."""
    step = 1e-30
    eye = 1j * step * np.eye(len(q))
    by_x = np.array([np.imag(closure(g, q, x + e)) for e in eye]).T / step
    by_q = np.array([np.imag(closure(g, q + e, x)) for e in eye]).T / step
    return by_x, by_q


def unit_jacobians(closure: Closure, g: Any, q: Array, x: Array) -> tuple[Array, Array]:
    """A with unit forces (first `forces` columns, a moment follows if the platform turns) and B of A t + B qdot = 0."""
    by_x, by_q = gradients(closure, g, q, x)
    forces = 2 if len(x) == 2 or closure in PLANAR else 3
    size = np.linalg.norm(by_x[:, :forces], axis=1, keepdims=True)
    return by_x / size, by_q / size


def close(closure: Closure, g: Any, q: Array, near: Array) -> Array:
    """Pose of joints q by Newton steps from a pose nearby; asserts that it closes."""
    x = np.array(near, dtype=float)
    for _ in range(20):
        by_x, _ = gradients(closure, g, q, x)
        step = np.linalg.solve(by_x, closure(g, q, x))
        x = x - step
        if np.abs(step).max() < 1e-15 * (1.0 + np.abs(x).max()):
            break
    assert np.abs(step).max() < 1e-12, "the motion left the branch: the fixture proves nothing"
    return x
