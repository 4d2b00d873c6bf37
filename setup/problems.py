"""Things that can be missing on a machine, each with one sentence and its remedy."""

from __future__ import annotations

import os
import platform
import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

NEEDED_BYTES = 2_500_000_000  # 1.2 GB of environment and workspace, 0.5 GB of downloads, and room to work

NETWORK = (
    "the package index cannot be reached: connect this machine to the network, or name a proxy (HTTPS_PROXY) or a "
    "reachable index (PIP_INDEX_URL), and run the same command again"
)
SYMPTOMS = {
    r"No space left on device|Disk quota exceeded": "the disk is full (also look at /tmp and ~/.cache): free some "
    f"space, {NEEDED_BYTES / 1e9:.1f} GB are needed in all, and run the same command again",
    r"NewConnectionError|NameResolutionError|Temporary failure in name resolution|ConnectTimeout|Read timed out"
    r"|ReadTimeout|ConnectionResetError|Connection broken|IncompleteRead|Network is unreachable|Max retries exceeded"
    r"|ProxyError|SSLError|RemoteDisconnected": NETWORK,
    r"No matching distribution found": "the package index lacks a version that irsbot needs: name a complete index "
    "(PIP_INDEX_URL)",
    r"Permission denied|Read-only file system": "a file cannot be written: the directory of irsbot must be yours and "
    "writable",
    r"Killed signal terminated program|MemoryError": "the memory ran out: close other programs, or add swap, and run "
    "the same command again",
}


class ProblemError(Exception):
    """A problem that the user can solve; its text is the sentence to print."""


def explain(output: str) -> str | None:
    """The sentence for the output of a failed command, None if it is not a known one."""
    return next((sentence for symptom, sentence in SYMPTOMS.items() if re.search(symptom, output)), None)


def need_compilers() -> None:
    """Raise unless a C and a C++ compiler work: the interfaces are generated as C and C++ and compiled."""
    for variable, names, language, header in (
        ("CC", ("cc", "gcc", "clang"), "c", "stdlib.h"),
        ("CXX", ("c++", "g++", "clang++"), "c++", "string"),
    ):
        command = os.environ.get(variable, "").split() or [name for name in names if shutil.which(name)][:1]
        if not command or not _compiles(command, language, header):
            raise ProblemError(
                f"a working {language.upper()} compiler is missing: install one, for instance with "
                "'apt install build-essential'"
            )


def need_own_build(stamp: Path, folders: Sequence[Path]) -> None:
    """Raise if a colcon build of the user is in these folders: nodes may run from it.

    stamp: file that the set-up writes before it builds.
    """
    if not stamp.exists() and any(entry.is_dir() for folder in folders for entry in folder.glob("*")):
        raise ProblemError(
            f"{' and '.join(map(str, folders))} hold a build that ./irsbot did not make: remove both folders, or use "
            "the command of that build, 'ros2 run irsbot_supervisor irsbot'"
        )


def _compiles(command: list[str], language: str, header: str) -> bool:
    with tempfile.TemporaryDirectory() as scratch:
        source = f"#include <{header}>\nint main(void) {{ return 0; }}\n"
        compile_it = [*command, "-x", language, "-", "-o", f"{scratch}/program"]
        try:
            return subprocess.run(compile_it, input=source, text=True, capture_output=True).returncode == 0
        except OSError:
            return False


def need_wheel_platform() -> None:
    """Raise unless the ROS 2 wheels of the index can run here: Linux x86_64, glibc 2.28 or newer."""
    library, version = platform.libc_ver()
    modern = library == "glibc" and tuple(int(part) for part in version.split(".")[:2]) >= (2, 28)
    if platform.system() != "Linux" or platform.machine() != "x86_64" or not modern:
        raise ProblemError(
            f"there are no ROS 2 wheels for this machine ({platform.system()} {platform.machine()}, "
            f"{library or 'no glibc'} {version}): they need Linux x86_64 with glibc 2.28 or newer, elsewhere install "
            "ROS 2 Jazzy and source it first"
        )


def need_space(directory: Path) -> None:
    """Raise unless the disk has room for the whole environment."""
    free = shutil.disk_usage(directory).free
    if free < NEEDED_BYTES:
        raise ProblemError(
            f"the disk that holds {directory} is too full: {free / 1e9:.1f} GB are free and "
            f"{NEEDED_BYTES / 1e9:.1f} GB are needed"
        )


# Python module -> what brings it, for a ROS 2 Jazzy on Ubuntu 24.04.
MODULES = {
    "rclpy": "apt install ros-jazzy-rclpy",
    "sensor_msgs": "apt install ros-jazzy-common-interfaces",
    "numpy": "apt install python3-numpy",
    "scipy": "apt install python3-scipy",
    "yaml": "apt install python3-yaml",
    "typer": "apt install python3-typer",
    "rich": "apt install python3-rich",
    "jinja2": "apt install python3-jinja2",
    "matplotlib": "apt install python3-matplotlib",
    "psutil": "apt install python3-psutil",
    "polars": "pip install polars",
    "mcap": "pip install mcap",
    "rosbags": "pip install rosbags",
}
CHECK_MODULES = {
    "pytest": "apt install python3-pytest",
    "pytest_timeout": "apt install python3-pytest-timeout",
    "xdist": "apt install python3-pytest-xdist",
    "hypothesis": "apt install python3-hypothesis",
    "material": "pip install mkdocs-material",
    "mpmath": "apt install python3-mpmath",
    "ruff": "pip install ruff",
    "mypy": "pip install mypy types-PyYAML",
}


def need_modules(python: str, modules: dict[str, str]) -> None:
    """Raise unless this interpreter, in the present environment, finds all of these modules."""
    find = "import sys, importlib.util as u; print(*(m for m in sys.argv[1:] if u.find_spec(m) is None))"
    found = subprocess.run([python, "-c", find, *modules], capture_output=True, text=True)
    if found.returncode != 0:
        raise ProblemError(f"{python} does not run in the sourced ROS 2 environment: {found.stderr.strip()[-200:]}")
    missing = found.stdout.split()
    if missing:
        remedies = "', '".join(modules[name] for name in missing)
        raise ProblemError(
            f"{python} has no {', '.join(missing)}: install with '{remedies}' (pip in a venv made with "
            "--system-site-packages), or let IRSBOT_ROS=wheels build an environment of its own"
        )


def need_tools(*tools: str) -> None:
    """Raise unless these programs are on the PATH of the sourced ROS 2 environment."""
    missing = [tool for tool in tools if not shutil.which(tool)]
    if missing:
        raise ProblemError(f"{' and '.join(missing)} not found: install with 'apt install ros-dev-tools'")
