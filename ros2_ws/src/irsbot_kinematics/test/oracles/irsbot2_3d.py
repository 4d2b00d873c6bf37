"""The IRSBot-2 in space, built from points, axes and screws: what the tests compare the library with.

Nothing here is taken from the library, and nothing here uses its planar shortcuts: margins come from 3-D unit vectors
and singular values, mobility from reciprocal screws and from the Jacobian of the eight rod equations.

Frame: x right, y normal to the plane of motion, z up. A planar angle t is the direction u(t) = (cos t, 0, -sin t).
Design numbers and angles may be arrays: shapes broadcast, vectors have their components last.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

AXIS_Y = np.array([0.0, 1.0, 0.0])
SIGMA = (1.0, -1.0)
"""Leg I stands on the left and points to +x, leg II mirrors it."""


class Design(NamedTuple):
    """Lengths in m, beta in rad; floats, or arrays of one shape."""

    l1: Array | float
    l2eq: Array | float
    b: Array | float
    p: Array | float
    a1: Array | float
    a2: Array | float
    beta: Array | float
    e: Array | float = 0.0

    @property
    def b0(self) -> Array | float:
        return self.b - self.p - self.a1 * np.sin(self.beta)

    @property
    def D(self) -> Array | float:
        return (self.a1 - self.a2) * np.sin(self.beta)

    @property
    def Lc(self) -> Array | float:
        return 2.0 * (self.p + self.a2 / (self.a1 - self.a2) * self.l2eq)


class Leg(NamedTuple):
    """Points (..., 3) in m; rod points and unit vectors (..., 2, 3), one row per rod j = 1, 2."""

    A: Array
    B: Array
    G: Array
    H: Array
    E: Array
    F: Array
    e1: Array
    f: Array
    e2: Array
    n: Array


def vector(x: Array | float, y: Array | float, z: Array | float) -> Array:
    return np.stack(np.broadcast_arrays(x, y, z), axis=-1).astype(float)


def u(t: Array | float) -> Array:
    return vector(np.cos(t), 0.0, -np.sin(t))


def unit(v: Array) -> Array:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def leg(d: Design, k: int, q: Array | float, psi: Array | float) -> Leg:
    """Leg k = 0, 1 with its motor at q and its equivalent distal rod at psi."""
    sign = SIGMA[k]
    x = np.array([1.0, 0.0, 0.0])
    length = lambda value: np.asarray(value)[..., None]  # noqa: E731
    A = vector(-sign * np.asarray(d.b), 0.0, 0.0)
    B = A + length(d.l1) * u(q)
    elbow = B - vector(0.0, 0.0, d.e)
    H = elbow + length(sign * d.a1 * np.sin(d.beta)) * x
    G = H + length(d.l2eq) * u(psi)
    wrist = G - length(sign * d.a2 * np.sin(d.beta)) * x
    angles = (np.pi + d.beta, -d.beta) if k == 0 else (np.pi - d.beta, d.beta)
    e1 = np.stack([vector(-np.sin(angle), np.cos(angle), 0.0) for angle in angles], axis=-2)
    E = elbow[..., None, :] + length(length(d.a1)) * e1
    F = wrist[..., None, :] + length(length(d.a2)) * e1
    f = unit(F - E)
    e2 = unit(np.cross(e1, f))
    return Leg(A, B, G, H, E, F, e1, f, e2, np.cross(e1, e2))


def platform_point(d: Design, k: int, at: Leg) -> Array:
    """P as leg k says; the loop is closed where both legs agree."""
    return at.G + np.asarray(SIGMA[k] * d.p)[..., None] * np.array([1.0, 0.0, 0.0])


def rod_lines_meet(at: Leg) -> Array:
    """Point nearest to both rod lines of a leg (P_k); asserts that they do meet."""
    f1, f2 = at.f[..., 0, :], at.f[..., 1, :]
    between = at.E[..., 1, :] - at.E[..., 0, :]
    across = np.cross(f1, f2)
    size = np.sum(across * across, axis=-1)
    along = np.sum(np.cross(between, f2) * across, axis=-1) / size
    miss = np.abs(np.sum(between * across, axis=-1)) / np.sqrt(size)
    assert np.all(miss < 1e-9 * (1.0 + np.abs(along))), "the rods of a leg lie in one plane by construction"
    return at.E[..., 0, :] + along[..., None] * f1


def constraint_matrix(d: Design, psi1: Array | float, psi2: Array | float) -> Array:
    """M (..., 3, 5): moments that the legs can exert on a platform held at one point."""
    legs = leg(d, 0, 0.0, psi1), leg(d, 1, 0.0, psi2)
    # The proximal arms only translate a leg: move leg II so that both see the same platform point.
    apart = platform_point(d, 0, legs[0]) - platform_point(d, 1, legs[1])
    line = rod_lines_meet(legs[1]) + apart - rod_lines_meet(legs[0])
    moment = np.cross(AXIS_Y, line) / np.asarray(d.Lc)[..., None]
    columns = [legs[k].n[..., j, :] for k in (0, 1) for j in (0, 1)]
    return np.stack(np.broadcast_arrays(*columns, moment), axis=-1)


def kappa(d: Design, psi1: Array | float, psi2: Array | float) -> Array:
    """Third singular value of M: the constraint margin."""
    return np.linalg.svd(constraint_matrix(d, psi1, psi2), compute_uv=False)[..., 2]


# --- screws: twists (omega; velocity at the origin), wrenches (force; moment about the origin) ---


def revolute(axis: Array, point: Array) -> Array:
    return np.concatenate([axis, np.cross(point, axis)])


def force(direction: Array, point: Array) -> Array:
    return np.concatenate([direction, np.cross(point, direction)])


def couple(direction: Array) -> Array:
    return np.concatenate([np.zeros(3), direction])


def power(wrenches: Array, twists: Array) -> Array:
    return wrenches[:, :3] @ twists[:, 3:].T + wrenches[:, 3:] @ twists[:, :3].T


def null_space(rows: Array, tolerance: float) -> Array:
    """Orthonormal rows x with rows @ x = 0; singular values below the tolerance count as 0."""
    _, values, right = np.linalg.svd(rows)
    rank = int(np.sum(values > tolerance))
    return right[rank:]


def reciprocal(screws: Array, tolerance: float) -> Array:
    """Wrenches (n, 6) that do no work on the twists, or twists on which the wrenches do no work."""
    swapped = np.concatenate([screws[:, 3:], screws[:, :3]], axis=1)
    return null_space(swapped, tolerance)


def rod_wrenches(at: Leg, j: int, tolerance: float) -> Array:
    """What rod j can transmit: reciprocal to its four passive revolutes e1, e2 at E and e2, e1 at F."""
    axes = (at.e1[j], at.E[j]), (at.e2[j], at.E[j]), (at.e2[j], at.F[j]), (at.e1[j], at.F[j])
    return reciprocal(np.array([revolute(axis, point) for axis, point in axes]), tolerance)


def elbow_twist(at: Leg) -> Array:
    """The elbow carrier does not turn; it translates with B, at right angles to the proximal arm."""
    return np.concatenate([np.zeros(3), np.cross(AXIS_Y, at.B - at.A)])


def leg_wrenches(at: Leg, tolerance: float, *, motor_locked: bool) -> Array:
    """What a leg transmits to the platform; with its motor free, only what does no work on the elbow's motion."""
    span = np.concatenate([rod_wrenches(at, j, tolerance) for j in (0, 1)])
    if motor_locked:
        return span
    work = power(span, elbow_twist(at)[None, :])
    return null_space(work.T, tolerance) @ span


