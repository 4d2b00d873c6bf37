"""The core imports without ROS, nothing depends on itself, and no folder depends on one above it."""

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
    # package: folders and modules that are importable without ROS; "" is all of it
    "irsbot_kinematics": ("",),
    "irsbot_msgs_py": (
        "records",
        "stamps",
        "errors",
        "cdr",
        "cdr_codec",
        "cdr_layout",
        "cdr_places",
        "health",
        "summary",
    ),
    "irsbot_supervisor": ("core", "configuration", "trajectory", "gate", "bag", "replay", "sim"),
}
SHELLS = ("nodes",)
LAYERS = (
    # folders of irsbot_supervisor from the lowest to the highest; those of one line do not know one another
    ("core",),
    ("trajectory", "configuration", "bag"),
    ("gate",),
    ("processes", "replay"),
    ("sim", "plots", "report"),
    ("live", "fleet"),
    ("nodes",),
    ("validation",),
    ("cli",),
)
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
    assert "irsbot_supervisor.core.supervisor" in names
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


def imported(file: Path, name: str) -> set[str]:
    """Absolute names of modules that a file imports anywhere: also in functions and for type checkers."""
    package = name if file.name == "__init__.py" else name.rpartition(".")[0]
    found: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            source = ".".join([*base, *([node.module] if node.module else [])])
            found |= {source, *(f"{source}.{alias.name}" for alias in node.names)}
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
            uses |= {module.split(".")[0] for module in imported(file, name)}
        uses = (uses & ours) - {package}
        assert uses <= declared(package), f"{package}: package.xml does not name {uses - declared(package)}"
        graph[package] = uses | (declared(package) & ours)
    order = list(TopologicalSorter(graph).static_order())  # raises CycleError
    assert order[0] == "irsbot_msgs"
    assert "irsbot_kinematics" not in graph["irsbot_msgs_py"], "messages never import kinematics"


@pytest.mark.parametrize("package", PACKAGES)
def test_no_module_depends_on_itself_whenever_it_imports(package):
    files = modules(package)
    graph = {}
    for name, file in files.items():
        needs = (imported(file, name) & set(files)) - {name}
        # A package imports its members, which may name the package: it is there already, and empty.
        needs = {need for need in needs if not name.startswith(f"{need}.")}
        graph[name] = needs
    assert len(list(TopologicalSorter(graph).static_order())) >= len(files)


def test_no_folder_of_the_supervisor_depends_on_one_above_or_beside_it():
    package = "irsbot_supervisor"
    height = {folder: level for level, folders in enumerate(LAYERS) for folder in folders}
    files = modules(package)
    seen = set()
    wrong = []
    for name, file in files.items():
        folder = name.split(".")[1] if name.count(".") > 1 else ""
        if folder not in height:
            continue
        seen.add(folder)
        for need in imported(file, name) & set(files):
            other = need.split(".")[1] if need.count(".") else ""
            if other != folder and other in height and height[other] >= height[folder]:
                wrong.append(f"{name} imports {need}")
    assert seen == set(height), "a folder is missing"
    assert sorted(wrong) == []


def test_every_folder_of_the_supervisor_has_its_layer():
    root = SRC / "irsbot_supervisor" / "irsbot_supervisor"
    folders = {file.parent.name for file in root.glob("*/__init__.py")}
    assert folders == {folder for folders in LAYERS for folder in folders}
