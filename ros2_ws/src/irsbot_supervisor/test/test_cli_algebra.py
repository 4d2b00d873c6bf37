"""`irsbot algebra` from the shell: numbers, pictures, refusals in one line."""

from __future__ import annotations

import json
import re

import pytest
from typer.testing import CliRunner

pytest.importorskip("flint", reason="python-flint is an optional extra")

from irsbot_kinematics import BadInput
from irsbot_supervisor.cli.app import whole_app
from irsbot_supervisor.cli.common import Failed

OWN = """
equations: ["x^2 + y^2 = r1^2", "(x - d)^2 + y^2 = r2^2"]
pose: [x, y]
joints: [r1, r2]
inequalities: ["r1 > 0", "r2 > 0"]
parameters: {d: "3/2"}
"""


SLICE = ("--fix", "rho1=17", "--box", "rho2=1:2", "--box", "rho3=1:2")


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("IRSBOT_CACHE", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)


def run(*words):
    done = CliRunner().invoke(whole_app(), ["algebra", *words], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.output


def test_cusps_and_configurations_as_json():
    found = json.loads(run("cusps", "3rpr", "--fix", "rho1=17", "--json"))
    assert (found["status"], len(found["cusps"])) == ("certified", 6)
    six = json.loads(
        run("configurations", "3rpr", "--fix", "rho1=14.98", "--fix", "rho2=15.38", "--fix", "rho3=12", "--json")
    )
    assert len(six["configurations"]) == 6
    assert (
        run("configurations", "orthoglide", "--fix", "x=1.3", "--fix", "y=1.1", "--fix", "z=1.2").count("1.300000000")
        == 8
    )


def test_cells_of_a_delta_slice_with_a_picture(tmp_path):
    box = ("--fix", "z=1", "--box", "x=-2:2", "--box", "y=-2:6")
    found = json.loads(run("cells", "orthoglide", *box, "--plot", "cells.png", "--json"))
    assert found["by_count"]["8"]["area"] == pytest.approx(0.42305387, abs=1e-8)
    assert (tmp_path / "cells.png").stat().st_size > 10_000
    assert "0.42305387" in run("cells", "orthoglide", *box)


def test_singular_surfaces_and_curves(tmp_path):
    box = ("--box", "x=-2:2", "--box", "y=-2:6", "--box", "z=-2:6")
    found = json.loads(run("singular", "orthoglide", "--space", "pose", *box, "--plot", "surface.html", "--json"))
    assert (found["generator"]["degree"], found["generator"]["terms"]) == (18, 97)
    assert "isosurface" in (tmp_path / "surface.html").read_text(encoding="utf-8")
    run("singular", "triaglide", "--space", "pose", *box, "--plot", "surface.png")
    run("singular", "rr_rrr", "--space", "pose", "--box", "x=-1.5:1.5", "--box", "z=-1.5:1.5", "--plot", "curve.png")
    assert (tmp_path / "surface.png").stat().st_size > 10_000
    assert (tmp_path / "curve.png").stat().st_size > 10_000


def test_a_loop_shows_the_change_of_the_assembly_mode(tmp_path):
    words = ("--centre=-0.750995,3.180521,-0.321021", "--radius", "0.1", "--start", "5.235988")
    stated = run(
        "loop", "rrr3_base", *words, "--pose", "0.08076,0.03511,1.22907", "--samples", "181", "--plot", "loop.png"
    )
    assert "CHANGED" in stated
    assert (tmp_path / "loop.png").stat().st_size > 10_000


def test_equations_of_ones_own_from_a_file(tmp_path):
    (tmp_path / "mine.yaml").write_text(OWN, encoding="utf-8")
    found = json.loads(run("cells", "mine.yaml", "--box", "r1=0.1:3", "--box", "r2=0.1:3", "--json"))
    # Two circles meet where |r1 - r2| < 3/2 < r1 + r2: the square less three triangles with corners at its edges.
    missing = 0.5 * 1.4**2 * 2 + 0.5 * 1.3**2
    assert found["by_count"]["2"]["area"] == pytest.approx(2.9**2 - missing, abs=1e-9)
    assert "x" in run("singular", "mine.yaml", "--kind", "serial", "--space", "pose")


@pytest.mark.parametrize(
    ("words", "word"),
    [
        (("cusps", "4rpr"), "known are"),
        (("cusps", "3rpr", "--fix", "rho1"), "must look like"),
        (("cells", "3rpr", "--fix", "rho1=17", "--box", "rho2=1:2"), "twice"),
        (("cells", "3rpr", "--fix", "rho1=17", "--box", "rho2=2:1", "--box", "rho3=1:2"), "empty"),
        (("cells", "3rpr", "--fix", "rho1=17", "--box", "rho2=1", "--box", "rho3=1:2"), "must look like"),
        (("singular", "3rpr"), "terms"),
        (("singular", "3rpr", "--fix", "rho1=17", "--plot", "a.txt"), "suffix"),
        (("configurations", "3rpr", "--fix", "rho1=1"), "infinitely many"),
        (("loop", "rrr3_base", "--centre", "1,2", "--radius", "1"), "3 numbers"),
        (("cusps", "nothing.yaml"), ""),
        (("cells", "3rpr", *SLICE, "--plot", "a.html"), "suffix"),
        (
            (
                "cells",
                "3rpr",
                "--fix",
                "rho1=17",
                "--box",
                "rho2=1:2",
                "--box",
                "rho3=1:2",
                "--plot",
                "/dev/null/a.png",
            ),
            "/dev/null",
        ),
        (("cells", "3rpr", "--fix", "rho1=17", "--box", "rho2=a:2", "--box", "rho3=1:2"), "must be a number"),
        (("singular", "3rpr", "--fix", "rho1=17", "--box", "x=1:2", "--box", "y=1:2", "--plot", "a.png"), "rho2, rho3"),
        (("cusps", "five_bar", "--set", "l1=abc"), "must be a number"),
        (("cusps", "bad.yaml"), "equations must be a sequence"),
    ],
)
def test_bad_words_are_refused_in_one_line(words, word, tmp_path):
    (tmp_path / "bad.yaml").write_text("equations: 3\npose: 4\njoints: 5\n", encoding="utf-8")
    with pytest.raises((BadInput, OSError)) as refused:
        run(*words)
    assert word in str(refused.value)
    assert "\n" not in str(refused.value)


def test_no_configuration_is_a_failure_not_a_mistake():
    with pytest.raises(Failed, match="no real configuration"):
        run("configurations", "orthoglide", "--fix", "x=9", "--fix", "y=9", "--fix", "z=9")


def test_robots_tell_whether_they_are_cuspidal():
    done = CliRunner().invoke(whole_app(), ["robots", "--json"], catch_exceptions=False)
    answers = {row["name"]: row["cuspidal"] for row in json.loads(done.output)}
    assert answers["ruu4"] == answers["rrr3_base"] == answers["rpr3"] == "yes"
    assert answers["irsbot2"] == answers["orthoglide"] == "no"


def test_every_command_has_an_example():
    for command in ("names", "singular", "cusps", "cells", "configurations", "loop"):
        assert re.search("Example: irsbot algebra", run(command, "--help"))
