"""What the load bends as an error of the geometry: where the number comes from, where it counts, what is refused."""

from __future__ import annotations

import ast
from dataclasses import asdict, replace
from math import nan
from pathlib import Path

import numpy as np
import pytest
from supervised import ready, sample, settings_of

import irsbot_kinematics as irs
from irsbot_kinematics import stiffness
from irsbot_kinematics.analysis.rectangle import Limits
from irsbot_kinematics.stiffness.supervision import useful
from irsbot_supervisor.configuration.compliance import require_bending_said
from irsbot_supervisor.configuration.feasibility import settings_from
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.configuration.stopping_cost import costs
from irsbot_supervisor.core import settings as settings_module
from irsbot_supervisor.core.settings import InvalidSettings
from irsbot_supervisor.gate.velocity_gate import Gate
from irsbot_supervisor.trajectory.verification import certify

MINE = {
    "compliance": "counted",
    "tubes": "five_bar_table1",
    "payload_kg": 1.0,
    "platform_acceleration_m_s2": 60.0,
    "load_moment_nm": 0.0,
    "load_force_n": 10.0,
}
SLACK_M = 4e-4


def test_the_slack_of_the_tubes_covers_every_pose_that_the_stop_limits_keep():
    settings, robot = read_settings("five_bar", MINE)
    assert settings.slack_m == settings.compliance_slack_m > 0.0
    stop = Limits(settings.type1_stop, settings.type2_stop, settings.constraint_stop)
    design = stiffness.load("five_bar_table1").fitted(robot.mechanism)
    rng = np.random.default_rng(3)
    poses = rng.uniform((-0.9, -1.2), (0.9, 1.2), (20000, 2))
    poses = poses[useful(design, poses, stop)]
    assert len(poses) > 2000
    force_n = 10.0 + 1.0 * (9.80665 + 60.0)
    each = stiffness.pose_errors(design, poses, stiffness.Load(force_n)).slack_m
    assert each.max() <= settings.slack_m < 1.2 * each.max()
    more = read_settings("five_bar", {**MINE, "type2_stop": 0.1})[0]
    assert more.slack_m > 1.2 * settings.slack_m  # nearer to Type 2 it bends more
    wrong = {**MINE, "geometry_tolerance_m": 1e-4}
    assert read_settings("five_bar", wrong)[0].slack_m == pytest.approx(settings.slack_m + 1e-4)


def test_a_stated_number_counts_where_compliance_does_and_needs_no_tubes():
    stated = {"compliance_slack_m": SLACK_M, "tubes": "nowhere.yaml"}
    assert read_settings("orthoglide", stated)[0].slack_m == 0.0
    settings, robot = read_settings("orthoglide", {**stated, "compliance": True, "geometry_tolerance_m": 1e-4})
    assert settings.slack_m == pytest.approx(SLACK_M + 1e-4)
    assert settings_from(asdict(settings), robot) == settings  # as a journal tells it


@pytest.mark.parametrize(
    ("robot", "changes", "stated"),
    [
        ("orthoglide", {"tubes": "none"}, "the robot's tubes are not known: set tubes to an elastic design"),
        ("orthoglide", {}, "are for the family five_bar, the robot is a orthoglide"),
        ("five_bar", {"tubes": "nix"}, "no elastic design 'nix'"),
        ("five_bar", {"platform_acceleration_m_s2": 0.0}, "platform_acceleration_m_s2 is 0.0 with payload_kg 1.0"),
        ("five_bar", {"assembly_mode": 1}, "no bound in assembly mode 1"),
        ("five_bar", {"payload_kg": 0.0, "load_force_n": 0.0}, "compliance_slack_m is 0.0"),
        ("irsbot2", {"tubes": "irsbot2_table2"}, "a parallelogram is flat"),
        ("irsbot2", {"compliance_slack_m": 0.09}, "and compliance_slack_m 0.09 alone take the"),
        ("five_bar", {"payload_kg": nan}, "payload_kg is nan"),
    ],
)
def test_an_invalid_amount_is_refused_in_one_line(robot, changes, stated):
    with pytest.raises(InvalidSettings) as caught:
        read_settings(robot, {**MINE, **changes})
    assert stated in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_design_of_one_posture_is_refused(tmp_path):
    file = tmp_path / "arm.yaml"
    file.write_text(
        "family: chains\npoints: {unit: m, A: [0, 0, 0], P: [1, 0, 0]}\nplatform: P\n"
        "sections: {arm: {outer: 60 mm, inner: 50 mm, material: aluminium}}\nlegs: [[{tube: [A, P, arm]}]]\n"
    )
    with pytest.raises(InvalidSettings, match="has one posture only"):
        read_settings("five_bar", {**MINE, "tubes": str(file)})


