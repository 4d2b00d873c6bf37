"""Certified bounds of margins over a box of joint positions: of second order, what is lost is of third order.

HEAD
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, product
from math import asin, hypot, inf, sqrt
from operator import mul
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from irsbot_kinematics import statics
from irsbot_kinematics.quadratics import Array, Quadratic, joined, multiplied, terms

if TYPE_CHECKING:
    from irsbot_kinematics.mechanism import Floats, Posture

WIDER = 1.2
"""1: how many times wider than its guess the box of what is of third order is."""
BOXES = 4
"""Guesses; where none of them holds, the box of joints is so large that it is better cut."""
LEAST = 1e-100
"""m or rad: the box is not smaller, so that its inside is not empty."""


class Rod(NamedTuple):
    """What the joint of a rod does to it within the box, m: joint i at s_i in -1..1 of its range."""

    length: float
    near: Floats  # s_i of this is how its near end moves, to first order
    aside: float  # how far the near end may be from there, the curve included
    growth: float = 0.0  # s_i of this is how its length grows, to first order
    growth_aside: float = 0.0
    curve: Floats = ()  # s_i^2 of this is what its near end does of second order; none if left out
    growth_curve: float = 0.0


class Change(NamedTuple):
    """How a rod changes over the box, over its length, seen from the base."""

    ways: Sequence[Sequence[float]]  # per joint, to first order
    most: float  # largest size of their sum
    rest: float  # what may come on top of it


class Reached(NamedTuple):
    """What happens anywhere in the box."""

    type2: float  # lower bound of the Type 2 margin
    pose: Quadratic  # (m,) displacement and turn of the platform, m and rad
    rods: Quadratic  # (n, k) m, the rods as vectors, seen from the base
    longest: Array  # (n,) m, of the rods

    @property
    def moves(self) -> list[Floats]:
        """m per joint, of the platform point, to first order."""
        ways = self._displacement.p[:, self.pose.terms.joints]
        return [tuple(way) for way in ways.T.tolist()]

    @property
    def aside(self) -> float:
        """m by which the platform point may be elsewhere."""
        return hypot(*_besides(self._displacement).tolist())

    @property
    def changes(self) -> list[Change]:
        """Of every rod."""
        joints, found = self.rods.terms.joints, []
        for vector, rest in zip(self.rods.p, _besides(self.rods), strict=True):
            length = hypot(*vector[:, 0])
            ways = (vector[:, joints].T / length).tolist()
            found.append(Change(ways, _largest(ways), hypot(*rest) / length))
        return found

    @property
    def turn(self) -> float:
        """rad that a rod turns at most."""
        share = max([change.most + change.rest for change in self.changes])
        return asin(share) if share < 1.0 else inf

    @property
    def _displacement(self) -> Quadratic:
        return self.pose[: self.rods.p.shape[1]]


def reached(at: Posture, rods: Sequence[Rod], arm: float = 0.0) -> Reached | None:
    """Bounds over the box of which `at` is the middle; None where nothing can be said, also for NaN.

    rods: one per leg, with near ends in the plane or in space as the screws. arm: m by which each of them may hold a
    platform that turns elsewhere; what that does to its ends is in `Rod.aside`.
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
    """The rods of a posture, and how they follow from pose and joints."""

    def __init__(self, at: Posture, rods: Sequence[Rod]) -> None:
        n, dims, size = len(rods), len(rods[0].near), len(at.screws[0])
        self.dims, self.turning = dims, bool(at.arms)
        t = self.terms = terms(n, size)
        each, still = np.arange(n), (0.0,) * dims
        columns = [
            (*rod.near, *(rod.curve or still), rod.length, rod.growth, rod.growth_curve, rod.growth_aside, rod.aside)
            for rod in rods
        ]
        table = np.array(columns)
        near, curve = table[:, :dims], table[:, dims : 2 * dims]
        length, growth, bend, uncertain, aside = table[:, 2 * dims :].T
        self.screws = np.array(at.screws)
        r = self.screws[:, :dims]
        self.arms = np.zeros((n, dims))
        if self.turning:
            self.arms[:, :2] = at.arms
        self.lengths, self.aside = length, aside
        self.drives = (r * near).sum(1) + growth
        self.near = np.zeros((n, dims, t.number))
        self.near[:, :, 0] = self.arms - length[:, None] * r
        self.near[each, :, 1 + each] = near
        self.near[each, :, t.squares] = curve
        # (length + growth s + bend s^2 + uncertain)^2/2
        self.length = np.zeros((n, t.number))
        self.length[:, 0], self.length[each, 1 + each], self.length[each, t.squares] = length, growth, bend
        self.uncertain = uncertain
        self.half = np.zeros((n, t.number))
        self.half[:, 0] = 0.5 * length * length
        self.half[each, 1 + each] = length * growth
        self.half[each, t.squares] = length * bend + 0.5 * growth * growth
        self.longest = length + abs(growth) + abs(bend) + uncertain
        self.half_rest = abs(growth * bend) + 0.5 * bend * bend + uncertain * self.longest
        self.half_rest += (self.longest + 0.5 * aside) * aside

    def vectors(self, pose: Array) -> tuple[Quadratic | None, Quadratic]:
        """cos and sin of the turn, as far as there is one, and the rods (n, dims), of a pose without rest."""
        t, arms = self.terms, self.arms
        vectors, rest = pose[: self.dims] - self.near, np.zeros(arms.shape)
        if not self.turning:
            return None, Quadratic(t, vectors, rest)
        turn = pose[-1]
        first = turn[t.joints]
        one, more = abs(turn) @ t.sizes
        most = one + more
        turned = np.zeros((2, t.number))
        turned[0, 0], turned[1] = 1.0, turn
        turned[0, t.pairs] = -0.5 * (first[:, None] * first).ravel() @ t.fold
        rests = np.array([more * (one + 0.5 * more) + most**4 / 24.0, most**3 / 6.0])
        x, y = arms[:, 0], arms[:, 1]
        vectors[:, :2] += arms[:, :2, None] * turned[0]
        vectors[:, 0] -= y[:, None] * turn
        vectors[:, 1] += x[:, None] * turn
        rest[:, :2] = abs(arms[:, :2]) * rests[0] + abs(arms[:, 1::-1]) * rests[1]
        return Quadratic(t, turned, rests), Quadratic(t, vectors, rest)

    def misfit(self, vectors: Quadratic) -> Quadratic:
        """(n,) m^2, what the halves of the rods' squares are too large by."""
        squares = vectors * vectors
        return Quadratic(self.terms, 0.5 * squares.p.sum(1) - self.half, 0.5 * squares.rest.sum(1) + self.half_rest)

    def pose(self, inverse: Array) -> tuple[Quadratic, Quadratic, Quadratic] | None:
        """Pose (m,), and rods (n, dims) seen from the platform and from the base."""
        t, per = self.terms, inverse / self.lengths
        pose = np.zeros((len(inverse), t.number))
        pose[:, t.joints] = inverse * self.drives
        vectors = self.vectors(pose)[1].p
        pose -= per @ (0.5 * multiplied(t, vectors, vectors).sum(1) - self.half)
        pose[:, 0] = 0.0
        room = self._rest(pose, per)
        if room is None:
            return None
        pose[:, t.effects] = np.diag(room)
        turned, rods = self.vectors(pose)
        rods.rest = rods.rest + self.aside[:, None]
        seen = rods if turned is None else _turned_back(turned, rods)
        return Quadratic(t, pose, np.zeros(len(pose))), seen, rods

    def _rest(self, pose: Array, per: Array) -> Array | None:
        """(m,) by which the pose may be elsewhere, displacement and turn; None if there is no bound."""
        dims, (_, vectors) = self.dims, self.vectors(pose)
        misfit = self.misfit(vectors)
        start = abs(per) @ misfit.largest()
        # How the rows (w, (R c) x w) of the Jacobian change with the joints,
        rows = np.zeros((*self.screws.shape, pose.shape[1]))
        rests = np.zeros(self.screws.shape)
        rows[:, :dims], rests[:, :dims] = vectors.p, vectors.rest
        radius = longest = 0.0 * self.lengths
        if self.turning:
            (x, y), w, turn = self.arms[:, :2].T, vectors.p, pose[-1]
            radius, longest, most = np.hypot(x, y), self.longest + self.aside, abs(turn).sum()
            rows[:, dims] = x[:, None] * w[:, 1] - y[:, None] * w[:, 0]
            rows[:, dims] -= ((x * w[:, 0, 0] + y * w[:, 1, 0])[:, None]) * turn
            change = np.hypot(*(abs(w[:, :2, 1:]).sum(2) + vectors.rest[:, :2]).T)
            rests[:, dims] = abs(x) * vectors.rest[:, 1] + abs(y) * vectors.rest[:, 0]
            rests[:, dims] += radius * most * (0.5 * most * (self.lengths + change) + change)
        rows[:, :, 0] -= self.lengths[:, None] * self.screws
        size = abs(per)
        changes = (per @ rows.reshape(len(per), -1)).reshape(rows.shape)
        share = abs(changes).sum(-1) + size @ rests
        farther = np.zeros(self.screws.shape)

        def shares(room: Array) -> Array:
            """(m, m): and within the room itself, half as much on the average of the way through it."""
            move, turn = hypot(*room[:dims].tolist()), room[-1] if self.turning else 0.0
            end = move + radius * turn
            farther[:, :dims] = 0.5 * end[:, None]
            if self.turning:
                farther[:, dims] = 0.5 * radius * (end + turn * (longest + end))
            both: Array = share + size @ farther
            return both

        found = start
        for _ in range(BOXES):
            try:
                found = np.linalg.solve(np.eye(len(start)) - shares(found), start)
            except np.linalg.LinAlgError:
                return None
            if not (found >= 0.0).all():
                return None
            room = WIDER * found + LEAST
            found = start + shares(room) @ room
            if (found < room).all():
                inside: Array = start + shares(found) @ found
                return inside
        return None


