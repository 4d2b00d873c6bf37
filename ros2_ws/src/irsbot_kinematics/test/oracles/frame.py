"""3-D frames of Euler-Bernoulli beams with joints: what the tests compare the elastostatics with.

Nothing here is taken from the library. Every beam has its 12 x 12 stiffness between two nodes of its own, joints and
rigid bodies are constraints between nodes, and the whole is solved with their Lagrange multipliers. No chain is
condensed, no symmetry is used, no wrench is known beforehand.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from irsbot2_3d import AXIS_Y, SIGMA, Design, leg
from numpy.typing import NDArray
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

Array = NDArray[np.float64]


class Pipe(NamedTuple):
    """Outer and inner diameter (m), modulus (Pa), Poisson's ratio; stiff: so much stiffer than it is."""

    outer: float
    inner: float
    young: float
    poisson: float
    stiff: float = 1.0

    @property
    def rigidities(self) -> tuple[float, float, float]:
        """EA, EI, GJ by integration over the radius."""
        r = np.linspace(0.5 * self.inner, 0.5 * self.outer, 20001)
        area = np.trapezoid(2.0 * np.pi * r, r)
        polar = np.trapezoid(2.0 * np.pi * r**3, r)
        shear = self.young / (2.0 + 2.0 * self.poisson)
        return self.stiff * self.young * area, self.stiff * self.young * polar / 2.0, self.stiff * shear * polar


class Frame:
    """Nodes with six displacements each, beams between them, linear constraints on them."""

    def __init__(self) -> None:
        self.places: list[Array] = []
        self.beams: list[tuple[int, int, Array]] = []
        self.constraints: list[dict[int, float]] = []

    def node(self, place: Iterable[float]) -> int:
        self.places.append(np.array(list(place), dtype=float))
        return len(self.places) - 1

    def beam(self, start: Iterable[float], end: Iterable[float], pipe: Pipe, pieces: int = 2) -> tuple[int, int]:
        """A tube of some elements; gives its end nodes."""
        start, end = np.array(list(start)), np.array(list(end))
        nodes = [self.node(start + t * (end - start)) for t in np.linspace(0.0, 1.0, pieces + 1)]
        for a, b in pairwise(nodes):
            self.beams.append((a, b, beam_stiffness(self.places[b] - self.places[a], *pipe.rigidities)))
        return nodes[0], nodes[-1]

    def clamp(self, node: int) -> None:
        self.constraints += [{6 * node + i: 1.0} for i in range(6)]

    def hold(self, node: int, coordinate: int) -> None:
        self.constraints.append({6 * node + coordinate: 1.0})

    def weld(self, a: int, b: int) -> None:
        """One rigid body holds both nodes, however far apart."""
        self.joint(a, b, ())

    def joint(self, a: int, b: int, axes: Iterable[Iterable[float]]) -> None:
        """A rigid body from a to where b is, and there revolutes with these axes between the body and b."""
        x, y, z = self.places[b] - self.places[a]
        lever = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])  # turn of a -> displacement at b
        for i in range(3):
            row = {6 * b + i: -1.0, 6 * a + i: 1.0}
            row |= {6 * a + 3 + k: lever[i, k] for k in range(3)}
            self.constraints.append(row)
        axes = np.array([list(axis) for axis in axes]).reshape(-1, 3)
        kept = np.linalg.svd(axes)[2][np.linalg.matrix_rank(axes) :] if len(axes) else np.eye(3)
        for direction in kept:
            self.constraints.append(
                {6 * a + 3 + k: direction[k] for k in range(3)} | {6 * b + 3 + k: -direction[k] for k in range(3)}
            )

    def solve(self, node: int, wrenches: Array) -> Array:
        """Displacements (6 x nodes, loads) under wrenches (6, loads) at a node."""
        number, held = 6 * len(self.places), len(self.constraints)
        K = np.zeros((number + held, number + held))
        for a, b, k in self.beams:
            at = [*range(6 * a, 6 * a + 6), *range(6 * b, 6 * b + 6)]
            K[np.ix_(at, at)] += k
        size = np.median(np.diag(K)[np.diag(K) > 0.0])  # so that the multipliers are of the size of displacements
        for row, constraint in enumerate(self.constraints, number):
            for at, value in constraint.items():
                K[row, at] += size * value
                K[at, row] += size * value
        load = np.zeros((number + held, wrenches.shape[1]))
        load[6 * node : 6 * node + 6] = wrenches
        return splu(csc_matrix(K)).solve(load)[:number]


