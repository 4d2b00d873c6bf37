"""What bending takes off a margin: bounds against bent 3-D frames, pose by pose and over a workspace, by sampling."""

from __future__ import annotations

from dataclasses import replace
from math import hypot

import numpy as np
import pytest
from frame import AXIS_Y, SIGMA, Pipe, five_bar_frame, irsbot2_frame
from irsbot2_3d import Design, leg, unit
from random_frames import random_irsbot2

import irsbot_kinematics as irs
from irsbot_kinematics import stiffness
from irsbot_kinematics.analysis.rectangle import Limits
from irsbot_kinematics.stiffness import Load, Section, SingularPosture, compliance_error, pose_errors
from irsbot_kinematics.stiffness.supervision import useful

LOAD = Load(force_n=10.0, moment_nm=1.0, payload_kg=1.5, acceleration_m_s2=60.0)
LIMITS = Limits(0.15, 0.15, 0.04)
BOX = ((-0.35, 0.35), (-0.95, -0.6))
ROBOTS = [("irsbot2_table2", None), ("irsbot2_table2", "irsbot2"), ("irsbot2_table4", None), ("five_bar_table1", None)]


def framed(design, q, psi, pose):
    """The frame of a design, its tubes from the numbers of the file."""
    g = design.geometry
    pipes = {kind: Pipe(s.outer, s.inner, s.material.young, s.material.poisson) for kind, s in design.sections.items()}
    if design.family == "five_bar":
        return five_bar_frame(g.l1, g.b, q, np.array([pose[0], 0.0, pose[1]]), pipes, np.array([AXIS_Y]))
    d3 = Design(g.l1, g.l2eq, g.b, g.p, g.a1, g.a2, g.beta, g.e)
    side = design.parallelogram * np.array([design.direction[0], 0.0, design.direction[1]])
    return irsbot2_frame(d3, q, psi, pipes, side, design.spacing)


def loads(rng, number, load=LOAD):
    """Wrenches in the plane of motion, on the surface of the two balls of a load and inside them."""
    angle, part = rng.uniform(0.0, 2.0 * np.pi, number), rng.choice([1.0, 0.6], number)
    force = load.force * part * np.array([np.cos(angle), np.sin(angle)])
    return np.array([force[0], force[1], load.moment_nm * rng.choice([-1.0, 1.0], number)])


def bent_margins(design, built, q, loads_xzm):
    """Type 1 of both legs, Type 2, and the error of each leg, of the bent frame: from the places of its nodes alone."""
    g = design.geometry
    moved = built.frame.solve(built.platform, np.eye(6)[:, [0, 2, 4]]) @ loads_xzm
    at = np.array([0, 2])
    cranks, rods, errors = [], [], []
    P = moved[6 * built.platform + at]
    for k, sigma in enumerate(SIGMA):
        near = sum(built.frame.places[n][at][:, None] + moved[6 * n + at] for n in built.near[k]) / len(built.near[k])
        far = sum(built.frame.places[n][at][:, None] + moved[6 * n + at] for n in built.far[k]) / len(built.far[k])
        rigid_near = sum(built.frame.places[n][at] for n in built.near[k]) / len(built.near[k])
        rigid_far = sum(built.frame.places[n][at] for n in built.far[k]) / len(built.far[k])
        shift = rigid_near - np.array([-sigma * g.b + g.l1 * np.cos(q[k]), -g.l1 * np.sin(q[k])])
        crank = near - shift[:, None] - np.array([[-sigma * g.b], [0.0]])
        rod = far - near
        cranks.append(crank / np.linalg.norm(crank, axis=0))
        length = hypot(*(rigid_far - rigid_near))
        rods.append(rod / np.linalg.norm(rod, axis=0))
        # Where a rigid rod of this direction, that carries the displaced platform, would begin.
        virtual = rigid_far[:, None] + P - length * rods[-1]
        errors.append(np.linalg.norm(virtual - rigid_near[:, None], axis=0))
    type1 = [np.abs(c[0] * r[1] - c[1] * r[0]) for c, r in zip(cranks, rods, strict=True)]
    type2 = np.abs(rods[0][0] * rods[1][1] - rods[0][1] * rods[1][0])
    return type1, type2, np.array(errors), np.linalg.norm(P, axis=0)


def bounds(design, at, slack_m):
    """Both bounds that a supervisor uses."""
    still = (0.0, 0.0)
    return design.mechanism.certified_bounds(at, still, slack_m), design.mechanism.sharp_bounds(at, still, slack_m)


