"""Whether a system has finitely many, and simple, solutions for joints taken at random."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

from irsbot_kinematics.algebra.engine import AlgebraError, TooLarge
from irsbot_kinematics.algebra.exact import pair_of_tangent
from irsbot_kinematics.algebra.fibre import Fibre, NotFinite
from irsbot_kinematics.algebra.parse import cosine_of, sine_of

if TYPE_CHECKING:
    from irsbot_kinematics.algebra.system import System

SAMPLES = (Fraction(13, 11), Fraction(9, 7), Fraction(17, 12), Fraction(7, 5), Fraction(21, 19), Fraction(3, 2))
"""Joint positions without any relation among them, and of half angles."""


def generic_point(system: System) -> dict[str, Fraction]:
    """Values of the joints' generators that satisfy no special relation."""
    found: dict[str, Fraction] = {}
    for i, name in enumerate(system.joints):
        value = SAMPLES[i % len(SAMPLES)] + Fraction(i // len(SAMPLES), 23)
        if name in system.angles:
            found[cosine_of(name)], found[sine_of(name)] = pair_of_tangent(value)
        else:
            found[name] = value
    return found


def generic_fibre(system: System) -> Fibre:
    """The direct solutions at the generic joints. Raises NotFinite, TooLarge."""
    unknown = (*system.pose, *system.passive)
    return Fibre([*system.polys(generic_point(system)), *system.circles(unknown)], system.gens(unknown))


def check_finite(system: System) -> None:
    """Raises AlgebraError where the direct kinematics of generic joints is not finite, empty or not radical.

    One point over Q decides: the set of joints where the answer differs is thin.
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
