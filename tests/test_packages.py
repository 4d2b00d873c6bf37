"""What the packages say of themselves: dependencies as they are imported, tests that colcon finds, entry points."""

from __future__ import annotations

import ast
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
import setuptools

SRC = Path(__file__).parents[1] / "ros2_ws" / "src"
PACKAGES = ("irsbot_kinematics", "irsbot_msgs_py", "irsbot_supervisor")

KEYS = {
    "contourpy": "python3-matplotlib",  # which draws contours by it
    "matplotlib": "python3-matplotlib",
    "numpy": "python3-numpy",
    "psutil": "python3-psutil",
    "rich": "python3-rich",
    "scipy": "python3-scipy",
    "typer": "python3-typer",
    "yaml": "python3-yaml",
}
"""Module -> rosdep key of an Ubuntu 24.04 package. ROS packages are their own keys."""

WITHOUT_KEY = {"mcap", "lz4", "zstandard", "plotly", "polars", "rosbags"}
"""Not packaged by Ubuntu 24.04 under a key that needs no pip; who needs one is told so in a sentence."""


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
    said: dict[str, Any] = {}
    monkeypatch.setattr(setuptools, "setup", said.update)
    monkeypatch.chdir(SRC / package)
    exec((SRC / package / "setup.py").read_text(encoding="utf-8"), {"__name__": "__main__"})
    return said


@pytest.mark.parametrize("package", PACKAGES)
def test_every_import_is_declared_and_every_declared_library_imported(package: str) -> None:
    used = {KEYS.get(module, module) for module in imported(package) - WITHOUT_KEY}
    assert used - declared(package) == set()
    # The types of messages may be needed at run time without being imported.
    assert {key for key in declared(package) - used if not key.endswith(("_msgs", "_interfaces"))} == set()


@pytest.mark.parametrize("package", PACKAGES)
def test_no_key_needs_pip(package: str) -> None:
    assert [key for key in declared(package) if key.endswith("-pip")] == []


@pytest.mark.parametrize("package", PACKAGES)
def test_colcon_finds_the_tests_of_every_package(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    colcon = pytest.importorskip("colcon_core.task.python.test.pytest", reason="needs colcon")
    said = said_to_setup(package, monkeypatch)
    assert colcon.PytestPythonTestingStep().match(None, {}, said)
    assert list((SRC / package / "test").glob("test_*.py"))


@pytest.mark.parametrize("package", PACKAGES)
def test_every_executable_exists_and_says_which_module_it_runs(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for script in _scripts(said_to_setup(package, monkeypatch)):
        module, function = script.split("=")[1].strip().split(":")
        started: list[str] = []
        monkeypatch.setattr("irsbot_msgs_py.start.start", started.append)
        monkeypatch.delitem(sys.modules, module, raising=False)
        getattr(import_module(module), function)()
        (runs,) = started
        file = SRC / runs.split(".")[0] / f"{runs.replace('.', '/')}.py"
        assert "def main()" in file.read_text(encoding="utf-8")


def _scripts(said: dict[str, Any]) -> Iterator[str]:
    yield from said.get("entry_points", {}).get("console_scripts", ())


def test_what_a_sourced_machine_has_to_have_is_used() -> None:
    sys.path.insert(0, str(Path(__file__).parents[1] / "setup"))
    try:
        needed = import_module("problems").MODULES
    finally:
        sys.path.pop(0)
    used = set().union(*map(imported, PACKAGES))
    assert set(needed) - used == set()
