"""Elastic IRSBot-2: proximal parallelograms with one or two bars, elbows, four distal rods with universal joints.

Source: [S1] (11)-(21) and elastostatic sheet sections 2 to 5. What is ours: the legs mirror themselves in the plane of
motion, so two 3 x 3 problems replace one of 6 x 6, and each distal rod transmits exactly two wrenches, a force along
itself and a couple along n = y1 x z2. Both are known, so no rank has to be guessed and nothing singular is inverted.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, hypot, sin
from typing import ClassVar, cast

import numpy as np

from irsbot_kinematics.mechanisms.irsbot2_space.geometry import Irsbot2Geometry
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_kinematics.stiffness.structure import Legs, Part, Structure
from irsbot_kinematics.stiffness.symmetric import apply, condensed, congruent, dot, inverse3
from irsbot_kinematics.stiffness.tubes import Terms, require

SIGMA = np.array([1.0, -1.0])
"""Leg I stands at x = -b, leg II at x = +b."""

FLAT_TOL = 1e-4
"""1: sine of the angle below which a parallelogram counts as flat, or a rod as lying along its elbow. The compliance
grows with the inverse square, so at this size it is good to 1e-8 and below it soon to nothing."""

TILT_SHARE = 0.1
"""1: share of a1. A platform that tilts turns its wrist axes, and with them what the rods hold, however near the rods'
ends are to P. Found by sampling: of random robots down to p = 0.02 mm none loses more than 0.4 of what is taken off."""


@dataclass(frozen=True)
class Irsbot2Structure(Structure):
    """Kinds of tubes: proximal (1_i of [S1]), parallel (2_i), distal (5_ji), elbow (4_i)."""

    family: ClassVar[str] = "irsbot2"
    kinds: ClassVar[tuple[str, ...]] = ("proximal", "parallel", "distal", "elbow")
    may_be_rigid: ClassVar[tuple[str, ...]] = ("elbow",)
    why_singular: ClassVar[str] = "a parallelogram is flat, or a distal rod lies along its elbow"

    parallelogram: float
    """Short side d of the proximal parallelogram, m."""
    direction: tuple[float, float]
    """Direction u of the short side from the proximal to the parallel tube, x and z; scaled to length 1."""
    spacing: float
    """Distance of the two proximal bars, m; 0: there is one bar."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require("the parallelogram needs a side > 0 m", 0.0 < self.parallelogram < np.inf, self.parallelogram)
        require("the spacing must be >= 0 m (0: one bar)", 0.0 <= self.spacing < np.inf, self.spacing)
        size = hypot(*self.direction)
        require("the direction of the parallelogram needs a length > 0", 0.0 < size < np.inf, size)

    @property
    def geometry(self) -> Irsbot2Geometry:
        return cast(Irsbot2Geometry, self.mechanism.geometry)

    @property
    def free(self) -> tuple[int, ...]:
        return ()

    @property
    def bars(self) -> int:
        """Proximal bars per leg."""
        return 2 if self.spacing > 0.0 else 1

    @property
    def tilt_lever_m(self) -> float:
        return TILT_SHARE * self.geometry.a1

    def parts(self) -> dict[str, Part]:
        g, sections = self.geometry, self.sections
        lengths = {"proximal": g.l1, "parallel": g.l1, "distal": g.l2, "elbow": g.a1}
        numbers = {"proximal": 2 * self.bars, "parallel": 2, "distal": 4, "elbow": 4}
        return {kind: Part(sections[kind].tube(lengths[kind]), numbers[kind]) for kind in self.kinds}

    def legs(self, joints: Array, pose: Array) -> Legs:
        g = self.geometry
        terms = {kind: part.tube.terms for kind, part in self.parts().items()}
        c, s = np.cos(joints), np.sin(joints)
        rx = pose[:, :1] + SIGMA * g.b - g.l1 * c  # P seen from B
        rz = pose[:, 1:] + g.l1 * s
        rod = _Rods(g, terms, rx, rz)
        side = self.parallelogram / hypot(*self.direction) * np.array(self.direction)
        bars = _Parallelogram(terms["proximal"], terms["parallel"], self.bars, self.spacing, c, s, side)
        planar, (along, about) = condensed(rod.planar_at(rx, rz), bars.planar_compliance(*rod.planar_at(0, 0), rod.own))
        lateral, _ = condensed(rod.lateral_at(rx, rz), bars.lateral_compliance(*rod.lateral_at(0, 0), rod.own))
        moves = [
            bars.displacement(wrench, rod.elbow_x, rod.elbow_z) + give
            for wrench, give in zip(rod.planar_at(0, 0), rod.elbow_gives(terms["elbow"]), strict=True)
        ]
        elbow = moves[0][:, None] * along[None] + moves[1][:, None] * about[None]
        grip = np.array([np.broadcast_to(-SIGMA * g.p, rx.shape), np.zeros_like(rx)])
        singular = ~((np.abs(bars.height) > FLAT_TOL * self.parallelogram) & (rod.sine > FLAT_TOL)).all(axis=1)
        return Legs(planar, lateral, elbow, np.array([rod.x, rod.z]), grip, singular)


