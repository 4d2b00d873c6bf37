"""The work of each step of the set-up.

before: state in which the last set-up left the step (steps.Step.state); only an "outdated" one is reused.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys

import environment
from fingerprint import packages
from place import Place
from progress import CommandError, Progress

ASK_INCLUDES = "import sysconfig, numpy; print(sysconfig.get_paths()['include']); print(numpy.get_include())"


def make_venv(place: Place, progress: Progress, before: str) -> None:
    """An empty environment with the pinned pip and setuptools; the first use of the network."""
    if place.venv.exists():
        shutil.rmtree(place.venv)
    progress.run([place.python, "-E", "-m", "venv", str(place.venv)], cwd=place.root, env=os.environ)
    _pip(place, progress, "--retries", "1", "--constraint", "setup/requirements.txt", "pip", "setuptools")


def install_libraries(place: Place, progress: Progress, before: str) -> None:
    """Install exactly requirements.txt, then correct the exports of the wheels."""
    # No resolving: the list is complete. No isolation: the one source package builds with the pinned setuptools.
    options = ("--no-deps", "--no-build-isolation", "--no-compile")
    _pip(place, progress, *options, "--requirement", "setup/requirements.txt")
    _correct_exports(place)


def build_workspace(place: Place, progress: Progress, before: str) -> None:
    """colcon build with symbolic links, so that edited Python code needs no second build."""
    _remove_stale_builds(place, everything=before != "outdated")
    cmake = ["-DCMAKE_BUILD_TYPE=Release", "-DBUILD_TESTING=OFF", f"-DPython3_EXECUTABLE={place.interpreter}"]
    if not place.sourced:
        cmake += ["-G", "Ninja"]
    command = ["colcon", "build", "--symlink-install", "--event-handlers", "console_direct+", "--cmake-args", *cmake]
    # Without MAKEFLAGS, colcon lets the load of the machine decide, and compiles one by one beside other work.
    env = {"MAKEFLAGS": f"-j{os.cpu_count() or 1}", **place.underlay()}
    progress.run(command, cwd=place.workspace, env=env, activity=colcon_activity)
    environment.save(environment.workspace_paths(place.install), place.paths_file)
    make_machine_code(place, progress)


def make_machine_code(place: Place, progress: Progress) -> None:
    """The bounds as machine code; without it everything runs, slower."""
    command = [place.interpreter, "-m", "irsbot_kinematics.machine_code"]
    try:
        progress.run(command, cwd=place.root, env=place.environment(), activity=machine_code_activity)
    except CommandError:
        print(f"irsbot: no machine code, plain Python runs (details: {place.log})", file=sys.stderr)


def has_machine_code(place: Place) -> bool:
    """True if there is machine code of the present bounds."""
    command = [place.interpreter, "-m", "irsbot_kinematics.machine_code", "--check"]
    env = place.environment()
    return subprocess.run(command, cwd=place.root, env=env, check=False, capture_output=True).returncode == 0


def _pip(place: Place, progress: Progress, *arguments: str) -> None:
    """pip install in .venv; index, proxy and cache are as the user has them configured."""
    redirecting = ("PIP_USER", "PIP_TARGET", "PIP_PREFIX", "PIP_ROOT")
    env = {name: value for name, value in place.underlay().items() if name not in redirecting}
    quietly = ("--disable-pip-version-check", "--no-input", "--progress-bar", "off")
    command = [place.interpreter, "-m", "pip", "install", *quietly, *arguments]
    progress.run(command, cwd=place.root, env=env, activity=pip_activity)


def pip_activity(line: str) -> str:
    """Present activity of pip, from a line of its output; empty if the line does not show it."""
    loading = re.match(r"\s*(Downloading|Using cached) ([^-/\s]+)-\S+(?:\.whl|\.tar\.gz)( \(.*\))?", line)
    if loading:
        doing = "downloading" if loading[1] == "Downloading" else "from the cache:"
        return f"{doing} {loading[2]}{loading[3] or ''}"
    if line.startswith("Installing collected packages"):
        return f"unpacking {line.count(',') + 1} packages"
    return ""


def colcon_activity(line: str) -> str:
    """Present activity of colcon, from a line of its output; empty if the line does not show it."""
    package = re.match(r"Starting >>> (\S+)", line)
    if package:
        return f"building {package[1]}"
    compiled = re.match(r"\[(\d+)/(\d+)\] |\[ *(\d+)%\] ", line)  # ninja, make
    if compiled:
        return f"compiling, {compiled[3]} %" if compiled[3] else f"compiling, {compiled[1]} of {compiled[2]}"
    return ""


def machine_code_activity(line: str) -> str:
    """Present activity of the maker of machine code, from a line of its output; empty if the line does not show it."""
    made = re.match(r"\[(\d+)/(\d+)\] ", line)
    return f"machine code, {made[1]} of {made[2]}" if made else ""


def _correct_exports(place: Place) -> None:
    """Correct the CMake exports of the wheels, which contain include paths of the machine they were built on."""
    ask = [place.interpreter, "-c", ASK_INCLUDES]
    answer = subprocess.run(ask, env=place.underlay(), check=True, capture_output=True, text=True).stdout
    python_include, numpy_include = answer.splitlines()
    for file in place.venv.glob("share/**/*.cmake"):
        theirs = file.read_text()
        ours = re.sub(r"/opt/python/[^;\"]*/numpy/_core/include", numpy_include, theirs)
        ours = re.sub(r"/opt/python/[^;\"/]*/include/python3\.\d+", python_include, ours)
        if ours != theirs:
            file.write_text(ours)


def _remove_stale_builds(place: Place, *, everything: bool) -> None:
    """Remove the build of packages that no longer exist, or of all if it was interrupted or had another base."""
    present = packages(place.workspace / "src")
    for built in (place.build, place.install):
        for package in built.glob("*"):
            if package.is_dir() and (everything or package.name not in present):
                shutil.rmtree(package)