def _turned_back(turned: Quadratic, vectors: Quadratic) -> Quadratic:
    """Vectors (n, dims), seen from a platform that has turned: cos and sin."""
    t, (p, rest) = vectors.terms, (vectors.p, vectors.rest)
    level = np.empty((2, len(p), 2, t.number))
    level[0], level[1, :, 0], level[1, :, 1] = p[:, :2], p[:, 1], -p[:, 0]
    rests = np.empty((2, len(p), 2))
    rests[0], rests[1] = rest[:, :2], rest[:, 1::-1]
    seen = (turned[:, None, None] * Quadratic(t, level, rests)).sum(0)
    if p.shape[1] == 2:
        return seen
    return Quadratic(t, np.concatenate([seen.p, p[:, 2:]], 1), np.concatenate([seen.rest, rest[:, 2:]], 1))


def _type2_over(platform: _Platform, rods: Quadratic, arm: float) -> float:
    """Lower bound of the smallest cos alpha_i, rods seen from the platform; not above 0 where that proves nothing."""
    n, dims = platform.arms.shape
    t, others = platform.terms, OTHERS[n]
    rows = rods[others]
    if platform.turning:  # moments about the place where the leg holds the platform that is left out
        arms = platform.arms[others] - platform.arms[:, None]
        x, y = arms[:, :, 0], arms[:, :, 1]
        p, rest = np.empty((n, n - 1, n, t.number)), np.empty((n, n - 1, n))
        p[:, :, :dims], rest[:, :, :dims] = rows.p, rows.rest
        p[:, :, dims] = x[..., None] * rows.p[:, :, 1] - y[..., None] * rows.p[:, :, 0]
        rest[:, :, dims] = abs(x) * rows.rest[:, :, 1] + abs(y) * rows.rest[:, :, 0]
        rest[:, :, dims] += 2.0 * arm * platform.longest[others]
        rows = Quadratic(t, p, rest)
    v = _crossed(rows)[:, :dims]
    return _in_plane(rods, v) if dims == 2 else _in_space(rods, v, platform)


