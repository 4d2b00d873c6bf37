"""Limb singularities: the joints of one limb alone move its end in fewer independent directions than they should.

Two views of a limb. Its joints: unit twists (angular; linear at the origin), for any chain of revolute and prismatic
joints; the smallest singular value of their matrix is the margin. The limbs of [S3], R U U and P R Pi R: the 6 x 6
kinematic Jacobian with the motions that the limb prevents added, whose determinant is a superbracket that factors into
conditions in plain words, and scale-free margins from the factors. Source: [S3] with the corrections listed in
docs/explanation/sources.md; the margins are ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from irsbot_kinematics import arguments
from irsbot_kinematics.errors import BadInput
from irsbot_kinematics.numerics.arithmetic import FLOATS, Arithmetic, Array, N
from irsbot_kinematics.numerics.tolerances import LARGEST

# --- margins of the two limbs, floats or arrays -----------------------------------------------------------------


def ruu_factors(k: Arithmetic[N], ab: Sequence[N], bc: Sequence[N], z: Sequence[float]) -> tuple[N, N]:
    """(|f1|, |f2|) of an R U U limb, 0..1 each: (u_AB x u_BC).z and (u_BC x z).m, m horizontal and normal to BC.

    ab, bc: unit vectors A to B and B to C; z: unit axis of the first joint, ab normal to z.
    f1 = 0: the plane ABC contains z (Type 1 of the leg). f2 = 0: BC is parallel to z.
    """
    hx, hy, hz = _cross(bc, z)
    return k.abs(_dot(ab, (hx, hy, hz))), k.safe_sqrt(hx * hx + hy * hy + hz * hz)


def prpir_factors(k: Arithmetic[N], l: Sequence[N], x: Sequence[float], z: Sequence[float]) -> tuple[N, N]:
    """(|l.x|, |(z x l).n|) of a P R Pi R limb, 0..1 each, n the normal of the parallelogram, normal to z and l.

    l: unit vector along the rods; x: unit direction of the slide; z: unit axis of the revolute joints.
    l.x = 0: C lies in the plane through A across the slide (Type 1 of the leg). |z x l| = 0: flat parallelogram.
    """
    nx, ny, nz = _cross(l, z)
    return k.abs(_dot(l, x)), k.safe_sqrt(nx * nx + ny * ny + nz * nz)


# --- limbs by their joints ----------------------------------------------------------------------------------------


def revolute(axis: ArrayLike, point_m: ArrayLike) -> Array:
    """Unit twist (6,) of a rotation about an axis (of any length) through a point: (s; r x s). Raises BadInput."""
    s = _unit(axis)
    return np.concatenate([s, np.cross(arguments.matrix(point_m, (3,), "point_m"), s)])


def prismatic(direction: ArrayLike) -> Array:
    """Unit twist (6,) of a translation: (0; s). Raises BadInput."""
    return np.concatenate([np.zeros(3), _unit(direction)])


def limb_margin(twists: ArrayLike, length_m: float, point_m: ArrayLike = (0.0, 0.0, 0.0)) -> float:
    """Distance of a limb from losing a motion: smallest singular value of its unit twists, 0 when singular.

    twists: (n, 6) with n <= 6, moments at the origin, m; they are taken about `point_m`, a point of the limb, and
    divided by the characteristic length. No added twist and no platform point enters. Raises BadInput. Source: ours.
    """
    T = arguments.table(twists, 6, "twists")
    if not (1 <= len(T) <= 6 and (np.abs(T) <= LARGEST).all()):
        raise BadInput(f"twists must be 1 to 6 rows of finite numbers, got {arguments.shown(twists)}")
    length_m = arguments.positive(length_m, "length_m")
    turning = np.linalg.norm(T[:, :3], axis=1) > 0.0
    T[:, 3:] += np.cross(T[:, :3], arguments.matrix(point_m, (3,), "point_m"))
    T[turning, 3:] /= length_m
    return float(np.linalg.svd(T, compute_uv=False)[-1])


def ruu_twists(a: ArrayLike, b: ArrayLike, c: ArrayLike, z: ArrayLike, m: ArrayLike) -> Array:
    """Twists (5, 6) of an R U U limb: z at A, z and m at B, m and z at C ([S3] (8))."""
    return np.array([revolute(z, a), revolute(z, b), revolute(m, b), revolute(m, c), revolute(z, c)])


def prpir_twists(a: ArrayLike, c: ArrayLike, x: ArrayLike, z: ArrayLike, n: ArrayLike) -> Array:
    """Twists (4, 6) of a P R Pi R limb: slide along x, z at A, circular translation along l x n, z at C ([S3] (2))."""
    along = np.cross(_unit(np.subtract(c, a)), _unit(n))
    return np.array([prismatic(x), revolute(z, a), prismatic(along), revolute(z, c)])


def ruu_jacobian(a: ArrayLike, b: ArrayLike, c: ArrayLike, z: ArrayLike, m: ArrayLike, e: ArrayLike) -> Array:
    """Kinematic Jacobian (6, 6): the limb's twists and the rotation about z x m at E that the limb prevents."""
    return np.vstack([ruu_twists(a, b, c, z, m), revolute(np.cross(_unit(z), _unit(m)), e)])