def freedom(d: Design, legs: tuple[Leg, Leg], tolerance: float, *, motors_locked: bool) -> Array:
    """Twists (n, 6) left to the platform, lengths divided by Lc and moments taken about P.

    Row vectors (omega; velocity of P over Lc). A regular robot has n = 2 with free motors, 0 with locked ones.
    """
    wrenches = np.concatenate([leg_wrenches(at, tolerance, motor_locked=motors_locked) for at in legs])
    P = platform_point(d, 0, legs[0])
    about_P = wrenches[:, 3:] - np.cross(P, wrenches[:, :3])
    scaled = np.concatenate([wrenches[:, :3], about_P / float(d.Lc)], axis=1)
    return reciprocal(scaled, tolerance)


# --- the eight equations of the four rods ---


def rotation(turn: Array) -> Array:
    """Rotation matrix of a Cayley vector (tan of half the angle); accepts complex steps."""
    x, y, z = turn
    skew = np.array([[0.0 * x, -z, y], [z, 0.0 * x, -x], [-y, x, 0.0 * x]])
    eye = np.eye(3)
    return eye + 2.0 / (1.0 + turn @ turn) * (skew + skew @ skew)


def rod_equations(d: Design, q: Array, pose: Array) -> Array:
    """Errors (8,) of the closed robot; pose (6,) = platform point and Cayley vector. Accepts complex steps.

    Per rod: its length, and the right angle that its two universal joints keep: both carry e2 normal to e1 and to
    the rod, and the rod does not twist, so e1 at the elbow, e1 at the platform and the rod stay in one plane.
    """
    P, turn = pose[:3], rotation(pose[3:])
    errors = []
    for k in (0, 1):
        sign = SIGMA[k]
        at_zero = leg(d, k, 0.0, 0.0)
        wrist = np.array([-sign * (d.p + d.a2 * np.sin(d.beta)), 0.0, 0.0])
        arm = d.l1 * np.array([np.cos(q[k]), 0.0, -np.sin(q[k])])
        elbow = np.array([-sign * d.b, 0.0, -d.e]) + arm
        for j in (0, 1):
            e1 = at_zero.e1[j]
            rod = P + turn @ (wrist + d.a2 * e1) - (elbow + d.a1 * e1)
            errors.append(rod @ rod - (d.l2eq**2 + ((d.a1 - d.a2) * np.cos(d.beta)) ** 2))
            errors.append(np.dot(rod, np.cross(e1, turn @ e1)))
    return np.array(errors)


