"""The whole of a planned motion: bounds before and behind a violation, every violation with its row, joint speeds."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from typer.testing import CliRunner, Result

from irsbot_msgs_py.records import Cause
from irsbot_supervisor.cli.app import whole_app
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.core.margins import MARGIN_CAUSES
from irsbot_supervisor.trajectory.survey import survey
from irsbot_supervisor.trajectory.task_space import survey_poses
from irsbot_supervisor.trajectory.verification import certify

TYPE2 = MARGIN_CAUSES.index(Cause.TYPE2)

SETTINGS, ROBOT = read_settings("irsbot2_beta45")

FREE, NEAR_THE_ARC, BEHIND_IT = (0.0, -0.75), (0.0, -0.53), (0.0, -0.45)


def to_and_fro(far: tuple[float, float], times: int) -> tuple[list[float], np.ndarray]:
    """Poses that approach an arc of parallel rods (Type 2), or cross it, and come back, so many times."""
    corners = [FREE if k % 2 == 0 else far for k in range(2 * times + 1)]
    return np.arange(len(corners), dtype=float).tolist(), np.array(corners)


def sampled(moments: list[float], poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Type 2 margins of straight ways of the platform, densely: nothing of boxes and segments is in it."""
    dense = np.linspace(moments[0], moments[-1], 20_001)
    x = np.column_stack([np.interp(dense, moments, column) for column in poses.T])
    joints, status, _ = ROBOT.inverse_many(x, SETTINGS.working_mode)
    assert not status.any(), "pose outside the workspace: the fixture proves nothing"
    return dense, ROBOT.evaluate_many(joints).type2_margin


def test_bounds_of_the_whole_path_go_below_the_limit_and_those_before_the_violation_do_not() -> None:
    moments, poses = to_and_fro(BEHIND_IT, 1)
    _dense, margin = sampled(moments, poses)
    assert margin.min() < 0.05, "the path misses the arc: the fixture proves nothing"
    found = survey_poses(ROBOT, SETTINGS, moments, poses.tolist())
    assert found.before[TYPE2][0] >= SETTINGS.type2_stop
    assert found.whole[TYPE2][0] <= margin.min()


def test_every_violation_is_found_with_its_end() -> None:
    moments, poses = to_and_fro(NEAR_THE_ARC, 2)
    dense, margin = sampled(moments, poses)
    bad = margin < SETTINGS.type2_stop
    begins, ends = dense[1:][bad[1:] & ~bad[:-1]], dense[:-1][bad[:-1] & ~bad[1:]]
    assert len(begins) > 1, "one violation: the fixture proves nothing"
    found = survey_poses(ROBOT, SETTINGS, moments, poses.tolist())
    assert len(found.runs) == len(begins)
    for run, begin, end in zip(found.runs, begins, ends, strict=True):
        assert begin - 0.01 <= run.first.time_s <= begin + 1e-3  # errors of encoders make it a little earlier
        assert end - 1e-3 <= run.until_s <= end + 0.01
        inside = (dense >= begin) & (dense <= end)
        assert run.worst.value == pytest.approx(margin[inside].min(), abs=0.01)


def test_a_motion_that_keeps_its_limits_has_the_bounds_of_its_certificate() -> None:
    q = [ROBOT.inverse(pose).tolist() for pose in (FREE, (0.0, -0.7))]
    found, certificate = survey(ROBOT, SETTINGS, [0.0, 1.0], q), certify(ROBOT, SETTINGS, [0.0, 1.0], q)
    assert certificate.safe
    assert found.safe
    assert found.before == found.whole == certificate.minima


def test_poses_out_of_reach_are_passed_over_and_the_path_goes_on_behind_them() -> None:
    poses = [FREE, (1.2, -0.75), FREE, BEHIND_IT]
    found = survey_poses(ROBOT, SETTINGS, [0.0, 1.0, 2.0, 3.0], poses)
    assert [run.first.time_s > 2.0 for run in found.runs].count(True) == 1
    assert any("unreachable" in run.first.text for run in found.runs)
    assert found.whole[TYPE2][0] == 0.0


def test_a_path_that_begins_out_of_reach_is_reported() -> None:
    found = survey_poses(ROBOT, SETTINGS, [0.0, 1.0], [(1.2, -0.75), FREE])
    assert "unreachable" in found.runs[0].first.text


@pytest.mark.parametrize("rates", [[], [[0.0, 0.0], [3.0, -1.0], [0.0, 0.0]]])
def test_speeds_are_those_of_the_motion_between_its_points(rates: list[list[float]]) -> None:
    start = np.array(ROBOT.inverse(FREE))
    q, times = [start, start + 0.05, start + 0.02], [0.0, 0.1, 0.3]
    found = survey(ROBOT, SETTINGS, times, np.array(q).tolist(), rates)
    dense = np.linspace(0.0, 0.3, 30_001)
    if rates:
        speed = np.abs(CubicHermiteSpline(times, q, rates)(dense, 1)).max(axis=0)
    else:
        speed = np.abs(np.diff(q, axis=0) / np.diff(times)[:, None]).max(axis=0)
    assert [value for value, _time in found.speeds] == pytest.approx(speed.tolist(), rel=1e-6)


def asked(folder: Path, header: str, rows: list[str], *words: str) -> Result:
    file = folder / "motion.csv"
    file.write_text("\n".join([header, *rows]) + "\n")
    return CliRunner().invoke(whole_app(), ["check-trajectory", "irsbot2_beta45", str(file), *words])


def test_the_command_prints_row_time_and_pose_of_a_violation_and_both_bounds(tmp_path: Path) -> None:
    rows = [f"{k},0,{-0.75 + 0.03 * k}" for k in range(11)]
    done = asked(tmp_path, "time_s,x,z", rows, "--json")
    stated = json.loads(done.stdout)
    assert not stated["safe"]
    assert stated["violation"]["row"] == int(stated["violation"]["time_s"]) + 1
    assert set(stated["violation"]["pose"]) == {"x", "z"}
    (type2,) = [row for row in stated["margins"] if row["margin"] == "Type 2 margin"]
    assert type2["before_violation"] >= SETTINGS.type2_stop > type2["whole"]


def test_all_violations_are_listed_on_request(tmp_path: Path) -> None:
    moments, poses = to_and_fro(NEAR_THE_ARC, 2)
    rows = [f"{t},{x},{z}" for t, (x, z) in zip(moments, poses.tolist(), strict=True)]
    some, every = (json.loads(asked(tmp_path, "time_s,x,z", rows, "--json", *more).stdout) for more in ([], ["--all"]))
    assert "violations" not in some
    assert len(every["violations"]) > 1
    assert every["violations"][0]["row"] == 1


def test_speeds_above_the_limit_are_a_finding(tmp_path: Path) -> None:
    """1 mm in a microsecond."""
    done = asked(tmp_path, "time_s,x,z", ["0,0,-0.75", "1e-6,0,-0.751"], "--json")
    stated = json.loads(done.stdout)
    assert not stated["safe"]
    assert {finding["joint"] for finding in stated["too_fast"]} == set(SETTINGS.joint_names)
    assert all(finding["row"] == 1 for finding in stated["too_fast"])
    slow = json.loads(asked(tmp_path, "time_s,x,z", ["0,0,-0.75", "1,0,-0.751"], "--json").stdout)
    assert slow["safe"]
    assert slow["too_fast"] == []
