"""Turning platforms on cranks: leg i is a crank on the base at A_i and a rod from its end C_i to the platform at B_i.

Planar with three legs or in space with four; cranks and platform turn about z. Such a platform has up to six turns for
one joint position and no closed form. All assemblies come from a polynomial; between neighbours the branch is followed.
Labels of these branches cannot hold everywhere, because two branches may be joined by a motion that meets no
singularity: a label is the sign of det A and a rank among the poses of that sign, the least turned one first.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from math import cos, hypot, inf, isfinite, nan, pi, remainder, sin, sqrt, tau
from operator import add, mul, neg, sub
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from irsbot_kinematics import statics
from irsbot_kinematics.arithmetic import ARRAYS, FLOATS, Arithmetic, Array, N
from irsbot_kinematics.assemblies import SAMPLED_TURNS, trigonometric_roots
from irsbot_kinematics.boxes import Reached, Rod
from irsbot_kinematics.guarantees import EXACT, Errors, lowered
from irsbot_kinematics.mechanism import Coordinate, Floats, Legs, Posture, Signs, Status, sign_of
from irsbot_kinematics.mechanisms.turning_platform import Travel, TurningPlatform
from irsbot_kinematics.quadratics import Quadratic
from irsbot_kinematics.skeleton import BASE, Link, Vector, Z
from irsbot_kinematics.tolerances import CLOSURE_TOL_M, FOLLOWED_TOL_M, SAME_POSE_TOL, UNREAL_TOL, VANISHED_TOL

Point = tuple[float, float]
TINY = 1e-200
"""m or 1: keeps the direction of a rod defined where it has none: upright, or without length at a pose that is not its
own. The margins, or the closure, then say so."""
POLISH = 3
"""Newton steps on every root of the polynomial: they start closer than 1e-4 and double the digits each time."""
NEAR = 0.01
"""1: a candidate that misses by more than this, over the size of the robot, is no root that rounding has displaced."""
FOLLOW = 4
"""Steps at most with the neighbour's screws, and Newton steps at most after them."""
HALVINGS = 6
"""How often the way from a neighbour is halved before the branch counts as lost."""
TURN_DIGITS = 9
"""Digits behind the point, rad, to which turns are compared in size: symmetric machines turn alike to both sides."""
MISSED_M = 1e-6
"""m: least closure error said of a label that has no pose; candidates that nearly close may belong to other labels."""


class Poses(NamedTuple):
    """Candidate poses of N joint positions, M each."""

    pose: tuple[Array, ...]
    """Coordinates, (N, M) each."""
    det: Array
    """(N, M) determinant of A, m."""
    valid: NDArray[np.bool_]
    """(N, M) whether the candidate closes and is not a copy of another one."""
    miss: Array
    """(N,) m: smallest closure error of the candidates that do not close; infinite if all do."""
    known: NDArray[np.bool_]
    """(N,) whether the joints determine the pose at all."""