def prpir_jacobian(a: ArrayLike, c: ArrayLike, x: ArrayLike, z: ArrayLike, n: ArrayLike, e: ArrayLike) -> Array:
    """Kinematic Jacobian (6, 6): the limb's twists and the rotations about x and y at E that the limb prevents."""
    return np.vstack([prpir_twists(a, c, x, z, n), revolute(x, e), revolute(np.cross(_unit(z), _unit(x)), e)])


# --- superbracket --------------------------------------------------------------------------------------------------

_PRINTED = """
- abcd efgi hjkl,  + abcd efhi gjkl,  + abcd efgj hikl,  - abcd efhj gikl,  + abce dfgh ijkl,  - abde cfgh ijkl,
- abcf degh ijkl,  + abdf cegh ijkl,  - abce dghi fjkl,  + abde cghi fjkl,  + abcf dghi ejkl,  + abce dghj fikl,
- abdf cghi ejkl,  - abde cghj fikl,  - abcf dghj eikl,  + abdf cghj eikl,  + abcg defi hjkl,  - abdg cefi hjkl,
- abch defi gjkl,  - abcg defj hikl,  + abdh cefi gjkl,  + abdg cefj hikl,  + abch defj gikl,  - abdh cefj gikl
"""
"""The 24 bracket monomials y1 to y24 of [S3] (1): y3, y4 and y6 corrected."""
_MONOMIALS = tuple(tuple(monomial.split()) for monomial in _PRINTED.split(","))

Point = tuple[float, float, float, float]
"""Projective point (x, y, z, weight): weight 1 for a point, 0 for a direction. Integers stay exact."""


def finite(point_m: Sequence[float]) -> Point:
    """A point of space."""
    x, y, z = point_m
    return x, y, z, 1


def infinite(direction: Sequence[float]) -> Point:
    """The point at infinity of all lines along a direction."""
    x, y, z = direction
    return x, y, z, 0


def bracket(a: Point, b: Point, c: Point, d: Point) -> float:
    """Determinant of four points as rows: 0 iff they are coplanar."""
    ab = [a[i] * b[j] - a[j] * b[i] for i, j in _PAIRS]
    cd = [c[i] * d[j] - c[j] * d[i] for i, j in _PAIRS]
    return ab[0] * cd[5] - ab[1] * cd[4] + ab[2] * cd[3] + ab[3] * cd[2] - ab[4] * cd[1] + ab[5] * cd[0]


_PAIRS = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))


def line(p: Point, q: Point) -> tuple[float, ...]:
    """Pluecker coordinates (6,) of the line pq: (w_p q - w_q p; p x q)."""
    return (*[p[3] * q[i] - q[3] * p[i] for i in range(3)], *_cross(p, q))


def superbracket(points: Sequence[Point]) -> float:
    """Minus the determinant of six lines ab, cd, ef, gh, ij, kl as rows, from 24 products of brackets ([S3] (1)).

    points: a to l. The sign belongs to points with the weight last; with the weight first it is plus.
    """
    if len(points) != 12:
        raise BadInput(f"a superbracket has 12 points, two per line, got {len(points)}")
    named = dict(zip("abcdefghijkl", points, strict=True))
    total: float = 0
    for sign, *words in _MONOMIALS:
        first, second, third = [bracket(*[named[letter] for letter in word]) for word in words]
        total += first * second * third if sign == "+" else -first * second * third
    return total


