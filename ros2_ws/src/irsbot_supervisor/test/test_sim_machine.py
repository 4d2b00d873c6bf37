"""Efforts against energy and virtual work, encoders against their data sheet, obedience against its table."""

from __future__ import annotations

import numpy as np
import pytest

from irsbot_kinematics import Robot, make_robot
from irsbot_supervisor.sim.errors import BadSetting
from irsbot_supervisor.sim.joints import Drives
from irsbot_supervisor.sim.machine import STANDARD_GRAVITY, Encoder, Machine, Payload
from irsbot_supervisor.sim.paths import RoundedPath
from irsbot_supervisor.sim.stop_response import StopResponse
from irsbot_supervisor.sim.trajectory import stand, task_move
from irsbot_supervisor.trajectory.joint_path import JointLimits, JointPath, JointPoint

MASS_KG = 2.5
LIMITS = JointLimits((12.0, 12.0), (400.0, 400.0), (400.0, 400.0))
POSES = ((0.3, -0.75), (-0.2, -0.9), (0.0, -1.0))
MS = 1_000_000


@pytest.fixture(scope="module")
def robot() -> Robot:
    return make_robot("irsbot2")


def moving(robot: Robot) -> JointPath:
    path = RoundedPath([(-0.3, -0.7), (0.2, -0.9), (0.3, -0.6)], 0.1, (1.0, 1.0))
    return task_move(robot.mechanism, path, (1, -1), tuple(robot.inverse((-0.3, -0.7))), LIMITS)


def resting(robot: Robot, pose: tuple[float, float]) -> JointPoint:
    return JointPoint(tuple(robot.inverse(pose)), (0.0, 0.0), (0.0, 0.0))


def jacobian(robot: Robot, q: np.ndarray) -> np.ndarray:
    """dP/dq by central differences of the direct kinematics."""
    step = 1e-6
    columns = [(robot.direct(q + step * e) - robot.direct(q - step * e)) / (2.0 * step) for e in np.eye(len(q))]
    return np.array(columns).T


# --- efforts ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("pose", POSES)
def test_the_effort_at_rest_is_the_slope_of_the_potential_energy(robot, pose):
    q = robot.inverse(pose)
    slope = MASS_KG * STANDARD_GRAVITY * jacobian(robot, q)[1]  # dV/dq with V = m g z
    efforts = Payload(robot.mechanism, MASS_KG, -1).efforts(resting(robot, pose))
    assert efforts == pytest.approx(slope, rel=1e-7)
    assert min(np.abs(slope)) > 1.0, "the weight is hardly felt: the fixture proves nothing"


@pytest.mark.parametrize(("name", "pose"), [("five_bar", (0.2, -0.8)), ("orthoglide", (0.2, -0.3, 0.4))])
def test_efforts_of_other_mechanisms_balance_the_weight_too(name, pose):
    other = make_robot(name)
    q = other.inverse(pose)
    rest = (0.0,) * len(q)
    slope = MASS_KG * STANDARD_GRAVITY * jacobian(other, q)[-1]  # z is the last task coordinate
    assert Payload(other.mechanism, MASS_KG, other.mechanism.usual_assembly_mode).efforts(
        JointPoint(tuple(q), rest, rest)
    ) == pytest.approx(slope, rel=1e-6)


def test_efforts_in_motion_are_those_of_lagrange(robot):
    payload, path, step = Payload(robot.mechanism, MASS_KG, -1), moving(robot), 1e-4
    for time in np.linspace(0.1, 0.9, 25) * path.duration_s:
        before, at, after = (robot.direct(path.at(time + dt).position) for dt in (-step, 0.0, step))
        acceleration = (before - 2.0 * at + after) / step**2
        force = MASS_KG * (acceleration + np.array([0.0, STANDARD_GRAVITY]))
        expected = jacobian(robot, np.array(path.at(time).position)).T @ force
        assert payload.efforts(path.at(time)) == pytest.approx(expected, rel=1e-3, abs=0.05)


def test_the_motors_do_the_work_that_the_energy_gains(robot):
    payload, path = Payload(robot.mechanism, MASS_KG, -1), moving(robot)
    times = np.linspace(0.0, path.duration_s, 4001)
    points = [path.at(t) for t in times]
    power = [np.dot(payload.efforts(point), point.velocity) for point in points]
    work = np.concatenate(([0.0], np.cumsum(0.5 * (np.array(power[1:]) + power[:-1]) * np.diff(times))))
    poses = np.array([robot.direct(point.position) for point in points])
    speeds = np.linalg.norm(np.gradient(poses, times, axis=0, edge_order=2), axis=1)
    energy = MASS_KG * (0.5 * speeds**2 + STANDARD_GRAVITY * (poses[:, 1] - poses[0, 1]))
    assert np.ptp(energy) > 10.0, "hardly any energy moves: the fixture proves nothing"
    assert np.abs(work - energy).max() < 1e-3 * np.ptp(energy)


