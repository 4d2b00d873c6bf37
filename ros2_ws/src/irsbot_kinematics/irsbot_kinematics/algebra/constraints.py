"""Equations that every reachable pose satisfies, and joint positions with a continuum of poses. Exact."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product as choices
from typing import Any

from irsbot_kinematics.algebra.elimination import eliminate
from irsbot_kinematics.algebra.manipulators.planar import PlanarLegs
from irsbot_kinematics.algebra.model.engine import AlgebraError, flint
from irsbot_kinematics.algebra.model.polynomial import (
    Polynomial,
    context,
    integer_context,
    irreducible,
    moved,
    primitive,
    public,
)
from irsbot_kinematics.algebra.model.system import System
from irsbot_kinematics.algebra.planar_forms import T, closing
from irsbot_kinematics.algebra.singular import complete, moved_whole, places_of
from irsbot_kinematics.arguments import checked


@checked
def constraint_equations(system: System) -> list[list[Polynomial]]:
    """Components of the set of reachable poses, each a list of polynomials in the pose alone. Exact.

    From the equations without actuators, passive variables eliminated; one component for each choice of factors. Empty
    if every pose is free.
    """
    complete(system, "constraint equations")
    joints, passive = system.gens(system.joints), system.gens(system.passive)
    polys = [p for p in system.polys() if all(not any(int(m[i]) for m in p.monoms()) for i in places_of(p, joints))]
    holding = [p for p in polys if any(any(int(m[i]) for m in p.monoms()) for i in places_of(p, passive))]
    names = system.gens(system.pose)
    free = [primitive(p, names) for p in polys if p not in holding]
    if holding:
        free += eliminate([*holding, *system.circles(system.passive)], names, passive)
    groups = [[factor for factor, _ in irreducible(poly)] for poly in free]
    if not groups:
        return []
    groups.sort(key=lambda group: -len(group))
    return [[public(factor) for factor in choice] for choice in choices(*groups)]


@checked
def infinite_equations(system: System) -> list[list[Polynomial]]:
    """Joint positions with infinitely many direct solutions: components, each a list of polynomials. Exact, complex.

    They are the common zeros of all coefficients of the equation that remains for one pose variable. Empty: none.
    Raises AlgebraError for systems other than planar platforms on three circles and two pose variables.
    """
    complete(system, "infinite equations")
    if isinstance(system.structure, PlanarLegs):
        coefficients = _coefficients(closing(system, {}).f, T)
    elif len(system.pose) == 2 and not system.passive:
        ring = context(system.gens((*system.pose, *system.joints)))
        first, second = (moved(p, ring) for p in system.polys())
        x, y = system.gens(system.pose)
        coefficients = []
        for a, b in ((x, y), (y, x)):
            coefficients += _coefficients(primitive(first.resultant(second, a)), b)
    else:
        raise AlgebraError(
            f"infinite equations are known for planar platforms and two pose variables, not {system.name}"
        )
    names = system.gens(system.joints)
    circles = [primitive(c, names) for c in system.circles(system.joints)]
    return _common(coefficients, circles, names)


def _coefficients(poly: Any, name: str) -> list[Any]:
    """Coefficients of the powers of a generator, in the ring without it."""
    own = tuple(poly.context().names())
    i = own.index(name)
    rest = [g for g in own if g != name]
    ring = context(rest)
    groups: dict[int, dict[tuple[int, ...], Any]] = {}
    for m, c in zip(poly.monoms(), poly.coeffs(), strict=True):
        groups.setdefault(int(m[i]), {})[tuple(int(m[own.index(g)]) for g in rest)] = c
    found = []
    for terms in groups.values():
        part = ring.constant(0)
        for m, c in terms.items():
            part = part + ring.from_dict({m: c})
        found.append(part)
    return found


def _common(polys: Sequence[Any], circles: Sequence[Any], names: Sequence[str]) -> list[list[Polynomial]]:
    """Groebner basis of the common zeros; empty if there are none."""
    whole = [primitive(moved_whole(p, names), names) for p in polys if p != 0]
    basis = flint.fmpz_mpoly_vec([*whole, *circles], integer_context(names)).buchberger_naive().autoreduction()
    if any(p.is_constant() for p in basis):
        return []
    return [[public(p) for p in basis if p not in circles]]
