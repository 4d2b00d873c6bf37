"""`map`: areas that do not depend on the grid, what the picture tells, Type 2 lines of any mechanism."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from command import irsbot
from matplotlib.figure import Figure

import irsbot_kinematics as irs
from irsbot_kinematics.analysis.workspace_maps import Box, type2_crossings, workspace_map

PRR3 = Path(__file__).parents[4] / "docs" / "examples" / "prr3" / "prr3.yaml"


@pytest.mark.parametrize("nodes", [3, 10, 101])
def test_a_box_that_is_reached_as_a_whole_has_its_own_area(nodes: int, tmp_path: Path) -> None:
    words = ["--box", -0.1, 0.1, -0.85, -0.75, "--nodes", nodes, "-o", tmp_path / "m.npz", "--json"]
    stated = json.loads(irsbot("map", "irsbot2", *words).out)
    assert stated["reached_area"] == pytest.approx(0.02, rel=1e-12)


def test_the_values_of_further_coordinates_stand_in_the_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    titles = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_a, **_k: titles.append(figure.axes[0].get_title()))
    box = ["--box", -0.2, 0.2, 0.1, 0.4]
    assert irsbot("map", PRR3, *box, "--at", 0.5, "--nodes", 5, "-o", tmp_path / "m.png").code == 0
    assert irsbot("map", PRR3, "--joints", *box, "--at", 0.25, "--nodes", 5, "-o", tmp_path / "n.png").code == 0
    assert titles[0].endswith("at phi = 0.5 rad")
    assert titles[1].endswith("= 0.25 m")


def test_a_free_rectangle_outside_of_the_box_is_not_shown_as_one_of_it(tmp_path: Path) -> None:
    away = ["map", "irsbot2", "--box", 0.0, 0.3, -0.9, -0.6, "--nodes", 5, "-o", tmp_path / "m.npz"]
    stated = irsbot(*away)
    assert stated.code == 0
    assert "largest free rectangle below the base is not within the box" in stated.out
    assert json.loads(irsbot(*away, "--json", "--force").out)["free_in_box"] is False


def test_type_2_lines_of_any_mechanism_lie_where_its_margin_vanishes(tmp_path: Path) -> None:
    robot = irs.load_robot(PRR3)
    mechanism = robot.mechanism
    box = Box((-0.25, 0.25), (0.1, 0.3), (1.0,))
    points = type2_crossings(workspace_map(mechanism, mechanism.usual_working_mode, box, (100, 100)))
    assert len(points) > 50, "no Type 2 line in the box: the fixture proves nothing"
    steps = 1e-6 * np.eye(3)
    for x, y in points[:: len(points) // 20]:
        pose = np.array([x, y, 1.0])  # where moving the platform some way moves no joint: det dq/dX = 0
        rates = np.array([robot.inverse(pose + step) - robot.inverse(pose - step) for step in steps]) / 2e-6
        assert abs(np.linalg.det(rates)) < 1e-3
    stated = irsbot("map", PRR3, "--box", -0.3, 0.3, 0.1, 0.4, "--at", 1.0, "--nodes", 20, "-o", tmp_path / "m.png")
    assert "Type 2 lines: read off the grid at" in stated.out


@pytest.mark.parametrize(
    ("words", "stated"),
    [
        (["irsbot2", "--box", 5, 6, 5, 6], "reaches none of the 25 nodes"),
        (["orthoglide", "--joints", "--box", 5, 6, 5, 6, "--at", 0.1], "reaches none of the 25 nodes"),
        (["five_bar", "--what", "constraint"], "has no constraint margin"),
        (["five_bar", "--joints", "--what", "limb"], "has no limb margin"),
        (["irsbot2", "--load", 5], "belong to --what force"),
        (["irsbot2", "--moment", 0], "belong to --what force"),
    ],
)
def test_a_map_of_nothing_is_refused(words: list[str], stated: str, tmp_path: Path) -> None:
    told = irsbot("map", *words, "--nodes", 5, "-o", tmp_path / "m.png")
    assert told.code == 2
    assert stated in told.err
    assert list(tmp_path.iterdir()) == []


def test_only_constraint_singularities_within_the_box_are_counted(tmp_path: Path) -> None:
    places = irs.load_robot("irsbot2_csc").mechanism.constraint_points((1, -1))
    assert places, "the fixture proves nothing"
    x, z = np.array(places)[0]
    near = ["--box", x - 0.01, x + 0.01, z - 0.01, z + 0.01]
    apart = ["--box", x + 0.05, x + 0.06, z + 0.05, z + 0.06]
    for box, number in ((near, 1), (apart, 0)):
        words = ["irsbot2_csc", "--mode", "+-", *box, "--nodes", 9, "-o", tmp_path / "m.npz", "--force", "--json"]
        assert len(json.loads(irsbot("map", *words).out)["constraint_points"]) == number


def test_the_axes_of_a_joint_map_have_the_unit_of_the_joints(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    labels = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_a, **_k: labels.append(figure.axes[0].get_xlabel()))
    for name, further in (("irsbot2", ()), ("orthoglide", ("--at", 0.2, "--box", 0.1, 0.3, 0.1, 0.3))):
        assert irsbot("map", name, "--joints", "--nodes", 5, *further, "-o", tmp_path / f"{name}.png").code == 0
    assert [label.split()[-1] for label in labels] == ["[rad]", "[m]"]
