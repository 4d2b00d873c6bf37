"""A mechanism of the user's own as YAML, in one posture:

    family: chains
    points: {unit: m, A: [0, 0, 0], B: [0.3, 0, -0.2], P: [0, 0, -0.8]}
    platform: P
    sections: {arm: {outer: 60 mm, inner: 50 mm, material: aluminium}}
    legs:                                  # each a chain from the base to the platform
      - - tube: [A, B, arm]
        - revolute: [B, [0, 1, 0]]
        - parallel:                        # chains within a chain
            - [{tube: [B, P, arm]}, {revolute: [P, [0, 1, 0]]}]
            - [{tube: [B, P, arm]}]

Two bodies that several chains join are `parallel` in the chain; what lies between two links is rigid.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from irsbot_kinematics.stiffness.chains import Chain, ChainStructure, Link, Parallel, Revolute, TubeBetween
from irsbot_kinematics.stiffness.errors import InvalidDesign
from irsbot_kinematics.stiffness.quantities import quantity
from irsbot_kinematics.stiffness.section_file import mapping, read_sections

_KEYS = {"family", "description", "points", "platform", "sections", "materials", "legs"}
_FORMS = "{tube: [start, end, section]}, {revolute: [point, [x, y, z]]} or {parallel: [chain, ...]}"


def read_chains(stated: Mapping[str, Any], name: str) -> ChainStructure:
    """The mechanism that a file describes. Raises InvalidDesign."""
    if unknown := set(stated) - _KEYS:
        raise InvalidDesign(f"unknown key '{sorted(map(str, unknown))[0]}'; known are {', '.join(sorted(_KEYS))}")
    places = dict(mapping(stated.get("points"), "points"))
    unit = places.pop("unit", None)
    if unit is None:
        raise InvalidDesign("points have no unit: write for example 'unit: m' among them")
    points = {str(point): _vector(place, f"points.{point}", str(unit)) for point, place in places.items()}
    legs = _chains(stated.get("legs"), "legs")
    platform, description = str(stated.get("platform", "")), str(stated.get("description", ""))
    return ChainStructure(name, description, points, platform, read_sections(stated), (Parallel(legs),))


def _vector(stated: Any, what: str, unit: str | None = None) -> tuple[float, float, float]:
    if not isinstance(stated, list) or len(stated) != 3:
        raise InvalidDesign(f"{what} must be [x, y, z], got {stated!r}")
    dimension, suffix = ("ratio", "") if unit is None else ("length", f" {unit}")
    x, y, z = (quantity(f"{part}{suffix}", dimension, what) for part in stated)
    return x, y, z


def _chains(stated: Any, what: str) -> tuple[Chain, ...]:
    if not isinstance(stated, list) or not stated or not all(isinstance(chain, list) for chain in stated):
        raise InvalidDesign(f"{what} must be a list of chains, each a list of links, got {stated!r}")
    return tuple(
        tuple(_link(link, f"{what}[{i}][{k}]") for k, link in enumerate(chain)) for i, chain in enumerate(stated)
    )


def _link(stated: Any, what: str) -> Link:
    if isinstance(stated, dict) and len(stated) == 1:
        (kind, value), *_ = stated.items()
        if kind == "parallel":
            return Parallel(_chains(value, f"{what}.parallel"))
        if kind == "tube" and isinstance(value, list) and len(value) == 3:
            return TubeBetween(*map(str, value))
        if kind == "revolute" and isinstance(value, list) and len(value) == 2:
            return Revolute(str(value[0]), _vector(value[1], f"{what}.revolute"))
    raise InvalidDesign(f"{what} must be {_FORMS}, got {stated!r}")