def ruu_points(
    a: Sequence[float],
    b: Sequence[float],
    c: Sequence[float],
    z: Sequence[float],
    m: Sequence[float],
    e: Sequence[float],
) -> tuple[Point, ...]:
    """The 12 points of an R U U limb and its added twist ([S3] (9)); they factor into [azbc][zbmc][zmen]."""
    A, B, C, E = finite(a), finite(b), finite(c), finite(e)
    Z, M = infinite(z), infinite(m)
    return A, Z, B, Z, B, M, C, M, C, Z, E, infinite(_cross(z, m))


def prpir_points(
    a: Sequence[float],
    c: Sequence[float],
    x: Sequence[float],
    z: Sequence[float],
    n: Sequence[float],
    e: Sequence[float],
) -> tuple[Point, ...]:
    """The 12 points of a P R Pi R limb and its added twists ([S3] (3)); they factor into [yzac][zlne][zxey]."""
    A, C, E = finite(a), finite(c), finite(e)
    X, Y, Z = infinite(x), infinite(_cross(z, x)), infinite(z)
    l = (c[0] - a[0], c[1] - a[1], c[2] - a[2])
    return Y, Z, A, Z, infinite(l), infinite(n), C, Z, E, X, E, Y


# --- conditions in words -------------------------------------------------------------------------------------------


class Condition(NamedTuple):
    """One condition under which a limb is singular."""

    words: str
    value: float
    """0 when it holds, at most 1: the sine of the angle, or the product of sines, that is missing."""


def ruu_conditions(a: ArrayLike, b: ArrayLike, c: ArrayLike, z: ArrayLike) -> tuple[Condition, ...]:
    """Distances of an R U U limb (BC normal to m) to each of its singularities, the nearest first. Points in m."""
    ab, bc, s = _unit(np.subtract(b, a)), _unit(np.subtract(c, b)), _unit(z)
    ac = np.subtract(c, a)
    f1, f2 = ruu_factors(FLOATS, ab.tolist(), bc.tolist(), s.tolist())
    conditions = [
        Condition("the plane ABC contains z", f1),
        Condition("BC parallel to z", f2),
        Condition("A, B, C in line", _sine(ab, bc)),
    ]
    if np.any(ac):
        conditions.append(Condition("AC parallel to z", _sine(_unit(ac), s)))
    return tuple(sorted(conditions, key=lambda condition: condition.value))


def prpir_conditions(a: ArrayLike, c: ArrayLike, x: ArrayLike, z: ArrayLike) -> tuple[Condition, ...]:
    """Distances of a P R Pi R limb to each of its singularities, the nearest first. Points in m."""
    l, slide, s = _unit(np.subtract(c, a)), _unit(x), _unit(z)
    across, flat = prpir_factors(FLOATS, l.tolist(), slide.tolist(), s.tolist())
    conditions = [
        Condition("AC at right angles to the slide", across),
        Condition("AC parallel to y = z x slide", _sine(l, np.cross(s, slide))),
        Condition("AC parallel to z: the parallelogram is flat", flat),
    ]
    return tuple(sorted(conditions, key=lambda condition: condition.value))


def _sine(a: Array, b: Array) -> float:
    return float(np.linalg.norm(np.cross(a, b)))


def _unit(vector: ArrayLike) -> Array:
    v = arguments.array(vector, "a direction", "three finite numbers")
    size = float(np.linalg.norm(v))
    if v.shape != (3,) or not 0.0 < size < np.inf:
        raise BadInput(f"a direction needs three finite numbers, not all zero, got {v.tolist()}")
    unit: Array = v / size
    return unit


def _cross(a: Sequence[N], b: Sequence[N] | Sequence[float]) -> tuple[N, N, N]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _dot(a: Sequence[N], b: Sequence[N] | Sequence[float]) -> N:
    product: N = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return product