def beam_stiffness(along: Array, EA: float, EI: float, GJ: float) -> Array:
    """(12, 12) in base axes of a beam with displacement and rotation at both ends."""
    L = float(np.linalg.norm(along))
    k = np.zeros((12, 12))
    for at, rigidity in ((0, EA), (3, GJ)):
        k[np.ix_([at, at + 6], [at, at + 6])] += rigidity / L * np.array([[1, -1], [-1, 1]])
    bend = EI / L**3 * np.array([[12, 6 * L, -12, 6 * L], [0, 4 * L**2, -6 * L, 2 * L**2], [0, 0, 12, -6 * L], [0] * 4])
    bend[3, 3] = 4 * EI / L
    bend = np.triu(bend) + np.triu(bend, 1).T
    for places, signs in (((1, 5, 7, 11), (1, 1, 1, 1)), ((2, 4, 8, 10), (1, -1, 1, -1))):
        k[np.ix_(places, places)] += bend * np.outer(signs, signs)
    x = along / L
    y = np.cross([0.3, 0.5, 0.8] if abs(x[0]) > 0.5 else [1.0, 0.0, 0.0], x)
    y /= np.linalg.norm(y)
    R = np.kron(np.eye(4), np.array([x, y, np.cross(x, y)]))
    return R.T @ k @ R


class Built(NamedTuple):
    """A framed robot: the platform's node, and per leg the nodes of the rods' ends."""

    frame: Frame
    platform: int
    near: list[list[int]]
    far: list[list[int]]


def irsbot2_frame(
    d: Design, q: Array, psi: Array, pipes: dict[str, Pipe], side: Array, spacing: float, point: Array | None = None
) -> Built:
    """IRSBot-2 with actuators locked. side: (3,) short side of the parallelograms; spacing 0: one bar.

    The platform's node is the platform point, or `point` of the platform.
    """
    frame, near, far = Frame(), [], []
    legs = [leg(d, k, q[k], psi[k]) for k in (0, 1)]
    P = legs[0].G + np.array([SIGMA[0] * d.p, 0.0, 0.0])
    platform = frame.node(P if point is None else point)
    for at in legs:
        carrier = frame.node(at.B)
        for y in (0.0,) if spacing == 0.0 else (0.5 * spacing, -0.5 * spacing):
            off = np.array([0.0, y, 0.0])
            foot, tip = frame.beam(at.A + off, at.B + off, pipes["proximal"], 1)
            frame.clamp(foot)
            frame.joint(carrier, tip, [AXIS_Y])
        foot, tip = frame.beam(at.A + side, at.B + side, pipes["parallel"], 1)
        base = frame.node(at.A + side)
        frame.clamp(base)
        frame.joint(base, foot, [AXIS_Y])
        frame.joint(carrier, tip, [AXIS_Y])
        elbow = at.B - np.array([0.0, 0.0, d.e])
        near.append([])
        far.append([])
        for j in (0, 1):
            root, end = frame.beam(elbow, at.E[j], pipes["elbow"], 1)
            frame.weld(carrier, root)
            start, stop = frame.beam(at.E[j], at.F[j], pipes["distal"], 1)
            frame.joint(end, start, [at.e1[j], at.e2[j]])
            frame.joint(platform, stop, [at.e2[j], at.e1[j]])
            near[-1].append(end)
            far[-1].append(stop)
    return Built(frame, platform, near, far)


def five_bar_frame(l1: float, b: float, q: Array, P: Array, pipes: dict[str, Pipe], released: Array) -> Built:
    """Five-bar with actuators locked. released: axes of the joint at the platform; what it frees there is held."""
    frame, near, far = Frame(), [], []
    platform = frame.node(P)
    for sigma, angle in zip(SIGMA, q, strict=True):
        A = np.array([-sigma * b, 0.0, 0.0])
        B = A + l1 * np.array([np.cos(angle), 0.0, -np.sin(angle)])
        foot, tip = frame.beam(A, B, pipes["proximal"])
        frame.clamp(foot)
        start, stop = frame.beam(B, P, pipes["distal"])
        frame.joint(tip, start, [AXIS_Y])
        frame.joint(platform, stop, released)
        near.append([tip])
        far.append([stop])
    for axis in released:
        frame.hold(platform, 3 + int(np.argmax(np.abs(axis))))
    return Built(frame, platform, near, far)
