"""Turning platforms whose assembly modes have no closed form: all assembly modes, and following of one branch.

Such a platform has up to six turns for one joint position. All assembly modes come from a polynomial; between
neighbouring joint positions the branch is followed. Labels are not invariant along these branches, because a motion
that meets no singularity can join two branches: a label is the sign of det A and a rank among the poses of that sign,
ordered by the size of the turn.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from functools import lru_cache
from math import cos, hypot, inf, nan, pi, remainder, sin, sqrt, tau
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from irsbot_kinematics import statics
from irsbot_kinematics.bounds.boxes import Reached, reached
from irsbot_kinematics.bounds.quadratics import aside, monomials, norm, value_at
from irsbot_kinematics.mechanism import Coordinate, Cuspidal, Floats, Legs, Posture, Status, meant, sign_of
from irsbot_kinematics.mechanisms.turning_platform import TurningPlatform
from irsbot_kinematics.numerics.arithmetic import ARRAYS, FLOATS, Arithmetic, Array, N
from irsbot_kinematics.numerics.assembly_roots import SAMPLED_TURNS, trigonometric_roots
from irsbot_kinematics.numerics.tolerances import CLOSURE_TOL_M, FOLLOWED_TOL_M, SAME_POSE_TOL, UNREAL_TOL, VANISHED_TOL
from irsbot_kinematics.skeleton import Vector

Point = tuple[float, float]
BY_A_LOOP = Cuspidal(
    "yes",
    "a certified loop about a cusp changes the assembly mode (irsbot_kinematics.analysis.loops); follow the branch",
    True,
)
TINY = 1e-150
"""m or 1: keeps the direction of a rod defined where it has none: upright, or without length at a pose that is not its
own. The margins, or the closure, then say so."""
POLISH = 3
"""Newton steps on every root of the polynomial: they start closer than 1e-4 and double the digits each time."""
NEAR = 0.01
"""1: a candidate with a larger error, over the size of the robot, is not a root displaced by rounding."""
FOLLOW = 4
"""Number of steps with the neighbour's screws, and of Newton steps after them, at most."""
HALVINGS = 6
"""How often the path from a neighbour is halved before the branch counts as lost."""
SPLIT = 2.0**23 + 1.0
"""1: x SPLIT - (x SPLIT - x) are the first 30 binary digits of x, rounded."""
WIDER = 1.0 + 2.0**-29
"""1: by this factor the box of a step is larger than these digits, so that it holds the step."""
TURN_DIGITS = 9
"""Digits after the point, rad, to which sizes of turns are compared: symmetric machines turn by the same angle to both
sides."""
MISSED_M = 1e-6
"""m: least reported closure error of a label without a pose; candidates that nearly close may belong to other
labels."""


class Poses(NamedTuple):
    """Candidate poses of N joint positions, M each."""

    pose: tuple[Array, ...]
    """Coordinates, (N, M) each."""
    det: Array
    """(N, M) determinant of A, m."""
    valid: NDArray[np.bool_]
    """(N, M) True if the candidate closes and is not a copy of another one."""
    miss: Array
    """(N,) m: smallest closure error of the candidates that do not close; infinite if all do."""
    known: NDArray[np.bool_]
    """(N,) True if the joints determine the pose."""


class _Ahead(NamedTuple):
    """What is proved of steps from a posture, whatever their signs."""

    at: Posture
    half: Floats
    """rad or m: largest sizes of the joints' steps."""
    move: float
    """m: of the platform, by the first bounds; infinite if these prove nothing."""
    turn: float
    """rad."""
    rod: float
    """m: the shortest."""
    met: Reached | None
    """By the bounds of third order, where the first ones prove nothing."""


