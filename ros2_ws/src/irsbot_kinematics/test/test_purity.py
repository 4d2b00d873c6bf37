"""The core imports without ROS, and nothing depends on itself: packages on packages, modules on modules."""

from __future__ import annotations

import ast
import json
import os
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

SRC = Path(__file__).parents[2]
PACKAGES = ("irsbot_kinematics", "irsbot_msgs_py", "irsbot_supervisor")
PURE = {
    # package: modules and subpackages that are importable without ROS; "" is all of it
    "irsbot_kinematics": ("",),
    "irsbot_msgs_py": ("records", "stamps", "cdr", "health"),
    "irsbot_supervisor": ("core", "sim", "tape", "replay", "columns", "settings_file", "mcap_reader", "mcap_writer"),
}
SHELLS = ("nodes",)
ROS_NAMES = {"ament_index_python", "launch", "launch_ros", "irsbot_msgs"}

pytestmark = pytest.mark.skipif(
    not (SRC / "irsbot_msgs").is_dir(), reason="installed without the source tree beside it"
)


def modules(package: str) -> dict[str, Path]:
    root = SRC / package / package
    found = {}
    for file in root.rglob("*.py"):
        parts = (package, *file.relative_to(root).with_suffix("").parts)
        found[".".join(part for part in parts if part != "__init__")] = file
    return found


def is_pure(name: str) -> bool:
    package, *inner = name.split(".")
    if SHELLS[0] in inner:
        return False
    return any(not wanted or inner[:1] == [wanted] for wanted in PURE[package])


def is_ros(name: str) -> bool:
    root = name.split(".")[0]
    return root in ROS_NAMES or root.endswith("_msgs") or root.startswith(("rcl", "rmw", "rosidl", "rpyutils"))


def pure_modules() -> list[str]:
    return sorted(name for package in PACKAGES for name in modules(package) if is_pure(name))


def test_the_list_of_pure_modules_is_not_empty_by_mistake():
    names = pure_modules()
    assert len(names) > 30
    assert {"irsbot_kinematics.robot", "irsbot_kinematics.design.check", "irsbot_msgs_py.records"} <= set(names)
    assert "irsbot_supervisor.core.pipeline" in names
    assert not any(".nodes" in name for name in names)


def test_every_pure_module_imports_in_a_fresh_interpreter_without_ros():
    code = (
        "import importlib, json, sys\n"
        "before = set(sys.modules)\n"
        "for name in json.loads(sys.argv[1]): importlib.import_module(name)\n"
        "print(json.dumps(sorted(set(sys.modules) - before)))\n"
    )
    path = os.pathsep.join(str(SRC / package) for package in PACKAGES)
    environment = {**os.environ, "PYTHONPATH": path}
    done = subprocess.run(
        [sys.executable, "-c", code, json.dumps(pure_modules())], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    loaded = json.loads(done.stdout)
    assert "irsbot_kinematics.robot" in loaded
    assert [name for name in loaded if is_ros(name)] == []


def test_the_test_would_notice_ros():
    assert is_ros("rclpy.node")
    assert is_ros("sensor_msgs.msg")
    assert is_ros("irsbot_msgs.msg")
    assert not is_ros("irsbot_msgs_py.records")


def imported(file: Path, name: str, *, at_import: bool) -> set[str]:
    """Absolute names of modules that a file imports; at_import: only what runs when the file is imported."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    package = name if file.name == "__init__.py" else name.rpartition(".")[0]
    found: set[str] = set()
    nodes = _executed(tree.body) if at_import else list(ast.walk(tree))
    for node in nodes:
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            source = ".".join([*base, *([node.module] if node.module else [])])
            found |= {source, *(f"{source}.{alias.name}" for alias in node.names)}
    return found


def _executed(body: list[ast.stmt]) -> list[ast.stmt]:
    """Statements that run on import: not those in functions, nor those for type checkers."""
    found: list[ast.stmt] = []
    for node in body:
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            continue
        found.append(node)
        for part in ("body", "orelse", "finalbody"):
            if not isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                found += _executed(getattr(node, part, []))
    return found


def declared(package: str) -> set[str]:
    root = ElementTree.parse(SRC / package / "package.xml").getroot()
    return {entry.text or "" for entry in root if entry.tag.endswith("depend")}


def test_packages_declare_what_they_import_of_one_another_and_form_no_cycle():
    ours = {*PACKAGES, "irsbot_msgs"}
    graph: dict[str, set[str]] = {"irsbot_msgs": declared("irsbot_msgs") & ours}
    for package in PACKAGES:
        uses: set[str] = set()
        for name, file in modules(package).items():
            uses |= {module.split(".")[0] for module in imported(file, name, at_import=False)}
        uses = (uses & ours) - {package}
        assert uses <= declared(package), f"{package}: package.xml does not name {uses - declared(package)}"
        graph[package] = uses | (declared(package) & ours)
    order = list(TopologicalSorter(graph).static_order())  # raises CycleError
    assert order[0] == "irsbot_msgs"
    assert "irsbot_kinematics" not in graph["irsbot_msgs_py"], "messages never import kinematics"


@pytest.mark.parametrize("package", PACKAGES)
def test_no_module_needs_itself_to_be_imported(package):
    files = modules(package)
    graph = {}
    for name, file in files.items():
        needs = (imported(file, name, at_import=True) & set(files)) - {name}
        # A package imports its members, which may name the package: it is there already, and empty.
        needs = {need for need in needs if not name.startswith(f"{need}.")}
        graph[name] = needs
    assert len(list(TopologicalSorter(graph).static_order())) >= len(files)
