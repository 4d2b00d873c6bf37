"""Texts in YAML: what they say, or one sentence why they cannot be read."""

from __future__ import annotations

import re
from collections.abc import Hashable
from typing import Any

import yaml

from irsbot_kinematics.errors import BadInput

_FLOAT = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)[eE][-+]?[0-9]+$")

_MERGE = "tag:yaml.org,2002:merge"
"""Of the key <<, whose mapping others may replace."""


class _Loader(yaml.SafeLoader):
    """Reads 1e-2 as a number, as ROS does; for YAML 1.1 it is a text. Refuses a key that stands twice: the first value
    would be dropped."""

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Hashable, Any]:
        seen: set[str] = set()
        keys = [key for key, _value in node.value] if isinstance(node, yaml.MappingNode) else []
        for key in keys:
            if isinstance(key, yaml.ScalarNode) and key.tag != _MERGE:
                if key.value in seen:
                    fault = f"the key '{key.value}' stands twice"
                    raise yaml.MarkedYAMLError(problem=fault, problem_mark=key.start_mark)
                seen.add(key.value)
        return super().construct_mapping(node, deep)


_Loader.add_implicit_resolver("tag:yaml.org,2002:float", _FLOAT, list("-+.0123456789"))
_Shipped: type = _Loader
if yaml.__with_libyaml__:
    _Shipped = type("_Shipped", (yaml.CSafeLoader,), {"yaml_implicit_resolvers": _Loader.yaml_implicit_resolvers})


def parsed(text: str | bytes, where: object = "") -> Any:
    """What a text of a user says. where: its file, for the message. Raises BadInput."""
    try:
        return yaml.load(text, _Loader)
    except (yaml.YAMLError, ValueError) as error:  # ValueError: a date that does not exist, a number of 5000 digits
        reason = " ".join(str(error).split())
    except RecursionError:
        reason = "brackets are nested too deeply"
    raise BadInput(f"{where}: not YAML: {reason}" if where else f"not YAML: {reason}")


def shipped(text: str) -> Any:
    """What a text that is installed with the package says. libyaml reads it, ten times as fast, where PyYAML has it.
    Brackets that are nested too deeply overflow its stack, so it reads no text of a user."""
    return yaml.load(text, _Shipped)
