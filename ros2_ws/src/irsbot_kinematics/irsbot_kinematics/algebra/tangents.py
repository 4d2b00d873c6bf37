"""Angles as t = tan(angle/2), for polynomials in one unknown per angle; angle pi lies at infinity."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from irsbot_kinematics.algebra.model.parse import cosine_of, sine_of
from irsbot_kinematics.algebra.model.polynomial import context, primitive


def tangent_of(angle: str) -> str:
    """Name of the generator that stands for tan(angle/2)."""
    return f"t_{angle}"


def with_tangents(poly: Any, angles: Sequence[str]) -> Any:
    """Primitive integer polynomial with cos = (1-t^2)/(1+t^2), sin = 2t/(1+t^2) put in and the numerator taken."""
    own = tuple(poly.context().names())
    turned = {g for angle in angles for g in (cosine_of(angle), sine_of(angle))}
    if not turned & set(own):
        return primitive(poly)
    rest = [name for name in own if name not in turned]
    new = (*rest, *(tangent_of(angle) for angle in angles if cosine_of(angle) in own))
    ring = context(new)
    places = []
    for angle in angles:
        if cosine_of(angle) in own:
            t = ring.gen(new.index(tangent_of(angle)))
            i, k = own.index(cosine_of(angle)), own.index(sine_of(angle))
            most = max((int(m[i]) + int(m[k]) for m in poly.monoms()), default=0)
            powers = ([1 + 0 * t], [1 + 0 * t], [1 + 0 * t])
            for row, base in zip(powers, (1 - t * t, 2 * t, 1 + t * t), strict=True):
                for _ in range(most):
                    row.append(row[-1] * base)
            places.append((i, k, most, powers))
    groups: dict[tuple[tuple[int, int], ...], dict[tuple[int, ...], Any]] = {}
    for m, c in zip(poly.monoms(), poly.coeffs(), strict=True):
        key = tuple((int(m[i]), int(m[k])) for i, k, _, _ in places)
        left = tuple(int(m[own.index(name)]) for name in rest) + (0,) * len(places)
        groups.setdefault(key, {})[left] = c
    total = ring.constant(0)
    for key, terms in groups.items():
        part = ring.from_dict(terms)
        for (a, b), (_, _, most, (cosines, normalised_levers, ones)) in zip(key, places, strict=True):
            part = part * cosines[a] * normalised_levers[b] * ones[most - a - b]
        total = total + part
    return primitive(total)


def without_circles(poly: Any) -> Any:
    """The polynomial without its factors 1 + t^2, which only isotropic directions satisfy."""
    for name in poly.context().names():
        if name.startswith("t_"):
            t = poly.context().gen(poly.context().variable_to_index(name))
            while poly != 0:
                whole, rest = divmod(poly, 1 + t * t)
                if rest != 0:
                    break
                poly = whole
    return poly
