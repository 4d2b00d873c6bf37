"""Checks of a system: its denominators, and that joints taken at random have finitely many, and simple, solutions."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from irsbot_kinematics.algebra.model.engine import AlgebraError, TooLarge
from irsbot_kinematics.algebra.model.equations import Equations
from irsbot_kinematics.algebra.model.exact import pair_of_tangent
from irsbot_kinematics.algebra.model.fibre import Fibre, NotFinite
from irsbot_kinematics.algebra.model.parse import cosine_of, sine_of

SAMPLES = (Fraction(13, 11), Fraction(9, 7), Fraction(17, 12), Fraction(7, 5), Fraction(21, 19), Fraction(3, 2))
"""Joint positions, and half angles, without any relation among them."""


def generic_point(system: Equations) -> dict[str, Fraction]:
    """Values of the joints' generators that satisfy no special relation."""
    found: dict[str, Fraction] = {}
    for i, name in enumerate(system.joints):
        value = SAMPLES[i % len(SAMPLES)] + Fraction(i // len(SAMPLES), 23)
        if name in system.angles:
            found[cosine_of(name)], found[sine_of(name)] = pair_of_tangent(value)
        else:
            found[name] = value
    return found


def generic_fibre(system: Equations) -> Fibre:
    """The direct solutions at the generic joints. Raises NotFinite, TooLarge."""
    unknown = (*system.pose, *system.passive)
    return Fibre([*system.polys(generic_point(system)), *system.circles(unknown)], system.gens(unknown))


def check_denominator(system: Equations, top: Any, bottom: Any, what: str) -> None:
    """Raises AlgebraError unless top = 0 says the same as top/bottom = 0: both must not vanish together.

    They do not if 1 is in their ideal, with the circles of the angles (Nullstellensatz). A denominator of parameters
    alone must not be 0; parameters without a value count as different from 0.
    """
    over = system.evaluated(bottom)
    if over == 0:
        raise AlgebraError(f"{what} divides by zero")
    variables = (*system.pose, *system.joints, *system.passive)
    names, own = system.gens(variables), over.context().names()
    if not any(power for m in over.monoms() for name, power in zip(own, m, strict=True) if name in names):
        return
    every = (*variables, *system.parameters)
    try:
        fibre = Fibre([system.evaluated(top), over, *system.circles(every)], system.gens(every))
        together = fibre.dimension > 0
    except (NotFinite, TooLarge):
        together = True
    if together:
        raise AlgebraError(
            f"{what} divides by {over}, and may be 0/0 where that is 0; write it without this denominator, "
            "such as sin(a)*x = cos(a)*y for tan(a) = y/x"
        )


def check_finite(system: Equations) -> None:
    """Raises AlgebraError if the direct kinematics of generic joints is not finite, empty or not radical.

    One point over Q suffices: the set of joints with another answer is thin.
    """
    if system.structure is not None:
        return
    try:
        fibre = generic_fibre(system)
    except TooLarge:
        return
    except NotFinite as error:
        raise AlgebraError(f"{system.name} is not zero-dimensional for given joints: {error}") from None
    if fibre.dimension == 0:
        raise AlgebraError(f"{system.name}: the equations contradict one another for joints in general position")
    if not fibre.radical:
        raise AlgebraError(
            f"{system.name} is not radical: {fibre.dimension} solutions for given joints, only {fibre.distinct} "
            "of them distinct; an equation is squared, or two say the same"
        )
