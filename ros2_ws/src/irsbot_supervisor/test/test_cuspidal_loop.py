"""A loop about a cusp under supervision: the assembly mode changes, no margin falls, the branch is known."""

from __future__ import annotations

import numpy as np
from supervised import feed, sample, settings_of, supervisor_of

from irsbot_kinematics import Status
from irsbot_kinematics.analysis.loops import certify_loop, circle
from irsbot_msgs_py.records import Level

CENTRE, RADIUS_RAD, START_RAD = (-0.750995, 3.180521, -0.321021), 0.1, 5.235988
BEFORE, AFTER = (0.08076, 0.03511, 1.22907), (0.21813, -0.10313, 1.77226)
"""m, m, rad: poses of rrr3_base at the same joints, printed in docs/explanation/algebra.md."""
SAMPLES = 3000
LIMITS = {"type2_stop": 0.05, "type2_warn": 0.08, "type1_stop": 0.05, "type1_warn": 0.1}
"""Below the margins of the loop, 0.129 and 0.357."""
SLOW = {"velocity_limit": [1.0] * 3, "acceleration_limit": [12.0] * 3, "stamp_jitter_s": 1e-5}
"""A faster robot would not stand before the singularity beside the cusp if its drives ran at it."""


STRUTS = ((0.17, 0.18040919, 0.31596386), (2, 3), 0.05, 4.886922)
"""m, rad: a wide circle about a cusp of the rpr3; the pose of label 1 goes on the branch that comes to another one."""


def label_of(robot, joints):
    """The assembly mode whose pose is BEFORE."""
    found = [(mode, robot.mechanism.posture(tuple(joints), mode)) for mode in robot.mechanism.assembly_modes]
    return min(
        (mode for mode, at in found if at.status == Status.SOLVED and np.abs(np.subtract(at.pose, BEFORE)).max() < 1e-4)
    )


def from_rest_to_rest(path):
    """The same way, as many samples, without a jump of the speed at its ends."""
    time = np.linspace(0.0, 1.0, len(path))
    share = time - np.sin(2.0 * np.pi * time) / (2.0 * np.pi)
    return np.column_stack([np.interp(share, time, joint) for joint in path.T])


def test_the_supervisor_knows_the_branch_after_a_change_of_assembly_mode_without_singularity():
    path = from_rest_to_rest(circle(CENTRE, (2, 3), RADIUS_RAD, START_RAD, SAMPLES))
    _settings, robot = settings_of("rrr3_base")
    label = label_of(robot, path[0])
    supervisor = supervisor_of("rrr3_base", working_mode=[-1, 1, 1], assembly_mode=label, **LIMITS, **SLOW)
    names = supervisor.settings.joint_names
    rates = np.gradient(path, 1e-3, axis=0)
    feed(supervisor, [sample(ms, tuple(path[0].tolist()), names=names) for ms in range(-200, 0)])
    states = [
        supervisor.step(sample(ms, tuple(q.tolist()), tuple(rate.tolist()), names=names)).state
        for ms, (q, rate) in enumerate(zip(path, rates, strict=True))
    ]
    assert {state.level for state in states} <= {Level.OK}
    assert states[0].joint_position == states[-1].joint_position
    np.testing.assert_allclose(states[0].pose, BEFORE, atol=1.5e-5)
    np.testing.assert_allclose(states[-1].pose, AFTER, atol=1.5e-5)
    assert min(state.type2_margin for state in states) > 0.12
    proved = certify_loop([*path[::10].tolist(), path[-1].tolist()], "rrr3_base", BEFORE)
    assert proved.certified
    assert proved.changed
    np.testing.assert_allclose(proved.end, states[-1].pose, atol=1e-9)
    # The labels of one posture alone do not tell: the same label at the same joints is where the robot came from.
    np.testing.assert_allclose(robot.mechanism.posture(tuple(path[-1]), label).pose, BEFORE, atol=1.5e-5)


def test_struts_come_back_and_the_platform_does_not_while_no_margin_is_near_its_limit():
    """With the shipped settings. Where the pose is shows a second way: Newton's method on the legs' lengths."""
    centre, (i, k), radius, start = STRUTS
    turn = start + np.pi * (1.0 - np.cos(np.pi * np.linspace(0.0, 1.0, SAMPLES)))  # from rest to rest
    path = np.tile(centre, (SAMPLES, 1))
    path[:, i - 1] += radius * np.cos(turn)
    path[:, k - 1] += radius * np.sin(turn)
    settings, robot = settings_of("rpr3")
    supervisor = supervisor_of("rpr3")
    names = settings.joint_names
    rates = np.gradient(path, 1e-3, axis=0)
    feed(supervisor, [sample(ms, tuple(path[0].tolist()), names=names) for ms in range(-200, 0)])
    states = [
        supervisor.step(sample(ms, tuple(q.tolist()), tuple(rate.tolist()), names=names)).state
        for ms, (q, rate) in enumerate(zip(path, rates, strict=True))
    ]
    assert {state.level for state in states} == {Level.OK}
    assert min(state.type2_margin for state in states) > 0.25
    assert min(min(state.limb_margin) for state in states) > 0.25
    assert len({state.working_mode for state in states}) == 1
    first, last = np.array(states[0].pose), np.array(states[-1].pose)
    assert np.abs(last - first)[:2].max() > 0.1
    np.testing.assert_allclose(last, newton(robot.mechanism.geometry, path, first), atol=1e-9)
    np.testing.assert_allclose(path[0], path[-1], atol=1e-15)
    proved = certify_loop([*path[::10].tolist(), path[-1].tolist()], "rpr3", first)
    assert proved.certified
    assert proved.changed
    np.testing.assert_allclose(proved.end, last, atol=1e-9)


def newton(g, path, pose):
    """Pose at the end of a path, from |p + R b_i - a_i|^2 = q_i^2 and complex steps alone."""
    a, b = np.array([g.a1, g.a2, g.a3]), np.array([g.b1, g.b2, g.b3])

    def closure(x, q):
        c, s = np.cos(x[2]), np.sin(x[2])
        rods = x[:2] + np.stack([c * b[:, 0] - s * b[:, 1], s * b[:, 0] + c * b[:, 1]], axis=1) - a
        return np.sum(rods * rods, axis=1) - q * q

    x = np.array(pose)
    for q in path:
        for _ in range(3):
            slopes = np.array([closure(x + 1e-30j * e, q).imag / 1e-30 for e in np.eye(3)]).T
            x = x - np.linalg.solve(slopes, closure(x, q))
    return x