class _Rods:
    """The rod j = 2 (y > 0) of each leg: its two wrenches and their compliance. The rod j = 1 is its mirror image."""

    def __init__(self, g: Irsbot2Geometry, terms: Mapping[str, Terms], rx: Array, rz: Array) -> None:
        across, up = SIGMA * sin(g.beta), cos(g.beta)  # y1 = (across, up, 0)
        self.elbow_x, self.elbow_y, self.elbow_z = g.a1 * across, g.a1 * up, -g.e  # E_ji seen from B
        self.x, self.z = rx - SIGMA * g.p - self.elbow_x, rz - self.elbow_z
        y = (g.a2 - g.a1) * up
        length = np.sqrt(self.x * self.x + y * y + self.z * self.z)
        u = self.u = np.array([self.x / length, y / length, self.z / length])
        along = self.along = u[0] * across + u[1] * up
        # z2 = unit(y1 x u), n = y1 x z2 = (along y1 - u)/sine
        cross = np.array([up * u[2], -across * u[2], across * u[1] - up * u[0]])
        self.sine = np.sqrt(dot(cross, cross))
        self.z2 = cross / self.sine
        self.n = np.array([along * across - u[0], along * up - u[1], -u[2]]) / self.sine
        self.y1 = (across, up)
        rod, elbow = terms["distal"], terms["elbow"]
        square, rest = along * along, self.sine * self.sine
        stretch = rod.stretch + square * elbow.stretch + rest * elbow.bend
        couple = rest * rod.twist + square * rod.turn + elbow.turn
        self.own = 0.5 * stretch, 0.5 * couple
        """Compliance of both rods j = 1, 2 under equal shares; a force and a couple do not mix."""

    def _moment(self, px: Array | float, pz: Array | float) -> Array:
        """Moment of the unit force along the rod about the point (px, 0, pz) seen from B."""
        x, y, z = self.elbow_x - px, self.elbow_y, self.elbow_z - pz
        u = self.u
        return np.array([y * u[2] - z * u[1], z * u[0] - x * u[2], x * u[1] - y * u[0]])

    def planar_at(self, px: Array | float, pz: Array | float) -> tuple[Array, Array]:
        """Force and couple as [fx fz my] about a point seen from B."""
        none = np.zeros_like(self.along)
        return np.array([self.u[0], self.u[2], self._moment(px, pz)[1]]), np.array([none, none, self.n[1]])

    def lateral_at(self, px: Array | float, pz: Array | float) -> tuple[Array, Array]:
        """Force and couple as [fy mx mz] about a point seen from B."""
        moment = self._moment(px, pz)
        return np.array([self.u[1], moment[0], moment[2]]), np.array([0.0 * self.along, self.n[0], self.n[2]])

    def elbow_gives(self, elbow: Terms) -> tuple[Array, Array]:
        """[dx dz] of the tip of the elbow tube under half a unit force and half a unit couple (each rod has half)."""
        across, _ = self.y1
        stretch, bend = 0.5 * self.along * elbow.stretch, -0.5 * self.sine * elbow.bend  # u = along y1 - sine n
        force = np.array([stretch * across + bend * self.n[0], bend * self.n[2]])
        return force, 0.5 * elbow.couple * np.array([self.z2[0], self.z2[2]])


