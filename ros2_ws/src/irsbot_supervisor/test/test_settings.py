"""Settings are used whole or not at all: each refusal names the setting and what it is, and what it has to be."""

from __future__ import annotations

from dataclasses import asdict, fields, replace
from importlib import resources
from math import inf, nan
from pathlib import Path

import numpy as np
import pytest
import yaml
from supervised import settings_of

import irsbot_kinematics as irs
from irsbot_kinematics.description.yaml_text import parsed, shipped
from irsbot_supervisor.configuration.feasibility import settings_from
from irsbot_supervisor.configuration.loading import read_settings, read_values, robot_of, shipped_values
from irsbot_supervisor.core.margins import MARGIN_NAMES
from irsbot_supervisor.core.settings import InvalidSettings, Settings
from irsbot_supervisor.core.stopping import cuts_of

NUMBERS = [entry for entry in fields(Settings) if "low" in entry.metadata]
SINGLE = [entry for entry in NUMBERS if not entry.metadata.get("each_joint")]


def refused(robot: str = "irsbot2", **changes) -> str:
    with pytest.raises(InvalidSettings) as caught:
        settings_of(robot, **changes)
    return str(caught.value)


def test_shipped_files_say_the_same_to_both_readers():
    files = sorted(Path(str(resources.files("irsbot_supervisor"))).rglob("*.yaml"))
    assert len(files) > 20
    for file in files:
        text = file.read_text(encoding="utf-8")
        assert shipped(text) == parsed(text), file


# --- single values ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [nan, inf, -inf, 10**400, True, None, "0.1", [0.1], {}, -1e9])
def test_a_value_that_is_not_a_number_or_out_of_range_is_refused_by_name(value):
    stated = refused(**{entry.name: value for entry in SINGLE})
    faults = dict(fault.split(" is ", 1) for fault in stated.split("; "))
    for entry in SINGLE:
        assert faults[entry.name].startswith((repr(value), repr((0.1,)))), entry.name


@pytest.mark.parametrize("values", [[nan, nan], [2e4, 2e4]])
def test_a_fault_of_every_joint_is_reported_once(values):
    assert refused(velocity_limit=values).count("velocity_limit") == 1


@pytest.mark.parametrize("entry", SINGLE, ids=lambda entry: entry.name)
def test_a_range_includes_both_ends(entry):
    low, high = entry.metadata["low"], entry.metadata["high"]
    assert low < entry.default < high or entry.default in (low, high)
    for beyond in (low - 1e-9 - abs(low) * 1e-9, high * (1.0 + 1e-9)):
        assert f"must be in {low:g}..{high:g}" in refused(**{entry.name: beyond})


@pytest.mark.parametrize("name", ["velocity_limit", "deceleration_limit"])
@pytest.mark.parametrize("value", [[], [1.0, 2.0, 3.0], [1.0, nan], [0.0, 1.0], [-1.0, 1.0], [1.0, "a"], None, 0.0, {}])
def test_limits_of_joints_come_for_all_joints_and_are_positive(name, value):
    assert name in refused(**{name: value})


def test_one_limit_serves_for_all_joints():
    assert settings_of(velocity_limit=3)[0].velocity_limit == (3.0, 3.0)
    assert settings_of("orthoglide", velocity_limit=[3.0])[0].velocity_limit == (3.0, 3.0, 3.0)


@pytest.mark.parametrize("name", [f"{kind}_{which}" for kind in MARGIN_NAMES for which in ("stop", "warn")])
def test_no_margin_is_switched_off_by_a_zero(name):
    """A floor of 0 means that nothing could be proved; with a limit of 0 it would be accepted."""
    assert name in refused(**{name: 0.0})


@pytest.mark.parametrize("name", [f"{kind}_{which}" for kind in MARGIN_NAMES for which in ("stop", "warn")])
def test_no_margin_limit_is_above_the_largest_margin(name):
    """A margin is at most 1: with a higher limit a robot never moves."""
    assert f"{name} is 1.1, must be in" in refused(**{name: 1.1})


