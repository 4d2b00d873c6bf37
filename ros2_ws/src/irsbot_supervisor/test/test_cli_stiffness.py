"""`irsbot stiffness` and `irsbot design size`: numbers as JSON, exit codes, one line for bad input, pictures, files."""

from __future__ import annotations

import json

import matplotlib.image
import numpy as np
import pytest
import yaml

from irsbot_kinematics import stiffness

LOAD = ("--payload", 1.5, "--acceleration", 60)


@pytest.mark.parametrize("command", [("stiffness",), ("design", "size")])
def test_each_command_explains_itself_with_an_example(irsbot, command):
    code, out, _ = irsbot(*command, "--help")
    assert code == 0
    assert f"Example: irsbot {' '.join(command)}" in out


def test_a_pose_gives_the_numbers_of_the_library(irsbot):
    """The deflection is that of the sheet's section 10."""
    code, out, _ = irsbot("stiffness", "irsbot2_table2", 0, -0.8, "--mass", 1.5, *LOAD, "--json")
    assert code == 0
    stated, design = json.loads(out), stiffness.load("irsbot2_table2")
    assert stated["deflection"][1] == pytest.approx(1.142578e-3, abs=0.6e-9)
    assert np.allclose(stated["stiffness"], stiffness.matrix(design, (0.0, -0.8)), rtol=1e-12)
    assert stated["frequency_hz"] == pytest.approx(stiffness.frequency(design, (0.0, -0.8), 1.5))
    assert stated["mass_kg"] == pytest.approx(10.93, abs=5e-3)
    assert sum(tube["mass_kg"] for tube in stated["tubes"]) == pytest.approx(stated["mass_kg"])
    assert stated["assumed"] == ["beta", "e", "direction"]
    margins = stated["margins"]
    assert margins["load"]["total_force_n"] == pytest.approx(1.5 * (9.80665 + 60.0))
    for name in ("type1", "type2", "constraint"):
        assert 0.0 < margins["bent_at_least"][name] < margins["rigid"][name]


def test_the_pages_for_people_show_the_same_numbers(irsbot):
    code, out, _ = irsbot("stiffness", "irsbot2_table2", 0, -0.8, "--mass", 1.5, *LOAD)
    assert code == 0
    for shown in ("dy 0.001142578", "mass of the tubes: 10.93 kg", "first natural frequency", "slack of a leg"):
        assert shown in out
    code, out, _ = irsbot("stiffness", "five_bar_table1")
    assert code == 0
    assert "largest 1.072, mean 0.9527" in out
    code, out, _ = irsbot("stiffness")
    assert code == 0
    assert all(name in out for name in stiffness.presets())
    assert "not reproducible" in out
    assert "1.227 1.135 0.064 5.600" in out


def test_changes_of_the_design_reach_the_model(irsbot):
    words = ("--set", "beta=40deg", "--set", "spacing=0.6434773", "--rigid", "elbow", "--json")
    code, out, _ = irsbot("stiffness", "irsbot2_table4", *words)
    assert code == 0
    stated = json.loads(out)["statistics"]
    assert (stated["largest_mm"], stated["mean_mm"]) == pytest.approx((0.629, 0.521), abs=6e-4)  # sheet section 8
    code, out, _ = irsbot("stiffness", "five_bar_table1", "--set", "platform_joint=spherical", "--json")
    assert json.loads(out)["statistics"]["largest_mm"] == pytest.approx(1.229, abs=6e-4)
    code, out, _ = irsbot("stiffness", "irsbot2_table2", "--robot", "irsbot2", "--json")
    assert code == 0
    lengths = {tube["kind"]: tube["length_m"] for tube in json.loads(out)["tubes"]}
    assert lengths["distal"] == pytest.approx(stiffness.load("irsbot2_table2", robot="irsbot2").geometry.l2)


def test_the_bound_over_a_workspace_is_the_setting_it_names(irsbot):
    box = ("--box", -0.2, 0.2, -0.85, -0.7)
    code, out, _ = irsbot("stiffness", "irsbot2_table2", "--bound", *LOAD, *box, "--json")
    assert code == 0
    stated = json.loads(out)
    code, out, _ = irsbot("stiffness", "irsbot2_table2", "--bound", *LOAD, *box)
    assert code == 0
    assert f"compliance: counted, compliance_slack_m: {stated['slack_m']:.6g}" in out


def test_a_map_is_a_picture_or_its_numbers(irsbot, tmp_path):
    picture, numbers = tmp_path / "map.png", tmp_path / "map.npz"
    box = ("--box", -0.3, 0.3, -0.9, -0.6, "--nodes", 31)
    assert irsbot("stiffness", "irsbot2_table2", "--map", "-o", picture, *box)[0] == 0
    assert matplotlib.image.imread(picture)[..., :3].std() > 0.05
    code, out, _ = irsbot("stiffness", "irsbot2_table2", "--map", "-o", numbers, *box, "--json")
    assert code == 0
    with np.load(numbers) as found:
        assert found["twist"].shape == (31, 31, 6)
        direct = stiffness.deflection(stiffness.load("irsbot2_table2"), (found["x"][3], found["z"][7]), found["wrench"])
        assert np.allclose(found["twist"][7, 3], direct, rtol=1e-9)
        assert json.loads(out)["largest_m"] == pytest.approx(np.linalg.norm(found["twist"][..., :3], axis=-1).max())