class _Parallelogram:
    """Element 3_i, held at B by one or two clamped bars with a revolute y0 and by the parallel tube with two.

    Sheet section 5, K_para. Local axes: x' along the bar, y0, z' = x' x y0.
    """

    def __init__(self, bar: Terms, tie: Terms, bars: int, spacing: float, c: Array, s: Array, side: Array) -> None:
        self.c, self.s = c, s
        self.height = side[0] * s + side[1] * c  # of the parallel tube over the bar, along z'
        self.stretch, self.bend, self.tie = bar.stretch / bars, bar.bend / bars, tie.stretch
        held = bars * _clamped(bar)
        if bars == 2:
            held[1, 1] += 0.5 * spacing**2 / bar.bend
            held[2, 2] += 0.5 * spacing**2 / bar.stretch
        one, none = np.ones_like(c), np.zeros_like(c)
        ahead = side[0] * c - side[1] * s  # of the parallel tube's end beyond B, along x'
        seen = np.array([[one, -self.height, ahead], [none, one, none], [none, none, one]])
        tied = congruent(seen, _clamped(tie)[:, :, None, None])
        self.lateral = inverse3(held[:, :, None, None] + tied)

    def _turned(self, x: Array, z: Array) -> tuple[Array, Array]:
        return self.c * x - self.s * z, self.s * x + self.c * z

    def _carried(self, wrench: Array) -> tuple[Array, Array, Array]:
        """Axial and lateral force of the bars and tension of the parallel tube: the plane is statically determinate."""
        fx, fz = self._turned(wrench[0], wrench[1])
        tension = wrench[2] / self.height
        return fx - tension, fz, tension

    def planar_compliance(self, a: Array, b: Array, own: tuple[Array, Array]) -> tuple[Array, Array, Array]:
        """M of `condensed` for two wrenches [fx fz my] about B, with the compliance that the rods add."""
        pa, pb = self._carried(a), self._carried(b)
        weights = self.stretch, self.bend, self.tie
        mixed = [
            sum(w * x * y for w, x, y in zip(weights, p, q, strict=True)) for p, q in ((pa, pa), (pa, pb), (pb, pb))
        ]
        return mixed[0] + own[0], np.asarray(mixed[1]), mixed[2] + own[1]

    def lateral_compliance(self, a: Array, b: Array, own: tuple[Array, Array]) -> tuple[Array, Array, Array]:
        """The same for [fy mx mz]."""
        va, vb = (np.array([w[0], *self._turned(w[1], w[2])]) for w in (a, b))
        ca, cb = apply(self.lateral, va), apply(self.lateral, vb)
        return dot(va, ca) + own[0], dot(va, cb), dot(vb, cb) + own[1]

    def displacement(self, wrench: Array, x: Array, z: float) -> Array:
        """[dx dz] of the point (x, z) of element 3_i, seen from B, under a planar wrench about B."""
        push, lift, tension = self._carried(wrench)
        dx, dz = self.stretch * push, self.bend * lift
        turn = (self.tie * tension - dx) / self.height
        return np.array([self.c * dx + self.s * dz + turn * z, -self.s * dx + self.c * dz - turn * x])


def _clamped(tube: Terms) -> Array:
    """Stiffness (3, 3) of a tube's end for [dy rx rz]; revolutes about y0 do not release it."""
    t = tube
    return inverse3(np.array([[t.bend, 0.0, t.couple], [0.0, t.twist, 0.0], [t.couple, 0.0, t.turn]]))
