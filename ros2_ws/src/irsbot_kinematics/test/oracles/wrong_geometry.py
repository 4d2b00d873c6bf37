"""Machines whose geometry is off, each number on its own: true margins by Newton's method from vectors.

Errors are what `Mechanism.certified_bounds` says of its slack: every length, both coordinates of every place (three in
space), the ends of every rail, beta as the end of its arm. A machine is closed with its own legs, all of them
different, from the exact posture on; the joints go along. Only the exact posture is taken from the library.
"""

from __future__ import annotations

from typing import NamedTuple

import irsbot2_3d as space
import numpy as np
from irsbot2_3d import Design
from numpy.typing import NDArray
from postures import joint_range
from rod_machines import closed
from wrong_machines import rails, rods

import irsbot_kinematics as irs
from irsbot_kinematics.mechanisms.five_bar import FiveBar, FiveBarGeometry
from irsbot_kinematics.mechanisms.irsbot2 import Irsbot2
from irsbot_kinematics.mechanisms.irsbot2_space.geometry import Irsbot2Geometry
from irsbot_kinematics.mechanisms.linear_delta import LinearDelta, LinearDeltaGeometry
from irsbot_kinematics.mechanisms.rails2 import Rails2, Rails2Geometry
from irsbot_kinematics.mechanisms.rails3 import Rails3, Rails3Geometry
from irsbot_kinematics.mechanisms.rpr3 import Rpr3, Rpr3Geometry
from irsbot_kinematics.mechanisms.rrr3 import Rrr3, Rrr3Geometry
from irsbot_kinematics.mechanisms.rrr3_base import Rrr3Base, Rrr3BaseGeometry
from irsbot_kinematics.mechanisms.ruu4 import Ruu4, Ruu4Geometry

Array = NDArray[np.float64]
RANDOM = 24
"""Random errors per attack."""


class Truth(NamedTuple):
    """Margins of N machines, as they are."""

    type1: Array
    """(N, n)"""
    type2: Array
    """(N,)"""
    constraint: Array
    """(N,), NaN where there is none"""
    limb: Array
    """(N, limbs)"""


def number_of_errors(robot: irs.Robot) -> int:
    """How many numbers of a machine can be off."""
    n = len(robot.mechanism.joints)
    return n * {"irsbot2": 10, "five_bar": 4, "rrr3": 6, "rrr3_base": 6, "ruu4": 8}.get(robot.mechanism.kind, 7)


def margins(robot: irs.Robot, at: irs.Posture, ahead: Array, wrong: Array) -> Truth:
    """ahead: (N, n) by which the joints are ahead of the posture's; wrong: (N, number_of_errors) m."""
    m, g = robot.mechanism, robot.mechanism.geometry
    n, q = len(m.joints), np.array(at.joints) + ahead
    e = wrong.reshape(len(wrong), n, -1)
    machine = rods(robot, at)
    if m.kind == "irsbot2":
        return _irsbot2(robot, at, q, e)
    if m.kind == "five_bar":
        elbows, rod = _elbows(g.b, 0.0, g.l1 + e[..., 2], q, e[..., :2]), e[..., 3]
        shift = elbows - _elbows(g.b, 0.0, g.l1, np.array(at.joints), 0.0 * e[0, :, :2])
        met = closed(machine, shift, rod)
        crank = np.stack([np.cos(q), -np.sin(q)], axis=2)
        return Truth(_across(crank, met.r), met.type2, np.full(len(q), np.nan), np.empty((len(q), 0)))
    if m.kind == "rrr3":
        a, b = g.l + e[..., 4], g.l + e[..., 5]
        rho = np.sqrt(a * a + b * b + 2.0 * a * b * np.cos(q))
        met = closed(machine, e[..., :2], rho - machine.length, turned(at, e[..., 2:4]))
        type1 = a * b * np.abs(np.sin(q)) / rho / np.minimum(a, b)
        return Truth(type1, met.type2, np.full(len(q), np.nan), rho / (a + b))
    if m.kind in ("rrr3_base", "ruu4"):
        d = machine.r.shape[1]
        crank = np.stack([np.cos(q), np.sin(q), 0.0 * q][:d], axis=2)
        start = np.stack([np.cos(at.joints), np.sin(at.joints), np.zeros(n)][:d], axis=1)
        shift = (g.l1 + e[..., -2:-1]) * crank - g.l1 * start + e[..., :d]
        corner = e[..., d : 2 * d]
        if d == 3:  # a corner that is too high is a foot that is too low
            shift[..., 2] -= corner[..., 2]
        met = closed(machine, shift, e[..., -1], turned(at, corner[..., :2]))
        type1 = _across(crank, met.r)
        if d == 2:
            return Truth(type1, met.type2, np.full(len(q), np.nan), np.empty((len(q), 0)))
        level = met.r[..., :2] / np.linalg.norm(met.r[..., :2], axis=2, keepdims=True)
        return Truth(type1, met.type2, np.linalg.svd(level, compute_uv=False)[:, 1] / np.sqrt(2.0), type1)
    lower, upper = (np.array([[getattr(joint, end)] for joint in m.joints]) for end in ("lower", "upper"))
    ways = rails(robot)
    struts = np.isnan(ways[:, 0])
    d = ways.shape[1]
    if d == 2:
        origins = np.array([getattr(g, f"o{i}", None) or getattr(g, f"a{i}") for i in (1, 2, 3)])
    else:
        origins = np.array([rail.origin for rail in m.rails])
    first, last = origins + lower * ways + e[..., :d], origins + upper * ways + e[..., d : 2 * d]
    along = last - first
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    # a rail is as long as it is: slides count from the middle
    slide = 0.5 * (first + last) + (q[..., None] - 0.5 * (lower + upper)) * along
    shift = slide - origins - np.array(at.joints)[:, None] * ways
    if d == 2:
        shift = np.where(struts[:, None], e[..., :2], shift)
        longer = e[..., 6] + np.where(struts, q - np.array(at.joints), 0.0)
        met = closed(machine, shift, longer, turned(at, e[..., 4:6]))
        type1 = np.where(struts, 1.0, np.abs(np.sum(met.r * along, axis=2)))
        limb = ((q + e[..., 6]) / upper[:, 0])[:, struts]
        return Truth(type1, met.type2, np.full(len(q), np.nan), np.minimum(limb, 1.0))
    met = closed(machine, shift, e[..., 6])
    type1 = np.abs(np.sum(met.r * along, axis=2))
    return Truth(type1, met.type2, np.full(len(q), np.nan), type1[:, : m.limb_count])


