"""A planar 3-RPR: three struts whose lengths are actuated join the base to a platform that moves and turns.

No closed form: for given lengths the platform has up to six poses. Freed of the position, the lengths leave one
equation for the turn, a trigonometric polynomial of degree 3. `BranchedPlatform` finds its roots, polishes the poses,
and follows one of them from sample to sample; it asks for `closing` and `candidates`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import asin, hypot, inf, sqrt
from typing import Any, ClassVar

import numpy as np

from irsbot_kinematics.own_mechanism import (
    EXACT,
    Arithmetic,
    Array,
    BranchedPlatform,
    Coordinate,
    Errors,
    Floats,
    InvalidGeometry,
    Legs,
    N,
    Point,
    Posture,
    Rod,
    Signs,
    Travel,
    planar_closing,
    planar_meetings,
    require_finite,
)

TINY = 1e-150  # m: keeps the direction of a strut without length defined; its limb margin then says so


@dataclass(frozen=True)
class Rpr3OwnGeometry:
    """Points (x, y) in metres: a_i on the base, b_i on the platform, seen from the platform point P."""

    a1: Point
    a2: Point
    a3: Point
    b1: Point
    b2: Point
    b3: Point
    stroke: Point  # open range of every strut's length

    def __post_init__(self) -> None:
        require_finite(self)
        if not 0.0 <= self.stroke[0] < self.stroke[1]:
            raise InvalidGeometry(f"0 <= stroke[0] < stroke[1] is broken: stroke = {self.stroke}")


class Rpr3Own(BranchedPlatform):
    """Joints: lengths of the struts. Task: x, y of P and the turn phi of the platform.

    Working mode: one. A strut that is longer by dq pushes its platform joint away by dq, in every posture: the lever
    is -1, so is the sine, and there is no Type 1 singularity. Assembly mode: sign of det A and rank, as the base class
    counts them. Limb margin: the length of a strut over its longest one; without length it pushes in no direction.
    """

    kind: ClassVar[str] = "rpr3_own"
    geometry: Rpr3OwnGeometry

    def __init__(self, geometry: Rpr3OwnGeometry) -> None:
        g = self.geometry = geometry
        self.feet = (g.a1, g.a2, g.a3)
        self.shortest, self.longest = g.stroke
        corners = (g.b1, g.b2, g.b3)
        joints = [Coordinate(f"strut_{i}", "m", *g.stroke) for i in (1, 2, 3)]
        places = max(hypot(*foot) for foot in self.feet) + max(hypot(*corner) for corner in corners)
        super().__init__(corners, joints, places + self.longest)  # radius, span, task and length_m follow
        self.limb_count = 3
        self.working_modes = ((-1, -1, -1),)
        self.assembly_modes = (1, -1, 2, -2, 3, -3)
        self.usual_working_mode, self.usual_assembly_mode = (-1, -1, -1), 1

    # --- equations, floats or arrays: no `if` on values, functions from k ---------------------------------------

    def rods(self, k: Arithmetic[N], joints: Sequence[N]) -> Sequence[tuple[N, N, Any]]:
        """Near end and length of every strut."""
        return [(ax + 0.0 * q, ay + 0.0 * q, q) for (ax, ay), q in zip(self.feet, joints, strict=True)]

    def inverse(self, k: Arithmetic[N], pose: Sequence[N], mode: Signs) -> tuple[tuple[N, ...], tuple[N, ...]]:
        """The distance |a_iB_i|; reach: to the nearer end of the stroke."""
        x, y, phi = pose
        (c, s), joints, reach = k.cos_sin(phi), [], []
        for (ax, ay), (bx, by) in zip(self.feet, self.corners, strict=True):
            length = k.hypot(x + c * bx - s * by - ax, y + s * bx + c * by - ay)
            zero = 0.0 * length
            joints.append(k.minimum(k.maximum(length, self.shortest + zero), self.longest + zero))
            reach.append(k.minimum(length - self.shortest, self.longest - length))
        return tuple(joints), tuple(reach)

    def legs(self, k: Arithmetic[N], joints: Sequence[N], pose: Sequence[N]) -> Legs[N]:
        """Rows (r, PB x r), r along the strut; closure |a_iB_i| - q_i, whose derivative by q_i, the lever, is -1."""
        x, y, phi = pose
        c, s = k.cos_sin(phi)
        screws, minus, reach, closure, attachments, limb = [], [], [], [], [], []
        for (ox, oy), (bx, by), q in zip(self.feet, self.corners, joints, strict=True):
            ax, ay = c * bx - s * by, s * bx + c * by
            rx, ry = x + ax - ox, y + ay - oy
            size = k.hypot(rx, ry) + TINY
            rx, ry = rx / size, ry / size
            screws.append((rx, ry, ax * ry - ay * rx))
            minus.append(0.0 * size - 1.0)
            reach.append(k.minimum(size - self.shortest, self.longest - size))
            closure.append(size - q)
            attachments.append((ax, ay))
            limb.append(k.minimum(size / self.longest, 1.0 + 0.0 * size))
        legs = Legs(tuple(screws), tuple(minus), tuple(minus), tuple(reach), tuple(closure))
        legs.attachments, legs.limb = tuple(attachments), tuple(limb)
        return legs

    # --- all assemblies: the base class has `direct` and `track` ------------------------------------------------

    def closing(self, joints: Sequence[Array], cosine: Array, sine: Array) -> Array:
        """0 at a turn with which three struts of these lengths can meet the platform; over size^6, without unit."""
        return np.asarray(planar_closing(self.ends(joints, cosine, sine), joints) / self.size_m**6)

    def candidates(self, joints: Sequence[Array], turn: Array) -> tuple[Array, ...]:
        """Both points where the circles of two struts meet, with each turn."""
        return planar_meetings(self.ends(joints, np.cos(turn), np.sin(turn)), joints, turn)

    # --- one sample ----------------------------------------------------------------------------------------------

    def bias(self, at: Posture, joint_rates: Sequence[float], pose_rates: Sequence[float]) -> Floats:
        """Second derivative of |a_iB_i| without accelerations: what moves across the strut, and the arm's pull."""
        vx, vy, w = pose_rates
        found = []
        for q, (rx, ry, _), (ax, ay) in zip(at.joints, at.screws, at.attachments, strict=True):
            across = rx * (vy + w * ax) - ry * (vx - w * ay)
            found.append(across * across / (q + TINY) - w * w * (ax * rx + ay * ry))
        return tuple(found)

    def travel_of(self, at: Posture, travel: Sequence[float], slack_m: float) -> Travel:
        """A strut that is longer by D pushes by D + D^2/(2 length); its near end stays."""
        ends, longer, _ = self.geometry_errors(slack_m) if slack_m else EXACT
        drives = []
        for q, t in zip(at.joints, travel, strict=True):
            D = t + longer
            drives.append(D + 0.5 * D * D / q + ends if q > 0.0 else inf)
        return Travel(drives, ends, min(at.joints))

    def geometry_errors(self, slack_m: float) -> Errors:
        """Both coordinates of both joints of a strut, and its length."""
        place = sqrt(2.0) * slack_m
        return Errors(2.0 * place, slack_m, place)

    def rods_of(self, at: Posture, travel: Sequence[float], slack_m: float) -> list[Rod]:
        """Near ends stay, lengths grow."""
        ends, longer, _ = self.geometry_errors(slack_m) if slack_m else EXACT
        return [Rod(q, (0.0, 0.0), ends, t, longer) for q, t in zip(at.joints, travel, strict=True)]

    def sine_floors(self, at: Posture, travel: Sequence[float], turn_rad: float, slack_m: float = 0.0) -> Floats:
        """A strut has no Type 1 singularity."""
        return (1.0, 1.0, 1.0)

    def limb_floors(self, at: Posture, travel: Sequence[float], slack_m: float, type1: Floats) -> Floats:
        """A strut is shorter by at most its travel and its error."""
        return tuple(
            [min(max(q - t - slack_m, 0.0) / self.longest, 1.0) for q, t in zip(at.joints, travel, strict=True)]
        )

    def turn_rate(self, at: Posture) -> tuple[float, float]:
        """A strut that keeps half its length turns by at most asin(move/length), which is at most pi/3 move/length."""
        ball = 0.5 * min(at.reach)
        return (ball, asin(0.5) / 0.5 / min(at.joints)) if ball > 0.0 else (0.0, inf)