class BranchedPlatform(TurningPlatform):
    """All assembly modes and the branch between them; the legs are in the subclasses."""

    label_is_invariant: ClassVar[bool] = False
    corners: tuple[Point, ...]
    """B_i relative to the platform point for turn 0, m."""
    size_m: float
    """m: approximate size of the robot; polynomials and closure errors are divided by it."""
    _last: _Ahead | None = None
    """Of the last box: the halves of a box are reached from its middle by steps of the same size."""

    def __init__(self, corners: Sequence[Point], joints: Sequence[Coordinate], size_m: float) -> None:
        """corners: B_i seen from the platform point, m; joints: of every leg; size_m: about the size of the robot, m.

        Sets `radius`, `diameter`, `length_m` and `task`: x, y and phi, or x, y, z and phi for four joints.
        """
        self.corners, self.joints, self.size_m = tuple(corners), tuple(joints), size_m
        self.radius = self.length_m = max(hypot(*corner) for corner in corners)
        self.diameter = max(hypot(a[0] - b[0], a[1] - b[1]) for a in corners for b in corners)
        names = ("x", "y", "phi") if len(self.joints) == 3 else ("x", "y", "z", "phi")
        self.task = tuple(Coordinate(name, "rad" if name == "phi" else "m", -inf, inf) for name in names)

    @property
    def platform_corners(self) -> list[Vector]:
        """`corners`, in space."""
        return [(x, y, 0.0) for x, y in self.corners]

    @abstractmethod
    def rods(self, k: Arithmetic[N], joints: Sequence[N]) -> Sequence[tuple[N, N, Any]]:
        """Per leg the place of its rod's near end C_i in the plane and the length of its rod, m."""

    @abstractmethod
    def closing(self, joints: Sequence[Array], cosine: Array, sine: Array) -> Array:
        """Closing equation in the turn of the platform, without unit: a trigonometric polynomial of degree 3."""

    @abstractmethod
    def candidates(self, joints: Sequence[Array], turn: Array) -> tuple[Array, ...]:
        """Poses with given turns (N, 6): coordinates (N, M)."""

    def ends(self, joints: Sequence[Array], cosine: Array, sine: Array) -> list[tuple[Array, Array]]:
        """R b_i - C_i, horizontally, m: added to P, it gives the rod."""
        return [
            (cosine * bx - sine * by - cx, sine * bx + cosine * by - cy)
            for (cx, cy, _), (bx, by) in zip(self.rods(ARRAYS, joints), self.corners, strict=True)
        ]

    # --- all assemblies ----------------------------------------------------------------------------------------------

    def direct(self, k: Arithmetic[N], joints: Sequence[N], assembly: int) -> tuple[tuple[N, ...], tuple[N, N]]:
        """Gaps: [0] |det A|, m; where there is no such pose, minus the closure error of the nearest candidate;
        [1] the size of the robot, or 0 where the platform can turn without the joints."""
        asked = np.array([np.atleast_1d(q) for q in joints], dtype=float)
        answer: Any = self._picked(_newest_assemblies(self, asked.tobytes()), assembly)
        if k is FLOATS:
            pose, (gap, size) = answer
            answer = tuple([float(column[0]) for column in pose]), (float(gap[0]), float(size[0]))
        return answer  # type: ignore[no-any-return]

    def _picked(self, poses: Poses, assembly: int) -> tuple[tuple[Array, ...], tuple[Array, Array]]:
        """Pose (N,) of one label, and the gaps."""
        same = poses.valid & (np.sign(poses.det) == (1.0 if assembly > 0 else -1.0))
        chosen = same & (np.cumsum(same, axis=1) == abs(assembly))
        there, column = chosen.any(axis=1), np.argmax(chosen, axis=1)[:, None]
        pose = tuple([np.take_along_axis(c, column, axis=1)[:, 0] for c in poses.pose])
        det = np.abs(np.take_along_axis(poses.det, column, axis=1)[:, 0])
        gap = np.where(there, det, np.where(poses.known, -np.clip(poses.miss, MISSED_M, self.size_m), 0.0))
        return pose, (gap, np.where(poses.known, self.size_m, 0.0))

    def assemblies(self, joints: Sequence[Array]) -> Poses:
        """All poses of joint positions, each (N,), ordered by the size of the turn; of two equal sizes the negative one
        first."""
        with np.errstate(all="ignore"):  # candidates that do not close may divide by zero; they are not valid
            return self._assemblies(joints)

    def _assemblies(self, joints: Sequence[Array]) -> Poses:
        cosine, sine = np.cos(SAMPLED_TURNS), np.sin(SAMPLED_TURNS)
        values = self.closing([q[:, None] for q in joints], cosine, sine)
        known = np.abs(values).max(axis=1) > VANISHED_TOL
        turns, unreal = trigonometric_roots(values)
        start = self.candidates([q[:, None] for q in joints], turns)
        repeated = [np.broadcast_to(q[:, None], start[0].shape) for q in joints]
        pose, miss = self._polished(repeated, start)
        order = np.lexsort((pose[-1], np.round(np.abs(pose[-1]), TURN_DIGITS)), axis=1)
        pose = tuple([np.take_along_axis(column, order, axis=1) for column in pose])
        legs = self.legs(ARRAYS, repeated, pose)
        left = np.max(np.abs(legs.closure), axis=0)
        miss = np.take_along_axis(miss, order, axis=1)
        valid = (left <= CLOSURE_TOL_M) & (miss <= NEAR * self.size_m) & known[:, None]
        real = np.tile(unreal <= UNREAL_TOL, (1, pose[0].shape[1] // unreal.shape[1]))
        valid &= np.take_along_axis(real, order, axis=1)
        valid &= ~_copies(pose, valid, left)
        miss = np.where(valid, np.inf, np.nan_to_num(miss, nan=np.inf))
        return Poses(pose, statics.cofactors(legs.screws)[0], valid, miss.min(axis=1), known)

    def _polished(self, joints: Sequence[Array], start: tuple[Array, ...]) -> tuple[tuple[Array, ...], Array]:
        """The poses after the Newton steps, and the closure errors before them, m."""
        pose, legs = self._improved(ARRAYS, joints, start)
        miss: Array = np.max(np.abs(legs.closure), axis=0)
        for _ in range(POLISH - 1):
            pose, _ = self._improved(ARRAYS, joints, pose)
        return (*pose[:-1], ARRAYS.wrap(pose[-1])), miss

    def _improved(self, k: Arithmetic[N], joints: Sequence[N], pose: Sequence[N]) -> tuple[tuple[N, ...], Legs[N]]:
        """One Newton step, and the legs before it."""
        legs = self.legs(k, joints, pose)
        step = statics.twist(legs.screws, [-error for error in legs.closure])
        return tuple([value + change for value, change in zip(pose, step, strict=True)]), legs

    # --- one branch --------------------------------------------------------------------------------------------------

    def track(self, joints: Sequence[float], previous: Posture) -> Posture:
        """The posture that the branch of `previous` has at neighbouring joints.

        A step counts only with a proof: the box of `displacement_and_turn` has exactly one solution, and det A keeps
        its sign in it, because the inequality's right side contracts there; or that of `_leap`. Steps that are too
        long are halved along the straight way, the shorter one round a crank; after HALVINGS the branch is lost,
        SINGULAR.
        """
        if previous.status != Status.SOLVED:
            return self.posture(joints, previous.assembly_mode or self.usual_assembly_mode)
        asked = tuple(joints)
        if not meant(asked):
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
                return self._undetermined(Status.SINGULAR, asked, (0.0, self.size_m))
        return at if goal == asked else at._replace(joints=asked)

    def _follow(self, joints: Floats, at: Posture) -> Posture | None:
        """One proved step, or None: first order, steps with the screws of `at`, then Newton steps."""
        ahead = [q - before for q, before in zip(joints, at.joints, strict=True)]
        half, proved = _box_of(ahead), self._last
        if proved is None or not (proved.at is at and proved.half == half):
            self._last = proved = self._ahead(at, half)
        d, t = proved.move, proved.turn
        if not d + t < inf:
            return self._leap(joints, ahead, proved)
        det, columns = statics.cofactors(at.screws)
        rods = self.rods(FLOATS, joints)
        pose, drive = at.pose, [-(lever * way) for lever, way in zip(at.levers, ahead, strict=True)]
        for _ in range(FOLLOW):
            pose = _moved(pose, statics.combined(det, columns, drive))
            drive = self._misfit(rods, pose)
            if all(abs(error) <= FOLLOWED_TOL_M for error in drive):
                break
        found = self._closed(joints, pose, at)
        way = [there - here for there, here in zip(found.pose, at.pose, strict=True)]
        x, y, turn, up = way[0], way[1], way[-1], way[2] if len(way) == 4 else 0.0
        inside = hypot(x, y, up) <= d + CLOSURE_TOL_M and abs(turn) <= t + CLOSURE_TOL_M / self.radius
        return found if inside and found.residual <= CLOSURE_TOL_M else None

    def _closed(self, joints: Floats, pose: Floats, at: Posture) -> Posture:
        """The posture to which Newton's method leads from a pose."""
        found = self.at(joints, pose, at.assembly_mode, at.gaps)  # type: ignore[arg-type]
        for _ in range(FOLLOW):
            if found.residual <= FOLLOWED_TOL_M or found.det == 0.0:
                break
            drive = [-error for error in found.parts[2 * len(joints) :]]
            pose = _moved(found.pose, statics.twist(found.screws, drive))
            found = self.at(joints, pose, at.assembly_mode, at.gaps)  # type: ignore[arg-type]
        return found

    def _ahead(self, at: Posture, half: Floats) -> _Ahead:
        """What is proved of steps by at most `half`."""
        _, _, rod = asked = self.travel_of(at, half, 0.0)
        d, t = self.box(at, asked)
        proved = d + t < inf or not rod > 0.0
        return _Ahead(at, half, d, t, rod, None if proved else reached(at, self.rods_of(at, half, 0.0)))

    def _leap(self, joints: Floats, ahead: Sequence[float], proved: _Ahead) -> Posture | None:
        """One step with the proof of `boxes`, which reaches much farther; None if it proves none.

        The box around `at` has the joints next to a corner. On the way there is no Type 2, and the pose ends in a set
        about a polynomial. Another pose in it would hold the end of some rod at a distance E, with r.e = -|e|^2/(2 L)
        for every rod, so that E <= rate (E^2/(2 rod) + E^2/(2 radius)), rate from A^-1: the set is too small for that.
        """
        n, at, met, rod = len(joints), proved.at, proved.met, proved.rod
        if met is None or not met.type2 > 0.0:
            return None
        shares = [way / most if most > 0.0 else 0.0 for way, most in zip(ahead, proved.half, strict=True)]
        terms = monomials(shares)
        step, size = tuple([value_at(x, terms) for x in met.pose]), [aside(n, x) for x in met.pose]
        found = self._closed(joints, _moved(at.pose, step), at)
        off = [abs(there - here - way) for there, here, way in zip(found.pose, at.pose, step, strict=True)]
        inside = [x <= most + CLOSURE_TOL_M for x, most in zip(off[:-1], size[:-1], strict=True)]
        inside.append(off[-1] <= size[-1] + CLOSURE_TOL_M / self.radius)
        apart = 2.0 * (norm(*size[:-1]) + self.radius * size[-1])
        rate = sum(found.parts[:n], 0.0) + self.radius * sum(found.parts[n : 2 * n], 0.0)
        alone = apart * rate * (0.5 / rod + 0.5 / self.radius) < abs(found.det)
        return found if alone and all(inside) and found.residual <= CLOSURE_TOL_M else None

    def _misfit(self, rods: Sequence[tuple[float, float, float]], pose: Floats) -> list[float]:
        """rod length - |C_iB_i|, m."""
        x, y, phi, up = pose[0], pose[1], pose[-1], pose[2] if len(pose) == 4 else 0.0
        c, s, square, misfit = cos(phi), sin(phi), up * up, []
        for (cx, cy, rod), (bx, by) in zip(rods, self.corners, strict=True):
            dx, dy = x + c * bx - s * by - cx, y + s * bx + c * by - cy
            misfit.append(rod - sqrt(dx * dx + dy * dy + square))
        return misfit

    def at(self, joints: Floats, pose: Floats, assembly: int, gaps: tuple[float, float]) -> Posture:
        """gaps[0] is |det A| whatever is given. `parts`: column sizes of adj(A), then the signed closure errors."""
        legs = self.legs(FLOATS, joints, pose)
        det, columns = statics.cofactors(legs.screws)
        size = abs(det)
        if len(joints) == 3:
            moves, speeds = [], []
            for (vx, vy, w), (ax, ay) in zip(columns, legs.attachments, strict=True):
                moves.append(sqrt(vx * vx + vy * vy))
                ux, uy = vx - w * ay, vy + w * ax
                speeds.append(sqrt(ux * ux + uy * uy))
        else:
            moves, speeds = [], []
            for (vx, vy, vz, w), (ax, ay) in zip(columns, legs.attachments, strict=True):
                moves.append(sqrt(vx * vx + vy * vy + vz * vz))
                ux, uy = vx - w * ay, vy + w * ax
                speeds.append(sqrt(ux * ux + uy * uy + vz * vz))
        return Posture(
            Status.SOLVED,
            joints,
            pose,
            tuple([sign_of(sine) for sine in legs.normalised_levers]),
            assembly,
            legs.screws,
            legs.levers,
            legs.normalised_levers,
            legs.reach,
            (size, gaps[1]),
            tuple([FLOATS.ratio(size, speed) for speed in speeds]),
            det,
            nan if legs.constraint is None else legs.constraint,
            legs.limb,
            max([abs(error) for error in legs.closure]),
            legs.attachments,
            (*moves, *[abs(column[-1]) for column in columns], *legs.closure),
        )


@lru_cache(maxsize=1)
def _newest_assemblies(mechanism: BranchedPlatform, joints: bytes) -> Poses:
    """`assemblies` of the joint positions that were asked for last: most who ask for one label ask for all of them.

    joints: (n, N) floats as bytes, in which 0.0 and -0.0 differ.
    """
    return mechanism.assemblies(list(np.frombuffer(joints).reshape(len(mechanism.joints), -1)))


def _copies(pose: Sequence[Array], valid: NDArray[np.bool_], left: Array) -> NDArray[np.bool_]:
    """(N, M) True for candidates that another one repeats (as near a double root) and closes better, or equally well
    and earlier. left: (N, M) closure errors."""
    place = np.argsort(np.argsort(left, axis=1, kind="stable"), axis=1)
    repeats: NDArray[np.bool_] = (place[:, None, :] < place[:, :, None]) & valid[:, None, :]
    for column in pose:
        repeats &= np.abs(column[:, :, None] - column[:, None, :]) <= SAME_POSE_TOL
    copies: NDArray[np.bool_] = np.asarray(repeats.any(axis=2))
    return copies


def _box_of(ahead: Sequence[float]) -> Floats:
    """Sizes of the box of a step: those of a step back, too, although that differs by rounding."""
    parts = [SPLIT * abs(way) for way in ahead]
    return tuple([WIDER * (part - (part - abs(way))) for part, way in zip(parts, ahead, strict=True)])


def _moved(pose: Floats, step: Floats) -> Floats:
    return tuple([value + change for value, change in zip(pose, step, strict=True)])


def _between(start: Floats, end: Floats, share: float) -> Floats:
    return tuple([a + share * (b - a) for a, b in zip(start, end, strict=True)])
