"""Columns of design parameters: the whole design space is computed on many designs at once.

Letters as in [S0] and `Irsbot2Geometry`; e plays no role in any singularity and is left out. Lengths in metres, beta
in radians.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from irsbot_kinematics.errors import BadInput
from irsbot_kinematics.mechanisms.irsbot2_space.geometry import Irsbot2Geometry
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_kinematics.numerics.tolerances import COINCIDENT_TOL_M

Flags = NDArray[np.bool_]
PARAMETERS = ("l1", "l2eq", "b", "p", "a1", "a2", "beta")


@dataclass(frozen=True)
class Designs:
    """One entry per design in each column. Shapes are equal; `columns` broadcasts."""

    l1: Array
    l2eq: Array
    b: Array
    p: Array
    a1: Array
    a2: Array
    beta: Array

    @classmethod
    def columns(cls, columns: Mapping[str, ArrayLike]) -> Designs:
        """Designs of seven columns that broadcast together. Raises BadInput unless they are exactly PARAMETERS."""
        if set(columns) != set(PARAMETERS):
            raise BadInput(f"designs have the columns {', '.join(PARAMETERS)}, got {', '.join(columns)}")
        arrays = np.broadcast_arrays(*(np.asarray(columns[name], dtype=float) for name in PARAMETERS))
        return cls(*arrays)

    @classmethod
    def of(cls, *geometries: Irsbot2Geometry) -> Designs:
        """Designs of validated geometries, shape (len(geometries),)."""
        return cls(*(np.array([getattr(g, name) for g in geometries], dtype=float) for name in PARAMETERS))

    def where(self, chosen: Flags) -> Designs:
        """The selected designs, shape (number of them,)."""
        return Designs(*(getattr(self, field.name)[chosen] for field in fields(self)))

    @cached_property
    def valid(self) -> Flags:
        """Valid designs, without the assembly condition: lengths > 0, a1 > a2, 0 < beta < pi/2, b0 != 0."""
        lengths = (self.l1, self.l2eq, self.b, self.p, self.a1, self.a2)
        finite = np.all([(x > 0.0) & np.isfinite(x) for x in lengths], axis=0)
        angle = (self.beta > 0.0) & (self.beta < np.pi / 2)
        with np.errstate(invalid="ignore"):  # inf - inf of a design that is not finite anyway
            apart = (self.a1 > self.a2) & (np.abs(self.b0) > COINCIDENT_TOL_M)
        flags: Flags = finite & angle & apart
        return flags

    @cached_property
    def s(self) -> Array:
        """sin(beta)."""
        return np.sin(self.beta)

    @cached_property
    def c(self) -> Array:
        """cos(beta)."""
        return np.cos(self.beta)

    @cached_property
    def D(self) -> Array:
        """(a1 - a2) sin(beta), m."""
        return (self.a1 - self.a2) * self.s

    @cached_property
    def mu(self) -> Array:
        """a2 / (a1 - a2), [S0] (34) over l2eq."""
        return self.a2 / (self.a1 - self.a2)

    @cached_property
    def s1g(self) -> Array:
        """sigma_1 of [S0], a1 sin(beta) + p, m."""
        return self.a1 * self.s + self.p

    @cached_property
    def s2g(self) -> Array:
        """sigma_2 of [S0], a2 sin(beta) + p, m."""
        return self.a2 * self.s + self.p

    @cached_property
    def b0(self) -> Array:
        """Half base of the equivalent five-bar, m; any sign."""
        return self.b - self.s1g