def complex_step(function, at: Array) -> Array:
    """Jacobian of a function that accepts complex numbers, exact to rounding."""
    step = 1e-30
    columns = [np.imag(function(at + 1j * step * direction)) / step for direction in np.eye(len(at))]
    return np.array(columns).T


# --- planar postures by the law of cosines ---


def posture(d: Design, q1: Array, q2: Array, assembly: int) -> tuple[Array, Array, Array, Array, Array]:
    """psi_1, psi_2, x, z and the distance of the elbows C; NaN where the rods cannot meet.

    The triangle C_1 C_2 P: at C_1 its angle is acos(|C_1C_2|/(2 l2eq)), on the side that the assembly mode says.
    """
    C = [
        (-sign * d.b0 + d.l1 * np.cos(q)) + 1j * (-np.asarray(d.e) - d.l1 * np.sin(q))
        for sign, q in zip(SIGMA, (q1, q2), strict=True)
    ]
    across = C[1] - C[0]
    opening = np.arccos(np.abs(across) / (2.0 * d.l2eq))
    rod1 = d.l2eq * across / np.abs(across) * np.exp(1j * assembly * opening)
    P = C[0] + rod1
    rod2 = P - C[1]
    return -np.angle(rod1), -np.angle(rod2), P.real, P.imag, np.abs(across)


def motors(d: Design, x: Array, z: Array, mode: tuple[int, int]) -> tuple[Array, Array]:
    """q_1, q_2 of a platform point; NaN where a leg cannot reach it. w = +1: u(q) turned from A P towards +y."""
    angles = []
    for sign, w in zip(SIGMA, mode, strict=True):
        to_P = (x + sign * d.b0) + 1j * (z + d.e)
        r = np.abs(to_P)
        opening = np.arccos((r**2 + d.l1**2 - d.l2eq**2) / (2.0 * d.l1 * r))
        angles.append(-np.angle(to_P * np.exp(-1j * w * opening)))
    return angles[0], angles[1]