@pytest.mark.parametrize("word", ["", "Stop", "nothing", 0, True, ["none"]])
def test_a_word_that_is_not_in_the_list_is_refused_with_the_list(word):
    assert "none, warn, stop" in refused(reaction_check=word) or "one value" in refused(reaction_check=word)


@pytest.mark.parametrize("stated", ["1e-2", "+1E-2", "1.e-2", ".1e-1", "10e-3", "0.01", "1.0e-2"])
def test_a_number_in_a_file_is_what_it_is_for_ros(tmp_path, stated):
    file = tmp_path / "mine.yaml"
    file.write_text(f"latency_s: {stated}\nrobot: 1e-2mm\n")
    assert read_values(file) == {"latency_s": 0.01, "robot": "1e-2mm"}


@pytest.mark.parametrize("stated", ["off", "'off'", "no", "none"])
def test_bags_and_yaml_files_that_say_off_mean_none(tmp_path, stated):
    file = tmp_path / "mine.yaml"
    file.write_text(f"reaction_check: {stated}\n")
    assert settings_of(**read_values(file))[0].reaction_check == "none"


@pytest.mark.parametrize("stated", ["on", "'on'", "yes", "true", "counted"])
def test_yaml_files_that_say_on_mean_counted(tmp_path, stated):
    file = tmp_path / "mine.yaml"
    file.write_text(f"compliance: {stated}\ncompliance_slack_m: 0.0005\n")
    assert settings_of(**read_values(file))[0].compliance == "counted"
    file.write_text(f"reaction_check: {stated}\n")
    assert "must be one of none, warn, stop" in refused(**read_values(file))


def test_no_word_of_a_setting_is_something_else_in_yaml():
    for entry in fields(Settings):
        for word in entry.metadata.get("words") or ():
            assert yaml.safe_load(word) == word


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("joint_names", 5),
        ("joint_names", ["joint_1"]),
        ("joint_names", ["joint_1", "joint_1"]),
        ("joint_names", ["joint_1", "joint_2", "joint_3"]),
        ("joint_names", [["joint_1"], "joint_2"]),
        ("joint_names", "joint_1"),
        ("working_mode", [1]),
        ("working_mode", [1, 0]),
        ("working_mode", [1.5, -1]),
        ("working_mode", "+-"),
        ("assembly_mode", 2),
        ("assembly_mode", "-1"),
        ("assembly_mode", [-1]),
    ],
)
def test_names_and_modes_that_do_not_fit_the_robot_are_refused(name, value):
    assert name in refused(**{name: value})


def test_an_unknown_setting_is_refused_with_the_known_ones():
    stated = refused(type1_limit=0.2)
    assert "type1_limit" in stated
    assert "type1_stop" in stated
    with pytest.raises(InvalidSettings, match="unknown setting"):
        settings_from({1: 2, "speed": 3}, robot_of("irsbot2"))


# --- values together --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", MARGIN_NAMES)
def test_a_warning_below_the_stop_is_refused_with_both_numbers(kind):
    stated = refused(**{f"{kind}_warn": 0.11, f"{kind}_stop": 0.12})
    assert f"{kind}_warn (0.11)" in stated
    assert f"{kind}_stop (0.12)" in stated
    same = settings_of(**{f"{kind}_warn": 0.12, f"{kind}_stop": 0.12})[0]
    assert getattr(same, f"{kind}_warn") == 0.12


@pytest.mark.parametrize("name", ["sample_gap_s", "judging_s"])
def test_a_stated_time_that_is_a_silence_is_refused_with_both_numbers(name):
    stated = refused(**{name: 0.06}, stale_s=0.05)
    assert f"{name} (0.06)" in stated
    assert "stale_s (0.05)" in stated