def turned(at: irs.Posture, corner: Array) -> Array:
    """Errors on the platform (..., 2) as they are seen from the base in the exact posture."""
    c, s = np.cos(at.pose[-1]), np.sin(at.pose[-1])
    return np.stack([c * corner[..., 0] - s * corner[..., 1], s * corner[..., 0] + c * corner[..., 1]], axis=-1)


def _across(crank: Array, r: Array) -> Array:
    size: Array = np.abs(crank[..., 0] * r[..., 1] - crank[..., 1] * r[..., 0])
    return size


def _elbows(half_base: Array | float, drop: Array | float, crank: Array | float, q: Array, foot: Array) -> Array:
    """(..., 2, 2) ends C_k of the cranks of a planar loop."""
    x = np.array([-1.0, 1.0]) * half_base + crank * np.cos(q) + foot[..., 0]
    return np.stack([x, -drop - crank * np.sin(q) + foot[..., 1]], axis=-1)


def _irsbot2(robot: irs.Robot, at: irs.Posture, q: Array, e: Array) -> Truth:
    """Per leg: motor x, z; wrist x, z; e, l1, l2eq, a1, a2, end of the arm across it."""
    g = robot.mechanism.geometry
    motor, wrist, drop, crank, rod, a1, _a2, across = e[..., :2], e[..., 2:4], *(e[..., k] for k in range(4, 10))
    beta = g.beta + across / g.a1
    inwards = np.array([1.0, -1.0]) * (g.p + (g.a1 + a1) * np.sin(beta))  # from the elbow frame's end to P's legs
    foot = motor - wrist
    foot[..., 0] += inwards - np.array([1.0, -1.0]) * (g.p + g.a1 * np.sin(g.beta))
    foot[..., 1] -= drop
    shift = _elbows(g.b, g.e, g.l1 + crank, q, foot) - _elbows(g.b, g.e, g.l1, np.array(at.joints), 0.0 * foot[0])
    met = closed(rods(robot, at), shift, rod)
    cranks = np.stack([np.cos(q), -np.sin(q)], axis=2)
    kappa = kappa_of_wrong_legs(robot, np.arctan2(-met.r[..., 1], met.r[..., 0]), e)
    return Truth(_across(cranks, met.r), met.type2, kappa, np.empty((len(q), 0)))


def kappa_of_wrong_legs(robot: irs.Robot, psi: Array, e: Array) -> Array:
    """Constraint margin (N,) of rods at psi (N, 2), from points in space; e as in `_irsbot2`."""
    g = robot.mechanism.geometry
    wrist, rod, a1, a2, beta = e[..., 2:4], e[..., 6], e[..., 7], e[..., 8], g.beta + e[..., 9] / g.a1
    columns, points, length = [], [], 0.0
    for i in (0, 1):
        d = Design(g.l1, g.l2eq + rod[:, i], g.b, g.p, g.a1 + a1[:, i], g.a2 + a2[:, i], beta[:, i], g.e)
        leg = space.leg(d, i, 0.0, psi[:, i])
        columns += [leg.n[:, 0], leg.n[:, 1]]
        aside = space.vector(wrist[:, i, 0], 0.0, wrist[:, i, 1])
        points.append(space.rod_lines_meet(leg) - space.platform_point(d, i, leg) + aside)  # P_k seen from P
        length = length + d.Lc / 2.0 - space.SIGMA[i] * wrist[:, i, 0]
    columns.append(np.cross(space.AXIS_Y, points[1] - points[0]) / length[:, None])
    kappa: Array = np.linalg.svd(np.stack(columns, axis=-1), compute_uv=False)[:, 2]
    return kappa