def test_a_design_is_sized_and_its_file_can_be_asked(irsbot, tmp_path):
    path = tmp_path / "sized.yaml"
    words = ("--largest", 0.001, "--generations", 15, "--seed", 2, "-o", path)
    code, out, _ = irsbot("design", "size", "five_bar_table1", *words, "--json")
    assert code == 0
    stated = json.loads(out)
    assert stated["statistics"]["largest_mm"] <= 1.0
    assert any(active["name"].startswith("largest deflection") for active in stated["active"])
    code, out, _ = irsbot("stiffness", path, "--json")
    assert code == 0
    assert json.loads(out)["mass_kg"] == pytest.approx(stated["statistics"]["mass_kg"], rel=1e-12)
    code, out, _ = irsbot("design", "size", "five_bar_table1", *words, "--force")
    assert code == 0
    assert "active" in out


def test_other_poses_than_the_papers_can_be_asked_for(irsbot):
    code, out, _ = irsbot("stiffness", "irsbot2_table2", "--robot", "irsbot2_csc")
    assert code == 0
    assert "not all in its reach" in out
    box = ("--box", -0.05, 0.05, -0.3, -0.25)
    search = ("--generations", 10, "--population", 4)
    words = ("design", "size", "irsbot2_table2", "--robot", "irsbot2_csc", "--largest", 0.001, *search)
    code, _, err = irsbot(*words)
    assert code == 2
    assert "it is out of reach or singular" in err
    code, out, _ = irsbot(*words, *box, "--json")
    assert code == 0
    assert json.loads(out)["statistics"]["largest_mm"] <= 1.0


def test_a_mechanism_of_the_users_own_is_read_from_a_file(irsbot, tmp_path):
    path = tmp_path / "arm.yaml"
    stated = {
        "family": "chains",
        "points": {"unit": "m", "A": [0, 0, 0], "P": [0.375, 0, 0]},
        "platform": "P",
        "sections": {"arm": {"outer": "60 mm", "inner": "50 mm", "material": "aluminium"}},
        "legs": [[{"tube": ["A", "P", "arm"]}]],
    }
    path.write_text(yaml.safe_dump(stated))
    code, out, _ = irsbot("stiffness", path, "--wrench", 0, 100, 0, 0, 0, 0, "--json")
    assert code == 0
    assert json.loads(out)["deflection"][1] == pytest.approx(100.0 * 7.6240e-07, rel=1e-4)  # sheet section 10
    assert irsbot("stiffness", path)[0] == 0
    for words in (("0", "-0.8"), ("--map",), ("--bound", "--force", "1")):
        code, _, err = irsbot("stiffness", path, *words)
        assert code == 2
        assert "one posture" in err


@pytest.mark.parametrize(
    ("words", "code", "stated"),
    [
        (("stiffness", "irsbot9"), 2, "no elastic design 'irsbot9'"),
        (("stiffness", "irsbot2_table2", "0", "-2"), 1, "unreachable"),
        (("stiffness", "irsbot2_table2", "0"), 2, "the pose must be 2 numbers"),
        (("stiffness", "irsbot2_table2", "0", "-0.8", "--payload", "-1"), 2, "payload_kg must be a number >= 0"),
        (("stiffness", "irsbot2_table2", "0", "-0.8", "--mass", "0"), 2, "mass_kg must be a number > 0"),
        (("stiffness", "irsbot2_table2", "--set", "beta"), 2, "must be name=value"),
        (("stiffness", "irsbot2_table2", "--set", "wing=1"), 2, "has no 'wing'"),
        (("stiffness", "irsbot2_table2", "--rigid", "wing"), 2, "no tube 'wing'"),
        (("stiffness", "irsbot2_table2", "--robot", "five_bar"), 2, "is a five_bar"),
        (("stiffness", "irsbot2_table2", "--bound"), 2, "--bound needs a load"),
        (("stiffness", "irsbot2_table2", "--bound", "--force", "100"), 1, "no bound; give a smaller box"),
        (("stiffness", "irsbot2_table2", "--map", "-o", "map.txt"), 2, "suffix must be .png or .npz"),
        (("stiffness", "irsbot2_table2", "--map", "--box", "3", "4", "3", "4"), 1, "nothing to map"),
        (("stiffness", "irsbot2_table2", "--map", "--box", "1", "0", "0", "1"), 2, "low < high"),
        (("stiffness", "five_bar_table1", "0", "-0.8", "--wrench", *"000010"), 1, "ry free"),
        (("stiffness", "five_bar_table1", "--map", "--wrench", *"000010"), 1, "ry free"),
        (("design", "size", "five_bar_table1", "--largest", "1e-7", "--generations", "1"), 1, "no tubes within"),
        (("design", "size", "five_bar_table1", "--largest", "-1"), 2, "largest_m must be a deflection > 0"),
        (("design", "size", "five_bar_table1", "--largest", "0.001", "--wall", "1"), 2, "a range is low:high"),
        (("design", "size", "five_bar_table1", "--largest", "0.001", "--vary", "l1"), 2, "--vary must be"),
        (("design", "size", "five_bar_table1", "--largest", "0.001", "--vary", "a1=0:1"), 2, "no length 'a1'"),
        (("design", "size", "five_bar_table1", "--largest", "0.001", "-o", "/dev/null/x.yaml"), 2, "/dev/null"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_an_impossible_request_is_refused_in_one_line(irsbot, words, code, stated):
    found, _, err = irsbot(*words)
    assert found == code
    lines = err.strip().splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("irsbot: ")
    assert stated in lines[0]
