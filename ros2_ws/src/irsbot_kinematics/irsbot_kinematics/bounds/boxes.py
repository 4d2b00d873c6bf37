"""Certified bounds of margins over a box of joint positions, with an error of third order in the size of the box.

The box is q = q0 + (s_1 h_1, .., s_n h_n) with every s_j in -1..1. Bounds of first order (`guarantees`) add the effects
of all joints in all directions. Here every quantity is a polynomial of second degree in the s_j with a certified
remainder (`quadratics`): effects of several joints, or of one joint on several terms, can cancel.

Setting. Rod i holds the platform point at arm c_i, w_i is the vector along it, L_i its length, C_i its near end. In the
box C_i is near_i s_i + curve_i s_i^2 away, and at most aside_i from there; L_i is a polynomial in s_i, and at most
growth_aside_i from there. With the platform moved by d and turned by t about z

    w_i = d + R(t) c_i - C_i(s_i),    F_i = (|w_i|^2 - L_i^2)/2 = 0

Rows of the Jacobian of F are (w_i, (R c_i) x w_i); in the middle they are L_i times the screws A, so C = A^-1/L is its
inverse there.

1. The pose. One Newton step from 0 gives what is linear in the s_j, a second one the squares and products: p(s).
   F(p(s)) is then small of third order. For any other pose x = p + r the mean value theorem says r = -C F(p) + (1 - C
   J) r, with J the average of the Jacobian on the way from p to x. Let start >= |C F(p)|, shares >= |1 - C J| at p(s),
   and farther(r) what C J changes by within r, half of it on the average of the way. A set |r| <= room with start +
   (shares + farther(room)) room < room cannot be left: on any way from the posture to a point of the box the motion is
   continuous, begins in it, and is never at its boundary. An error of a near end, aside_i, makes |w_i| differ from L_i
   by as much, and is part of F. (Krawczyk's operator, applied to a polynomial.)
2. The rods. The pose is p(s) plus an effect of known direction and size at most room in every coordinate: these
   effects are kept like joints, to first order, because they act on all rods at once. That gives w_i seen from the
   base, and, turned back by R(-t), seen from the platform, where only the rods turn and the arms do not.
3. Type 2. cos alpha_i is the sine of the angle between w_i and the line or plane across v_i, the cross product of the
   other rows, moments taken where leg i holds the platform: D = w_i . v_i, cos alpha_i = |D|/(|v_i| L_i). The lengths
   of the other rods cancel. v_i and D are products of the above. In the plane tan alpha_i = |w_i x v_i|/D, so nothing
   but two quadratics is compared. The quotient is guessed from the corners; what is then certified are two lower
   bounds, that D is at least d, and that D is at least the guess times the other one less m. Both bound the quotient.
4. The least value of a quadratic over the box (`Quadratic.least`).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, product
from math import asin, hypot, inf, sqrt
from operator import mul
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from irsbot_kinematics import statics
from irsbot_kinematics.bounds.quadratics import Array, Quadratic, multiplied, terms

if TYPE_CHECKING:
    from irsbot_kinematics.mechanism import Floats, Posture

WIDER = 1.2
"""1: factor of the room for third-order terms over its guess."""
BOXES = 4
"""Number of guesses; if none holds, the box of joints is so large that a cut is better."""
LEAST = 1e-100
"""m or rad: least size of the room, so that it has an interior."""


class Rod(NamedTuple):
    """Effect of a joint on its rod within the box, m: joint i is at s_i in -1..1 of its range."""

    length: float
    near: Floats  # factor of s_i in the motion of its near end
    aside: float  # how far the near end may be from there, the curve included
    growth: float = 0.0  # s_i of this is how its length grows, to first order
    growth_aside: float = 0.0
    curve: Floats = ()  # factor of s_i^2 in the motion of its near end; none if left out
    growth_curve: float = 0.0


class Change(NamedTuple):
    """Change of a rod over the box, divided by its length, seen from the base."""

    ways: Sequence[Sequence[float]]  # per joint, to first order
    most: float  # largest size of their sum
    rest: float  # bound of the remainder


class Reached(NamedTuple):
    """Bounds that hold everywhere in the box."""

    type2: float  # lower bound of the Type 2 margin
    pose: Quadratic  # (m,) displacement and turn of the platform, m and rad
    rods: Quadratic  # (dims, n) m, the rods as vectors, seen from the base
    longest: Array  # (n,) m, of the rods

    @property
    def moves(self) -> list[Floats]:
        """m per joint, of the platform point, to first order."""
        return [tuple(way) for way in self._displacement.p[self.pose.terms.joints].tolist()]

    @property
    def aside(self) -> float:
        """m: residual of the motion of the platform point."""
        return hypot(*self._displacement.besides().tolist())

    @property
    def changes(self) -> list[Change]:
        """The change of every rod."""
        joints, found = self.rods.terms.joints, []
        for vector, rest in zip(np.moveaxis(self.rods.p, 2, 0), self.rods.besides().T, strict=True):
            length = hypot(*vector[0])
            ways = (vector[joints] / length).tolist()
            found.append(Change(ways, _largest(ways), hypot(*rest) / length))
        return found

    @property
    def turn(self) -> float:
        """rad: largest turn of a rod."""
        share = max([change.most + change.rest for change in self.changes])
        return asin(share) if share < 1.0 else inf

    @property
    def _displacement(self) -> Quadratic:
        return self.pose[: len(self.rods.rest)]


def reached(at: Posture, rods: Sequence[Rod], arm: float = 0.0) -> Reached | None:
    """Bounds over the box with the middle `at`; None if nothing can be proved, also for NaN.

    rods: one per leg, with near ends in the plane or in space as the screws. arm: m, error of the attachments of a
    platform that turns; its effect on their ends is in `Rod.aside`.
    """
    det, columns = statics.cofactors(at.screws)
    if not (abs(det) > 0.0 and all(rod.length > 0.0 for rod in rods)):
        return None
    with np.errstate(all="ignore"):  # boxes that are far too large
        platform = _Platform(at, rods)
        found = platform.pose(np.array(columns).T / det)
        if found is None:
            return None
        pose, seen, vectors = found
        type2 = _type2_over(platform, seen, arm)
    return Reached(type2 if type2 > 0.0 else 0.0, pose, vectors, platform.longest)


class _Platform:
    """The rods of a posture, and their dependence on pose and joints. Vectors are (dims, n), one column per leg."""

    def __init__(self, at: Posture, rods: Sequence[Rod]) -> None:
        n, dims, size = len(rods), len(rods[0].near), len(at.screws[0])
        self.dims, self.turning = dims, size > dims
        t = self.terms = terms(n, size)
        each, still = np.arange(n), (0.0,) * dims
        table = np.array([(*rod.near, *(rod.curve or still)) for rod in rods]).T
        near, curve = table[:dims], table[dims:]
        numbers = [(rod.length, rod.growth, rod.growth_curve, rod.growth_aside, rod.aside) for rod in rods]
        length, growth, bend, uncertain, self.aside = np.array(numbers).T
        self.screws = np.array(at.screws).T.copy()
        self.attachments = np.array(at.attachments).T.copy() if self.turning else np.zeros((2, n))
        self.lengths = length
        self.drives = (self.screws[:dims] * near).sum(0) + growth
        self.near = np.zeros((t.number, dims, n))
        self.near[0] = -length * self.screws[:dims]
        self.near[0, :2] += self.attachments[:dims]
        self.near[1 + each, :, each] = near.T
        self.near[1 + n + each, :, each] = curve.T
        self.length = np.zeros((t.number, n))
        self.length[0], self.length[1 + each, each], self.length[1 + n + each, each] = length, growth, bend
        self.longest = length + abs(growth) + abs(bend) + uncertain
        self.uncertain = uncertain
        self.half = 0.5 * multiplied(t, self.length, self.length)
        self.half_rest = abs(growth * bend) + 0.5 * bend * bend + uncertain * self.longest
        self.half_rest += (self.longest + 0.5 * self.aside) * self.aside

    def vectors(self, pose: Array) -> tuple[Quadratic | None, Quadratic]:
        """cos and sin of the turn, if there is one, and the rods (dims, n), of a pose (N, m) without remainder."""
        t, attachments = self.terms, self.attachments
        vectors, rest = pose[:, : self.dims, None] - self.near, np.zeros(self.near.shape[1:])
        if not self.turning:
            return None, Quadratic(t, vectors, rest)
        turn = pose[:, -1]
        first, (one, more) = turn[t.joints], (t.sizes @ abs(turn)).tolist()
        most = one + more
        turned = np.zeros((t.number, 2))
        turned[:, 1], turned[0, 0] = turn, 1.0
        turned[t.pairs, 0] = -0.5 * (t.fold @ (first[:, None] * first).ravel())
        rests = np.array([more * (one + 0.5 * more) + most * most * most * most / 24.0, most * most * most / 6.0])
        ways = np.array([attachments, [-attachments[1], attachments[0]]])
        vectors[:, :2] += (turned @ ways.reshape(2, -1)).reshape(-1, *attachments.shape)
        rest[:2] = rests[0] * abs(attachments) + rests[1] * abs(attachments[::-1])
        return Quadratic(t, turned, rests), Quadratic(t, vectors, rest)

    def pose(self, inverse: Array) -> tuple[Quadratic, Quadratic, Quadratic] | None:
        """Pose (m,), and rods (dims, n) from the platform and from the base."""
        t, per = self.terms, inverse / self.lengths
        pose = np.zeros((t.number, len(inverse)))
        pose[t.joints] = (inverse * self.drives).T
        first = self.vectors(pose)[1].p
        pose[t.pairs] = (self.half - 0.5 * multiplied(t, first, first).sum(1))[t.pairs] @ per.T
        room = self._rest(pose, per)
        if room is None:
            return None
        pose[t.effects] = np.diag(room)
        turned, rods = self.vectors(pose)
        rods.rest += self.aside
        seen = rods if turned is None else _turned_back(turned, rods)
        return Quadratic(t, pose, np.zeros(len(inverse))), seen, rods

    def _rest(self, pose: Array, per: Array) -> Array | None:
        """(m,) bound of the residual of the pose, displacement and turn; None if there is no bound."""
        dims, (_, vectors), size = self.dims, self.vectors(pose), abs(per)
        squares, w = vectors * vectors, vectors.p
        start = size @ (abs(0.5 * squares.p.sum(1) - self.half).sum(0) + 0.5 * squares.rest.sum(0) + self.half_rest)
        # How the Jacobian, columns (w, (R c) x w), changes with the joints,
        change, rests = w, vectors.rest
        x, y = self.attachments
        if self.turning:
            change, rests = np.empty((len(w), dims + 1, len(x))), np.empty((dims + 1, len(x)))
            change[:, :dims], rests[:dims] = w, vectors.rest
            turn, most = pose[:, -1:], abs(pose[:, -1]).sum()
            change[:, dims] = x * w[:, 1] - y * w[:, 0] - turn * (x * w[0, 0] + y * w[0, 1])
            radius, moved = np.hypot(x, y), np.hypot(*(abs(w[1:, :2]).sum(0) + vectors.rest[:2]))
            rests[dims] = abs(x) * vectors.rest[1] + abs(y) * vectors.rest[0]
            rests[dims] += radius * most * (0.5 * most * (self.lengths + moved) + moved)
        change[0] -= self.lengths * self.screws
        shares = abs(change.reshape(-1, len(x)) @ per.T).reshape(-1, len(per), len(per)).sum(0).T + size @ rests.T
        found: Array | None = start
        for _ in range(BOXES):
            if found is None or (found := _solved(shares + size @ self._farther(found), start)) is None:
                return None
            room = WIDER * found + LEAST
            found = np.asarray(start + (shares + size @ self._farther(room)) @ room)
            if (found < room).all():
                return found
        return None

    def _farther(self, room: Array) -> Array:
        """(n, m): and its change within the room itself: half as much on the average over a straight line through
        it."""
        farther = np.empty((len(self.lengths), len(room)))
        move = hypot(*room[: self.dims].tolist())
        if not self.turning:
            farther[:] = 0.5 * move
            return farther
        turn, radius = room[-1], np.hypot(*self.attachments)
        end = move + radius * turn
        farther[:, :-1] = 0.5 * end[:, None]
        farther[:, -1] = 0.5 * radius * (end + turn * (self.longest + self.aside + end))
        return farther


def _solved(shares: Array, start: Array) -> Array | None:
    """The solution of x = start + shares x; None if there is none that is not negative."""
    try:
        found = np.asarray(np.linalg.solve(np.eye(len(start)) - shares, start), dtype=float)
    except np.linalg.LinAlgError:
        return None
    return found if (found >= 0.0).all() else None


def _turned_back(turned: Quadratic, rods: Quadratic) -> Quadratic:
    """Vectors (dims, n), seen from a turned platform: cos and sin of its turn."""
    t, p, rest = rods.terms, rods.p, rods.rest
    level, rests = np.empty((t.number, 2, 2, p.shape[2])), np.empty((2, 2, p.shape[2]))
    level[:, 0], level[:, 1, 0], level[:, 1, 1] = p[:, :2], p[:, 1], -p[:, 0]
    rests[0], rests[1] = rest[:2], rest[1::-1]
    seen = (turned[:, None, None] * Quadratic(t, level, rests)).sum(0)
    if p.shape[1] == 2:
        return seen
    return Quadratic(t, np.concatenate([seen.p, p[:, 2:]], 1), np.concatenate([seen.rest, rest[2:]]))


def _type2_over(platform: _Platform, rods: Quadratic, arm: float) -> float:
    """Lower bound of the smallest cos alpha_i, with rods seen from the platform; not above 0 if nothing is proved."""
    dims, n = rods.rest.shape
    t, others = platform.terms, OTHERS[n]
    rows = rods[:, others]
    if platform.turning:  # moments about the place where the leg holds the platform that is left out
        x, y = platform.attachments[:, others] - platform.attachments[:, None]
        p, rest = np.empty((t.number, n, n - 1, n)), np.empty((n, n - 1, n))
        p[:, :dims], rest[:dims] = rows.p, rows.rest
        p[:, dims] = x * rows.p[:, 1] - y * rows.p[:, 0]
        rest[dims] = abs(x) * rows.rest[1] + abs(y) * rows.rest[0] + 2.0 * arm * platform.longest[others]
        rows = Quadratic(t, p, rest)
    v = _crossed(rows)[:dims]
    return _in_plane(rods, v) if dims == 2 else _in_space(rods, v, platform)


def _in_plane(rods: Quadratic, v: Quadratic) -> float:
    """tan alpha_i = |X|/D with D = rod . v_i and X = rod x v_i. If D s - X c and D s + X c are at least -m and D is at
    least d, m >= 0 and d > 0, then |X| d c <= D (d s + m)."""
    t, n = rods.terms, v.rest.shape[1]
    products = rods[None] * v[PLANE]
    sign = np.sign(products.p[0, 0].sum(0))
    p, rest = products.p * sign, products.rest.sum(1)
    both = Quadratic(t, p[:, :, 0], rest)
    both.p[:, 0] += p[:, 0, 1]
    both.p[:, 1] -= p[:, 1, 1]
    corners = both[1].corner_values() / both[0].corner_values()
    tangent = abs(corners).max(0)
    c = 1.0 / np.hypot(1.0, tangent)
    s = tangent * c
    one, none = np.ones(n), np.zeros(n)
    asked = both[0, None].times(np.array([one, s, s])) + both[1, None].times(np.array([none, -c, c]))
    least = Quadratic(t, asked.p.reshape(-1, 3 * n), asked.rest.ravel()).least()
    d, m = least[:n], np.maximum(-np.minimum(least[n : 2 * n], least[2 * n :]), 0.0)
    if not (d > 0.0).all():
        return 0.0
    return float(1.0 / np.hypot(1.0, ((d * s + m) / (d * c)).max()))


def _in_space(rods: Quadratic, v: Quadratic, platform: _Platform) -> float:
    """cos alpha_i = D/(|v_i| length) with D = rod . v_i. If D - q |v_i| length is at least -m and D at least d, m >= 0
    and d > 0, then D (d + m) >= q d |v_i| length. |v| <= along + aside^2/(2 along), along and across its middle."""
    t, n, det = rods.terms, v.rest.shape[1], (rods * v).sum(0)
    det = det.times(np.sign(det.p[0]))
    middle = v.p[0]
    way = middle / np.sqrt((middle * middle).sum(0))
    along = v.times(way).sum(0)
    shortest = 2.0 * along.p[0] - along.largest()
    if not (shortest > 0.0).all():
        return 0.0
    across = v - along[None].times(way)
    size = along + (across * across).sum(0).times(0.5 / shortest)
    below = size * Quadratic(t, platform.length, platform.uncertain)
    q = np.maximum((det.corner_values() / below.corner_values()).min(0), 0.0)
    asked = det - below.times(q)
    least = Quadratic(t, np.concatenate([det.p, asked.p], 1), np.concatenate([det.rest, asked.rest])).least()
    d, m = least[:n], np.maximum(-least[n:], 0.0)
    if not (d > 0.0).all():
        return 0.0
    return float((q * d / (d + m)).min())


OTHERS = {n: np.array([[k for k in range(n) if k != i] for i in range(n)]).T.copy() for n in (2, 3, 4)}
"""(n - 1, n) indices of the other legs of each leg."""
PLANE = np.array([[0, 1], [1, 0]])
"""x with x and y with y; x with y and y with x."""


def _crossed(rows: Quadratic) -> Quadratic:
    """(n, M) what the determinants of any row and the n - 1 given ones, (n, n - 1, M), are the products with."""
    n, t = len(rows.rest), rows.terms
    if n == 2:
        return rows[::-1, 0].times(np.array([[1.0], [-1.0]]))
    if n == 3:
        products = rows[CYCLES, 0] * rows[CYCLES[::-1], 1]
        return products[0] - products[1]
    products = rows[COLUMNS, 1] * rows[COLUMNS[::-1], 2]
    minors = products[0] - products[1]
    products = (rows[WEDGE[0], 0] * minors[WEDGE[1]]).times(WEDGE[2])
    return Quadratic(t, products.p.reshape(t.number, 3, 3, -1).sum(2), products.rest.reshape(3, 3, -1).sum(1))


CYCLES = np.array([[1, 2, 0], [2, 0, 1]])
COLUMNS = np.array([[0, 0, 0, 1, 1, 2], [1, 2, 3, 2, 3, 3]])
"""Columns of the minors of two rows of four."""
WEDGE = (
    np.array([1, 3, 2, 2, 0, 3, 0, 3, 1]),
    np.array([5, 3, 4, 2, 5, 1, 4, 0, 2]),
    np.array([1.0, 1.0, -1.0, 1.0, -1.0, -1.0, 1.0, 1.0, -1.0])[:, None],
)
"""Entries of a third row, minors and signs that make up the first three entries of the cross product of three rows,
three products each."""


def least_singular(matrix: Sequence[Floats], ways: Sequence[Sequence[Floats]], rest: float) -> float:
    """Lower bound of the second singular value of M(s) = M + sum_j s_j M_j + R, s_j in -1..1, |R| <= rest (Frobenius).

    matrix: columns of M, two numbers each; ways: those of every M_j. With P(s) multilinear in s and equal to
    M(s) M(s)^T at the corners, M M^T = P - sum (1 - s_j^2) M_j M_j^T, and the smaller eigenvalue is concave.
    """
    values, sizes = [], [sum([x * x + y * y for x, y in way]) for way in ways]
    for corner in product((-1.0, 1.0), repeat=len(ways)):
        a = b = c = square = 0.0
        columns: list[tuple[float, float]] = []
        for k, (x, y) in enumerate(matrix):
            for s, way in zip(corner, ways, strict=True):
                x, y = x + s * way[k][0], y + s * way[k][1]
            a, b, c = a + x * x, b + x * y, c + y * y
            for u, v in columns:
                square += (u * y - v * x) ** 2
            columns.append((x, y))
        # the product of both eigenvalues, without cancellation, over the larger one
        larger = 0.5 * (a + c + hypot(a - c, 2.0 * b))
        values.append(square / larger if larger > 0.0 else 0.0)
    least = _least_of_two(values, sizes) if len(ways) == 2 else min(values) - sum(sizes)
    left = (sqrt(least) if least > 0.0 else 0.0) - rest
    return left if left > 0.0 else 0.0


def _least_of_two(values: Sequence[float], sizes: Sequence[float]) -> float:
    """Smallest value over the square -1..1 of the bilinear function with the given values at (-1, -1), (-1, 1), (1,
    -1), (1, 1) minus sum (1 - s_j^2) sizes_j: at a corner, on an edge, or where both slopes vanish."""
    a, b, c, d = values
    m, p, q, r = 0.25 * (a + b + c + d), 0.25 * (c + d - a - b), 0.25 * (b + d - a - c), 0.25 * (a + d - b - c)
    e, f = sizes
    points = [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)]
    for edge in (-1.0, 1.0):
        if f > 0.0 and abs(q + r * edge) < 2.0 * f:
            points.append((edge, -0.5 * (q + r * edge) / f))
        if e > 0.0 and abs(p + r * edge) < 2.0 * e:
            points.append((-0.5 * (p + r * edge) / e, edge))
    det = 4.0 * e * f - r * r
    if det > 0.0:
        x, y = (q * r - 2.0 * p * f) / det, (p * r - 2.0 * q * e) / det
        if abs(x) < 1.0 and abs(y) < 1.0:
            points.append((x, y))
    return min([m + p * x + q * y + r * x * y - (1.0 - x * x) * e - (1.0 - y * y) * f for x, y in points])


def distances(x: Sequence[float], moves: Sequence[Sequence[float]], rest: float) -> tuple[float, float]:
    """Bounds of |x + sum_j s_j move_j + e|, s_j in -1..1, |e| <= rest: smallest and largest."""
    size = hypot(*x)
    if not size > 0.0:
        return 0.0, sum([hypot(*move) for move in moves]) + rest
    along = [_dot(x, move) / size for move in moves]
    aside = sum(
        [hypot(*[b - a * c / size for b, c in zip(move, x, strict=True)]) for a, move in zip(along, moves, strict=True)]
    )
    reach = sum(map(abs, along))
    return size - reach - rest, hypot(size + reach, aside) + rest


def _largest(ways: Sequence[Sequence[float]]) -> float:
    """Upper bound of the size of a sum of vectors with any signs."""
    square = sum([sum(map(mul, way, way)) for way in ways])
    return sqrt(square + 2.0 * sum([abs(sum(map(mul, a, b))) for a, b in combinations(ways, 2)]))


def _dot(row: Sequence[float], vector: Sequence[float]) -> float:
    return sum(map(mul, row, vector), 0.0)  # a row may also have a moment
