"""Forces as a command: a map against single postures, the table of the paper, reactions of many samples."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from command import irsbot

import irsbot_kinematics as irs


def test_a_map_of_forces_agrees_with_single_postures(tmp_path: Path) -> None:
    target = tmp_path / "f.npz"
    box = ["--box", -0.3, 0.3, -0.95, -0.6]
    words = ["--what", "force", "--load", 100, "--admissible", 125, "--nodes", 7, "-o", target]
    stated = json.loads(irsbot("map", "irsbot2", *words, *box, "--json").out)
    found, robot = np.load(target), irs.make_robot("irsbot2")
    carried = 0
    for row, z in enumerate(found["second"]):
        for column, x in enumerate(found["first"]):
            q = robot.inverse((x, z))
            single = robot.reaction_max((x, z), q, 100.0)
            np.testing.assert_allclose(found["reaction_max"][row, column], single, rtol=1e-12)
            carried += single.max() <= 125.0
    assert 0 < carried < 49, "all or nothing is carried: the fixture proves nothing"
    assert 0.0 < stated["admissible_area_m2"] < 0.6 * 0.35


def test_the_force_workspace_has_the_area_of_the_paper(tmp_path: Path) -> None:
    """[S2], phi = 45 deg, f = 100 N, m = 5 N m, 200 N admissible: 0.16875 m2."""
    turn = float(np.pi / 4)
    words = ["--what", "force", "--load", 100, "--moment", 5, "--admissible", 200, "--at", turn, "--nodes", 21]
    place = ["--centre", f"0,0,{turn}", "--mode", "+++", "--box", -0.3, 0.3, -0.3, 0.3, "-o", tmp_path / "f.png"]
    done = irsbot("map", "rrr3", *words, *place, "--json")
    assert done.code == 0, done.err
    assert json.loads(done.out)["force_workspace_m2"] == pytest.approx(0.16875, rel=2e-3)
    assert (tmp_path / "f.png").stat().st_size > 10_000


def test_reactions_of_many_samples_are_those_of_one(tmp_path: Path) -> None:
    robot = irs.make_robot("irsbot2")
    rows = [robot.inverse((x, -0.8)) for x in (-0.2, 0.0, 0.3)]
    source, target = tmp_path / "j.csv", tmp_path / "m.csv"
    source.write_text("joint_1,joint_2\n" + "".join(f"{a!r},{b!r}\n" for a, b in np.array(rows).tolist()))
    assert irsbot("evaluate", "irsbot2", "--input", source, "--output", target, "--load", 10).code == 0
    found = pl.read_csv(target).select("reaction_max_1", "reaction_max_2").to_numpy()
    for q, forces in zip(rows, found, strict=True):
        np.testing.assert_allclose(forces, robot.evaluate(q, force=10.0).reaction_max, rtol=1e-9)
    assert irsbot("evaluate", "irsbot2", "--input", source, "--output", target, "--force").code == 0
    assert not any(name.startswith("reaction") for name in pl.read_csv(target).columns)


@pytest.mark.parametrize(
    ("words", "stated"),
    [
        (["--what", "force"], "--what force wants --admissible N"),
        (["--what", "force", "--admissible", "-1"], "admissible_n must be a finite number that is not negative"),
        (["--what", "force", "--admissible", "9", "--centre", "0"], "--centre must be 2 numbers"),
        (["--admissible", "9"], "--load, --moment, --admissible and --centre belong to --what force"),
    ],
)
def test_forces_that_make_no_sense_are_refused(words: list[str], stated: str, tmp_path: Path) -> None:
    done = irsbot("map", "irsbot2", *words, "-o", tmp_path / "f.png")
    assert (done.code, done.refusal.removeprefix("irsbot: ")[: len(stated)]) == (2, stated)
