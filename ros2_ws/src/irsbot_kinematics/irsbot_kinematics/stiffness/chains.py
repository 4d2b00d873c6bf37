"""Any mechanism of tubes and revolutes in one posture: serial chains, side by side or within one another.

Source: [S1] (11)-(13) and elastostatic sheet section 4, with W = null(Jq') instead of the bordered matrix: a chain
transmits the wrenches W that do no work on its passive joints, and K = W (W' S W)^-1 W'.
All twists and wrenches at the platform point P in base axes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from irsbot_kinematics.arguments import array, checked, matrix
from irsbot_kinematics.errors import BadInput
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_kinematics.stiffness.errors import InvalidDesign, SingularPosture
from irsbot_kinematics.stiffness.structure import Part
from irsbot_kinematics.stiffness.tubes import Section, Tube, tube_compliance

SPAN_TOL = 1e-9
"""1: singular value, relative to the largest and with lengths divided by the mechanism's, that counts as 0 when joint
axes and transmitted wrenches are counted. Rounding is of order 1e-15, tubes differ in stiffness by about 1e6."""

RIGID_TOL = 1e-14
"""1: compliance along one wrench, relative to the sum of all, that counts as none. Stretch and bending of a slender
tube differ by about 1e6, short and long tubes of one mechanism by another 1e6."""


def shift(r: ArrayLike) -> Array:
    """X(r) (6, 6): t_Q = X(r) t_P for r = Q - P, of a rigid body."""
    x, y, z = np.asarray(r, dtype=float)
    X = np.eye(6)
    X[:3, 3:] = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]
    return X


@checked
def moved(K: Array, r: ArrayLike) -> Array:
    """A stiffness (..., 6, 6) at P, expressed at Q = P + r: X(-r)' K X(-r)."""
    K = _stiffness(K)
    X = shift(-matrix(r, (3,), "r"))
    at_q: Array = X.T @ K @ X
    return at_q


@checked
def turned(K: Array, R: ArrayLike) -> Array:
    """A stiffness (..., 6, 6) in the axes that the rows of R (3, 3) are, seen from the old ones."""
    K = _stiffness(K)
    big = np.kron(np.eye(2), matrix(R, (3, 3), "R"))
    in_new: Array = big @ K @ big.T
    return in_new


def _stiffness(K: ArrayLike) -> Array:
    given = array(K, "K", "numbers of shape (..., 6, 6)")
    if given.shape[-2:] != (6, 6):
        raise BadInput(f"K must be numbers of shape (..., 6, 6), got shape {given.shape}")
    return given


@dataclass(frozen=True)
class TubeBetween:
    """An elastic tube from one named point to another, with its spring at the far end."""

    start: str
    end: str
    section: str


@dataclass(frozen=True)
class Revolute:
    """A passive revolute through a named point."""

    at: str
    axis: tuple[float, float, float]


@dataclass(frozen=True)
class Parallel:
    """Parallel chains between two rigid bodies."""

    chains: tuple[Chain, ...]


Link = TubeBetween | Revolute | Parallel
Chain = tuple[Link, ...]
"""A chain from the base to the platform; the parts between two links are rigid."""


