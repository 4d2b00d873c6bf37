"""Message definitions as text, with those they depend on, so that a bag is readable without the packages."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

from irsbot_supervisor.bag.errors import BagError

_PRIMITIVES = {"bool", "byte", "char", "float32", "float64", "string", "wstring"}
_PRIMITIVES |= {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)}
_FIELD = re.compile(r"^\s*([a-zA-Z]\w*(?:/\w+)*)(?:<=\d+)?(?:\[[<=\d]*\])?\s+[a-zA-Z]\w*", re.MULTILINE)
_SEPARATOR = "=" * 80 + "\nMSG: "


@lru_cache
def definition(type_name: str) -> str:
    """The text of `package/msg/Name` and of all it is made of, in the format `ros2msg`. Raises BagError."""
    text = _file(type_name, ".msg").read_text()
    rest = list(dict.fromkeys(_dependencies(type_name)))
    return text + "".join(
        f"{_SEPARATOR}{name.replace('/msg/', '/')}\n{_file(name, '.msg').read_text()}" for name in rest
    )


@lru_cache
def type_hash(type_name: str) -> str:
    """The hash that ROS 2 gives the type, empty where the generated description is not installed."""
    try:
        described = json.loads(_file(type_name, ".json").read_text())
    except BagError:
        return ""
    return next((entry["hash_string"] for entry in described["type_hashes"] if entry["type_name"] == type_name), "")


def _dependencies(type_name: str) -> Iterator[str]:
    for used in _FIELD.findall(re.sub(r"#.*", "", _file(type_name, ".msg").read_text())):
        if used not in _PRIMITIVES:
            package, _, name = used.rpartition("/")
            full = f"{package.removesuffix('/msg') or type_name.split('/')[0]}/msg/{name}"
            yield full
            yield from _dependencies(full)


def _file(type_name: str, suffix: str) -> Path:
    package, _, name = type_name.partition("/msg/")
    for share in _shares():
        path = share / package / "msg" / f"{name}{suffix}"
        if path.is_file():
            return path
    raise BagError(f"the definition of {type_name} is not installed: source the ROS 2 workspace")


def _shares() -> Iterator[Path]:
    """Folders with the messages of packages: sourced prefixes, the environment, and the source tree next to this
    package."""
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if prefix:
            yield Path(prefix, "share")
    yield Path(sys.prefix, "share")
    yield Path(__file__).resolve().parents[3]
