"""Certificates of platform paths against dense sampling of the true path."""

from __future__ import annotations

import csv
from itertools import pairwise
from math import inf, nan
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import irsbot_kinematics as irs
from irsbot_msgs_py.records import Cause
from irsbot_supervisor.cli.app import whole_app
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.trajectory.joint_path import BadTrajectory
from irsbot_supervisor.trajectory.task_space import certify_poses

SETTINGS, ROBOT = read_settings("irsbot2")


def test_a_safe_path_is_certified_and_its_minima_bound_those_on_the_line():
    corners = np.array([(-0.2, -0.85), (0.2, -0.85), (0.2, -0.75)])
    found = certify_poses(ROBOT, SETTINGS, [0.0, 1.0, 1.5], corners.tolist())
    assert found.safe
    line = np.concatenate([np.linspace(a, b, 4000) for a, b in pairwise(corners)])
    joints = ROBOT.inverse_many(line)[0]
    true = ROBOT.evaluate_many(joints)
    least = (true.type1_margin.min(), true.type2_margin.min(), true.constraint_margin.min())
    for (bound, _time_s), value in zip(found.minima, least, strict=False):
        assert 0.0 < bound <= value + 1e-9
        assert value - bound < 0.05


def test_the_first_violation_of_a_path_is_where_the_margin_on_the_line_falls_below_its_limit():
    start, end = (0.0, -0.8), (0.878, -0.8)
    found = certify_poses(ROBOT, SETTINGS, [0.0, 2.0], [start, end])
    assert found.violation is not None
    line = np.linspace(start, end, 100_000)
    joints, _status, _box = ROBOT.inverse_many(line)
    true = ROBOT.evaluate_many(joints)
    below = (true.type1_margin.min(axis=1) < SETTINGS.type1_stop) | (true.type2_margin < SETTINGS.type2_stop)
    first_s = 2.0 * int(np.argmax(below)) / len(line)
    assert below.any()
    assert first_s - 0.01 <= found.violation.time_s <= first_s + 1e-3


def test_a_pose_out_of_reach_is_a_violation_with_its_distance():
    """The published example: (0, -1.25) is unreachable by 50.08 mm."""
    found = certify_poses(ROBOT, SETTINGS, [0.0], [(0.0, -1.25)])
    assert found.violation is not None
    assert found.violation.cause == Cause.TYPE1
    assert "unreachable by 50.08 mm" in found.violation.text


@pytest.mark.parametrize(
    ("times", "poses"),
    [
        ([], []),
        ([0.0, 1.0], [(0.0, -0.8)]),
        ([0.0], [(0.0, -0.8, 0.1)]),
        ([0.0, 0.0], [(0.0, -0.8), (0.1, -0.8)]),
        ([0.0, nan], [(0.0, -0.8), (0.1, -0.8)]),
        ([0.0, 1.0], [(0.0, -0.8), (inf, -0.8)]),
        ([0.0, 1.0], [(0.0, -0.8), (1e9, -0.8)]),
    ],
)
def test_an_invalid_path_is_refused(times, poses):
    with pytest.raises(BadTrajectory):
        certify_poses(ROBOT, SETTINGS, times, poses)


def test_the_command_takes_poses_by_the_names_of_the_task_coordinates(tmp_path: Path):
    path = tmp_path / "path.csv"
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([("time_s", "x", "z"), (0.0, 0.0, -0.85), (1.0, 0.2, -0.8)])
    assert CliRunner().invoke(whole_app(), ["check-trajectory", "irsbot2", str(path)]).exit_code == 0
    with path.open("a", newline="") as file:
        csv.writer(file).writerow((3.0, 0.0, -1.25))
    assert CliRunner().invoke(whole_app(), ["check-trajectory", "irsbot2", str(path)]).exit_code == 1


@pytest.mark.parametrize(
    ("table", "words"),
    [
        (b"", "not a CSV table: empty CSV"),
        (b"a,b\n\xff,\xfe\n", "not a CSV table"),
        (b"a,b\n1,2\n", "no column 'joint_1'"),
    ],
)
def test_a_file_that_is_no_motion_is_refused(tmp_path: Path, table: bytes, words: str):
    path = tmp_path / "motion.csv"
    path.write_bytes(table)
    refused = CliRunner().invoke(whole_app(), ["check-trajectory", "irsbot2", str(path)])
    assert isinstance(refused.exception, irs.BadInput)
    assert words in str(refused.exception)


@pytest.mark.parametrize(
    ("words", "stated"),
    [
        (["rrr3"], "ranges of x and y: --box"),
        (["rrr3", "--box", "-1", "1", "-1", "1"], "coordinate (phi), got 0: --at"),
    ],
)
def test_a_map_without_its_ranges_names_the_missing_options(tmp_path: Path, words: list[str], stated: str):
    refused = CliRunner().invoke(whole_app(), ["map", *words, "-o", str(tmp_path / "map.png")])
    assert isinstance(refused.exception, irs.BadInput)
    assert stated in str(refused.exception)


def other_modes(name: str, number: int) -> list[irs.Posture]:
    """Postures in the configured working mode but in another assembly mode, all margins high."""
    settings, robot = read_settings(name)
    mechanism, rng = robot.mechanism, np.random.default_rng(8)
    low = [max(joint.lower, -np.pi) if joint.is_angle else joint.lower for joint in mechanism.joints]
    high = [min(joint.upper, np.pi) if joint.is_angle else joint.upper for joint in mechanism.joints]
    found: list[irs.Posture] = []
    for _ in range(20_000):
        joints = tuple(rng.uniform(low, high).tolist())
        for label in mechanism.assembly_modes:
            at = mechanism.posture(joints, label)
            if label != settings.assembly_mode and at.status == irs.Status.SOLVED:
                margins = [*map(abs, at.normalised_levers), *at.cos_pressure]
                if at.working_mode == settings.working_mode and min(margins) > 0.4:
                    found.append(at)
        if len(found) >= number:
            break
    assert found, f"{name}: no such posture, the test proves nothing"
    return found


@pytest.mark.parametrize("name", ["irsbot2_csc", "rrr3", "orthoglide"])
def test_a_path_of_the_platform_in_another_assembly_mode_is_not_certified_for_this_one(name):
    settings, robot = read_settings(name)
    for at in other_modes(name, 5):
        found = certify_poses(robot, settings, [0.0], [at.pose])
        assert found.violation is not None, at
        assert found.violation.cause == Cause.BRANCH
        assert f"{at.assembly_mode:+d}, not in {settings.assembly_mode:+d}" in found.violation.text
        there = certify_poses(robot, settings, [0.0], [at.pose], assembly_mode=at.assembly_mode)
        assert min(at.cos_pressure) - 0.02 <= there.minima[1][0] <= min(at.cos_pressure) + 1e-9


def test_where_labels_do_not_tell_the_branch_the_path_of_the_platform_does():
    settings, robot = read_settings("ruu4")
    for at in other_modes("ruu4", 1)[:2]:
        found = certify_poses(robot, settings, [0.0], [at.pose])
        assert min(at.cos_pressure) - 0.02 <= found.minima[1][0] <= min(at.cos_pressure) + 1e-9
