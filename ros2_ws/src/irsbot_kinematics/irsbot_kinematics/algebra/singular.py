"""Parallel and serial singularities, their projections, constraint equations, infinite equations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

from irsbot_kinematics.algebra.delta_forms import delta_projection
from irsbot_kinematics.algebra.determinants import determinant, jacobian
from irsbot_kinematics.algebra.elimination import eliminate
from irsbot_kinematics.algebra.manipulators.delta import DeltaRails
from irsbot_kinematics.algebra.manipulators.planar import PlanarLegs
from irsbot_kinematics.algebra.model.engine import AlgebraError
from irsbot_kinematics.algebra.model.parse import cosine_of, sine_of
from irsbot_kinematics.algebra.model.polynomial import (
    Polynomial,
    context,
    irreducible,
    moved,
    primitive,
    product,
    public,
    rational,
)
from irsbot_kinematics.algebra.model.system import System
from irsbot_kinematics.algebra.planar_forms import parallel_joint
from irsbot_kinematics.algebra.tangents import with_tangents, without_circles
from irsbot_kinematics.arguments import checked

MARGIN_CAUSES = ("parallel", "serial")
SPACES = ("joint", "pose")


class Projection(list[Polynomial]):
    """Irreducible polynomials of a projected hypersurface. Exact.

    generator: their product with the multiplicities that the eliminated ideal has ([S4], Tables 3 and 4); its measures
    are repeated here.
    """

    def __init__(self, factors: Sequence[Polynomial], generator: Polynomial) -> None:
        super().__init__(factors)
        self.generator = generator

    @property
    def degree(self) -> int:
        """Total degree of the generator."""
        return self.generator.degree

    @property
    def degrees(self) -> tuple[int, ...]:
        """Partial degrees of the generator."""
        return self.generator.degrees

    @property
    def terms(self) -> int:
        """Number of terms of the generator."""
        return self.generator.terms

    @property
    def height_bits(self) -> int:
        """Smallest b with all |coefficients| of the generator <= 2^b."""
        return self.generator.height_bits


def one_of(value: str, known: Sequence[str], what: str) -> str:
    """The value, if it is a known one. Raises AlgebraError otherwise."""
    if value not in known:
        raise AlgebraError(f"{what} must be one of {', '.join(known)}, got '{value}'")
    return value


def complete(system: System, what: str) -> None:
    """Raises AlgebraError if a parameter has no value."""
    if not system.assigned:
        lost = [name for name in system.parameters if name not in system.values]
        raise AlgebraError(f"{what} needs values for {', '.join(lost)}: use assign()")


def square_system(
    system: System, kind: str, fixed: Mapping[str, Fraction] | None = None
) -> tuple[list[Any], list[str]]:
    """Equations with circles, and the generators by which they are differentiated, as many.

    parallel: pose and passive; serial: joints and passive, equations without any of them left out.
    """
    names = (*system.pose, *system.passive) if kind == "parallel" else (*system.joints, *system.passive)
    gens = list(system.gens(names))
    polys = [*system.polys(fixed), *system.circles(names)]
    if kind == "serial":
        polys = [p for p in polys if any(p.degrees()[p.context().variable_to_index(g)] for g in gens)]
    return polys, gens


def determinant_of(system: System, kind: str) -> Any:
    """det dF/d(X, P) or det dF/d(Q, P), circles appended, as flint's fmpq_mpoly; the circles make it 2 x per angle."""
    polys, gens = square_system(system, kind)
    if len(polys) != len(gens):
        raise AlgebraError(
            f"{system.name} has {len(polys)} equations for {len(gens)} {kind} unknowns: no square matrix to examine"
        )
    return determinant(jacobian(polys, gens))


def _components(system: System, det: Any, names: Sequence[str]) -> list[Any]:
    """Irreducible factors of a determinant, sin^2 = 1 - cos^2 put in; factors that are constant on the circles go."""
    found: dict[str, Any] = {}
    for factor, _ in irreducible(primitive(det, names)):
        for angle in system.angles:
            if cosine_of(angle) in names:
                factor = _on_circle(factor, cosine_of(angle), sine_of(angle))
        for part, _ in irreducible(factor):
            found[str(part)] = part
    return list(found.values())


def _on_circle(poly: Any, cosine: str, sine: str) -> Any:
    names = tuple(poly.context().names())
    i = names.index(sine)
    ring = poly.context()
    c = ring.gen(names.index(cosine))
    total = ring.constant(0)
    for m, k in poly.to_dict().items():
        half, odd = divmod(int(m[i]), 2)
        term = ring.from_dict({(*m[:i], odd, *m[i + 1 :]): k})
        total = total + term * (1 - c * c) ** half
    return primitive(total)


@checked
def singularities(system: System, kind: str = "parallel") -> list[list[Polynomial]]:
    """Components of the parallel or serial singularities: the equations and one factor of the determinant each. Exact.

    Parameters without a value are symbols.
    """
    one_of(kind, MARGIN_CAUSES, "kind")
    det = determinant_of(system, kind)
    if isinstance(det, int) or det == 0:
        raise AlgebraError(f"{system.name}: every configuration is a {kind} singularity")
    names = system.gens([n for n in system.names if n not in system.values])
    equations = [
        public(p, names) for p in (*system.polys(), *system.circles((*system.pose, *system.joints, *system.passive)))
    ]
    return [[*equations, public(factor)] for factor in _components(system, det, names)]


