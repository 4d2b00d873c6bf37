"""Checks that a system has finitely many, and simple, solutions for joints taken at random."""

from __future__ import annotations

from fractions import Fraction

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
