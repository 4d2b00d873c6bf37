"""Tables of samples: what is wrong in them is named with file, row and column."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from irsbot_kinematics import BadInput
from irsbot_supervisor.bag.columns import read_joint_columns, read_motion
from irsbot_supervisor.cli.app import whole_app

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
    ],
)
def test_a_fault_is_named_with_its_file_row_and_column(lines: tuple[str, ...], words: str, tmp_path: Path) -> None:
    file = table(tmp_path, *lines)
    with pytest.raises(BadInput) as caught:
        read_motion(file, NAMES)
    assert str(caught.value).startswith(f"{file}: {words}")


def test_equal_times_and_nan_are_no_fault_of_samples(tmp_path: Path) -> None:
    positions, times = read_joint_columns(table(tmp_path, "time_s,a,b", "0,1,2", "0,3,4", "0,NaN,4"), NAMES)
    assert times is not None
    assert times.tolist() == [0.0, 0.0, 0.0]
    assert positions[:2].tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert positions[2, 0] != positions[2, 0]


def test_of_a_motion_in_joints_and_poses_the_joints_are_used(tmp_path: Path) -> None:
    joints = "-0.3,-2.84"  # of the pose (0, -0.85) or not: they are what is certified
    file = table(tmp_path, "time_s,joint_1,joint_2,x,z", f"0,{joints},0,-0.85", f"1,{joints},0,-0.85")
    stated = CliRunner().invoke(whole_app(), ["check-trajectory", "irsbot2", str(file)])
    assert "the motion is that of the joints; the columns x, z are not used" in stated.output