@pytest.mark.parametrize(("name", "robot"), ROBOTS)
def test_no_sample_of_the_bent_frame_is_worse_than_the_bounds(name, robot):
    """Bounds of each pose hold for every load; the bound over the workspace holds at poses it has not met; and they
    are not idle: the worst sample takes a good part of each."""
    design = stiffness.load(name, robot=robot)
    limits = LIMITS._replace(constraint=0.0) if design.family == "five_bar" else LIMITS
    over_all = compliance_error(design, LOAD, limits, BOX)
    rng = np.random.default_rng(11)
    poses = rng.uniform(*np.transpose(BOX), (400, 2))
    poses = poses[useful(design, poses, limits)]
    assert len(poses) > 100
    each = pose_errors(design, poses, LOAD)
    assert (each.slack_m <= over_all.slack_m).all()
    assert (each.displacement_m <= over_all.displacement_m).all()
    assert (each.lateral_m <= over_all.lateral_m).all()
    rigid, used = irs.Robot(design.mechanism), []
    for i in range(12):
        q = rigid.inverse(poses[i], design.working_mode)
        at = rigid.posture(q)
        psi = design.mechanism.rod_angles(at)
        built = framed(design, q, psi, poses[i])
        wrenches = loads(rng, 300)
        type1, type2, errors, displaced = bent_margins(design, built, q, wrenches)
        for slack in (float(each.slack_m[i]), over_all.slack_m):
            for sure in bounds(design, at, slack):
                assert all((found >= floor).all() for found, floor in zip(type1, sure.type1, strict=True))
                assert (type2 >= sure.type2).all()
        assert errors.max() <= each.slack_m[i]
        assert displaced.max() <= each.displacement_m[i]
        used.append((errors.max() / each.slack_m[i], displaced.max() / each.displacement_m[i]))
        across = built.frame.solve(built.platform, np.eye(6)[:, [1, 3, 5]])[6 * built.platform + 1]
        assert LOAD.force * abs(across[0]) + LOAD.moment_nm * hypot(*across[1:]) == pytest.approx(
            each.lateral_m[i], rel=1e-6
        )
    assert np.max(used, axis=0)[0] > 0.3
    assert np.max(used, axis=0)[1] > 0.9


def bent_constraint_margin(design, built, moved, end):
    """kappa of the bent robot in space, as `irsbot2_3d.kappa` of the rigid one: from the places of the rods' ends and
    the elbow axes, turned with the elbow (`near`) or with the platform (`far`)."""
    g = design.geometry
    normals, meets = [], []
    for k in (0, 1):
        lines = []
        for j in (0, 1):
            a, b = built.near[k][j], built.far[k][j]
            E = built.frame.places[a] + moved[6 * a : 6 * a + 3]
            F = built.frame.places[b] + moved[6 * b : 6 * b + 3]
            body = a if end == "near" else built.platform
            y1 = leg(Design(g.l1, g.l2eq, g.b, g.p, g.a1, g.a2, g.beta, g.e), k, 0.0, 0.0).e1[j]
            y1 = unit(y1 + np.cross(moved[6 * body + 3 : 6 * body + 6], y1))
            along = unit(F - E)
            normals.append(np.cross(y1, unit(np.cross(y1, along))))
            lines.append((E, along))
        (E1, f1), (E2, f2) = lines
        meets.append(E1 + np.linalg.lstsq(np.stack([f1, -f2], axis=1), E2 - E1, rcond=None)[0][0] * f1)
    length = 2.0 * (g.p + g.a2 / (g.a1 - g.a2) * g.l2eq)
    across = np.cross(AXIS_Y, meets[1] - meets[0]) / length
    return np.linalg.svd(np.stack([*normals, across], axis=1), compute_uv=False)[2]


def soft_rods(p):
    """Table 2 with soft rods on thick cranks and elbows: the platform tilts and hardly anything else moves."""
    design = stiffness.load("irsbot2_table2", p=p)
    material = design.sections["distal"].material
    thick, thin = Section(0.3, 0.0, material), Section(0.02, 0.016, material)
    return replace(design, sections={"proximal": thick, "parallel": thick, "elbow": thick, "distal": thin})


@pytest.mark.parametrize(
    ("design", "load"),
    [
        *((stiffness.load(name, robot=robot), LOAD) for name, robot in ROBOTS[:3]),
        *((soft_rods(p), Load(moment_nm=0.03)) for p in (0.05, 2e-4)),
    ],
    ids=["table2", "table2 on irsbot2", "table4", "soft rods", "soft rods, narrow platform"],
)
def test_no_sample_has_a_smaller_constraint_margin_than_is_left_for_certain(design, load):
    """Sampled, not derived: the slack bounds how the rods turn; axes on platform and elbows tilt besides."""
    rng = np.random.default_rng(12)
    poses = rng.uniform(*np.transpose(BOX), (300, 2))
    poses = poses[useful(design, poses, LIMITS)][:10]
    each, rigid, taken = pose_errors(design, poses, load), irs.Robot(design.mechanism), 0.0
    for pose, slack in zip(poses, each.slack_m, strict=True):
        q = rigid.inverse(pose, design.working_mode)
        at = rigid.posture(q)
        built = framed(design, q, design.mechanism.rod_angles(at), pose)
        moved = built.frame.solve(built.platform, np.eye(6)[:, [0, 2, 4]])
        assert bent_constraint_margin(design, built, 0.0 * moved[:, 0], "near") == pytest.approx(
            at.constraint, abs=1e-9
        )
        sure = max(bound.constraint for bound in bounds(design, at, float(slack)))
        for w in loads(rng, 12, load).T:
            found = min(bent_constraint_margin(design, built, moved @ w, end) for end in ("near", "far"))
            assert found >= sure
            taken = max(taken, at.constraint - found)
    assert taken > 1e-5