@dataclass(frozen=True)
class ChainStructure:
    """A mechanism of chains in one posture: its points are coordinates in the base frame."""

    family: ClassVar[str] = "chains"

    name: str
    description: str
    points: Mapping[str, tuple[float, float, float]]
    """m, base axes."""
    platform: str
    """Name of the platform point P."""
    sections: Mapping[str, Section]
    chains: Chain
    """One `Parallel` of all legs."""

    def __post_init__(self) -> None:
        for link in self.links():
            named = (link.start, link.end) if isinstance(link, TubeBetween) else (link.at,)
            for point in named:
                if point not in self.points:
                    raise InvalidDesign(f"no point '{point}'; the points are {', '.join(self.points)}")
            if isinstance(link, TubeBetween):
                if link.section not in self.sections:
                    raise InvalidDesign(f"no section '{link.section}'; the sections are {', '.join(self.sections)}")
                self.tube(link)
            elif not 0.0 < np.linalg.norm(link.axis) < np.inf:
                raise InvalidDesign(f"the axis of the revolute at '{link.at}' needs a length > 0, got {link.axis}")
        if self.platform not in self.points:
            raise InvalidDesign(f"no platform point '{self.platform}'; the points are {', '.join(self.points)}")

    def links(self) -> list[TubeBetween | Revolute]:
        """All tubes and revolutes, from the first chain to the last."""
        return list(_flat(self.chains))

    def tube(self, link: TubeBetween) -> Tube:
        """The tube of a link. Raises InvalidDesign if its ends coincide."""
        length = float(np.linalg.norm(np.subtract(self.points[link.end], self.points[link.start])))
        try:
            return self.sections[link.section].tube(length)
        except InvalidDesign as error:
            raise InvalidDesign(f"tube {link.start} to {link.end}: {error}") from None

    def parts(self) -> dict[str, Part]:
        """Each tube once, by the names of its ends."""
        tubes = [link for link in self.links() if isinstance(link, TubeBetween)]
        return {f"{i}: {link.start} to {link.end}": Part(self.tube(link), 1) for i, link in enumerate(tubes, 1)}

    @property
    def mass(self) -> float:
        """Mass of all tubes, kg."""
        return sum(part.number * part.tube.mass for part in self.parts().values())

    @cached_property
    def length_m(self) -> float:
        """Length by which moments are divided to compare them with forces: the largest distance of two points."""
        places = np.array(list(self.points.values()))
        return float(max(np.linalg.norm(places - place, axis=1).max() for place in places)) or 1.0

    @cached_property
    def stiffness(self) -> Array:
        """(6, 6) at P, symmetric and positive semidefinite."""
        W, D = self._carried(self.chains)
        K: Array = W @ np.linalg.solve(D, W.T)
        return K

    @cached_property
    def rank(self) -> int:
        """Number of independent wrenches that the mechanism transmits."""
        return int(self._carried(self.chains)[0].shape[1])

    @cached_property
    def compliance(self) -> Array:
        """(6, 6) at P. Raises SingularPosture if the platform is free."""
        W, D = self._carried(self.chains)
        if W.shape[1] < 6:
            raise SingularPosture((), f"the chains transmit {W.shape[1]} independent wrenches, 6 hold a platform")
        T = np.linalg.inv(W)
        C: Array = T.T @ D @ T
        return C

    def deflection(self, wrench: Array) -> Array:
        """Twist (6,) of P under a wrench (6,). What the wrench does no work on is returned without free motion, lengths
        divided by `length_m`. Raises SingularPosture for a wrench that the chains do not balance."""
        W, D = self._carried(self.chains)
        scale = self._scale
        share, *_ = np.linalg.lstsq(W / scale[:, None], wrench / scale, rcond=None)
        missed = (wrench - W @ share) / scale
        if not np.linalg.norm(missed) <= SPAN_TOL * np.linalg.norm(wrench / scale):
            free = missed / np.abs(missed).max() / scale
            raise SingularPosture((), f"nothing balances the wrench along the twist {np.round(free, 6).tolist()}")
        # Among the twists with W' t = D share the shortest one, in lengths: the columns of W / scale are orthonormal.
        twist: Array = (W / scale[:, None]) @ (D @ share) / scale
        return twist

    @property
    def _scale(self) -> Array:
        return np.array([1.0] * 3 + [self.length_m] * 3)

    def _carried(self, chain: Chain) -> tuple[Array, Array]:
        """Wrenches (6, r) that a chain transmits, orthonormal with moments over `length_m`, and their compliance."""
        scale = self._scale
        compliance = np.zeros((6, 6))
        free: list[Array] = [np.zeros((6, 0))]
        at_p = np.array(self.points[self.platform])
        for link in chain:
            if isinstance(link, TubeBetween):
                start, end = np.array(self.points[link.start]), np.array(self.points[link.end])
                R = np.kron(np.eye(2), axes_along(end - start))
                X = shift(at_p - end)
                compliance += X @ R @ tube_compliance(self.tube(link)) @ R.T @ X.T
            elif isinstance(link, Revolute):
                axis = np.array(link.axis) / np.linalg.norm(link.axis)
                lever = at_p - np.array(self.points[link.at])
                free.append(np.concatenate([np.cross(axis, lever), axis])[:, None])
            else:
                K = np.zeros((6, 6))
                for W, D in map(self._carried, link.chains):
                    K += W @ np.linalg.solve(D, W.T)
                springs, released = self._split(K)
                compliance += springs
                free.append(released)
        J = np.hstack(free) * scale[:, None]
        left, values, _ = np.linalg.svd(J) if J.shape[1] else (np.eye(6), np.zeros(0), None)
        rank = int(np.sum(values > SPAN_TOL * max(values.max(initial=0.0), self.length_m)))
        W = left[:, rank:] * scale[:, None]
        D = W.T @ compliance @ W
        least = np.linalg.eigvalsh(D).min(initial=np.inf)
        if not least > RIGID_TOL * np.trace(compliance * np.outer(scale, scale)):
            raise InvalidDesign("a chain does not give way along a wrench that it transmits: a tube is missing in it")
        return W, D

    def _split(self, K: Array) -> tuple[Array, Array]:
        """A stiffness (6, 6) as a spring in series with the twists (6, n) that it leaves free."""
        scale = self._scale
        values, vectors = np.linalg.eigh(K / np.outer(scale, scale))
        held = values > SPAN_TOL * values[-1]
        W = vectors[:, held] / scale[:, None]
        springs = (W / values[held]) @ W.T
        return springs, vectors[:, ~held] / scale[:, None]


def axes_along(along: Array) -> Array:
    """Rotation (3, 3) whose first column is the direction of a tube; the others are any two across it."""
    x = along / np.linalg.norm(along)
    y = np.cross(np.eye(3)[np.argmin(np.abs(x))], x)
    y /= np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)])


def _flat(chain: Sequence[Link]) -> list[TubeBetween | Revolute]:
    found: list[TubeBetween | Revolute] = []
    for link in chain:
        if isinstance(link, Parallel):
            for inner in link.chains:
                found += _flat(inner)
        else:
            found.append(link)
    return found