def _in_plane(rods: Quadratic, v: Quadratic) -> float:
    """tan alpha_i = |X|/D with D = rod . v_i and X = rod x v_i. If D s - X c and D s + X c are at least -m and D is at
    least d, m >= 0 and d > 0, then |X| d c <= D (d s + m)."""
    n, t = len(rods.p), rods.terms
    ways = np.arange(2)[:, None] ^ np.arange(2)  # x with x and y with y, then x with y and y with x
    products = rods[:, None] * v[:, ways]
    signs = np.sign(products.p[:, 0, :, 0].sum(1))[:, None] * np.array([[1.0, 1.0, 1.0, -1.0]])
    both = products.times(signs.reshape(n, 2, 2)).sum(2)
    det, side = both[:, 0], both[:, 1]
    corners = side.p[:, : t.polynomial] @ t.monomials / (det.p[:, : t.polynomial] @ t.monomials)
    tangent = abs(corners).max(1)
    c = 1.0 / np.hypot(1.0, tangent)
    s = tangent * c
    up, across = det.times(s), side.times(c)
    least, *ends = np.split(joined(det, up - across, up + across).least(), 3)
    if not (least > 0.0).all():
        return 0.0
    missing = np.maximum(-np.minimum(*ends), 0.0)
    return float(1.0 / np.hypot(1.0, ((least * s + missing) / (least * c)).max()))


