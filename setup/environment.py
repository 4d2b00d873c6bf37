"""The environment variables of irsbot."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

SEARCH_PATHS = ("PATH", "LD_LIBRARY_PATH", "PYTHONPATH", "AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH", "PKG_CONFIG_PATH")
# Said by another ROS 2 or another Python: of no use, or harmful, beside the environment in .venv.
FOREIGN = ("PYTHONPATH", "PYTHONHOME", "AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH", "COLCON_PREFIX_PATH")

NO_BYTE_CODE, BYTE_CODE = "PYTHONDONTWRITEBYTECODE", "PYTHONPYCACHEPREFIX"

SearchPaths = dict[str, list[str]]


def with_wheels(venv: Path, user: Mapping[str, str]) -> dict[str, str]:
    """The environment of the wheels in .venv, without the workspace."""
    env = {name: value for name, value in user.items() if name not in FOREIGN}
    env["VIRTUAL_ENV"] = str(venv)
    env["_ROS_WHEELS_BOOTSTRAP_COMPLETE"] = "1"  # LD_LIBRARY_PATH is set here: no need to start Python a second time
    env["ROS_DISTRO"] = "jazzy"
    env["ROS_VERSION"] = "2"
    env["RMW_IMPLEMENTATION"] = "rmw_fastrtps_cpp"  # the only one among the wheels
    bundled = sorted(str(path) for path in venv.glob("lib/python3.*/site-packages/ros_*.libs"))
    ours = {
        "PATH": [f"{venv}/bin"],
        "LD_LIBRARY_PATH": [f"{venv}/lib", *bundled],
        "AMENT_PREFIX_PATH": [str(venv)],
        "CMAKE_PREFIX_PATH": [str(venv)],
    }
    return prepend(ours, env)


def with_byte_code(env: Mapping[str, str], folder: Path) -> dict[str, str]:
    """The same environment; a Python that must not write beside its modules keeps its byte code in this folder.

    Images of containers say so often. Without byte code, every process compiles all libraries again.
    """
    if not env.get(NO_BYTE_CODE):
        return dict(env)
    allowed = {name: value for name, value in env.items() if name != NO_BYTE_CODE}
    return {BYTE_CODE: str(folder), **allowed}


def prepend(paths: SearchPaths, env: Mapping[str, str]) -> dict[str, str]:
    """The same environment with these directories in front of its search paths, each once."""
    merged = dict(env)
    for name, ours in paths.items():
        theirs = [entry for entry in env.get(name, "").split(os.pathsep) if entry and entry not in ours]
        merged[name] = os.pathsep.join([*ours, *theirs])
    return merged


def without(folders: Sequence[Path], env: Mapping[str, str]) -> dict[str, str]:
    """The same environment without entries of search paths in or below these folders."""
    kept = dict(env)
    for name in {*SEARCH_PATHS, "COLCON_PREFIX_PATH"} & set(env):
        entries = env[name].split(os.pathsep)
        kept[name] = os.pathsep.join(e for e in entries if not any(Path(e).is_relative_to(f) for f in folders))
    return kept


def workspace_paths(install: Path) -> SearchPaths:
    """Additions of the built workspace to each search path.

    Taken from its setup script once, after a build: sourcing takes longer than most commands.
    """
    script = 'source "$1/local_setup.bash" && exec env -0'
    bare = {"PATH": "/usr/local/bin:/usr/bin:/bin", "_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1"}
    command = ["bash", "--noprofile", "--norc", "-c", script, "bash", str(install)]
    output = subprocess.run(command, env=bare, check=True, capture_output=True, text=True).stdout
    sourced = dict(line.split("=", 1) for line in output.split("\0") if "=" in line)
    system = bare["PATH"].split(os.pathsep)
    added = {
        name: [e for e in sourced.get(name, "").split(os.pathsep) if e and e not in system] for name in SEARCH_PATHS
    }
    return {name: entries for name, entries in added.items() if entries}


def save(paths: SearchPaths, file: Path) -> None:
    """Store the additions of the workspace for the next commands."""
    file.write_text(json.dumps(paths, indent=2))


def load(file: Path) -> SearchPaths:
    """Read back what save wrote."""
    paths: SearchPaths = json.loads(file.read_text())
    return paths