def test_no_time_for_a_sample_without_cuts_is_refused_with_both_numbers():
    stated = refused(bounding_s=0.001, judging_s=0.0029)
    assert "judging_s (0.0029)" in stated
    assert "3 times bounding_s (0.001)" in stated
    refused(bounding_s=0.001)


@pytest.mark.parametrize("steps", [7, 14, 19, 33, 123])
def test_the_time_for_cuts_is_exact_in_decimal_fractions(steps):
    """0.00042 s is three times 0.00014 s, also where their nearest numbers are not."""
    for cuts in (0, 1, 5, 12):
        most = (3 + 2 * cuts) * steps
        enough = settings_of(bounding_s=steps / 1e5, judging_s=most / 1e5)[0]
        assert cuts_of(enough) == cuts
        if cuts:
            assert cuts_of(replace(enough, judging_s=(most - 1) / 1e5)) == cuts - 1
    assert cuts_of(replace(enough, judging_s=0.05)) == 12, "more time is for no more cuts"
    assert cuts_of(settings_of()[0]) == 12, "without a stated time of a box every cut counts"


def test_a_heartbeat_slower_than_the_limit_of_staleness_is_refused_with_both_numbers():
    stated = refused(heartbeat_s=0.02, stale_s=0.01)
    assert "heartbeat_s (0.02)" in stated
    assert "stale_s (0.01)" in stated


def test_every_fault_is_named_at_once():
    stated = refused(type1_warn=-1.0, latency_s=nan, velocity_limit=[])
    assert all(name in stated for name in ("type1_warn", "latency_s", "velocity_limit"))


# --- whole ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("robot", irs.robots())
def test_a_robot_is_supervised_in_its_usual_modes_and_by_its_own_joint_names(robot):
    settings, machine = settings_of(robot)
    mechanism = machine.mechanism
    assert settings.working_mode == mechanism.usual_working_mode
    assert settings.assembly_mode == mechanism.usual_assembly_mode
    assert settings.joint_names == tuple(joint.name for joint in mechanism.joints)
    assert len(settings.velocity_limit) == len(mechanism.joints)


@pytest.mark.parametrize("name", ["joint_names", "working_mode", "assembly_mode"])
@pytest.mark.parametrize("nothing", [False, 0.0, ""])
def test_an_accidentally_empty_value_does_not_select_the_usual_modes_or_names(name, nothing):
    with pytest.raises(InvalidSettings, match=name):
        settings_of(**{name: nothing})


def test_settings_survive_being_written_down():
    settings, robot = settings_of(type1_warn=0.3, velocity_limit=[3, 4])
    assert settings_from(asdict(settings), robot) == settings


def test_equal_settings_have_equal_hashes_and_each_change_another():
    settings, robot = settings_of()
    assert settings_of(velocity_limit=[12, 12])[0].config_hash == settings.config_hash  # 12 is 12.0
    hashes = {settings.config_hash}
    for entry in SINGLE:
        low, high = entry.metadata["low"], entry.metadata["high"]
        value = 0.5 * (getattr(settings, entry.name) + (high if entry.name.endswith(("warn", "stale_s")) else low))
        hashes.add(settings_from({**asdict(settings), entry.name: value}, robot).config_hash)
    assert len(hashes) == 1 + len([entry for entry in SINGLE if entry.default != entry.metadata["low"]])


def test_every_declared_parameter_has_a_description():
    for entry in fields(Settings):
        assert entry.metadata["text"], entry.name
        assert "unit" in entry.metadata, entry.name


# --- files ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("robot", [name for name in irs.robots() if shipped_values(robot_of(name))])
def test_shipped_settings_are_valid_and_their_numbers_are_floats(robot):
    """ROS refuses an integer where a parameter is a double."""
    values = shipped_values(robot_of(robot))
    for name, value in values.items():
        if name in {entry.name for entry in NUMBERS}:
            each = value if isinstance(value, list) else [value]
            assert all(isinstance(number, float) for number in each), name
    settings, _machine = read_settings(robot)
    assert min(settings.deceleration_limit) > 0.0