def factors_of_determinant(system: System, kind: str) -> list[Polynomial]:
    """The irreducible factors alone, without the equations."""
    return [component[-1] for component in singularities(system, kind)]


@checked
def project(
    system: System, kind: str = "parallel", space: str = "joint", fixed: Mapping[str, Any] | None = None
) -> Projection:
    """Hypersurface that the singularities of a kind project to, in joint or pose space, some variables fixed. Exact.

    Angles among the variables of the space appear as t_a = tan(a/2). The zero set is the closure over the complex
    numbers: a point on it need not be singular for a real configuration within the limits.
    """
    one_of(kind, MARGIN_CAUSES, "kind")
    one_of(space, SPACES, "space")
    complete(system, "a projection")
    names = system.joints if space == "joint" else system.pose
    known = slice_values(system, names, fixed)
    free = [name for name in names if name not in (fixed or {})]
    if isinstance(system.structure, DeltaRails):
        rails = replace(system.structure, rod=system.values["L"])  # type: ignore[arg-type]
        generator = delta_projection(rails, kind, space, names)
        if known:
            generator = primitive(_put_in(generator, known))
        return Projection([public(f) for f, _ in irreducible(generator)], public(generator))
    if isinstance(system.structure, PlanarLegs) and (kind, space) == ("parallel", "joint"):
        from irsbot_kinematics.algebra.sizes import refuse_large_discriminant

        refuse_large_discriminant(system, free)
        found = [_joint_form(system, poly) for poly in parallel_joint(system, known)]
    else:
        found = _eliminated(system, kind, names, free, known)
    whole = product(found, found[0].context()) if found else None
    generator_ = public(whole) if whole is not None else Polynomial(tuple(free), {(0,) * len(free): 1})
    return Projection([public(f) for f in found], generator_)


def slice_values(system: System, names: Sequence[str], fixed: Mapping[str, Any] | None) -> dict[str, Fraction]:
    """Generators that are fixed. Raises AlgebraError for names of another space, and if no variable is left."""
    stated = dict(fixed or {})
    for name in stated:
        if name not in names:
            raise AlgebraError(f"'{name}' cannot be fixed here; the variables are {', '.join(names)}")
    if len(stated) >= len(names):
        raise AlgebraError(f"all of {', '.join(names)} are fixed: nothing is left")
    return system.point(stated)


def _joint_form(system: System, poly: Any) -> Any:
    return without_circles(with_tangents(poly, [j for j in system.joints if j in system.angles]))


def _eliminated(
    system: System, kind: str, names: Sequence[str], free: Sequence[str], known: Mapping[str, Fraction]
) -> list[Any]:
    others = [n for n in (*system.pose, *system.joints, *system.passive) if n not in names]
    turned = [name for name in free if name in system.angles]
    ring = context(system.gens([*free, *others]))
    det = system.evaluated(determinant_of(system, kind), known)
    keep = [f"t_{name}" if name in turned else name for name in free]
    found: dict[str, Any] = {}
    for factor in _components(system, moved(det, ring), tuple(ring.names())):
        equations, drop = linked(system, moved_whole(factor, ring.names()), known, others, ring)
        hits = (
            [primitive(with_tangents(factor, turned), keep)]
            if not drop
            else eliminate([with_tangents(p, turned) for p in equations], keep, drop)
        )
        for poly in hits:
            for part, _ in irreducible(without_circles(poly)):
                found[str(part)] = part
    return sorted(found.values(), key=lambda f: (int(f.total_degree()), len(f), str(f)))


def _put_in(poly: Any, known: Mapping[str, Fraction]) -> Any:
    """An integer polynomial with generators fixed, over Q in the names that are left."""
    names = tuple(poly.context().names())
    whole = context(names).from_dict({m: int(c) for m, c in poly.to_dict().items()})
    return moved(whole.subs({k: rational(v) for k, v in known.items()}), context([n for n in names if n not in known]))


def places_of(poly: Any, names: Sequence[str]) -> list[int]:
    own = tuple(poly.context().names())
    return [own.index(name) for name in names if name in own]


def moved_whole(poly: Any, names: Sequence[str]) -> Any:
    """A rational polynomial in Q[names]."""
    return moved(poly, context(names))


def linked(
    system: System, start: Any, known: Mapping[str, Fraction], others: Sequence[str], ring: Any
) -> tuple[list[Any], list[str]]:
    """The equations that share unknowns with a polynomial, directly or through one another, and these unknowns."""
    rest = [moved(p, ring) for p in (*system.polys(known), *system.circles(others)) if not p.is_constant()]
    drop = set(system.gens(others))
    polys, wanted, size = [start], occurring(start) & drop, -1
    while size != len(polys):
        size = len(polys)
        for poly in [p for p in rest if occurring(p) & wanted]:
            polys.append(poly)
            rest.remove(poly)
            wanted |= occurring(poly) & drop
    return polys, [g for g in system.gens(others) if g in wanted]


def occurring(poly: Any) -> set[str]:
    """Names of the generators that occur."""
    return {name for name, degree in zip(poly.context().names(), poly.degrees(), strict=True) if degree > 0}
