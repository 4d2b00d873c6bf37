"""The branch of a robot: when it is lost, and what loses it."""

from __future__ import annotations

from math import cos, isnan, tau

import numpy as np
import pytest
from near_type2 import ALWAYS, FREE, STAND_MS, along, distance_m, out_s, standing, until_type2
from supervised import (
    MS,
    configure,
    expectation,
    feed,
    joints_of,
    level_in_force,
    newest,
    ready,
    reset,
    resting,
    sample,
    supervisor_of,
    tick,
)

import irsbot_kinematics as irs
from irsbot_msgs_py.records import Cause, Floats, JointSample, Level
from irsbot_supervisor.core.events import Step
from irsbot_supervisor.core.reachable_box import position_error
from irsbot_supervisor.core.supervisor import Supervisor

# --- the branch -------------------------------------------------------------------------------------------------


def test_another_working_mode_is_a_loss_of_the_branch_that_a_look_does_not_cure():
    supervisor = supervisor_of()
    wrong = tuple(supervisor.robot.inverse((0.0, -0.85), (-1, -1)).tolist())
    steps = feed(supervisor, resting(0, 200, wrong))
    assert (level_in_force(steps), newest(steps).latched) == (Level.UNKNOWN, True)
    assert newest(steps).causes & Cause.BRANCH
    assert "mode" in supervisor.step(reset(200, newest(steps).event)).refusal
    assert supervisor.step(sample(201, wrong)).state.level == Level.UNKNOWN


@pytest.mark.parametrize("gap_m", [0.0, 1e-12, 1e-9, 1e-7, 9e-7, 1.1e-6, 1e-4, 1e-2])
def test_near_a_type_2_locus_nothing_is_ok_and_contact_is_latched_as_a_loss_of_the_branch(gap_m):
    """Elbows of irsbot2_beta45 that are `gap_m` apart: the cranks stand mirrored with b0 + l1 cos q2 = gap/2."""
    supervisor = supervisor_of("irsbot2_beta45")
    geometry = supervisor.robot.mechanism.geometry
    q2 = -np.arccos((0.5 * gap_m - geometry.b0) / geometry.l1)
    q = (float(-np.pi - q2), float(q2))
    steps = feed(supervisor, resting(0, 100, q))
    for step in steps:
        assert step.state.level in (Level.STOP, Level.UNKNOWN)
        assert step.state.causes & (Cause.TYPE2 | Cause.NOT_ASSEMBLED)
    verdict = newest(steps)
    assert verdict.latched
    touched = bool(verdict.causes & Cause.BRANCH)
    # Between two samples both cranks may turn for 0.5 ms at recovery speed, and back in the other 0.5 ms.
    settings = supervisor.settings
    unseen = 0.5e-3 * settings.recovery_share * settings.velocity_limit[0] + position_error(settings)
    closing_m = 2.0 * geometry.l1 * abs(np.sin(q2)) * unseen
    assert not 0.8 * closing_m < gap_m < 1.2 * closing_m, "too near to tell"
    assert touched == (gap_m < closing_m)
    away = joints_of(supervisor, 0.0, -0.8)
    steps = feed(supervisor, resting(2000, 2200, away))
    assert newest(steps).latched
    assert newest(steps).level == Level.UNKNOWN  # who knows what it met in two seconds, so near to the locus
    assert newest(steps).causes & Cause.BRANCH


def test_legs_that_come_apart_have_passed_type_2_and_the_branch_is_lost():
    """Rods in line: the elbows of irsbot2 are farther apart than both rods reach."""
    supervisor = supervisor_of("irsbot2")
    geometry = supervisor.robot.mechanism.geometry
    assert 2.0 * (geometry.l1 + geometry.b0) < 2.0 * geometry.l2eq, "the fixture needs a design that cannot come apart"
    csc = supervisor_of("irsbot2_csc")
    wide = (float(np.pi), 0.0)  # both cranks point outwards
    assert csc.robot.mechanism.posture(wide, -1).status == irs.Status.UNREACHABLE
    steps = feed(csc, [sample(ms, wide) for ms in range(100)])
    assert newest(steps).latched
    assert newest(steps).causes & Cause.BRANCH
    assert all(step.state.causes == Cause.BRANCH | Cause.NOT_ASSEMBLED for step in steps)
    assert all(isnan(step.state.type2_margin) for step in steps)


