"""Further measures of the planar loop of the IRSBot-2 and the five-bar, in addition to the margins of every mechanism.

Pure functions of a posture, in plain floats. Conditioning, rates of the rods and of the gaps, distances to the postures
with parallel rods, forces in the rods. Source: IRSBot-2 sheet sections 5 to 7 and 10; frame and angles as in
`mechanisms.planar_pair`. Those without a printed source are ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, hypot, inf, nan, remainder, sin, sqrt, tau
from typing import NamedTuple

from irsbot_kinematics.mechanism import Floats, Posture, Signs
from irsbot_kinematics.mechanisms.irsbot2 import Irsbot2
from irsbot_kinematics.mechanisms.planar_loop import arc_distance, coincident_arcs, coincident_elbows
from irsbot_kinematics.mechanisms.planar_pair import PlanarPair


class Distal(NamedTuple):
    """A distal leg of the IRSBot-2 in the plane of motion: E_k F_k = lambda u(theta)."""

    theta: float
    """rad."""
    lam: float
    """m."""


class JointBounds(NamedTuple):
    """Least motion of the joints to a Type 2 singularity, rad; infinite if there is none."""

    sum: float
    """|dq_1| + |dq_2|."""
    norm: float
    """Euclidean norm of dq."""
    largest: float
    """The larger of |dq_1|, |dq_2|."""


def inverse_condition_of_rods(at: Posture) -> float:
    """1/cond(A), 0..1, 0 at Type 2: tan of half the acute angle between the rods. Sheet section 6."""
    (ax, az), (bx, bz) = at.screws
    return abs(at.det) / (1.0 + abs(ax * bx + az * bz))


def inverse_condition_of_jacobian(at: Posture) -> float:
    """1/cond(J), 0..1, 0 at Type 1 and at Type 2; J maps joint rates to the platform's velocity, both joints revolute.

    N = adj(A) B has the singular values of J times |det A|, so nothing is divided by det A. Sheet section 6.
    """
    (ax, az), (bx, bz) = at.screws
    b1, b2 = at.levers
    size = b1 * b1 * (bx * bx + bz * bz) + b2 * b2 * (ax * ax + az * az)
    det = abs(at.det * b1 * b2)
    if not size > 0.0:
        return 0.0 * size
    return 2.0 * det / (size + sqrt(max((size - 2.0 * det) * (size + 2.0 * det), 0.0)))


def rod_rates(pair: PlanarPair, at: Posture, joint_rates: Sequence[float], pose_rates: Sequence[float]) -> Floats:
    """psidot_k, rad/s, for consistent rates (A t + B qdot = 0). Sheet section 5."""
    crank, rod = pair.loop.crank, pair.loop.rod
    xdot, zdot = pose_rates
    rates = []
    for q, rate, (rx, rz) in zip(at.joints, joint_rates, at.screws, strict=True):
        rates.append((rz * (xdot + crank * rate * sin(q)) - rx * (zdot + crank * rate * cos(q))) / rod)
    return tuple(rates)


def gap_rate(pair: PlanarPair, at: Posture, joint_rates: Sequence[float]) -> float:
    """Rate, m/s, at which the distance of the elbows grows: the rate of gaps[1], and minus the rate of gaps[0]. Sheet
    section 6."""
    (ax, az), (bx, bz) = at.screws  # C_1C_2 = rod (r_1 - r_2)
    vx, vz = ax - bx, az - bz
    crank = pair.loop.crank
    (q1, q2), (w1, w2) = at.joints, joint_rates
    return crank * (vx * (sin(q1) * w1 - sin(q2) * w2) + vz * (cos(q1) * w1 - cos(q2) * w2)) / hypot(vx, vz)


def type2_joint_bounds(pair: PlanarPair, at: Posture) -> JointBounds:
    """Guaranteed joint travel to the nearest Type 2 singularity, in three norms. Sheet section 6.

    Each elbow moves by crank |dq_k| at most, and a gap closes no faster than both together. A kind of singularity
    that the lengths exclude does not count.
    """
    gap = inf
    if abs(pair.loop.half_base) <= pair.loop.crank:
        gap = at.gaps[1]
    if abs(pair.loop.half_base) + pair.loop.crank >= pair.loop.rod:
        gap = min(gap, at.gaps[0])
    reach = gap / pair.loop.crank
    return JointBounds(reach, reach / sqrt(2.0), reach / 2.0)


def joint_distance_to_parallel_rods(pair: PlanarPair, joints: Sequence[float]) -> float:
    """Exact distance on the torus of joint angles, rad, to the isolated points with psi_I = psi_II; inf if none."""
    distances = [
        hypot(remainder(joints[0] - q1, tau), remainder(joints[1] - q2, tau)) for q1, q2 in coincident_elbows(pair.loop)
    ]
    return min(distances, default=inf)


def distance_to_parallel_rods(pair: PlanarPair, pose: Sequence[float], working_mode: Signs | None = None) -> float:
    """Exact distance of the platform point, m, to the arcs with psi_I = psi_II of one working mode, or of any.

    Infinite where the lengths exclude them. Sheet section 6.
    """
    modes = pair.working_modes if working_mode is None else (working_mode,)
    arcs = [arc for mode in modes for arc in coincident_arcs(pair.loop, mode)]
    x, z = pose
    return min((arc_distance(x - cx, z - cz, pair.loop.rod, start, size) for cx, cz, start, size in arcs), default=inf)


def distal_legs(robot: Irsbot2, at: Posture) -> tuple[Distal, Distal]:
    """theta_k and lambda_k of both distal legs: lambda u(theta) = l2eq u(psi) + sigma D x, [S0] (35) corrected."""
    g = robot.geometry
    (ax, az), (bx, bz) = at.screws
    return _distal(g.l2eq * ax + g.D, g.l2eq * az), _distal(g.l2eq * bx - g.D, g.l2eq * bz)


def _distal(fx: float, fz: float) -> Distal:
    return Distal(atan2(-fz, fx), hypot(fx, fz))


def rod_line_points_apart(robot: Irsbot2, at: Posture) -> tuple[float, float]:
    """P_I P_II (x, z), m: between the points where the rod lines of each leg meet, [S0] (36)."""
    g = robot.geometry
    (ax, az), (bx, bz) = at.screws
    return 2.0 * g.p + g.ell * (bx - ax), g.ell * (bz - az)


def rod_forces(robot: Irsbot2, leg_forces: Sequence[float]) -> Floats:
    """N, force in each of the two rods of each leg, compression positive: R_k l2/(2 l2eq).

    leg_forces: N, in-plane forces of the legs as `statics.reactions` gives them. Both rods of a leg carry the same; a
    force along y or a moment loads them differentially and is hyperstatic. Sheet section 10.
    """
    share = robot.geometry.l2 / (2.0 * robot.geometry.l2eq)
    return tuple([share * force for force in leg_forces])


def leg_forces_from_efforts(at: Posture, efforts: Sequence[float], smallest_sine: float) -> Floats:
    """N, force of each leg on the platform behind external motor efforts: R_k = -tau_k/(l1 sin(q_k - psi_k)).

    efforts: N m, measured minus what gravity, inertia and friction explain. NaN for a leg whose Type 1 margin is not
    above `smallest_sine`: there the motors do not feel the force. Regular at Type 2. Sheet section 10.
    """
    pairs = zip(efforts, at.levers, at.normalised_levers, strict=True)
    return tuple([-effort / lever if abs(sine) > smallest_sine else nan for effort, lever, sine in pairs])
