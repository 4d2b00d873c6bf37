"""Materials and round tubes: frozen records that refuse impossible values, and the compliance of a tube.

Euler-Bernoulli beam without shear: elastostatic sheet section 3, with [S1] Fig. 10 for the spring at the tube's end.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import resources
from math import inf, pi

import numpy as np

from irsbot_kinematics.arguments import check_fields, checked, shown
from irsbot_kinematics.description import yaml_text
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_kinematics.stiffness.errors import InvalidDesign
from irsbot_kinematics.stiffness.quantities import quantity

LONGEST_M = 1e6
"""m: longer or wider tubes are refused; powers of the size stay finite."""


def require(rule: str, holds: bool, value: float) -> None:
    """Raise InvalidDesign unless `holds`; the test accepts, so NaN is refused."""
    if not holds:
        raise InvalidDesign(f"{rule}, got {value:.9g}")


@dataclass(frozen=True)
class Material:
    """An isotropic elastic material."""

    young: float
    """Modulus of elasticity, Pa."""
    poisson: float
    """Poisson's ratio, -1 < nu <= 0.5."""
    density: float
    """kg/m3."""
    name: str = ""
    source: str = ""

    def __post_init__(self) -> None:
        check_fields(self, InvalidDesign)
        require("a material needs a modulus young > 0 Pa", 0.0 < self.young < inf, self.young)
        require("a material needs -1 < poisson <= 0.5", -1.0 < self.poisson <= 0.5, self.poisson)
        require("a material needs a density > 0 kg/m3", 0.0 < self.density < inf, self.density)

    @property
    def shear(self) -> float:
        """Shear modulus E / 2(1 + nu), Pa."""
        return self.young / (2.0 * (1.0 + self.poisson))


@cache
def materials() -> dict[str, Material]:
    """The shipped materials by name."""
    text = resources.files("irsbot_kinematics").joinpath("stiffness/presets/materials.yaml").read_text(encoding="utf-8")
    return {name: material_of(stated, name, "materials.yaml") for name, stated in yaml_text.shipped(text).items()}


def material_of(stated: object, name: str, where: str) -> Material:
    """A material from its mapping {young, poisson, density, source}. Raises InvalidDesign."""
    wanted = {"young": "pressure", "poisson": "ratio", "density": "density"}
    if not isinstance(stated, dict) or not set(wanted) <= set(stated) <= {*wanted, "source"}:
        raise InvalidDesign(
            f"{where}: material '{name}' needs {', '.join(wanted)} and may have a source, got {stated!r}"
        )
    E, nu, rho = (quantity(stated[key], dimension, f"{where}: {name}.{key}") for key, dimension in wanted.items())
    try:
        return Material(E, nu, rho, name, str(stated.get("source", "")))
    except InvalidDesign as error:
        raise InvalidDesign(f"{where}: material '{name}': {error}") from None


def shipped_material(name: str) -> Material:
    """A shipped material by name. Raises InvalidDesign."""
    if name not in materials():
        raise InvalidDesign(f"no material '{name}'; known are {', '.join(materials())}, or define it in the file")
    return materials()[name]


@dataclass(frozen=True)
class Section:
    """Cross section of the tubes of one kind, and the sources of its numbers."""

    outer: float
    """Outer diameter, m."""
    inner: float
    """Inner diameter, m; 0 for a solid bar."""
    material: Material
    rigid: bool = False
    """The tube has its mass but does not deform: for a much stiffer part of another construction."""
    source: str = ""
    assumed: bool = False
    """True for numbers that the source does not print."""

    def __post_init__(self) -> None:
        check_fields(self, InvalidDesign)
        self.tube(1.0)

    def tube(self, length: float) -> Tube:
        """A tube of this section and a length in m."""
        return Tube(self.outer, self.inner, length, self.material, self.rigid)


@dataclass(frozen=True)
class Tube:
    """A round tube: `Tube(0.06, 0.05, 0.375, "aluminium")`. Raises InvalidDesign for impossible values."""

    outer: float
    """Outer diameter, m."""
    inner: float
    """Inner diameter, m; 0 for a solid bar."""
    length: float
    """m."""
    material: Material
    """A material, or the name of a shipped one."""
    rigid: bool = False
    """The tube has its mass but does not deform."""

    def __post_init__(self) -> None:
        given: object = self.material
        if isinstance(given, str):
            object.__setattr__(self, "material", shipped_material(given))
        elif not isinstance(given, Material):
            raise InvalidDesign(f"a tube needs a Material or the name of a shipped one, got {shown(given)}")
        check_fields(self, InvalidDesign)
        require("a tube needs an outer diameter > 0 m", 0.0 < self.outer <= LONGEST_M, self.outer)
        require("a tube needs an inner diameter >= 0 m", self.inner >= 0.0, self.inner)
        if not self.inner < self.outer:
            raise InvalidDesign(f"a tube needs inner < outer diameter, got {self.inner:.9g} against {self.outer:.9g} m")
        require("a tube needs a length > 0 m", 0.0 < self.length <= LONGEST_M, self.length)
        require("a tube needs a second moment > 0 m4", self.second_moment > 0.0, self.second_moment)

    @property
    def area(self) -> float:
        """m2."""
        return 0.25 * pi * (self.outer - self.inner) * (self.outer + self.inner)

    @property
    def second_moment(self) -> float:
        """Of bending, m4; that of torsion is twice as large."""
        return self.area * (self.outer**2 + self.inner**2) / 16.0

    @property
    def mass(self) -> float:
        """kg."""
        return self.material.density * self.area * self.length

    @property
    def terms(self) -> Terms:
        """Terms of the compliance of the tip, see `Terms`."""
        if self.rigid:
            return Terms(0.0, 0.0, 0.0, 0.0, 0.0)
        E, L, inertia = self.material.young, self.length, self.second_moment
        return Terms(
            L / (E * self.area),
            L**3 / (3.0 * E * inertia),
            L / (2.0 * self.material.shear * inertia),
            L / (E * inertia),
            L**2 / (2.0 * E * inertia),
        )


@dataclass(frozen=True, slots=True)
class Terms:
    """The five different entries of a tube's compliance."""

    stretch: float
    """C11, m/N: along the tube per axial force."""
    bend: float
    """C22 = C33, m/N: across the tube per lateral force."""
    twist: float
    """C44, rad/(N m): about the tube per torque."""
    turn: float
    """C55 = C66, rad/(N m): across the tube per bending moment."""
    couple: float
    """C26 = -C35, rad/N and m/(N m): slope per lateral force."""


@checked
def tube_compliance(tube: Tube) -> Array:
    """Compliance (6, 6) of the free end of a tube whose other end is clamped, in the tube's own axes.

    Maps the wrench [fx fy fz mx my mz] at the tip (N, N m) to its displacement [dx dy dz rx ry rz] (m, rad), x along
    the tube from the clamped end. Source: elastostatic sheet section 3.
    """
    t = tube.terms
    C = np.diag([t.stretch, t.bend, t.bend, t.twist, t.turn, t.turn])
    C[1, 5] = C[5, 1] = t.couple
    C[2, 4] = C[4, 2] = -t.couple
    return C
