"""What the packages say of themselves: dependencies as they are imported, tests that colcon finds, entry points."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
import setuptools

from irsbot_supervisor.processes.suite import free_domain

SRC = Path(__file__).parents[1] / "ros2_ws" / "src"
PACKAGES = ("irsbot_kinematics", "irsbot_msgs_py", "irsbot_supervisor")

KEYS = {
    "contourpy": "python3-matplotlib",  # which draws contours by it
    "jinja2": "python3-jinja2",
    "matplotlib": "python3-matplotlib",
    "numpy": "python3-numpy",
    "psutil": "python3-psutil",
    "rich": "python3-rich",
    "scipy": "python3-scipy",
    "typer": "python3-typer",
    "yaml": "python3-yaml",
}
"""Module -> rosdep key of an Ubuntu 24.04 package. ROS packages are their own keys."""

KNOWN_KEYS = {*KEYS.values(), "python3-pytest", "python3-hypothesis", "python3-sympy"}
"""Keys of libraries that were looked up in rosdistro: a package of Ubuntu is not always a key of the same name."""

DISTRIBUTIONS = {"foxglove": "foxglove-sdk", "pinocchio": "pin"}
"""Module -> name at pip, where they differ."""

WITHOUT_KEY = {"mcap", "lz4", "zstandard", "plotly", "polars", "rosbags", "websockets", "orjson", "foxglove"}
WITHOUT_KEY |= {"dask", "distributed", "tornado", "pinocchio"}
"""Not packaged by Ubuntu 24.04 under a key that needs no pip; who needs one is told so in a sentence."""

PAGES = [SRC.parents[1] / page for page in ("README.md", "docs/how_to/ros2_machine.md")]
"""Pages that say how to install on a ROS 2 machine."""


def imported(package: str) -> set[str]:
    """Modules from elsewhere, top level names."""
    root = SRC / package
    found = set()
    for file in [*(root / package).rglob("*.py"), *(root / "launch").glob("*.py")]:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
                found.add(node.module.split(".")[0])
    return found - set(sys.stdlib_module_names) - {package, "__future__"}


def declared(package: str) -> set[str]:
    root = ElementTree.parse(SRC / package / "package.xml").getroot()
    return {entry.text or "" for entry in root if entry.tag in ("depend", "exec_depend")}


def said_to_setup(package: str, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    stated: dict[str, Any] = {}
    monkeypatch.setattr(setuptools, "setup", stated.update)
    monkeypatch.chdir(SRC / package)
    exec((SRC / package / "setup.py").read_text(encoding="utf-8"), {"__name__": "__main__"})
    return stated


@pytest.mark.parametrize("package", PACKAGES)
def test_every_import_is_declared_and_every_declared_library_imported(package: str) -> None:
    used = {KEYS.get(module, module) for module in imported(package) - WITHOUT_KEY}
    assert used - declared(package) == set()
    # The types of messages may be needed at run time without being imported.
    assert {key for key in declared(package) - used if not key.endswith(("_msgs", "_interfaces"))} == set()


@pytest.mark.parametrize("package", PACKAGES)
def test_no_key_needs_pip(package: str) -> None:
    assert [key for key in declared(package) if key.endswith("-pip")] == []


@pytest.mark.parametrize("package", [*PACKAGES, "irsbot_msgs"])
def test_rosdep_knows_every_library(package: str) -> None:
    """rosdep installs nothing if it does not know one of the keys, also of those for tests."""
    root = ElementTree.parse(SRC / package / "package.xml").getroot()
    keys = {entry.text or "" for entry in root if entry.tag.endswith("depend")}
    assert {key for key in keys if key.startswith("python3-")} - KNOWN_KEYS == set()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_page_installs_every_library_that_rosdep_cannot(page: Path) -> None:
    (line,) = [line for line in page.read_text(encoding="utf-8").splitlines() if "pip install mcap" in line]
    needed = WITHOUT_KEY - {"dask", "tornado"}  # which distributed brings
    assert set(re.findall(r"[\w-]+", line)) >= {DISTRIBUTIONS.get(module, module) for module in needed}


@pytest.mark.parametrize("package", [package for package in PACKAGES if package != "irsbot_msgs_py"])
def test_executables_run_in_the_python_of_an_active_environment(package: str, tmp_path: Path) -> None:
    """colcon of Ubuntu runs in /usr/bin/python3, which does not see the libraries of a venv."""
    command = [sys.executable, "setup.py", "-q", "egg_info", "--egg-base", str(tmp_path)]
    command += ["install_scripts", "--install-dir", str(tmp_path / "scripts")]
    done = subprocess.run(command, cwd=SRC / package, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    scripts = [*(tmp_path / "scripts").iterdir()]
    assert {file.read_text().splitlines()[0] for file in scripts} == {"#!/usr/bin/env python3"}


@pytest.mark.parametrize("package", PACKAGES)
def test_colcon_finds_the_tests_of_every_package(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    colcon = pytest.importorskip("colcon_core.task.python.test.pytest", reason="needs colcon")
    stated = said_to_setup(package, monkeypatch)
    assert colcon.PytestPythonTestingStep().match(None, {}, stated)
    assert list((SRC / package / "test").glob("test_*.py"))


@pytest.mark.parametrize("package", PACKAGES)
def test_every_executable_exists_and_names_its_module(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for script in _scripts(said_to_setup(package, monkeypatch)):
        module, function = script.split("=")[1].strip().split(":")
        started: list[str] = []
        monkeypatch.setattr("irsbot_msgs_py.process.start.start", started.append)
        monkeypatch.delitem(sys.modules, module, raising=False)
        getattr(import_module(module), function)()
        (runs,) = started
        file = SRC / runs.split(".")[0] / f"{runs.replace('.', '/')}.py"
        assert "def main()" in file.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What an installation without links holds of the three packages."""
    folder = tmp_path_factory.mktemp("installed")
    for package in PACKAGES:
        scratch = folder / "build" / package
        command = [sys.executable, "setup.py", "-q", "build", "--build-base", str(scratch)]
        command += ["build_py", "--build-lib", str(folder / "lib"), "egg_info", "--egg-base", str(scratch.parent)]
        scratch.mkdir(parents=True)
        done = subprocess.run(command, cwd=SRC / package, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr
    return folder / "lib"


@pytest.mark.parametrize("package", PACKAGES)
def test_an_installed_copy_holds_every_file_of_its_package(package: str, installed: Path) -> None:
    def files(root: Path) -> set[Path]:
        """Without byte code, which others may be writing."""
        every = {path.relative_to(root) for path in root.rglob("*") if path.is_file()}
        return {path for path in every if "__pycache__" not in path.parts}

    assert files(installed / package) == files(SRC / package / package)


ASK = """
import irsbot_supervisor, irsbot_kinematics
from irsbot_kinematics.stiffness import presets
from irsbot_msgs_py.process.fastdds import LOCALHOST, NETWORK
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.sim.scenario_file import scenario_names
from pathlib import Path
assert all(Path(file).is_file() for file in (LOCALHOST, NETWORK))
assert irsbot_supervisor.__file__.startswith({folder!r}), irsbot_supervisor.__file__
for robot in irsbot_kinematics.robots():
    read_settings(robot)
print(len(irsbot_kinematics.robots()), len(scenario_names()), len(presets()))
"""


def test_an_installed_copy_finds_robots_settings_scenarios_and_profiles(installed: Path) -> None:
    done = _python(installed, ["-c", ASK.format(folder=str(installed))])
    assert done.returncode == 0, done.stderr
    assert all(int(count) > 0 for count in done.stdout.split())


@pytest.mark.ros
def test_the_nodes_of_an_installed_copy_start(installed: Path) -> None:
    pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")
    for module in ("irsbot_supervisor.nodes.supervisor", "irsbot_kinematics.nodes.kinematics"):
        done = _python(installed, ["-m", module, "--ros-args", "-p", "robot:=nonsense"])
        assert (done.returncode, "Traceback" in done.stderr) == (2, False), done.stderr
        assert "nonsense" in done.stderr


def _python(installed: Path, arguments: list[str]) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(installed), *filter(None, [os.environ.get("PYTHONPATH")])])
    command = [sys.executable, *arguments]
    env = {**os.environ, "PYTHONPATH": path, "ROS_DOMAIN_ID": str(free_domain())}
    return subprocess.run(command, cwd=installed, env=env, capture_output=True, text=True, timeout=120)


def _scripts(stated: dict[str, Any]) -> Iterator[str]:
    yield from stated.get("entry_points", {}).get("console_scripts", ())


def test_the_dependencies_of_a_sourced_machine_are_used() -> None:
    sys.path.insert(0, str(Path(__file__).parents[1] / "setup"))
    try:
        needed = import_module("problems").MODULES
    finally:
        sys.path.pop(0)
    used = set().union(*map(imported, PACKAGES))
    assert set(needed) - used == set()
