"""The short version of tests/campaigns/mutations.py: mutants of which the outcome is known."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).parent / "campaigns" / "mutations.py"
MODULE = "irsbot_kinematics/bounds/displacement.py"
CHANGE = "max(moves / x0, turns / y0) -> min(moves / x0, turns / y0)"


def mutations(*words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(SCRIPT), "--only", MODULE, "--like", CHANGE, "--jobs", "1", *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=240)


def test_a_bound_that_is_too_small_is_found_and_the_tree_stays_as_it_is(tmp_path: Path) -> None:
    source = SCRIPT.parents[2] / "ros2_ws/src/irsbot_kinematics" / MODULE
    before = source.read_bytes()
    done = mutations("--out", str(tmp_path / "results.json"))
    assert done.returncode == 0, done.stdout + done.stderr
    [(name, killer)] = json.loads((tmp_path / "results.json").read_text()).items()
    assert name.endswith(CHANGE)
    assert "test_displacement_inequalities.py::" in killer
    assert source.read_bytes() == before


def test_a_survivor_of_an_earlier_run_is_reported_and_not_tried_again(tmp_path: Path) -> None:
    out = tmp_path / "results.json"
    [name] = mutations("--list", "--out", str(out)).stdout.splitlines()
    out.write_text(json.dumps({name: ""}))
    done = mutations("--out", str(out))
    assert done.returncode == 1, done.stderr
    assert name in done.stdout
    assert "0 of 1 killed" in done.stdout


def test_every_listed_equivalent_mutant_is_found_and_excuses_no_other_line() -> None:
    check = """
import mutations
places = {entry: set() for entry in mutations.equivalent()}
for module in {entry[0] for entry in places}:
    for mutant in filter(mutations.excused, mutations.mutants(module)):
        places[mutations.entry_of(mutant)].add(mutant.line)
for key, entry in mutations.equivalent().items():
    assert len(places[key]) == entry.get("lines", 1), (key, places[key])
    assert entry["reason"], key
"""
    done = subprocess.run([sys.executable, "-c", check], cwd=SCRIPT.parent, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr


def test_every_module_has_mutants_and_tests_that_exist() -> None:
    check = """
import mutations
for folder in mutations.FOLDERS:
    package = folder.split("/")[0]
    for path in sorted((mutations.SRC / package / folder).rglob("*.py")):
        module = str(path.relative_to(mutations.SRC / package))
        if not mutations.mutants(module):
            continue
        files, _keyword = mutations.tests_of(module)
        assert files, module
        for file in files:
            assert (mutations.SRC / file).is_file(), (module, file)
"""
    done = subprocess.run([sys.executable, "-c", check], cwd=SCRIPT.parent, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