# --- attacks ---


def columns(found: Truth | irs.Posture | irs.CertifiedBounds) -> Array:
    """(N, margins) of margins that the machine has."""
    constraint = np.atleast_1d(found.constraint)
    type2 = np.atleast_1d(found.type2)
    named = [np.atleast_2d(found.type1), type2[:, None], constraint[:, None], np.atleast_2d(found.limb)]
    table = np.concatenate([part for part in named if part.shape[1]], axis=1)
    return table[:, ~np.isnan(table[0])]


def attacks(
    robot: irs.Robot, at: irs.Posture, travel: Array, slack: float, rng: np.random.Generator
) -> tuple[Array, Array]:
    """(N, n) joints ahead and (N, k) errors: random ones, half of them at their limits, and for every margin the
    signs of joints and errors that lower it fastest."""
    n, k = len(travel), number_of_errors(robot)
    limits = np.concatenate([travel, np.full(k, slack)])
    step = 1e-7 * np.eye(n + k)
    tries = np.concatenate([np.zeros((1, n + k)), step])
    there = columns(margins(robot, at, tries[:, :n], tries[:, n:]))
    fastest = -np.sign(there[1:] - there[0]).T
    inner = rng.uniform(-1.0, 1.0, (RANDOM, n + k))
    inner[: RANDOM // 2] = np.sign(inner[: RANDOM // 2])
    points = limits * np.concatenate([fastest, inner])
    return points[:, :n], points[:, n:]


def random_machine(kind: str, rng: np.random.Generator) -> irs.Robot:
    """Proportions of all sorts."""
    size = lambda *shape: np.exp(rng.uniform(np.log(0.1), np.log(0.6), shape)).tolist()  # noqa: E731
    point = lambda n, r: tuple((r * rng.normal(size=n)).tolist())  # noqa: E731
    while True:
        try:
            if kind == "irsbot2":
                l1, l2eq, b, p, a1 = size(5)
                return irs.Robot(
                    Irsbot2(Irsbot2Geometry(l1, l2eq, b, p, a1, a1 * rng.uniform(0.1, 0.8), rng.uniform(0.1, 1.4)))
                )
            if kind == "five_bar":
                return irs.Robot(FiveBar(FiveBarGeometry(*size(3))))
            if kind == "rrr3":
                return irs.Robot(Rrr3(Rrr3Geometry(*size(3))))
            if kind == "rrr3_base":
                base, platform = [point(2, 0.3) for _ in range(3)], [point(2, 0.1) for _ in range(3)]
                return irs.Robot(Rrr3Base(Rrr3BaseGeometry(*base, *platform, *size(2))))
            if kind == "ruu4":
                return irs.Robot(Ruu4(Ruu4Geometry(*size(4))))
            if kind in ("rpr3", "rails3", "rails2"):
                base, platform = [point(2, 0.3) for _ in range(3)], [point(2, 0.1) for _ in range(3)]
                first, second, third = (point(2, 1.0) for _ in range(3))
                if kind == "rpr3":
                    return irs.Robot(Rpr3(Rpr3Geometry(*base, *platform, (0.0, 0.8))))
                if kind == "rails3":
                    ways = first, second, third
                    return irs.Robot(Rails3(Rails3Geometry(*base, *ways, *platform, tuple(size(3)), (-0.5, 0.5))))
                return irs.Robot(
                    Rails2(Rails2Geometry(*base, first, second, *platform, *size(2), (0.0, 0.8), (-0.5, 0.5)))
                )
            ends = [part for _ in range(3) for part in (point(3, 0.2), point(3, 1.0))]
            return irs.Robot(LinearDelta(LinearDeltaGeometry(0.5, (-0.5, 0.5), *ends)))
        except irs.InvalidGeometry:
            continue


def some_posture(robot: irs.Robot, rng: np.random.Generator) -> irs.Posture | None:
    lower, upper = joint_range(robot)
    for _ in range(20):
        assembly = int(rng.choice(robot.mechanism.assembly_modes))
        at = robot.mechanism.posture(tuple(rng.uniform(lower, upper).tolist()), assembly)
        if at.status == irs.Status.SOLVED and min(*at.type1, at.type2) > 0.02:
            return at
    return None


def random_travel(robot: irs.Robot, at: irs.Posture, rng: np.random.Generator) -> Array:
    """(n,) rad or m that stays within the range of the joints."""
    lower, upper = joint_range(robot)
    travel = (upper - lower) * 10.0 ** rng.uniform(-6.0, -2.5) * rng.uniform(0.0, 1.0, len(lower))
    inside: Array = np.minimum(np.array(at.joints) - lower, upper - np.array(at.joints))
    return np.minimum(travel, inside)