@pytest.mark.parametrize("narrow", [1.0, 0.1, 0.001], ids=["p", "p/10", "p/1000"])
def test_no_random_robot_loses_more_than_half_of_the_subtracted_margin(narrow):
    """Geometry, tubes, materials and posture at random; force or moment so large that the slack is 10 um."""
    rng, seen = np.random.default_rng(21), 0
    while seen < 25:
        design, pose, built, _, q, _, _ = random_irsbot2(rng, narrow)
        at = design.mechanism.posture(tuple(q), design.mechanism.usual_assembly_mode)
        if at.status != 0 or hypot(*(at.pose - pose)) > 1e-6 or min(at.constraint, at.type2, *at.type1) < 0.1:
            continue
        seen += 1
        moved = built.frame.solve(built.platform, np.eye(6)[:, [0, 2, 4]])
        for load in (Load(force_n=1.0), Load(moment_nm=1.0)):
            share = 1e-5 / float(pose_errors(design, pose[None], load).slack_m[0])
            load = Load(share * load.force_n, share * load.moment_nm)
            slack = float(pose_errors(design, pose[None], load).slack_m[0])
            sure = bounds(design, at, slack)
            wrenches = loads(rng, 8, load)
            type1, type2, errors, _ = bent_margins(design, built, q, wrenches)
            ends = [
                bent_constraint_margin(design, built, moved @ w, end) for w in wrenches.T for end in ("near", "far")
            ]
            assert errors.max() <= slack
            for found, rigid, floor in (
                (min(ends), at.constraint, max(b.constraint for b in sure)),
                (type2.min(), at.type2, max(b.type2 for b in sure)),
                *((type1[k].min(), at.type1[k], max(b.type1[k] for b in sure)) for k in (0, 1)),
            ):
                assert rigid - found <= 0.5 * (rigid - floor)


def test_the_bound_over_a_workspace_stays_below_a_finer_look_by_little():
    design = stiffness.load("irsbot2_table2")
    found = compliance_error(design, LOAD, LIMITS, BOX)
    x, z = np.meshgrid(np.linspace(*BOX[0], 401), np.linspace(*BOX[1], 201))
    dense = np.column_stack([x.ravel(), z.ravel()])
    dense = dense[useful(design, dense, LIMITS)]
    largest = pose_errors(design, dense, LOAD).slack_m.max()
    assert largest <= found.slack_m <= 1.1 * largest
    assert all(low <= value <= high for value, (low, high) in zip(found.worst_pose, BOX, strict=True))
    worst = pose_errors(design, np.array([found.worst_pose]), LOAD).slack_m[0]
    assert worst == pytest.approx(found.slack_m - found.refinement_m, rel=1e-12)


def test_the_tubes_of_a_design_fit_the_robot_that_is_supervised():
    tubes, robot = stiffness.load("irsbot2_table2"), irs.make_robot("irsbot2", l1=0.4)
    fitted = tubes.fitted(robot.mechanism)
    other = stiffness.load("irsbot2_table2", robot="irsbot2", l1=0.4)
    assert np.array_equal(stiffness.matrix(fitted, (0.1, -0.8)), stiffness.matrix(other, (0.1, -0.8)))
    assert tubes.fitted(robot.mechanism, (1, 1)).working_mode == (1, 1)
    with pytest.raises(stiffness.InvalidDesign, match="the robot is a five_bar"):
        tubes.fitted(irs.make_robot("five_bar").mechanism)


def test_without_load_nothing_bends_and_twice_the_load_bends_twice_and_a_little_more():
    design, poses = stiffness.load("irsbot2_table2"), np.array([(0.1, -0.8)])
    none, one, two = (pose_errors(design, poses, Load(force)) for force in (0.0, 10.0, 20.0))
    assert (none.slack_m[0], none.displacement_m[0], none.lateral_m[0]) == (0.0, 0.0, 0.0)
    assert two.displacement_m[0] == pytest.approx(2.0 * one.displacement_m[0])
    assert 2.0 * one.slack_m[0] < two.slack_m[0] < 2.02 * one.slack_m[0]


def test_weight_and_inertia_add_to_the_force():
    assert Load(10.0, 0.0, 2.0, 30.0).force == pytest.approx(10.0 + 2.0 * (9.80665 + 30.0))
    for wrong in ({"force_n": -1.0}, {"payload_kg": float("nan")}, {"acceleration_m_s2": float("inf")}):
        with pytest.raises(irs.BadInput):
            Load(**wrong)


def test_a_workspace_without_bound_or_without_pose_is_refused():
    design = stiffness.load("irsbot2_table2")  # cranks that point straight down fold the parallelogram
    with pytest.raises(SingularPosture, match="no bound; give a smaller box"):
        compliance_error(design, LOAD, LIMITS)
    with pytest.raises(irs.BadInput, match="no pose of the workspace"):
        compliance_error(design, LOAD, LIMITS, ((3.0, 4.0), (3.0, 4.0)))