def _in_space(rods: Quadratic, v: Quadratic, platform: _Platform) -> float:
    """cos alpha_i = D/(|v_i| length) with D = rod . v_i. If D - q |v_i| length is at least -m and D at least d, m >= 0
    and d > 0, then D (d + m) >= q d |v_i| length. |v| <= along + aside^2/(2 along), along and across its middle."""
    t, det = rods.terms, (rods * v).sum(1)
    det = det.times(np.sign(det.p[:, 0]))
    middle = v.p[:, :, 0]
    way = middle / np.sqrt((middle * middle).sum(1))[:, None]
    along = v.times(way).sum(1)
    shortest = 2.0 * along.p[:, 0] - along.largest()
    if not (shortest > 0.0).all():
        return 0.0
    across = v - along[:, None].times(way)
    size = along + (across * across).sum(1).times(0.5 / shortest)
    below = size * Quadratic(t, platform.length, platform.uncertain)
    corners = det.p[:, : t.polynomial] @ t.monomials / (below.p[:, : t.polynomial] @ t.monomials)
    cosine = np.maximum(corners.min(1), 0.0)
    least, both = np.split(joined(det, det - below.times(cosine)).least(), 2)
    if not (least > 0.0).all():
        return 0.0
    return float((cosine * least / (least + np.maximum(-both, 0.0))).min())


OTHERS = {n: np.array([[k for k in range(n) if k != i] for i in range(n)]) for n in (2, 3, 4)}
"""The other legs of each."""


def _crossed(rows: Quadratic) -> Quadratic:
    """(n, n) what the determinants of any row and the n - 1 given ones, (n, n - 1, n), are the products with."""
    n = len(rows.p)
    if n == 2:
        turned = rows[:, 0, ::-1]
        return turned.times(np.array([1.0, -1.0]))
    if n == 3:
        products = rows[:, 0, CYCLES] * rows[:, 1, CYCLES[::-1]]
        return products[:, 0] - products[:, 1]
    a, b, c = rows[:, 0], rows[:, 1], rows[:, 2]
    products = b[:, COLUMNS] * c[:, COLUMNS[::-1]]
    minors = products[:, 0] - products[:, 1]
    products = a[:, WEDGE[0]] * minors[:, WEDGE[1]]
    t, signed = rows.terms, products.times(WEDGE[2])
    return Quadratic(t, signed.p.reshape(n, 3, 3, t.number).sum(2), signed.rest.reshape(n, 3, 3).sum(2))


CYCLES = np.array([[1, 2, 0], [2, 0, 1]])
COLUMNS = np.array([[0, 0, 0, 1, 1, 2], [1, 2, 3, 2, 3, 3]])
"""Columns of the minors of two rows of four."""
WEDGE = (
    np.array([1, 3, 2, 2, 0, 3, 0, 3, 1]),
    np.array([5, 3, 4, 2, 5, 1, 4, 0, 2]),
    np.array([1.0, 1.0, -1.0, 1.0, -1.0, -1.0, 1.0, 1.0, -1.0]),
)
"""Entries of a third row, minors and signs that make up the first three entries of the cross product of three rows,
three products each."""


def _besides(x: Quadratic) -> Array:
    """Bound of all that is not constant or of first order in the joints."""
    more: Array = (abs(x.p) @ x.terms.sizes)[..., 1] + x.rest
    return more


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
    """Smallest value over the square -1..1 of the bilinear function with the given values at (-1, -1), (-1, 1),
    (1, -1), (1, 1) less sum (1 - s_j^2) sizes_j: at a corner, on an edge, or where both slopes vanish."""
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
    """Largest size of a sum of vectors with any signs, or a little more."""
    square = sum([sum(map(mul, way, way)) for way in ways])
    return sqrt(square + 2.0 * sum([abs(sum(map(mul, a, b))) for a, b in combinations(ways, 2)]))
def _dot(row: Sequence[float], vector: Sequence[float]) -> float:
    return sum(map(mul, row, vector), 0.0)  # a row may have a moment besides
