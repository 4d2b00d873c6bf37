"""The common parts of design files: materials and sections."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from irsbot_kinematics.stiffness.errors import InvalidDesign
from irsbot_kinematics.stiffness.quantities import quantity
from irsbot_kinematics.stiffness.tubes import Material, Section, material_of, shipped_material

_KEYS = {"outer", "inner", "material", "source", "assumed", "rigid"}


def mapping(value: Any, what: str) -> Mapping[str, Any]:
    """The value, if it is a mapping. Raises InvalidDesign."""
    if not isinstance(value, dict):
        raise InvalidDesign(f"{what} must be a mapping, got {value!r}")
    return value


def read_sections(stated: Mapping[str, Any]) -> dict[str, Section]:
    """The sections of a file, with the materials it defines. Raises InvalidDesign."""
    own = mapping(stated.get("materials", {}), "materials")
    materials = {str(name): material_of(entry, str(name), "materials") for name, entry in own.items()}
    sections = mapping(stated.get("sections"), "sections")
    return {str(kind): _section(entry, f"sections.{kind}", materials) for kind, entry in sections.items()}


def _section(stated: Any, what: str, materials: Mapping[str, Material]) -> Section:
    entry = mapping(stated, what)
    if not {"outer", "inner", "material"} <= set(entry) <= _KEYS:
        raise InvalidDesign(f"{what} needs outer, inner, material and may have source, assumed, rigid, got {stated!r}")
    for key in ("rigid", "assumed"):
        if not isinstance(entry.get(key, False), bool):
            raise InvalidDesign(f"{what}.{key} must be true or false, got {entry[key]!r}")
    outer, inner = (quantity(entry[key], "length", f"{what}.{key}") for key in ("outer", "inner"))
    name = str(entry["material"])
    try:
        material = materials[name] if name in materials else shipped_material(name)
        rigid, assumed = entry.get("rigid", False), entry.get("assumed", False)
        return Section(outer, inner, material, rigid, str(entry.get("source", "")), assumed)
    except InvalidDesign as error:
        raise InvalidDesign(f"{what}: {error}") from None
