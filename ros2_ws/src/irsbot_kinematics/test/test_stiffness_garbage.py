"""Any entry of a design file replaced by any nonsense: a design, or one line of refusal."""

from __future__ import annotations

import copy
import random
import warnings
from importlib import resources

import pytest
import yaml

from irsbot_kinematics import KinematicsError, stiffness

NONSENSE = [None, [], {}, "x", "", 1, -1, True, "nan m", "1e999 m", "-1 m", "1e-300 m", "1e300 m", [1, 2, 3], [[1]]]
NONSENSE += [{"value": None}, {"value": [1]}, 10**400]


def preset(name):
    folder = resources.files("irsbot_kinematics").joinpath("stiffness/presets")
    return yaml.safe_load(folder.joinpath(f"{name}.yaml").read_text(encoding="utf-8"))


CHAIN = {
    "family": "chains",
    "points": {"unit": "m", "A": [0, 0, 0], "P": [1, 0, 0]},
    "platform": "P",
    "sections": {"tube": {"outer": "60 mm", "inner": "50 mm", "material": "aluminium"}},
    "legs": [
        [{"tube": ["A", "P", "tube"]}, {"revolute": ["P", [0, 1, 0]]}, {"parallel": [[{"tube": ["A", "P", "tube"]}]]}]
    ],
}


def places(stated, path=()):
    """Paths of all entries."""
    if path:
        yield path
    for key, value in (
        stated.items() if isinstance(stated, dict) else enumerate(stated) if isinstance(stated, list) else ()
    ):
        yield from places(value, (*path, key))


def replaced(stated, path, value):
    changed = copy.deepcopy(stated)
    at = changed
    for key in path[:-1]:
        at = at[key]
    at[path[-1]] = value
    return changed


FILES = {"irsbot2": preset("irsbot2_table2"), "five_bar": preset("five_bar_table1"), "chains": CHAIN}
SAMPLE = 100
"""Replacements tried per file, of some 800 that there are."""


@pytest.mark.parametrize("kind", FILES)
def test_no_entry_of_a_file_can_cause_a_traceback(tmp_path, kind):
    path, refusals, taken = tmp_path / "garbage.yaml", [], 0
    every = [(place, value) for place in places(FILES[kind]) for value in NONSENSE]
    for place, value in random.Random(8).sample(every, SAMPLE):
        path.write_text(yaml.dump(replaced(FILES[kind], place, value), Dumper=yaml.CSafeDumper))
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                design = stiffness.load(path)
                if isinstance(design, stiffness.ChainStructure):
                    stiffness.deflection(design, (), (0.0, 1.0, 0.0, 0.0, 0.0, 0.0))
                else:
                    stiffness.evaluate_many(design, [(0.0, -0.8), (0.1, -0.7)])
                taken += 1
            except KinematicsError as error:
                refusals.append(str(error))
    assert len(refusals) > taken > 0
    assert not any("\n" in refusal for refusal in refusals)