def test_efforts_are_not_numbers_where_no_pose_belongs_to_the_joints(robot):
    nowhere = JointPoint((0.0, np.pi), (0.0, 0.0), (0.0, 0.0))
    far_apart = make_robot("five_bar", b=0.6)
    assert np.isnan(Payload(far_apart.mechanism, 1.0, -1).efforts(JointPoint((np.pi, 0.0), *nowhere[1:]))).all()
    coincident = JointPoint((1.531939174925, 1.609653478665), (0.0, 0.0), (0.0, 0.0))  # W2 of the model
    assert np.isnan(Payload(robot.mechanism, 1.0, -1).efforts(coincident)).all()


@pytest.mark.parametrize("mass", [-1.0, float("nan"), float("inf")])
def test_a_mass_must_be_finite_and_not_negative(robot, mass):
    with pytest.raises(BadSetting, match="mass"):
        Payload(robot.mechanism, mass, -1)


# --- encoders ---------------------------------------------------------------------------------------------------


def test_a_perfect_encoder_reads_the_true_position():
    assert Encoder().read((0.123456789, -1.0)) == (0.123456789, -1.0)


def test_an_encoder_reads_whole_steps_within_half_a_step():
    step = 1e-3
    true = np.random.default_rng(1).uniform(-4.0, 4.0, 1000)
    read = np.array(Encoder(resolution=step).read(tuple(true)))
    assert np.abs(read / step - np.round(read / step)).max() < 1e-9
    assert np.abs(read - true).max() <= 0.5 * step * (1.0 + 1e-9)


def test_noise_has_its_deviation_and_repeats_with_its_seed():
    true = (0.5,) * 20_000
    read = np.array(Encoder(noise=0.01, seed=3).read(true))
    assert np.std(read - 0.5) == pytest.approx(0.01, rel=0.03)  # standard error 0.5 %
    assert np.mean(read - 0.5) == pytest.approx(0.0, abs=3e-4)  # standard error 7e-5
    assert np.array_equal(read, Encoder(noise=0.01, seed=3).read(true))
    assert not np.array_equal(read, Encoder(noise=0.01, seed=4).read(true))


@pytest.mark.parametrize("bad", [-1e-3, float("nan"), float("inf")])
def test_an_encoder_needs_a_finite_resolution_and_noise(bad):
    with pytest.raises(BadSetting):
        Encoder(resolution=bad)
    with pytest.raises(BadSetting):
        Encoder(noise=bad)


def test_a_reading_has_encoder_positions_and_motor_efforts_of_the_drives(robot):
    payload = Payload(robot.mechanism, MASS_KG, -1)
    q = tuple(robot.inverse(POSES[0]))
    machine = Machine(Drives(stand(q), LIMITS), Encoder(resolution=0.01), payload)
    reading = machine.step(0.001, 1.0)
    assert reading.position == pytest.approx(np.round(np.array(q), 2))
    assert reading.velocity == (0.0, 0.0)
    assert reading.effort == payload.efforts(resting(robot, POSES[0]))


# --- obedience --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("level", "scale", "allowed"),
    [
        (0, 1.0, 1.0),
        (1, 1.0, 1.0),
        (1, 0.1, 0.1),
        (0, 0.5, 0.5),
        (2, 1.0, 0.0),
        (3, 1.0, 0.0),
        (4, 1.0, 0.0),
        (0, 0.0, 0.0),
        (0, -1.0, 0.0),
        (0, 1.5, 0.0),
        (0, float("nan"), 0.0),
        (1, float("inf"), 0.0),
    ],
)
def test_only_ok_and_warn_with_a_scale_in_0_to_1_allow_motion(level, scale, allowed):
    stop_response = StopResponse(0.1)
    stop_response.hear(level, scale, 5 * MS)
    assert stop_response.allowed(6 * MS) == allowed


def test_before_the_first_verdict_a_consumer_brakes():
    assert StopResponse(0.1).allowed(0) == 0.0


def test_silence_longer_than_the_timeout_means_brake_and_a_new_verdict_ends_it():
    stop_response = StopResponse(0.1)
    stop_response.hear(0, 1.0, 0)
    assert stop_response.allowed(100 * MS) == 1.0
    assert stop_response.allowed(100 * MS + 1) == 0.0
    stop_response.hear(0, 1.0, 300 * MS)
    assert stop_response.allowed(301 * MS) == 1.0


def test_a_verdict_does_not_excuse_silence_long_before_it():
    stop_response = StopResponse(0.1)
    stop_response.hear(0, 1.0, 5000 * MS)
    assert stop_response.allowed(4000 * MS) == 0.0


@pytest.mark.parametrize("timeout", [0.0, -1.0, float("nan"), float("inf")])
def test_the_timeout_cannot_be_switched_off(timeout):
    with pytest.raises(BadSetting):
        StopResponse(timeout)
