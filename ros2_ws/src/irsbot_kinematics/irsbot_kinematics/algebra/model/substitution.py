"""Coherent substitution (SubsPlus of [S4]): an angle's cosine and sine change together."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping
from typing import Any

from irsbot_kinematics.algebra.model.engine import AlgebraError
from irsbot_kinematics.algebra.model.equations import Equations


def substituted(system: Equations, replaced: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of the system that `System.substitute` changes, with their new values. Raises AlgebraError."""
    groups: dict[str, Any] = {group: list(getattr(system, group)) for group in ("pose", "joints", "passive")}
    parameters, angles = dict(system.parameters), list(system.angles)
    texts = [str(text) for text in (*system.equations, *system.inequalities)]
    for name, value in replaced.items():
        if name not in system.names:
            raise AlgebraError(f"'{name}' is no variable of {system.name}; it has {', '.join(system.names)}")
        if not isinstance(value, str) or _is_number(value):
            for members in groups.values():
                if name in members:
                    members.remove(name)
            parameters[name] = value
            continue
        new = _new_names(value, system)
        for members in groups.values():
            if name in members:
                place = members.index(name)
                members[place : place + 1] = [n for n in new if n not in members]
        if name in parameters:
            parameters |= dict.fromkeys(n for n in new if n not in parameters)
            del parameters[name]
        if name in angles:
            angles.remove(name)
            angles += [n for n in new if n not in angles]
        texts = [_written(text, name, value) for text in texts]
    count = len(system.equations)
    return {
        **groups,
        "equations": texts[:count],
        "inequalities": texts[count:],
        "parameters": parameters,
        "angles": angles,
        "structure": None,
    }


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _new_names(expression: str, system: Equations) -> list[str]:
    try:
        tree = ast.parse(expression.replace("^", "**"), mode="eval")
    except SyntaxError:
        raise AlgebraError(f"'{expression}' is no expression") from None
    found = [node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and node.id not in ("cos", "sin", "tan")]
    return [name for name in dict.fromkeys(found) if name not in system.names]


def _written(text: str, name: str, value: str) -> str:
    """The text with the name replaced; decimals are unchanged."""
    return re.sub(rf"\b{re.escape(name)}\b", f"({value})", text)
