"""Elimination by a cascade of resultants, with a sieve that removes the extra factors of the resultants.

Every intermediate polynomial is factored, and a factor is kept only if it vanishes at a sampled (complex) solution of
the system. The factors that are kept are exact polynomials, verified on the solution set.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from irsbot_kinematics.algebra.model.polynomial import irreducible, primitive, product
from irsbot_kinematics.algebra.sampling import Complexes, Numeric, sample_zeros

SAMPLES = 40
"""1: starts per scale for the sieve; the solutions found should include every component of the solution set."""

SCALES = (2.0, 0.5, 8.0)
"""Sizes of the random starts, in the units of the equations."""

SMALL = 1e-6
"""1: a singular value of unit rows below it counts as 0."""

VANISHED = 1e-9
"""1: relative value below which a factor vanishes at a sample."""


def eliminate(polys: Sequence[Any], keep: Sequence[str], drop: Sequence[str], seed: int = 1) -> list[Any]:
    """Irreducible polynomials in Z[keep] whose zeros are the closure of the projection of the zeros of `polys`.

    polys: flint polynomials in which only keep and drop occur; their zero set has to have one dimension less than
    there are names in keep. Empty where it projects to less than a hypersurface.
    """
    names = (*keep, *drop)
    whole = [primitive(poly, names) for poly in polys]
    whole = [poly for poly in whole if poly != 0]
    samples = np.concatenate([sample_zeros(whole, names, SAMPLES, seed + k, scale) for k, scale in enumerate(SCALES)])
    samples = samples[_spread(whole, names, samples, len(keep))]
    if not len(samples):
        return []
    found = _cascade(whole, list(drop), samples, names)
    parts = {str(f): f for poly in found for f, _ in irreducible(primitive(poly, tuple(keep)))}
    kept = _best(list(parts.values()), tuple(keep), samples[:, : len(keep)])
    return sorted(kept, key=lambda f: (int(f.total_degree()), len(f), str(f)))


def _spread(polys: Sequence[Any], names: Sequence[str], samples: Complexes, kept: int) -> Any:
    """Mark the samples on components that project to a hypersurface of the first `kept` coordinates, not to a smaller
    set."""
    if not len(samples):
        return np.zeros(0, dtype=bool)
    with np.errstate(all="ignore"):
        jacobian = np.stack([Numeric(poly, names).gradient(samples) for poly in polys], axis=1)
    jacobian = np.where(np.isfinite(jacobian).all(axis=(1, 2), keepdims=True), jacobian, 0.0)  # not regular: left out
    size = np.linalg.norm(jacobian, axis=2, keepdims=True)
    jacobian = jacobian / np.where(size > 0.0, size, 1.0)
    dropped = jacobian[:, :, kept:]
    # A tangent vector whose kept part is 0 lies in the kernel of the dropped columns.
    if dropped.shape[2] == 0:
        return np.ones(len(samples), dtype=bool)
    regular = np.linalg.svd(jacobian, compute_uv=False)[:, -1] > SMALL
    return regular & (np.linalg.svd(dropped, compute_uv=False)[:, dropped.shape[2] - 1] > SMALL)


def _cascade(polys: list[Any], drop: list[str], samples: Complexes, names: Sequence[str]) -> list[Any]:
    polys = [sieved(poly, samples, names) for poly in polys]
    polys = [poly for poly in polys if not poly.is_constant()]
    while drop:
        name, holding = _next(polys, drop)
        drop = [other for other in drop if other != name]
        if len(holding) < 2:
            polys = [poly for poly in polys if poly not in holding]
            continue
        i = names.index(name)
        pivot, *others = sorted(holding, key=lambda p: (p.degrees()[i], len(p)))
        rest = [poly for poly in polys if poly not in holding]
        for other in others:
            found = pivot.resultant(other, name)
            if found == 0:
                common = pivot.gcd(other)
                branches = []
                for choice in (common, None):
                    parts = [common] if choice is not None else [pivot // common, other // common]
                    remaining = [p for p in holding if p not in (pivot, other)]
                    if any(p.is_constant() for p in parts):
                        continue
                    branches += _cascade([*rest, *remaining, *parts], [name, *drop], samples, names)
                return branches
            found = sieved(primitive(found), samples, names)
            if not found.is_constant() and found not in rest:
                rest.append(found)
        polys = rest
    if len(polys) > 1:
        shared = polys[0]
        for poly in polys[1:]:
            shared = shared.gcd(poly)
        return [shared] if not shared.is_constant() else polys
    return polys


def _next(polys: Sequence[Any], drop: Sequence[str]) -> tuple[str, list[Any]]:
    """The cheapest name to eliminate, and the polynomials that contain it."""
    best: tuple[tuple[int, int, int], str, list[Any]] | None = None
    for name in drop:
        holding = [poly for poly in polys if poly.degrees()[poly.context().variable_to_index(name)] > 0]
        degrees = sorted(poly.degrees()[poly.context().variable_to_index(name)] for poly in holding)
        low = degrees[0] if degrees else 0
        cost = (low * sum(degrees[1:]) if len(holding) > 1 else 0, len(holding), sum(len(p) for p in holding))
        if best is None or cost < best[0]:
            best = (cost, name, holding)
    assert best is not None
    return best[1], best[2]


def sieved(poly: Any, samples: Complexes, names: Sequence[str]) -> Any:
    """The product of the irreducible factors that vanish at some sample."""
    factors = [factor for factor, _ in irreducible(poly)]
    if len(factors) < 2:
        return product(factors, poly.context())
    return product(_best(factors, names, samples), poly.context())


def _best(factors: Sequence[Any], names: Sequence[str], samples: Complexes) -> list[Any]:
    """The factor that vanishes best for each sample; factors that are not the best for any sample are left out."""
    if not factors:
        return []
    values = np.stack([Numeric(factor, names).relative(samples) for factor in factors])
    best, least = values.argmin(axis=0), values.min(axis=0)
    return [factor for i, factor in enumerate(factors) if (least[best == i] < VANISHED).any()]