@pytest.mark.parametrize(
    ("name", "of"), [("rrr3_base", "rails3"), ("ours", "rails3"), ("irsbot2_csc", "irsbot2_csc"), ("rails3", "rails3")]
)
def test_a_file_with_the_name_of_a_preset_of_another_topology_gets_the_limits_of_its_own(tmp_path, name, of):
    preset = Path(irs.__file__).parent / "presets" / f"{of}.yaml"
    file = tmp_path / f"{name}.yaml"
    file.write_text(preset.read_text(encoding="utf-8"), encoding="utf-8")
    settings, _machine = read_settings(file)
    expected, _preset = read_settings(of)
    assert replace(settings, robot="") == replace(expected, robot="")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("assembly_mode", np.int64(-1)),
        ("working_mode", np.array([1, -1])),
        ("latency_s", np.float64(0.004)),
        ("velocity_limit", np.array([11.0, 12.0])),
        ("velocity_limit", [np.float32(11.0), np.int64(12)]),
        ("joint_names", np.array(["a", "b"])),
        ("compliance", np.str_("none")),
    ],
)
def test_values_of_numpy_are_those_of_python(name, value):
    plain = [one.item() for one in value] if isinstance(value, list) else value.tolist()
    assert read_settings("irsbot2", {name: value})[0] == read_settings("irsbot2", {name: plain})[0]


@pytest.mark.parametrize("value", [np.array([0.05]), np.array([[0.05]]), np.array([]), np.array("x"), np.bool_(True)])
def test_values_of_numpy_that_are_wrong_are_refused(value):
    with pytest.raises(InvalidSettings):
        read_settings("irsbot2", stale_s=value)


def test_changes_replace_shipped_numbers_and_the_rest_stays():
    settings, _robot = read_settings("irsbot2_beta45", {"type2_warn": 0.4})
    assert settings.type2_warn == 0.4
    assert settings.constraint_stop == read_settings("irsbot2_beta45")[0].constraint_stop
    assert settings.robot == "irsbot2_beta45"


def test_a_robot_from_a_file_gets_the_settings_of_its_topology(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("mechanism: five_bar\ngeometry: {l1: 0.3, l2: 0.5, b: 0.1}\n")
    settings, robot = read_settings(str(file))
    assert robot.mechanism.kind == "five_bar"
    assert settings.velocity_limit == read_settings("five_bar")[0].velocity_limit


@pytest.mark.parametrize("text", ["", "- 1\n", "5\n", "a: [1\n", "a: 2001-99-99\n", "a: 0.3\n\tb: 0.1\n", "\x00"])
def test_a_file_that_is_no_mapping_is_refused_by_its_name(text, tmp_path):
    file = tmp_path / "bad.yaml"
    file.write_text(text)
    with pytest.raises(InvalidSettings, match=r"bad\.yaml"):
        read_values(file)


def test_a_file_that_is_missing_or_no_text_is_refused_by_its_name(tmp_path):
    with pytest.raises(InvalidSettings, match=r"none\.yaml"):
        read_values(tmp_path / "none.yaml")
    (tmp_path / "bytes.yaml").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(InvalidSettings, match=r"bytes\.yaml"):
        read_values(tmp_path / "bytes.yaml")


def test_a_file_of_ros_parameters_is_a_file_of_settings(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("/**:\n  ros__parameters:\n    type1_stop: 0.2\n")
    assert read_values(file) == {"type1_stop": 0.2}
    for other in ("/**:\n  ros__parameters: 5\n", "/a:\n  ros__parameters: {}\n/b:\n  ros__parameters: {}\n"):
        file.write_text(other)
        with pytest.raises(InvalidSettings, match="one node"):
            read_values(file)