def bounds_of(robot, **changes):
    """Numbers of all that bounds margins: what is published of a sample, cost, certificate, the gate's rates."""
    supervisor, joints = ready(robot, (0.1, -0.7), **changes)
    step = supervisor.step(sample(0, joints))
    settings, machine = settings_of(robot, **changes)
    other = tuple(q + 0.05 for q in joints)
    motion = certify(machine, settings, [0.0, 1.0], [joints, other])
    gate = Gate(settings, machine.mechanism)
    allowed = [gate.velocity(rates, supervisor.view) for rates in ((2.0, 0.0), (-3.0, 3.0))]
    state = step.state._asdict()
    return motion.minima, allowed, costs(settings, machine.mechanism, 1000.0), state


@pytest.mark.parametrize("robot", ["five_bar", "irsbot2"])
def test_bending_counts_in_every_bound_as_an_error_of_the_geometry_does(robot):
    counted = bounds_of(robot, compliance="counted", compliance_slack_m=SLACK_M)
    wrong = bounds_of(robot, geometry_tolerance_m=SLACK_M)
    exact = bounds_of(robot, compliance="none", compliance_slack_m=SLACK_M)
    assert repr(counted) == repr(wrong)
    for less, all_of_it in zip(counted[0], exact[0], strict=True):
        assert less == all_of_it or less[0] < all_of_it[0]
    assert counted[0] != exact[0]
    assert counted[3]["type2_uncertainty"] > exact[3]["type2_uncertainty"]


def test_every_bound_includes_bending_in_the_error_of_the_geometry():
    """Where the bounds do not tell the difference above: contact, the way out of a stop, the way over a silence."""
    package = Path(settings_module.__file__).parents[1]
    stated = {
        (path.name, ast.unparse(node.value))
        for folder in ("core", "gate", "trajectory", "configuration")
        for path in (package / folder).rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute) and node.attr == "geometry_tolerance_m"
    }
    assert stated == {("settings.py", "self"), ("feasibility.py", "settings"), ("proposal.py", "plant")}


def test_more_bending_has_to_be_stated_while_supervising():
    now = settings_of("five_bar", compliance="counted", compliance_slack_m=SLACK_M)[0]
    for name, value in (("payload_kg", 2.0), ("type2_stop", 0.1), ("platform_acceleration_m_s2", 5.0)):
        wanted = replace(now, **{name: value})
        with pytest.raises(InvalidSettings, match=f"{name} lets the robot bend more"):
            require_bending_said(now, wanted, {name})
        require_bending_said(now, replace(wanted, compliance_slack_m=1e-3), {name, "compliance_slack_m"})
        require_bending_said(wanted, now, {name})  # less is no harm
        require_bending_said(replace(now, compliance="none"), replace(wanted, compliance="none"), {name})


def test_a_margin_that_bending_may_take_is_no_margin():
    """At a limit that the rigid robot just keeps, one that bends is stopped."""
    robot = irs.make_robot("five_bar")
    q = robot.inverse((0.1, -0.7))
    at = robot.posture(q)
    limits = {"type2_stop": 0.999 * at.type2, "type2_warn": 0.9995 * at.type2, "velocity_limit": 0.05}
    settings, machine = settings_of("five_bar", **limits)
    assert certify(machine, settings, [0.0], [q]).safe
    settings, machine = settings_of("five_bar", compliance="counted", compliance_slack_m=2e-3, **limits)
    assert not certify(machine, settings, [0.0], [q]).safe
