"""Origin of a mechanism: shipped, installed under the entry point group `irsbot.mechanisms`, or a Python file.

A robot file names its mechanism in one of four ways:

    mechanism: rrr3                  # shipped
    mechanism: prr3                  # the name of an entry point of an installed package
    mechanism: our_robots.prr3:Prr3  # a class in an importable module
    mechanism: prr3.py:Prr3          # a class in a file, beside the robot file

The class derives from `Mechanism`, and its annotation `geometry: Prr3Geometry` names the dataclass of its lengths.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import inspect
import sys
import typing
from collections.abc import Iterable, Mapping
from dataclasses import is_dataclass
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from irsbot_kinematics import arguments
from irsbot_kinematics.errors import BadInput, KinematicsError
from irsbot_kinematics.mechanism import Mechanism
from irsbot_kinematics.mechanisms import TOPOLOGIES, Topology

GROUP = "irsbot.mechanisms"
"""Entry point group; the name of an entry point is the name of the mechanism in robot files."""
_FILE_MODULE = "irsbot_mechanism_"
"""Prefix of module names of mechanism files; the hash of the text follows, so that a changed file is another module."""


def topology(stated: object, folder: Path) -> Topology:
    """The topology that a robot file names. folder: where the robot file is.

    Raises BadInput, in one line, for a name that leads nowhere and for a class that is no mechanism.
    """
    if not isinstance(stated, str) or not stated:
        raise BadInput(f"mechanism is '{stated}'; {_known()}")
    if stated in TOPOLOGIES:
        return TOPOLOGIES[stated]
    if ":" in stated:
        return _checked(stated, _class_of(stated, folder))
    for found in entry_points(group=GROUP):
        if found.name == stated:
            try:
                return _checked(stated, found.load())
            except Exception as error:
                raise _unusable(stated, f"entry point {found.value}", error) from None
    raise BadInput(f"mechanism is '{stated}'; {_known()}")


def reference(mechanism: Mechanism) -> dict[str, str]:
    """The entries by which `referenced` finds the topology again: `mechanism`, and `sha256` of its file if it has
    one."""
    kind, cls = mechanism.kind, type(mechanism)
    if kind in TOPOLOGIES and TOPOLOGIES[kind].mechanism is cls:
        return {"mechanism": kind}
    if not cls.__module__.startswith(_FILE_MODULE):
        return {"mechanism": f"{cls.__module__}:{cls.__qualname__}"}
    file = Path(inspect.getfile(cls))
    return {"mechanism": f"{file}:{cls.__qualname__}", "sha256": cls.__module__.removeprefix(_FILE_MODULE)}


def referenced(stated: Mapping[str, Any], files: Iterable[Path] = ()) -> Topology:
    """The topology of a `reference`. files: other places of its file, which is identified by its hash.

    Raises BadInput if none of the files is the recorded one.
    """
    where, _, name = str(stated.get("mechanism")).rpartition(":")
    wanted = stated.get("sha256")
    if not where.endswith(".py"):
        return topology(stated.get("mechanism"), Path())
    others = list(files)
    for path in (Path(where), *others):
        if path.is_file() and _hash(path.read_bytes()) == wanted:
            return topology(f"{path.absolute()}:{name}", Path())
    state = "has changed since" if Path(where).is_file() else "is not there any more"
    looked = f", and none of {len(others)} other files is it" if others else ""
    wanted_back = "bring back the file as it was, or name it: --mechanism FILE"
    raise BadInput(f"the robot was defined by {where}, which {state}{looked}; {wanted_back}")


def file_of(stated: object, folder: Path) -> Path | None:
    """The Python file of a mechanism that a robot file names as FILE.py:CLASS; None for one that is named otherwise.
    folder: where the robot file is."""
    where, _, _name = stated.rpartition(":") if isinstance(stated, str) else ("", "", "")
    return folder / where if where.endswith(".py") else None


def _known() -> str:
    installed = sorted({found.name for found in entry_points(group=GROUP)})
    names = ", ".join([*TOPOLOGIES, *installed])
    return f"known are {names}; or name a class of yours, such as prr3.py:Prr3"


def _class_of(stated: str, folder: Path) -> Any:
    where, _, name = stated.rpartition(":")
    file = file_of(stated, folder)
    module = _file_module(stated, file) if file is not None else _module(stated, where)
    if not hasattr(module, name):
        own = [n for n, c in vars(module).items() if inspect.isclass(c) and c.__module__ == module.__name__]
        raise BadInput(f"mechanism '{stated}': there is no class '{name}' in it; it has {', '.join(own) or 'none'}")
    return getattr(module, name)


def _module(stated: str, name: str) -> ModuleType:
    try:
        return importlib.import_module(name)
    except Exception as error:  # a module of the user may raise anything when it is loaded
        raise _unusable(stated, f"module {name}", error) from None


def _file_module(stated: str, path: Path) -> ModuleType:
    try:
        source = path.read_bytes()
    except OSError as error:
        raise BadInput(f"mechanism '{stated}': {path}: {error.strerror}; the path starts at the robot file") from None
    name = _FILE_MODULE + _hash(source)
    if name in sys.modules and sys.modules[name].__file__ == str(path.resolve()):
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, path.resolve())
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look themselves up there
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # a file of the user may raise anything when it is loaded
        del sys.modules[name]
        raise _unusable(stated, str(path), error) from None
    return module


def _checked(stated: str, cls: Any) -> Topology:
    where = f"mechanism '{stated}'"
    if not (inspect.isclass(cls) and issubclass(cls, Mechanism)):
        raise BadInput(
            f"{where}: {getattr(cls, '__name__', cls)!s} is no class derived from irsbot_kinematics.Mechanism"
        )
    if missing := sorted(cls.__abstractmethods__):
        raise BadInput(f"{where}: {cls.__name__} lacks the methods {', '.join(missing)}")
    kind = getattr(cls, "kind", None)
    if not isinstance(kind, str) or (kind in TOPOLOGIES and TOPOLOGIES[kind].mechanism is not cls):
        raise BadInput(f"{where}: {cls.__name__}.kind is {kind!r}; it must be a name of its own, such as 'prr3'")
    try:
        geometry = typing.get_type_hints(cls).get("geometry")
    except Exception as error:  # a name in an annotation that does not exist
        raise _unusable(stated, "its annotations", error) from None
    if not (inspect.isclass(geometry) and is_dataclass(geometry)):
        raise BadInput(f"{where}: {cls.__name__} must annotate the dataclass of its lengths: 'geometry: Prr3Geometry'")
    return Topology(geometry, cls)


def built(found: Topology, geometry: Mapping[str, Any]) -> Mechanism:
    """The mechanism of these lengths, complete. Raises InvalidGeometry, and BadInput for an incomplete mechanism."""
    name = found.mechanism.__name__
    try:
        mechanism: Mechanism = found.mechanism(found.geometry(**geometry))  # type: ignore[call-arg]
    except KinematicsError:
        raise
    except Exception as error:
        raise _unusable(name, "with this geometry it", error) from None
    for attribute in ("geometry", "joints", "task", "length_m", "working_modes", "assembly_modes"):
        if not hasattr(mechanism, attribute):
            raise BadInput(f"mechanism '{name}': __init__ must set {attribute}")
    if not len(mechanism.joints) == len(mechanism.task) in (2, 3, 4):
        have = f"{len(mechanism.joints)} joints and {len(mechanism.task)} task coordinates"
        raise BadInput(f"mechanism '{name}' has {have}; it must have as many of one as of the other, 2 to 4")
    if not mechanism.length_m > 0.0:
        raise BadInput(f"mechanism '{name}': length_m is {mechanism.length_m}, it must be positive")
    for modes, usual in (("working_modes", "usual_working_mode"), ("assembly_modes", "usual_assembly_mode")):
        if getattr(mechanism, usual, None) not in getattr(mechanism, modes):
            known = getattr(mechanism, modes)
            raise BadInput(f"mechanism '{name}': {usual} is {getattr(mechanism, usual, None)}, not one of {known}")
    return mechanism


def set_usual_modes(mechanism: Mechanism, working_mode: Any, assembly_mode: Any, where: str) -> None:
    """Make other modes the usual ones of a new mechanism. working_mode: signs as a list or tuple. where: what the
    message begins with. Raises BadInput for a mode that the mechanism does not have."""
    signs = tuple(working_mode) if isinstance(working_mode, (list, tuple)) else working_mode
    mechanism.usual_working_mode = arguments.one_of(signs, mechanism.working_modes, f"{where}working_mode")
    mechanism.usual_assembly_mode = arguments.one_of(assembly_mode, mechanism.assembly_modes, f"{where}assembly_mode")


def _unusable(stated: str, what: str, error: Exception) -> BadInput:
    line = f", line {error.lineno}" if isinstance(error, SyntaxError) else ""
    words = " ".join(str(error.msg if isinstance(error, SyntaxError) else error).split())
    return BadInput(f"mechanism '{stated}': {what} cannot be used: {type(error).__name__}: {words}{line}")


def _hash(source: bytes) -> str:
    return hashlib.sha256(source).hexdigest()
