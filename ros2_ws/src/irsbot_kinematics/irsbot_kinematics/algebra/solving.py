"""Direct and inverse solutions at exact values: fibres of a system, in the order and the units of a user."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import atan2
from typing import Any

from irsbot_kinematics.algebra.manipulators.spatial import UprightRods
from irsbot_kinematics.algebra.model.engine import AlgebraError
from irsbot_kinematics.algebra.model.fibre import Fibre
from irsbot_kinematics.algebra.model.parse import cosine_of, sine_of
from irsbot_kinematics.algebra.model.system import System
from irsbot_kinematics.algebra.singular import complete
from irsbot_kinematics.arguments import checked


@dataclass(frozen=True)
class Configuration:
    """One real solution. Values are floats (rad for angles) of certified enclosures; radius bounds their error."""

    pose: dict[str, float]
    joints: dict[str, float]
    passive: dict[str, float]
    radius: float
    """Largest error of a value before it was rounded to a float."""

    @property
    def values(self) -> dict[str, float]:
        """All of them."""
        return {**self.pose, **self.joints, **self.passive}


@checked
def configurations(
    system: System, known: Mapping[str, Any], *, constraints: bool = True, order: str | None = None
) -> list[Configuration]:
    """All real configurations with given joints, or with given pose (or any values that leave finitely many).

    known: name -> exact value; floats are decimals, angles rad or (cos, sin). constraints=False ignores the
    inequalities. order: name by which they are sorted, else the order of the first unknown. Certified: the result is
    complete, and every solution is real. Raises AlgebraError if infinitely many are left.
    """
    complete(system, "configurations")
    fixed = system.point(known)
    variables = (*system.pose, *system.joints, *system.passive)
    unknown = [name for name in variables if name not in known]
    if order is not None and order not in variables:
        raise AlgebraError(f"'{order}' is no variable; order by one of {', '.join(variables)}")
    if isinstance(system.structure, UprightRods) and set(known) == set(system.joints):
        from irsbot_kinematics.algebra.upright_rods import upright_poses

        rows = upright_poses(system, fixed)
    else:
        rows = _solved(system, fixed, unknown, constraints)
    found = []
    for row, radius in rows:
        row = {**{name: _given(system, name, fixed) for name in known}, **row}
        groups = [{n: row[n] for n in g} for g in (system.pose, system.joints, system.passive)]
        found.append(Configuration(groups[0], groups[1], groups[2], radius))
    key = order or (unknown[0] if unknown else variables[0])
    return sorted(found, key=lambda c: c.values[key])


def fibre_of(system: System, fixed: Mapping[str, Fraction], unknown: Sequence[str]) -> Fibre:
    """The solutions for the unknown variables, with all others fixed."""
    polys = [*system.polys(fixed), *system.circles(unknown)]
    return Fibre([p for p in polys if p != 0], system.gens(unknown))


def count(system: System, fixed: Mapping[str, Fraction], unknown: Sequence[str]) -> int:
    """Number of real solutions that satisfy the inequalities. Certified."""
    fibre = fibre_of(system, fixed, unknown)
    positive = []
    for poly in system.positive(fixed):
        if not poly.is_constant():
            positive.append(poly)
        elif not poly.leading_coefficient() > 0:
            return 0
    return len(fibre.accepted(positive)) if positive else fibre.count()


def _solved(
    system: System, fixed: Mapping[str, Fraction], unknown: Sequence[str], constraints: bool
) -> list[tuple[dict[str, float], float]]:
    fibre = fibre_of(system, fixed, unknown)
    positive = system.positive(fixed) if constraints else []
    if any(p.is_constant() and not (p != 0 and p.leading_coefficient() > 0) for p in positive):
        return []
    found = []
    for solution in fibre.sharp([p for p in positive if not p.is_constant()]):
        values = {name: float(ball.mid()) for name, ball in solution.items()}
        radius = max((float(ball.rad()) for ball in solution.values()), default=0.0)
        found.append(({name: _value(system, name, values) for name in unknown}, radius))
    return found


def _value(system: System, name: str, values: Mapping[str, float]) -> float:
    if name in system.angles:
        return atan2(values[sine_of(name)], values[cosine_of(name)])
    return values[name]


def _given(system: System, name: str, fixed: Mapping[str, Fraction]) -> float:
    return _value(system, name, {g: float(fixed[g]) for g in system.gens([name])})