class CrankPlatform(TurningPlatform):
    """Kinematics of cranks and rods; the legs themselves are in the subclasses."""

    labels_hold: ClassVar[bool] = False
    feet: tuple[Point, ...]
    """A_i, m."""
    corners: tuple[Point, ...]
    """B_i seen from the platform point when the platform is not turned, m."""
    crank: float
    rod: float

    def __init__(self, feet: Sequence[Point], corners: Sequence[Point], crank: float, rod: float) -> None:
        self.feet, self.corners, self.crank, self.rod = tuple(feet), tuple(corners), crank, rod
        self.radius = self.length_m = max(hypot(*corner) for corner in corners)
        self.span = max(hypot(a[0] - b[0], a[1] - b[1]) for a in corners for b in corners)
        self.joints = tuple(Coordinate(f"crank_{i + 1}", "rad", -inf, inf) for i in range(len(self.feet)))
        names = ("x", "y", "phi") if len(self.feet) == 3 else ("x", "y", "z", "phi")
        self.task = tuple(Coordinate(name, "rad" if name == "phi" else "m", -inf, inf) for name in names)
        self._size = max(hypot(*foot) for foot in feet) + crank + rod + self.radius

    @abstractmethod
    def closing(self, joints: Sequence[Array], cosine: Array, sine: Array) -> Array:
        """What has to vanish at the turn of the platform, without unit: a trigonometric polynomial of degree 3."""

    @abstractmethod
    def candidates(self, joints: Sequence[Array], turn: Array) -> tuple[Array, ...]:
        """Poses with given turns (N, 6): coordinates (N, M)."""

    def ends(self, joints: Sequence[Array], cosine: Array, sine: Array) -> list[tuple[Array, Array]]:
        """R b_i - C_i, horizontally, m: what P has to be added to for the rod."""
        return [
            (
                cosine * bx - sine * by - fx - self.crank * np.cos(q),
                sine * bx + cosine * by - fy - self.crank * np.sin(q),
            )
            for (fx, fy), (bx, by), q in zip(self.feet, self.corners, joints, strict=True)
        ]

    # --- description -----------------------------------------------------------------------------------------------

    def arms(self) -> list[Link]:
        """The cranks as links."""
        return [
            Link(f"arm_{leg}", joint.name, BASE, (x, y, 0.0), Z, shape=((self.crank, 0.0, 0.0),))
            for leg, (joint, (x, y)) in enumerate(zip(self.joints, self.feet, strict=True), 1)
        ]

    @property
    def platform_corners(self) -> list[Vector]:
        """`corners`, in space."""
        return [(x, y, 0.0) for x, y in self.corners]

    # --- cranks ----------------------------------------------------------------------------------------------------

    def inverse(self, k: Arithmetic[N], pose: Sequence[N], mode: Signs) -> tuple[tuple[N, ...], tuple[N, ...]]:
        """q = azimuth of A_iB_i + w atan2(area, ...): the circle of C_i about A_i against the sphere about B_i.

        The circle's farthest and nearest points are far and near away: 16 area^2 = (far^2 - rod^2)(rod^2 - near^2).
        """
        x, y, phi = pose[0], pose[1], pose[-1]
        z = pose[2] if len(pose) == 4 else 0.0 * x
        c, s, joints, reach = k.cos(phi), k.sin(phi), [], []
        for (fx, fy), (bx, by), w in zip(self.feet, self.corners, mode, strict=True):
            X, Y = x + c * bx - s * by - fx, y + s * bx + c * by - fy
            r = k.hypot(X, Y)
            near, far = k.hypot(r - self.crank, z), k.hypot(r + self.crank, z)
            area = k.root((far - self.rod) * (far + self.rod) * (self.rod - near) * (self.rod + near))
            along = r * r + z * z + (self.crank - self.rod) * (self.crank + self.rod)
            joints.append(k.wrap(k.atan2(Y, X) + w * k.atan2(area, along)))
            reach.append(k.least(self.rod - near, far - self.rod))
        return tuple(joints), tuple(reach)

    # --- all assemblies ----------------------------------------------------------------------------------------------

    def direct(self, k: Arithmetic[N], joints: Sequence[N], assembly: int) -> tuple[tuple[N, ...], tuple[N, N]]:
        """Gaps: [0] |det A|, m; where there is no such pose, minus the closure error of the nearest candidate;
        [1] the size of the robot, or 0 where the platform can turn without the cranks."""
        answer: Any = self._picked([np.atleast_1d(np.asarray(q, dtype=float)) for q in joints], assembly)
        if k is FLOATS:
            pose, (gap, size) = answer
            answer = tuple([float(column[0]) for column in pose]), (float(gap[0]), float(size[0]))
        return answer  # type: ignore[no-any-return]

    def _picked(self, joints: Sequence[Array], assembly: int) -> tuple[tuple[Array, ...], tuple[Array, Array]]:
        """Pose (N,) of one label, and the gaps."""
        poses = self.assemblies(joints)
        same = poses.valid & (np.sign(poses.det) == (1.0 if assembly > 0 else -1.0))
        chosen = same & (np.cumsum(same, axis=1) == abs(assembly))
        there, column = chosen.any(axis=1), np.argmax(chosen, axis=1)[:, None]
        pose = tuple([np.take_along_axis(c, column, axis=1)[:, 0] for c in poses.pose])
        det = np.abs(np.take_along_axis(poses.det, column, axis=1)[:, 0])
        gap = np.where(there, det, np.where(poses.known, -np.clip(poses.miss, MISSED_M, self._size), 0.0))
        return pose, (gap, np.where(poses.known, self._size, 0.0))

    def assemblies(self, joints: Sequence[Array]) -> Poses:
        """All poses of joint positions, each (N,), the least turned one first; of two turned alike the negative one."""
        with np.errstate(all="ignore"):  # candidates that do not close may divide by zero; they are not valid
            return self._assemblies(joints)

    def _assemblies(self, joints: Sequence[Array]) -> Poses:
        cosine, sine = np.cos(SAMPLED_TURNS), np.sin(SAMPLED_TURNS)
        values = self.closing([q[:, None] for q in joints], cosine, sine)
        known = np.abs(values).max(axis=1) > VANISHED_TOL
        turns, unreal = trigonometric_roots(values)
        start = self.candidates([q[:, None] for q in joints], turns)
        repeated = [np.broadcast_to(q[:, None], start[0].shape) for q in joints]
        miss = self._error(repeated, start)
        pose = self._polished(repeated, start)
        order = np.lexsort((pose[-1], np.round(np.abs(pose[-1]), TURN_DIGITS)), axis=1)
        pose = tuple([np.take_along_axis(column, order, axis=1) for column in pose])
        legs = self.legs(ARRAYS, repeated, pose)
        left = np.max(np.abs(legs.closure), axis=0)
        miss = np.take_along_axis(miss, order, axis=1)
        valid = (left <= CLOSURE_TOL_M) & (miss <= NEAR * self._size) & known[:, None]
        real = np.tile(unreal <= UNREAL_TOL, (1, pose[0].shape[1] // unreal.shape[1]))
        valid &= np.take_along_axis(real, order, axis=1)
        valid &= ~_copies(pose, valid, left)
        miss = np.where(valid, np.inf, np.nan_to_num(miss, nan=np.inf))
        return Poses(pose, statics.cofactors(legs.screws)[0], valid, miss.min(axis=1), known)

    def _polished(self, joints: Sequence[Array], pose: tuple[Array, ...]) -> tuple[Array, ...]:
        for _ in range(POLISH):
            pose, _ = self._improved(ARRAYS, joints, pose)
        return (*pose[:-1], ARRAYS.wrap(pose[-1]))

    def _error(self, joints: Sequence[Array], pose: Sequence[Array]) -> Array:
        closure = self.legs(ARRAYS, joints, pose).closure
        error: Array = np.max(np.abs(closure), axis=0)
        return error

    def _improved(self, k: Arithmetic[N], joints: Sequence[N], pose: Sequence[N]) -> tuple[tuple[N, ...], Legs[N]]:
        """One Newton step, and the legs before it."""
        legs = self.legs(k, joints, pose)
        step = statics.twist(legs.screws, [-error for error in legs.closure])
        return tuple([value + change for value, change in zip(pose, step, strict=True)]), legs

    # --- one branch --------------------------------------------------------------------------------------------------

    def track(self, joints: Sequence[float], previous: Posture) -> Posture:
        """The posture that the branch of `previous` has at neighbouring joints.

        A step counts only with a proof: the box of guarantees.displacement_and_turn holds exactly one solution, and
        det A keeps its sign in it, because the inequality's right side contracts there. Steps that are too long are
        halved along the straight way, the shorter one round a crank; after HALVINGS the branch is lost, SINGULAR.
        """
        if previous.status != Status.SOLVED:
            return self.posture(joints, previous.assembly_mode or self.usual_assembly_mode)
        asked = tuple(joints)
        if not all(map(isfinite, asked)):
            return super().posture(asked, previous.assembly_mode)
        pairs = zip(asked, previous.joints, strict=True)
        goal = tuple([q if abs(q - p) <= pi else p + remainder(q - p, tau) for q, p in pairs])
        at, length, left = previous, 1.0, 1.0
        while left > 0.0:
            share = min(length / left, 1.0)
            ahead = goal if share == 1.0 else _between(at.joints, goal, share)
            step = self._follow(ahead, at)
            if step is not None:
                at, left = step, left - length
            elif length > 0.5**HALVINGS:
                length *= 0.5
            else:
                return self._undetermined(Status.SINGULAR, asked, (0.0, self._size))
        return at if goal == asked else at._replace(joints=asked)

    def _follow(self, joints: Floats, at: Posture) -> Posture | None:
        """One proved step, or None: first order, steps with the screws of `at`, then Newton steps."""
        ahead = list(map(sub, joints, at.joints))
        d, t = self.box(at, self.travel_of(at, list(map(abs, ahead)), 0.0))
        if not d + t < inf:
            return None
        det, columns = statics.cofactors(at.screws)
        ends = [
            (fx + self.crank * cos(q), fy + self.crank * sin(q)) for (fx, fy), q in zip(self.feet, joints, strict=True)
        ]
        pose, drive = at.pose, list(map(neg, map(mul, at.levers, ahead)))
        for _ in range(FOLLOW):
            pose = tuple(map(add, pose, statics.combined(det, columns, drive)))
            drive = self._misfit(ends, pose)
            if max(map(abs, drive)) <= FOLLOWED_TOL_M:
                break
        found = self.at(joints, pose, at.assembly_mode, at.gaps)  # type: ignore[arg-type]
        for _ in range(FOLLOW):
            if found.residual <= FOLLOWED_TOL_M or found.det == 0.0:
                break
            drive = list(map(neg, found.parts[2 * len(joints) :]))
            pose = tuple(map(add, found.pose, statics.twist(found.screws, drive)))
            found = self.at(joints, pose, at.assembly_mode, at.gaps)  # type: ignore[arg-type]
        *shift, turn = map(sub, found.pose, at.pose)
        inside = hypot(*shift) <= d + CLOSURE_TOL_M and abs(turn) <= t + CLOSURE_TOL_M / self.radius
        return found if inside and found.residual <= CLOSURE_TOL_M else None

    def _misfit(self, ends: Sequence[Point], pose: Floats) -> list[float]:
        """rod - |C_iB_i|, m, with the crank ends given."""
        x, y, *z, phi = pose
        c, s = cos(phi), sin(phi)
        return [
            self.rod - hypot(x + c * bx - s * by - ex, y + s * bx + c * by - ey, *z)
            for (ex, ey), (bx, by) in zip(ends, self.corners, strict=True)
        ]

    def at(self, joints: Floats, pose: Floats, assembly: int, gaps: tuple[float, float]) -> Posture:
        """gaps[0] is |det A| whatever is given. `parts`: column sizes of adj(A), then the signed closure errors."""
        legs = self.legs(FLOATS, joints, pose)
        det, columns = statics.cofactors(legs.screws)
        size = abs(det)
        if len(joints) == 3:
            moves = [hypot(vx, vy) for vx, vy, _ in columns]
            speeds = [hypot(vx - w * ay, vy + w * ax) for (vx, vy, w), (ax, ay) in zip(columns, legs.arms, strict=True)]
        else:
            moves = [hypot(vx, vy, vz) for vx, vy, vz, _ in columns]
            speeds = [
                hypot(vx - w * ay, vy + w * ax, vz)
                for (vx, vy, vz, w), (ax, ay) in zip(columns, legs.arms, strict=True)
            ]
        return Posture(
            Status.SOLVED,
            joints,
            pose,
            tuple([sign_of(sine) for sine in legs.sines]),
            assembly,
            legs.screws,
            legs.levers,
            legs.sines,
            legs.reach,
            (size, gaps[1]),
            tuple([FLOATS.ratio(size, speed) for speed in speeds]),
            det,
            nan if legs.constraint is None else legs.constraint,
            legs.limb,
            max(map(abs, legs.closure)),
            legs.arms,
            (*moves, *[abs(column[-1]) for column in columns], *legs.closure),
        )

    # --- guarantees, one sample --------------------------------------------------------------------------------

    def travel_of(self, at: Posture, travel: Sequence[float], slack_m: float) -> Travel:
        """C_i moves by at most crank travel_i; along the rod by |B_ii| travel_i + crank travel_i^2/2."""
        half = 0.5 * self.crank
        ends, length, _ = self.geometry_errors(slack_m) if slack_m else EXACT
        off = ends + length
        drives = [(abs(lever) + half * t) * t + off for lever, t in zip(at.levers, travel, strict=True)]
        return Travel(drives, self.crank * max(travel) + ends, self.rod)

    def geometry_errors(self, slack_m: float) -> Errors:
        """Level, the places of both joints and the crank's length, which moves its end along the crank; along z both
        places, where there is a z."""
        place = sqrt(2.0) * slack_m
        level = 2.0 * place + slack_m
        return Errors(hypot(level, 2.0 * slack_m) if len(self.feet) == 4 else level, slack_m, place)

    def rods_of(self, at: Posture, travel: Sequence[float], slack_m: float) -> list[Rod]:
        """The near ends run on the circles of the cranks."""
        l1, level, rods = self.crank, (0.0,) * (len(at.pose) - 3), []
        ends, length, _ = self.geometry_errors(slack_m) if slack_m else EXACT
        for q, h in zip(at.joints, travel, strict=True):
            x, y = l1 * h * cos(q), l1 * h * sin(q)
            near, curve = (-y, x, *level), (-0.5 * h * x, -0.5 * h * y, *level)
            rods.append(Rod(self.rod, near, l1 * h * h * h / 6.0 + ends, 0.0, length, curve))
        return rods

    def sines_over(self, at: Posture, travel: Sequence[float], met: Reached, slack_m: float) -> Floats:
        """The sine is the cross product of the directions of crank and rod, seen from above."""
        q, h, t, each = np.array(at.joints), np.array(travel), met.rods.terms, np.arange(len(travel))
        n, x, y, rest = len(q), np.cos(q), np.sin(q), h * h * h / 6.0
        cranks = np.zeros((t.number, 2, n))
        # y before x, as the cross product takes them.
        cranks[0] = y, x
        cranks[1 + each, :, each] = np.array([h * x, -h * y]).T
        cranks[1 + n + each, :, each] = (-0.5 * h * h * cranks[0]).T
        products = met.rods[:2] * Quadratic(t, cranks, np.array([rest, rest]))
        sines = (products[0] - products[1]).times(np.sign(at.sines))
        return tuple(np.maximum(sines.least() / met.longest, 0.0).tolist())

    def sine_floors(self, at: Posture, travel: Sequence[float], turn_rad: float, slack_m: float = 0.0) -> Floats:
        """The sine is |elevation| of the rod over the upright plane through its crank: both turn by bounded angles."""
        return tuple([lowered(sine, turn_rad + t, 0.0) for sine, t in zip(at.type1, travel, strict=True)])

    def turn_rate(self, at: Posture) -> tuple[float, float]:
        """A rod end that moves by v drags the crank's end by at most v/sine: the rod turns by at most
        (1 + 1/sine) v/rod. sine^2 = (far^2 - rod^2)(rod^2 - near^2)/(2 crank rod)^2; far, near change by at most v."""
        ball = 0.5 * min(at.reach)
        if not ball > 0.0:
            return 0.0, inf
        l1, l2 = self.crank, self.rod
        z = at.pose[2] if len(at.pose) == 4 else 0.0
        least = inf
        for (ax, ay), (fx, fy) in zip(at.arms, self.feet, strict=True):
            r = hypot(at.pose[0] + ax - fx, at.pose[1] + ay - fy)
            near, far = hypot(r - l1, z) + ball, hypot(r + l1, z) - ball
            least = min(least, (far - l2) * (far + l2) * (l2 - near) * (l2 + near))
        return (ball, (1.0 + 2.0 * l1 * l2 / sqrt(least)) / l2) if least > 0.0 else (0.0, inf)


def _copies(pose: Sequence[Array], valid: NDArray[np.bool_], left: Array) -> NDArray[np.bool_]:
    """(N, M) candidates that another one gives too, as the two of an almost double root may, and closes better, or
    as well and earlier. left: (N, M) closure errors."""
    apart = np.max([np.abs(column[:, :, None] - column[:, None, :]) for column in pose], axis=0)
    place = np.argsort(np.argsort(left, axis=1, kind="stable"), axis=1)
    better = place[:, None, :] < place[:, :, None]
    copies: NDArray[np.bool_] = np.asarray(((apart <= SAME_POSE_TOL) & better & valid[:, None, :]).any(axis=2))
    return copies


def _between(start: Floats, end: Floats, share: float) -> Floats:
    return tuple([a + share * (b - a) for a, b in zip(start, end, strict=True)])
