"""What `help()` and the pages made of docstrings show: every field, and no name that does not exist."""

from __future__ import annotations

import dataclasses
import inspect
import re

import pytest

import irsbot_kinematics as irs
from irsbot_kinematics import mechanism
from irsbot_kinematics.analysis import force_workspace as forces

PUBLIC = [*(getattr(irs, name) for name in irs.__all__), mechanism.Legs, forces.LegPressure, forces.ForceWorkspace]
RECORDS = [cls for cls in PUBLIC if inspect.isclass(cls) and (dataclasses.is_dataclass(cls) or hasattr(cls, "_fields"))]


def fields_of(cls):
    return [f.name for f in dataclasses.fields(cls)] if dataclasses.is_dataclass(cls) else list(cls._fields)


@pytest.mark.parametrize("cls", RECORDS, ids=lambda cls: cls.__name__)
def test_help_of_a_record_names_every_field(cls):
    told = re.findall(r"^\s*(\w+): \S", inspect.getdoc(cls), re.MULTILINE)
    assert told == fields_of(cls)


def test_help_of_a_mechanism_names_its_attributes():
    told = set(re.findall(r"^(\w+): \S", inspect.getdoc(irs.Mechanism), re.MULTILINE))
    assert {
        "kind",
        "geometry",
        "joints",
        "task",
        "length_m",
        "working_modes",
        "assembly_modes",
        "label_is_invariant",
    } <= told
    instance = irs.make_robot("irsbot2").mechanism
    assert all(hasattr(instance, name) for name in told)


def test_every_name_in_the_help_of_a_robot_exists():
    robot = irs.make_robot("irsbot2")
    texts = [
        inspect.getdoc(irs.Robot),
        *(inspect.getdoc(member) for _, member in inspect.getmembers(irs.Robot, callable)),
    ]
    names = {name for text in texts if text for name in re.findall(r"`([\w.]+)`", text)}
    assert names
    for name in names:
        owners = [robot, robot.mechanism, irs, inspect.getmodule(irs.Robot)]
        assert any(_reaches(owner, name) for owner in owners), name


def _reaches(owner, name):
    for part in name.split("."):
        if not hasattr(owner, part):
            return False
        owner = getattr(owner, part)
    return True


@pytest.mark.parametrize(
    ("centre", "mode", "stated"),
    [
        ((0.1, -0.8), "up", "working mode"),
        ((0.1, -0.8), (1, 1, 1), "working mode"),
        ((0.1,), (1, -1), "centre"),
        ("here", (1, -1), "centre must be a sequence"),
        ((0.1, float("nan")), (1, -1), "finite"),
    ],
)
def test_a_force_workspace_of_nonsense_is_refused_in_one_sentence(centre, mode, stated):
    load = forces.Load(10.0, 0.0, 50.0)
    with pytest.raises(irs.BadInput, match=stated):
        forces.force_workspace(irs.make_robot("irsbot2").mechanism, centre, mode, load)