def test_a_jump_that_stays_is_latched_until_a_reset():
    supervisor, q = ready()
    steps = feed(supervisor, resting(0, 250, (q[0] + 0.2, q[1])))
    verdict = newest(steps)
    assert verdict.latched
    assert verdict.causes & Cause.BRANCH
    assert supervisor.step(reset(250, verdict.event)).refusal == ""
    assert level_in_force(feed(supervisor, resting(251, 300, (q[0] + 0.2, q[1])))) == Level.OK


@pytest.mark.parametrize("back_ms", [0.0, 5000.0], ids=["same clock", "clock set back"])
def test_a_silence_in_which_the_robot_may_have_met_a_type_2_singularity_latches_the_loss_of_the_branch(back_ms):
    """From z = -0.9 m to +0.7 m in 0.4 s; each of both postures by itself is good."""
    supervisor = supervisor_of()
    first, then = (2.7, 0.44), (0.0, 3.14)
    feed(supervisor, resting(-300, 0, first))
    assert supervisor.step(sample(0, first)).state.level == Level.OK
    ends = [supervisor.robot.direct(q, supervisor.settings.assembly_mode)[1] for q in (first, then)]
    assert ends[0] * ends[1] < 0.0, "the platform has not changed sides: the fixture proves nothing"
    steps = feed(supervisor, [set_back(one, back_ms) for one in resting(400, 700, then)])
    assert newest(steps).latched
    assert newest(steps).causes & Cause.BRANCH
    assert all(one.level != Level.OK for one in expectation(steps))


def set_back(one: JointSample, back_ms: float) -> JointSample:
    """A sample as it comes after the ROS clock, which sender and receiver share, was set back."""
    back_ns = round(back_ms * MS)
    return one._replace(stamp_ns=one.stamp_ns - back_ns, received_ns=one.received_ns - back_ns)


@pytest.mark.parametrize("silence_ms", [60, 400, 5000])
@pytest.mark.parametrize("back_ms", [0.0, 5000.0], ids=["same clock", "clock set back"])
def test_a_silence_in_a_good_posture_at_rest_loses_no_branch(silence_ms, back_ms):
    """Also where the clocks are set meanwhile."""
    supervisor, q = ready()
    steps = feed(supervisor, [set_back(one, back_ms) for one in resting(silence_ms, silence_ms + 300, q)])
    assert not newest(steps).latched
    assert level_in_force(steps) == Level.OK


# --- between two samples ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("gap_ms", [45, 49, 60, 100, 2000])
@pytest.mark.parametrize("ticks", [False, True], ids=["alone", "with ticks"])
def test_a_time_without_samples_in_which_type_2_can_be_met_loses_the_branch_of_a_robot_that_stood_free(gap_ms, ticks):
    assert 2.0 * out_s(distance_m()) < 0.04, "the drives cannot be there and back: they may turn at once"
    supervisor = supervisor_of("rails3")
    assert level_in_force(feed(supervisor, standing(-STAND_MS, 0))) == Level.OK
    if ticks:
        feed(supervisor, [tick(ms) for ms in range(5, gap_ms, 10)])
    verdict = newest(feed(supervisor, standing(gap_ms, gap_ms + 300)))
    assert verdict.causes & Cause.BRANCH
    assert verdict.latched
    assert "while no samples came" in verdict.text


def fails(*_arguments: object) -> None:
    raise ArithmeticError("a fake error of the mechanism")


@pytest.mark.parametrize("times_ms", [(60,), (20, 40, 60), (1, 2, 3)], ids=["one late sample", "rare samples", "early"])
def test_an_error_inside_hides_no_time_without_samples(times_ms, monkeypatch):
    """Samples whose posture was not judged end no silence."""
    supervisor = supervisor_of("rails3")
    feed(supervisor, standing(-STAND_MS, 0))
    names = supervisor.settings.joint_names
    with monkeypatch.context() as broken:
        broken.setattr(type(supervisor.robot.mechanism), "posture", fails)
        broken.setattr(type(supervisor.robot.mechanism), "track", fails)
        for ms in times_ms:
            with pytest.raises(ArithmeticError) as error:
                supervisor.step(sample(ms, FREE, names=names))
            supervisor.fail(sample(ms, FREE, names=names).seen_ns, error.value)
    steps = feed(supervisor, standing(times_ms[-1] + 1, times_ms[-1] + 300))
    assert bool(newest(steps).causes & Cause.BRANCH) == (times_ms[-1] > 7), newest(steps).text
    assert times_ms[-1] > 7 or level_in_force(steps) == Level.OK


