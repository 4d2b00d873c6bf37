"""Certified bounds of margins over a box of joint positions, with an error of third order in the size of the box.

The box is q = q0 + (s_1 h_1, .., s_n h_n) with every s_j in -1..1. Bounds of first order (`displacement`) add the
effects of all joints in all directions. Here every quantity is a polynomial of second degree in the s_j with a
certified remainder (`quadratics`): effects of several joints, or of one joint on several terms, can cancel.

Setting. Rod i holds the platform point at arm c_i, w_i is the vector along it, L_i its length, C_i its near end. In the
box C_i is near_i s_i + curve_i s_i^2 + third_i s_i^3 away, and at most aside_i from there; L_i is a polynomial in s_i,
and at most growth_aside_i from there. With the platform moved by d and turned by t about z

    w_i = d + R(t) c_i - C_i(s_i),    F_i = (|w_i|^2 - L_i^2)/2 = 0

Rows of the Jacobian of F are (w_i, (R c_i) x w_i); in the middle they are L_i times the screws A, so C = A^-1/L is its
inverse there.

1. The pose. One Newton step from 0 gives what is linear in the s_j, a second one the squares and products, a third one
   the products of three (`cubics`): p(s). F(p(s)) is then small of fourth order. For any other pose x = p + r the mean
   value theorem says r = -C F(p) + (1 - C J) r, with J the average of the Jacobian on the way from p to x. Let start >=
   |C F(p)|, shares >= |1 - C J| at p(s), and farther(r) what C J changes by within r, half of it on the average of the
   way. A set |r| <= room with start + (shares + farther(room)) room < room cannot be left: on any way from the posture
   to a point of the box the motion is continuous, begins in it, and is never at its boundary. An error of a near end,
   aside_i, makes |w_i| differ from L_i by as much, and is part of F. (Krawczyk's operator, applied to a polynomial.)
2. The rods. The pose is p(s) without the products of three joints, plus an effect of known direction in every
   coordinate, at most as large as these products and room: these effects are kept like joints, to first order, because
   they act on all rods at once. That gives w_i seen from the base, and, turned back by R(-t), seen from the platform,
   where only the rods turn and the arms do not.
3. Type 2 (`type2_over_box`). cos alpha_i is the sine of the angle between w_i and the line or plane across v_i, the
   cross product of the other rows, moments taken where leg i holds the platform: D = w_i . v_i, cos alpha_i =
   |D|/(|v_i| L_i). The lengths of the other rods cancel. v_i and D are products of the above. In the plane tan alpha_i
   = |w_i x v_i|/D, so nothing but two quadratics is compared. The quotient is guessed from the corners; what is then
   certified are two lower bounds, that D is at least d, and that D is at least the guess times the other one less m.
   Both bound the quotient.
4. The least value of a quadratic over the box (`quadratics.least`).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import asin, hypot, inf
from typing import TYPE_CHECKING, NamedTuple

from irsbot_kinematics import statics
from irsbot_kinematics.bounds import cubics
from irsbot_kinematics.bounds.box_code import codes_for
from irsbot_kinematics.bounds.cubics import Cubic, cube, cubic
from irsbot_kinematics.bounds.quadratics import (
    Quadratic,
    besides,
    combined,
    dot,
    largest,
    minus,
    multiplied,
    norm,
    numbers,
    plus,
    polynomial,
    scaled,
)
from irsbot_kinematics.bounds.sizes import largest_sum
from irsbot_kinematics.bounds.type2_over_box import type2_over

if TYPE_CHECKING:
    from irsbot_kinematics.mechanism import Floats, Posture

WIDER = 1.2
"""1: factor of the room, over its guess, for which the change of the Jacobian is computed."""
BOXES = 4
"""Number of guesses; if none holds, the box of joints is so large that a cut is better."""
INSIDE = 1e-6
"""1: share of (1 - rows)^-1 room by which the room is larger, so that the bound is inside it in every coordinate, also
in one that is displaced only because others are."""
LEAST = 1e-100
"""m or rad: least size of the room, so that it has an interior."""


Leg = tuple[float, float, float, float]
"""m: attachment (x, y), longest length, error of the near end."""


class Rod(NamedTuple):
    """Effect of a joint on its rod within the box, m: joint i is at s_i in -1..1 of its range."""

    length: float
    near: Floats  # factor of s_i in the motion of its near end
    aside: float  # how far the near end may be from there, all factors included
    growth: float = 0.0  # s_i of this is how its length grows, to first order
    growth_aside: float = 0.0
    curve: Floats = ()  # factor of s_i^2 in the motion of its near end; none if left out
    growth_curve: float = 0.0
    third: Floats = ()  # factor of s_i^3 in the motion of its near end; none if left out
    growth_third: float = 0.0


class Change(NamedTuple):
    """Change of a rod over the box, divided by its length, seen from the base."""

    ways: Sequence[Sequence[float]]  # per joint, to first order
    most: float  # largest size of their sum
    rest: float  # bound of the remainder


class Reached(NamedTuple):
    """Bounds that hold everywhere in the box."""

    type2: float  # lower bound of the Type 2 margin
    pose: list[Quadratic]  # displacement and turn of the platform, m and rad
    rods: list[list[Quadratic]]  # m, the rods as vectors, seen from the base
    longest: list[float]  # m, of the rods

    @property
    def moves(self) -> list[Floats]:
        """m per joint, of the platform point, to first order."""
        return [tuple([x[1 + joint] for x in self._displacement]) for joint in range(len(self.rods))]

    @property
    def aside(self) -> float:
        """m: residual of the motion of the platform point."""
        return hypot(*[besides(len(self.rods), x) for x in self._displacement])

    @property
    def changes(self) -> list[Change]:
        """The change of every rod."""
        found, n = [], len(self.rods)
        for rod in self.rods:
            length = hypot(*[x[0] for x in rod])
            ways = [[x[1 + joint] / length for x in rod] for joint in range(n)]
            found.append(Change(ways, largest_sum(ways), hypot(*[besides(n, x) for x in rod]) / length))
        return found

    @property
    def turn(self) -> float:
        """rad: largest turn of a rod."""
        share = max([change.most + change.rest for change in self.changes])
        return asin(share) if share < 1.0 else inf

    @property
    def _displacement(self) -> list[Quadratic]:
        return self.pose[: len(self.rods[0])]


def reached(at: Posture, rods: Sequence[Rod], arm: float = 0.0) -> Reached | None:
    """Bounds over the box with the middle `at`; None if nothing can be proved, also for NaN.

    rods: one per leg, with near ends in the plane or in space as the screws. arm: m, error of the attachments of a
    platform that turns; its effect on their ends is in `Rod.aside`. Machine code answers where there is some.
    """
    n, dims, m = len(rods), len(rods[0].near), len(at.screws[0])
    code = codes_for(n, dims, m).get("reached")
    if code is not None:
        found = code(numbers_of(at, rods, arm))
        if found is None:
            return None
        if found:
            return _from_numbers(found, n, dims, m)
    return by_equations(at, rods, arm)


def by_equations(at: Posture, rods: Sequence[Rod], arm: float) -> Reached | None:
    """The same without machine code, which is made from this."""
    det, columns = statics.cofactors(at.screws)
    if not (abs(det) > 0.0 and all(rod.length > 0.0 for rod in rods)):
        return None
    platform = _Platform(at, rods)
    pose = platform.pose([[value / det for value in column] for column in columns])
    if pose is None:
        return None
    turned, vectors = platform.vectors(pose)
    for vector, rod in zip(vectors, rods, strict=True):
        for x in vector:
            x[-1] += rod.aside
    seen = vectors if turned is None else [_turned_back(len(rods), turned, vector) for vector in vectors]
    attachments = () if turned is None else at.attachments
    type2 = type2_over(seen, platform.lengths, attachments, arm, platform.longest)
    return Reached(type2, pose, vectors, platform.longest)


def numbers_of(at: Posture, rods: Sequence[Rod], arm: float) -> list[float]:
    """What machine code takes."""
    found: list[float] = []
    for screw in at.screws:
        found += screw
    if len(at.screws[0]) > len(rods[0].near):
        for attachment in at.attachments:
            found += attachment
    none = (0.0,) * len(rods[0].near)
    for rod in rods:
        found.append(rod.length)
        found += rod.near
        found += (rod.aside, rod.growth, rod.growth_aside)
        found += rod.curve or none
        found.append(rod.growth_curve)
        found += rod.third or none
        found.append(rod.growth_third)
    found.append(arm)
    return found


def _from_numbers(found: list[float], n: int, dims: int, m: int) -> Reached:
    """What machine code has found: the Type 2 margin, then the quantities of the pose, of the rods, and the lengths."""
    size = numbers(n, m)
    parts = [found[k : k + size] for k in range(1, len(found) - n, size)]
    rods = [parts[k : k + dims] for k in range(m, m + n * dims, dims)]
    return Reached(found[0], parts[:m], rods, found[len(found) - n :])


class _Platform:
    """The rods of a posture, and their dependence on pose and joints."""

    def __init__(self, at: Posture, rods: Sequence[Rod]) -> None:
        n, dims, m = len(rods), len(rods[0].near), len(at.screws[0])
        self.n, self.dims, self.m, self.turning = n, dims, m, m > dims
        self.screws, self.at_rest = at.screws, [rod.length for rod in rods]
        self.attachments = at.attachments if self.turning else ((0.0, 0.0),) * n
        self.aside = [rod.aside for rod in rods]
        self.near: list[list[Quadratic]] = []
        self.places: list[list[Cubic]] = []
        """Near ends, to third order."""
        self.drives: list[float] = []
        self.lengths: list[Quadratic] = []
        self.longest: list[float] = []
        self.half: list[Cubic] = []
        """L^2/2, with what its error and that of the near end add to F."""
        for i, rod in enumerate(rods):
            ends, places, drive = [], [], rod.growth
            for d in range(dims):
                end = self._constant(-rod.length * at.screws[i][d] + (self.attachments[i][d] if d < 2 else 0.0))
                end[1 + i] = rod.near[d]
                end[1 + n + i] = rod.curve[d] if rod.curve else 0.0
                drive += at.screws[i][d] * rod.near[d]
                place = cubic(n, end)
                if rod.third:
                    place[cube(n, i)] = rod.third[d]
                    end[-1] = abs(rod.third[d])
                ends.append(end)
                places.append(place)
            length = self._constant(rod.length)
            length[1 + i], length[1 + n + i] = rod.growth, rod.growth_curve
            half = cubic(n, length)
            half[cube(n, i)] = rod.growth_third
            half = scaled(cubics.squared(n, half), 0.5)
            length[-1] = rod.growth_aside + abs(rod.growth_third)
            longest = largest(length)
            half[-1] += rod.growth_aside * longest + (longest + 0.5 * rod.aside) * rod.aside
            self.near.append(ends)
            self.places.append(places)
            self.drives.append(drive)
            self.lengths.append(length)
            self.longest.append(longest)
            self.half.append(half)

    def vectors(self, pose: Sequence[Quadratic]) -> tuple[tuple[Quadratic, Quadratic] | None, list[list[Quadratic]]]:
        """cos and sin of the turn, if there is one, and the rods, of a pose without remainder."""
        turned, found = self._turned(pose[-1]) if self.turning else None, []
        for near, (ax, ay) in zip(self.near, self.attachments, strict=True):
            rod = [minus(pose[d], near[d]) for d in range(self.dims)]
            if turned is not None:
                rod[0] = plus(rod[0], combined((ax, -ay), turned))
                rod[1] = plus(rod[1], combined((ay, ax), turned))
            found.append(rod)
        return turned, found

    def pose(self, inverse: Sequence[Sequence[float]]) -> list[Quadratic] | None:
        """Displacement and turn. inverse: per leg, the column of A^-1."""
        n, pose = self.n, [self._constant(0.0) for _ in range(self.m)]
        per = [[inverse[i][k] / self.at_rest[i] for i in range(n)] for k in range(self.m)]
        for k, x in enumerate(pose):
            for joint in range(n):
                x[1 + joint] = inverse[joint][k] * self.drives[joint]
        first = self.vectors(pose)[1]
        sizes = [dot(n, rod, rod) for rod in first]
        for place in range(1 + n, polynomial(n)):
            short = [half[place] - 0.5 * size[place] for half, size in zip(self.half, sizes, strict=True)]
            for x, shares in zip(pose, per, strict=True):
                x[place] = _product(shares, short)
        third, start = self._third(pose, per)
        found = [list(x) for x in pose]
        for x, size in zip(found, third, strict=True):
            x[-1] = size
        room = self._rest(found, per, start)
        if room is None:
            return None
        for k, x in enumerate(pose):
            x[polynomial(n) + k] = third[k] + room[k]
        return pose

    def _third(self, pose: Sequence[Quadratic], per: Sequence[Sequence[float]]) -> tuple[list[float], list[float]]:
        """(m,) sizes of the terms of third degree that a third Newton step adds to the pose, and bounds of |C F| with
        them: their first-order effect removes the terms of third degree of F, and what else they do is bounded."""
        n, places = self.n, cubics.third_degree(self.n)
        errors, moved = self._errors([cubic(n, x) for x in pose])
        third, start = [], []
        for shares in per:
            misfit = combined(shares, errors)
            size = 0.0
            for place in places:
                size += abs(misfit[place])
                misfit[place] = 0.0
            third.append(size)
            start.append(largest(misfit))
        turn, whole = third[-1], largest(pose[-1])
        for leg, (length, ahead, (x, y)) in enumerate(zip(self.at_rest, moved, self.attachments, strict=True)):
            steps, bend = third[: self.dims], 0.0
            if self.turning:
                steps[0] += abs(y) * turn
                steps[1] += abs(x) * turn
                bend = norm(x, y) * turn * (whole + 0.5 * turn)
            farther = norm(*steps) + bend
            error = _product(ahead, steps) + (length + norm(*ahead)) * bend + 0.5 * farther * farther
            for k, shares in enumerate(per):
                start[k] += abs(shares[leg]) * error
        return third, start

    def _errors(self, pose: Sequence[Cubic]) -> tuple[list[Cubic], list[list[float]]]:
        """F of every leg to third order, and how far its rod changes as a vector, m."""
        n, errors, moved = self.n, [], []
        turned = cubics.cosine_and_sine(n, pose[-1]) if self.turning else None
        for near, half, (ax, ay) in zip(self.places, self.half, self.attachments, strict=True):
            rod = [minus(pose[d], near[d]) for d in range(self.dims)]
            if turned is not None:
                rod[0] = plus(rod[0], combined((ax, -ay), turned))
                rod[1] = plus(rod[1], combined((ay, ax), turned))
            size = cubics.squared(n, rod[0])
            for x in rod[1:]:
                size = plus(size, cubics.squared(n, x))
            errors.append(minus(scaled(size, 0.5), half))
            moved.append([largest(x) - abs(x[0]) for x in rod])
        return errors, moved

    def _rest(
        self, pose: Sequence[Quadratic], per: Sequence[Sequence[float]], start: list[float]
    ) -> list[float] | None:
        """(m,) bound of the residual of the pose, displacement and turn; None if there is no bound. start: of |C F|."""
        n, m, rods = self.n, self.m, self.vectors(pose)[1]
        sizes = [[abs(share) for share in shares] for shares in per]
        changes = [self._change(leg, rods[leg], pose[-1]) for leg in range(n)]
        shares = [[largest(combined(row, [change[e] for change in changes])) for e in range(m)] for row in per]
        places = zip(self.attachments, self.longest, self.aside, strict=True)
        return room_within(
            shares, sizes, start, [(x, y, longest, aside) for (x, y), longest, aside in places], self.dims
        )

    def _change(self, leg: int, rod: Sequence[Quadratic], turn: Quadratic) -> list[Quadratic]:
        """How a row of the Jacobian, (w, (R c) x w), changes with the joints."""
        length, found = self.at_rest[leg], [list(x) for x in rod]
        if self.turning:
            x, y = self.attachments[leg]
            moment = combined((x, -y, -(x * rod[0][0] + y * rod[1][0])), (rod[1], rod[0], turn))
            moved, most = norm(largest(rod[0]) - abs(rod[0][0]), largest(rod[1]) - abs(rod[1][0])), largest(turn)
            moment[-1] += norm(x, y) * most * (0.5 * most * (length + moved) + moved)
            found.append(moment)
        for change, screw in zip(found, self.screws[leg], strict=True):
            change[0] -= length * screw
        return found

    def _turned(self, turn: Quadratic) -> tuple[Quadratic, Quadratic]:
        """cos and sin."""
        n = self.n
        more = besides(n, turn)
        most = largest(turn)
        one = most - more
        c, s = self._constant(1.0), list(turn)
        place = 1 + 2 * n
        for k in range(n):
            c[1 + n + k] = -0.5 * turn[1 + k] * turn[1 + k]
            for j in range(k):
                c[place] = -turn[1 + j] * turn[1 + k]
                place += 1
        c[-1] = more * (one + 0.5 * more) + most * most * most * most / 24.0
        s[-1] += most * most * most / 6.0
        return c, s

    def _constant(self, value: float) -> Quadratic:
        found = [0.0] * numbers(self.n, self.m)
        found[0] = value
        return found


def room_within(
    shares: Sequence[Sequence[float]],
    sizes: Sequence[Sequence[float]],
    start: Sequence[float],
    legs: Sequence[Leg],
    dims: int,
) -> list[float] | None:
    """(m,) step 1: a room that cannot be left; None if none is found. shares: (m, m) of |1 - C J|. sizes: (m, n) of C.
    start: (m,) of |C F|."""
    guess = _solved(shares, start)
    for _ in range(BOXES):
        if guess is None:
            return None
        rows = _with(shares, sizes, legs, dims, [WIDER * x for x in guess])
        if (guess := _solved(rows, start)) is None or (more := _solved(rows, guess)) is None:
            return None
        room = [x + INSIDE * y + LEAST for x, y in zip(guess, more, strict=True)]
        rows = _with(shares, sizes, legs, dims, room)
        found = [x + _product(row, room) for x, row in zip(start, rows, strict=True)]
        if all(x < y for x, y in zip(found, room, strict=True)):
            return found
    return None


def _with(
    shares: Sequence[Sequence[float]],
    sizes: Sequence[Sequence[float]],
    legs: Sequence[Leg],
    dims: int,
    room: Sequence[float],
) -> list[list[float]]:
    """(m, m) shares, and what the Jacobian changes by within the room itself: half as much on the average over a
    straight line through it."""
    move, farther = norm(*room[:dims]), []
    for x, y, longest, aside in legs:
        if len(room) == dims:
            farther.append([0.5 * move] * dims)
            continue
        turn, radius = room[-1], norm(x, y)
        end = move + radius * turn
        last = 0.5 * radius * (end + turn * (longest + aside + end))
        farther.append([*[0.5 * end] * dims, last])
    return [
        [share + _product(size, [more[e] for more in farther]) for e, share in enumerate(row)]
        for row, size in zip(shares, sizes, strict=True)
    ]


def _solved(shares: Sequence[Sequence[float]], start: Sequence[float]) -> list[float] | None:
    """The solution of x = start + shares x; None if there is none that is not negative."""
    rows = [tuple([float(k == e) - share for e, share in enumerate(row)]) for k, row in enumerate(shares)]
    det, columns = statics.cofactors(rows)
    if not det > 0.0:
        return None
    found = [_product(start, [column[e] for column in columns]) / det for e in range(len(start))]
    return found if all(x >= 0.0 for x in found) else None


def _turned_back(n: int, turned: tuple[Quadratic, Quadratic], rod: Sequence[Quadratic]) -> list[Quadratic]:
    """A vector, seen from a turned platform: cos and sin of its turn."""
    (c, s), (x, y, *level) = turned, rod
    return [plus(multiplied(n, c, x), multiplied(n, s, y)), minus(multiplied(n, c, y), multiplied(n, s, x)), *level]


def _product(a: Sequence[float], b: Sequence[float]) -> float:
    found = 0.0
    for k in range(len(a)):
        found += a[k] * b[k]
    return found
