"""Tables of samples: what is wrong in them is named with file, row and column."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from irsbot_kinematics import BadInput
from irsbot_msgs_py.records import JointSample
from irsbot_supervisor.bag.bag_writer import BagWriter
from irsbot_supervisor.bag.columns import read_joint_columns, read_motion
from irsbot_supervisor.cli.app import whole_app
from irsbot_supervisor.fleet.evaluating import InputJob, Question, evaluate_input

NAMES = ["a", "b"]


def table(tmp_path: Path, *lines: str) -> Path:
    file = tmp_path / "motion.csv"
    file.write_text("\n".join(lines) + "\n")
    return file


def test_numbers_are_read_in_the_order_that_is_asked_for(tmp_path: Path) -> None:
    file = table(tmp_path, "b,time_s,a,other", "1, 0,2e-1,x", "-3,0.5,4,", "5,1,6,y")
    times, positions, rates = read_motion(file, NAMES)
    assert times.tolist() == [0.0, 0.5, 1.0]
    assert positions.tolist() == [[0.2, 1.0], [4.0, -3.0], [6.0, 5.0]]
    assert rates.shape == (0, 2)


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (("time_s,a,b",), "it has no rows below its header"),
        (("time_s,a", "0,1"), "no column 'b'; it has time_s, a"),
        (("a,b", "0,1"), "no column 'time_s'"),
        (("time_s,a,b", "0,1,2", "1,1,", "2,,2"), "row 2 below the header, column 'b': the cell is empty"),
        (("time_s,a,b", "0,1,2", "1,one,2"), "row 2 below the header, column 'a': 'one' is no number"),
        (("time_s,a,b", *(f"{k},1,2" for k in range(300)), "300,1,x"), "row 301 below the header, column 'b': 'x' is"),
        (("time_s,a,b", "0,1,nan"), "row 1 below the header, column 'b' is nan, must be finite"),
        (("time_s,a,b", "0,1,2", "inf,1,2"), "row 2 below the header, column 'time_s' is inf, must be finite"),
        (("time_s,a,b", "0,1,2", ",1,2"), "row 2 below the header, column 'time_s': the cell is empty"),
        (
            ("time_s,a,b", "0,1,2", "0.5,1,2", "0.5,1,2"),
            "row 3 below the header, column 'time_s' is 0.5, must be above",
        ),
        (("time_s,a,b", "0,1,2", "-1,1,2"), "row 2 below the header, column 'time_s' is -1, must be above 0"),
        (("time_s,a,b,a_velocity,b_velocity", "0,1,2,0,0", "1,1,2,0,"), "row 2 below the header, column 'b_velocity':"),
        (("time_s,a,b,a_velocity", "0,1,2,0", "1,1,2,0"), "no column 'b_velocity'; it has"),
        (("time_s,a,b,b_velocity", "0,1,2,0", "1,1,2,0"), "no column 'a_velocity'; it has"),
    ],
)
def test_a_fault_is_named_with_its_file_row_and_column(lines: tuple[str, ...], words: str, tmp_path: Path) -> None:
    file = table(tmp_path, *lines)
    with pytest.raises(BadInput) as caught:
        read_motion(file, NAMES)
    assert str(caught.value).startswith(f"{file}: {words}")


@pytest.mark.parametrize("name", ["motion.csv", "motion.txt", "motion.CSV", "motion", "motion[1].csv", "motion*.csv"])
def test_a_table_is_read_whatever_its_name_is(name: str, tmp_path: Path) -> None:
    table(tmp_path, "time_s,a,b,a_velocity,b_velocity", "5,6,7,8,9")  # its name fits the pattern motion*.csv
    file = tmp_path / name
    file.write_text("time_s,a,b,a_velocity,b_velocity\n0,1,2,3,4\n1,1,2,3,4\n")
    times, positions, rates = read_motion(file, NAMES)
    assert (times.tolist(), positions.tolist(), rates.tolist()) == ([0.0, 1.0], [[1.0, 2.0]] * 2, [[3.0, 4.0]] * 2)


def test_equal_times_and_nan_are_no_fault_of_samples(tmp_path: Path) -> None:
    positions, times, _damage = read_joint_columns(table(tmp_path, "time_s,a,b", "0,1,2", "0,3,4", "0,NaN,4"), NAMES)
    assert times is not None
    assert times.tolist() == [0.0, 0.0, 0.0]
    assert positions[:2].tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert positions[2, 0] != positions[2, 0]


def test_of_a_motion_in_joints_and_poses_the_joints_are_used(tmp_path: Path) -> None:
    joints = "-0.3,-2.84"  # of the pose (0, -0.85) or not: they are what is certified
    file = table(tmp_path, "time_s,joint_1,joint_2,x,z", f"0,{joints},0,-0.85", f"1,{joints},0,-0.85")
    stated = CliRunner().invoke(whole_app(), ["check-trajectory", "irsbot2", str(file)])
    assert "the motion is that of the joints; the columns x, z are not used" in stated.output


def test_a_column_that_is_not_used_is_named(tmp_path: Path) -> None:
    """Velocities under another name: the motion that is certified is another one than the user means."""
    rows = "time_s,joint_1,joint_2,joint_1_{0},joint_2_{0}", "0,2.544,-0.19,0.1,0", "1,2.534,-0.18,0,0"
    told = {}
    for name in ("vel", "velocity"):
        file = table(tmp_path, rows[0].format(name), *rows[1:])
        told[name] = CliRunner().invoke(whole_app(), ["check-trajectory", "irsbot2", str(file)]).output
    assert "the columns joint_1_vel, joint_2_vel are not used" in told["vel"]
    assert "straight lines between them" in told["vel"]
    assert "not used" not in told["velocity"]
    assert "cubics between them" in told["velocity"]


def test_damage_of_a_bag_is_told_with_its_samples_and_refused_for_a_motion(tmp_path: Path) -> None:
    whole, cut = tmp_path / "whole.mcap", tmp_path / "cut.mcap"
    with BagWriter(whole) as writer:
        for k in range(5000):
            writer.add("/joint_states", JointSample(k, k, k, ("joint_1", "joint_2"), (2.5, -0.17), (0.0, 0.0)), k)
    cut.write_bytes(whole.read_bytes()[:300_000])
    names = ["joint_1", "joint_2"]
    assert read_joint_columns(whole, names).damage == ""
    assert "never closed" in read_joint_columns(cut, names).damage
    with pytest.raises(BadInput, match="damaged"):
        read_motion(cut, names)
    assert len(read_motion(whole, names)[0]) == 5000
    rows = [evaluate_input(InputJob(file.name, str(file), Question("irsbot2"))).row for file in (whole, cut)]
    assert [any("damaged" in text for text in row.warnings) for row in rows] == [False, True]
