"""The mechanism of the documentation, from the shell: checked, and caught where it is wrong."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from command import IRSBOT

import irsbot_kinematics as irs
from irsbot_kinematics import own_mechanism as own
from irsbot_kinematics.analysis.workspace_maps import Box, workspace_map
from irsbot_kinematics.conformance import LAWS

EXAMPLES = Path(__file__).parents[1] / "docs" / "examples"
EXAMPLE = EXAMPLES / "prr3"
STRUTS = EXAMPLES / "rpr3_own" / "rpr3_own.yaml"
CHECK = [*IRSBOT, "check-mechanism"]


def check(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*CHECK, *arguments], capture_output=True, text=True, timeout=120)


def test_the_mechanism_of_the_documentation_keeps_every_law() -> None:
    done = check(str(EXAMPLE / "prr3.yaml"), "--joints", "30")
    assert done.returncode == 0, done.stderr
    assert f"prr3 keeps all {len(LAWS) + 1} laws" in done.stdout
    stated = json.loads(check(str(EXAMPLE / "prr3.yaml"), "--json", "--joints", "30").stdout)
    assert stated["holds"]
    assert {law["law"] for law in stated["laws"]} == {"postures", *[entry.name for entry in LAWS]}
    assert all(law["tried"] > 0 and law["worst"] <= law["allowed"] for law in stated["laws"])


def test_one_law_may_be_checked_alone() -> None:
    done = check(str(EXAMPLE / "prr3.yaml"), "--only", "inverse rates", "--joints", "30")
    assert done.returncode == 0, done.stderr
    assert "prr3 keeps inverse rates" in done.stdout
    assert "inverse closes" not in done.stdout
    refused = check(str(EXAMPLE / "prr3.yaml"), "--only", "inverse rate")
    assert refused.returncode == 2
    assert "no law 'inverse rate'; there are inverse closes," in refused.stderr


def test_the_example_with_struts_keeps_every_law() -> None:
    stated = json.loads(check(str(STRUTS), "--json", "--joints", "30").stdout)
    assert stated["holds"], [law for law in stated["laws"] if law["broken"]]
    assert all(law["tried"] > 1 for law in stated["laws"] if law["law"].endswith("declared"))


def test_the_example_with_struts_is_the_shipped_robot_with_struts() -> None:
    """Written anew: the same poses and margins, in every assembly mode."""
    g = irs.load_robot(STRUTS).mechanism.geometry
    points = {name: getattr(g, name) for name in ("a1", "a2", "a3", "b1", "b2", "b3")}
    robot, shipped = irs.load_robot(STRUTS), irs.make_robot("rpr3", limits=g.stroke, **points)
    assert robot.mechanism.working_modes == shipped.mechanism.working_modes == ((-1, -1, -1),)
    lengths = np.random.default_rng(4).uniform(*g.stroke, (300, 3))
    for label in robot.mechanism.assembly_modes:
        mine, theirs = robot.evaluate_many(lengths, label), shipped.evaluate_many(lengths, label)
        assert (mine.status == theirs.status).all()
        assert abs(label) > 1 or (mine.status == irs.Status.SOLVED).sum() > 20
        np.testing.assert_allclose(mine.pose, theirs.pose, atol=1e-9)
        np.testing.assert_allclose(mine.type2_margin, theirs.type2_margin, atol=1e-9)
        np.testing.assert_allclose(mine.limb_margin, theirs.limb_margin, atol=1e-9)


def test_a_map_of_struts_ends_where_a_stroke_ends() -> None:
    """Distances of the joints of every strut, by hand: the margins of its legs do not depend on the joints."""
    mechanism = irs.load_robot(STRUTS).mechanism
    g, c, s = mechanism.geometry, np.cos(0.2), np.sin(0.2)
    found = workspace_map(mechanism, (-1, -1, -1), Box((0.0, 0.8), (0.0, 0.7), (0.2,)), (81, 71))
    x, y = np.meshgrid(found.first, found.second)
    ends = [(g.a1, g.b1), (g.a2, g.b2), (g.a3, g.b3)]
    far = [np.hypot(x + c * bx - s * by - ax, y + s * bx + c * by - ay) for (ax, ay), (bx, by) in ends]
    inside = np.logical_and.reduce([(g.stroke[0] <= r) & (r <= g.stroke[1]) for r in far])
    assert 0 < inside.sum() < inside.size
    for part in (found.type1, found.type2, found.limb, found.assembly):
        assert (np.isfinite(part) == inside).all()


def test_the_closing_polynomial_vanishes_where_three_legs_meet_and_its_roots_are_the_turns() -> None:
    """Lengths are measured at random poses, so every pose is a root, and one of the meeting points of its turn."""
    rng = np.random.default_rng(8)
    base, platform = rng.uniform(-0.5, 0.5, (2, 3, 2))

    def ends(c, s):
        pairs = zip(platform.tolist(), base.tolist(), strict=True)
        return [(c * bx - s * by - ax, s * bx + c * by - ay) for (bx, by), (ax, ay) in pairs]

    for x, y, phi in rng.uniform(-0.4, 0.4, (20, 3)).tolist():
        lengths = [float(np.hypot(x + u, y + v)) for u, v in ends(np.cos(phi), np.sin(phi))]
        values = own.planar_closing(ends(np.cos(own.SAMPLED_TURNS), np.sin(own.SAMPLED_TURNS)), lengths)
        turns, unreal = own.trigonometric_roots(values[None])
        nearest = int(np.abs(turns[0] - phi).argmin())
        assert abs(turns[0, nearest] - phi) < 1e-6
        assert unreal[0, nearest] < 1e-4
        exact = np.array([[phi]])
        found = own.planar_meetings(ends(np.cos(exact), np.sin(exact)), lengths, exact)
        assert np.hypot(found[0] - x, found[1] - y).min() < 1e-9


WRONG = {
    "sign of a screw": ("screws.append((rx, ry, ax * ry - ay * rx))", "screws.append((rx, -ry, ax * ry - ay * rx))"),
    "sign of a lever": (
        "normalised_levers.append(-(rx * ux + ry * uy))",
        "normalised_levers.append(rx * ux + ry * uy)",
    ),
    "small radius": ("self.radius = self.diameter", "self.radius = 0.3 * g.b\n        self.diameter"),
    "small span": ("self.radius = self.diameter =", "self.diameter = 0.1 * g.b\n        self.radius ="),
    "slow rods": ("max([1.0 / (l", "max([0.1 / (l"),
    "optimistic bound": ("drives = [abs(lever) * t + ends", "drives = [0.1 * abs(lever) * t + ends"),
}
LAW = {
    "sign of a screw": "Jacobian by pose",
    "sign of a lever": "Jacobian by joints",
    "small radius": "sizes are as declared",
    "small span": "sizes are as declared",
    "slow rods": "turn rate is as declared",
    "optimistic bound": "guarantee is kept",
}


@pytest.mark.parametrize("what", WRONG)
def test_a_mechanism_that_is_wrong_is_caught_with_law_posture_and_numbers(what: str, tmp_path: Path) -> None:
    right, wrong = WRONG[what]
    source = (EXAMPLE / "prr3.py").read_text()
    assert source.count(right) == 1
    (tmp_path / "prr3.py").write_text(source.replace(right, wrong))
    (tmp_path / "prr3.yaml").write_text((EXAMPLE / "prr3.yaml").read_text())
    done = check(str(tmp_path / "prr3.yaml"), "--joints", "30")
    assert done.returncode == 1, done.stdout
    (line,) = [line for line in done.stderr.splitlines() if line.startswith(LAW[what] + " (")]
    assert "joints (" in line
    assert "error" in line
    assert "allowed" in line
    assert f"laws: {LAW[what]}" in done.stderr or f", {LAW[what]}" in done.stderr
    assert "Traceback" not in done.stderr


def test_an_error_of_the_mechanism_is_reported_with_its_line(tmp_path: Path) -> None:
    lines = (EXAMPLE / "prr3.py").read_text().splitlines()
    number = next(k for k, line in enumerate(lines, 1) if "screws.append(" in line)
    lines[number - 1] = lines[number - 1].replace("screws.append(", "screw.append(")
    (tmp_path / "prr3.py").write_text("\n".join(lines))
    (tmp_path / "prr3.yaml").write_text((EXAMPLE / "prr3.yaml").read_text())
    done = check(str(tmp_path / "prr3.yaml"), "--joints", "30")
    assert done.returncode == 1
    assert f"NameError: name 'screw' is not defined (prr3.py, line {number})" in " ".join(done.stderr.split())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nothing"], "no robot 'nothing'"),
        ([str(EXAMPLE / "prr3.py")], "give the YAML file of a robot"),
        ([str(EXAMPLE / "prr3.yaml"), "--joints", "0"], "--joints is 0, must be in 1..100000"),
    ],
)
def test_bad_use_is_refused_in_one_line(arguments: list[str], words: str) -> None:
    done = check(*arguments)
    assert done.returncode == 2, done
    assert words in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