def test_a_jump_stays_known_if_an_error_comes_before_its_posture(monkeypatch):
    supervisor = supervisor_of("rails3")
    feed(supervisor, standing(-STAND_MS, 0))
    names, aside = supervisor.settings.joint_names, along(-0.05)
    supervisor.step(sample(1, aside, names=names))
    with monkeypatch.context() as broken:
        broken.setattr(type(supervisor.robot.mechanism), "posture", fails)
        broken.setattr(type(supervisor.robot.mechanism), "track", fails)
        with pytest.raises(ArithmeticError) as error:
            supervisor.step(sample(60, aside, names=names))
        supervisor.fail(sample(60, aside, names=names).seen_ns, error.value)
    verdict = newest(feed(supervisor, [sample(ms, aside, names=names) for ms in range(61, 300)]))
    assert verdict.causes & Cause.BRANCH
    assert "jumped" in verdict.text


def test_a_time_that_the_box_covers_loses_no_branch():
    supervisor = supervisor_of("rails3")
    feed(supervisor, standing(-STAND_MS, 0))
    steps = feed(supervisor, standing(7, 300))  # 1 ms until the next, 1 ms of judging, 5 ms of latency
    assert level_in_force(steps) == Level.OK
    assert not newest(steps).latched


@pytest.mark.parametrize(("held_ms", "lost"), [(5, True), (200, False)])
def test_a_stop_keeps_the_branch_through_a_silence_once_its_brakes_have_acted(held_ms, lost):
    supervisor = supervisor_of("rails3")
    feed(supervisor, standing(-STAND_MS, 0))
    supervisor.step(configure(0, supervisor, type2_stop=0.4, type2_warn=0.5))
    verdict = newest(feed(supervisor, standing(1, held_ms)))
    assert (verdict.level, verdict.latched) == (Level.STOP, True)
    verdict = newest(feed(supervisor, standing(held_ms + 100, held_ms + 400)))
    assert bool(verdict.causes & Cause.BRANCH) == lost
    assert verdict.latched


# --- near Type 2 after a stop ------------------------------------------------------------------------------------


def by_hand(supervisor: Supervisor, start: Floats, way: Floats, wrong: float, shift_ms: float) -> list[Step]:
    """A stopped robot that somebody moves slowly that far and back, in 0.8 s. wrong: readings are off by this share of
    the error that the settings state, towards the start. shift_ms: the turn is so long after a sample."""
    settings = supervisor.settings
    feed(supervisor, still(supervisor, start, 0, 299))
    steps = feed(supervisor, [configure(299, supervisor, **ALWAYS), *still(supervisor, start, 300, 400)])
    assert (newest(steps).level, newest(steps).latched) == (Level.STOP, True)
    error = wrong * position_error(settings)
    longest = max(map(abs, way))
    for ms in range(400, 1201):
        share = 0.5 * (1.0 - cos(tau * (ms - 400 - shift_ms) / 800.0))
        position = tuple(q + share * step - error * step / longest for q, step in zip(start, way, strict=True))
        steps.append(supervisor.step(sample(ms, position, names=settings.joint_names)))
    return steps


def still(supervisor: Supervisor, position: Floats, begin_ms: int, end_ms: int) -> list[JointSample]:
    return [sample(ms, position, names=supervisor.settings.joint_names) for ms in range(begin_ms, end_ms)]


ROBOTS = ("rails3", "orthoglide", "irsbot2_beta45")


@pytest.mark.parametrize(
    ("robot", "wrong", "shift_ms"),
    [("orthoglide", 0.0, 0.5), ("irsbot2_beta45", 0.98, 0.0), *[(robot, 0.98, 0.5) for robot in ROBOTS]],
)
def test_a_stopped_robot_that_is_moved_to_type_2_and_back_has_lost_its_branch(robot, wrong, shift_ms):
    """By hand, with the drives off: no sample has to show the contact, neither for its time nor for its errors."""
    supervisor = supervisor_of(robot)
    steps = by_hand(supervisor, *until_type2(robot), wrong, shift_ms)
    assert newest(steps).causes & Cause.BRANCH
    assert newest(steps).latched


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_stopped_robot_that_is_moved_near_type_2_and_back_keeps_its_branch(robot):
    supervisor = supervisor_of(robot)
    start, way = until_type2(robot)
    steps = by_hand(supervisor, start, tuple(0.9 * step for step in way), 0.98, 0.0)
    assert not any(one.causes & Cause.BRANCH for one in expectation(steps))
