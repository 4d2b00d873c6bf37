"""Stops and their resets, restarts of the supervisor."""

from __future__ import annotations

from math import inf, nan

import numpy as np
import pytest
from supervised import (
    BOUNDARY,
    approach,
    at_ns,
    bad,
    expectation,
    feed,
    joints_of,
    level_in_force,
    newest,
    ready,
    reset,
    resting,
    sample,
    stopped,
    supervisor_of,
    tick,
)

from irsbot_msgs_py.records import Cause, Level, Restart
from irsbot_supervisor.bag.journal import JournalError, read_entry, write_entry
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.core.stopping import CUTS_OF_A_SAMPLE
from irsbot_supervisor.validation.in_process.loci import Stand

# --- stop and reset ---------------------------------------------------------------------------------------------


def test_a_stop_names_cause_value_limit_and_a_way_out():
    supervisor, q = ready(pose=BOUNDARY)
    steps = feed(supervisor, [approach(q, ms, (-6.0, 0.0)) for ms in range(1, 75)])
    stop = next(step.verdict for step in steps if step.verdict is not None and step.verdict.level == Level.STOP)
    assert stop.latched
    assert stop.event == 1
    assert stop.speed_scale == 0.0
    assert stop.causes & Cause.BRAKING
    finding = next(one for one in stop.findings if one.level == Level.STOP)
    assert finding.value < finding.limit == 0.15
    assert finding.text in stop.text
    assert np.hypot(*stop.escape_direction) == pytest.approx(1.0)
    at = next(step.state for step in steps if step.verdict is stop)
    assert at.time_to_stop == 0.0
    kind = 0 if finding.cause & Cause.TYPE1 else 1
    ahead = supervisor.robot.evaluate(np.add(at.joint_position, np.multiply(1e-3, stop.escape_direction)))
    now = supervisor.robot.evaluate(at.joint_position)
    assert (min(ahead.type1_margin), ahead.type2_margin)[kind] > (min(now.type1_margin), now.type2_margin)[kind]


def test_the_text_of_a_verdict_begins_with_what_is_worst():
    supervisor = supervisor_of(type1_warn=0.99, type2_stop=0.4, type2_warn=0.45)
    verdict = newest(feed(supervisor, resting(0, 200, joints_of(supervisor, *BOUNDARY))))
    assert [(one.cause, one.level) for one in verdict.findings] == [
        (Cause.TYPE1, Level.WARN),
        (Cause.TYPE2, Level.STOP),
    ]
    assert verdict.text == "; ".join(one.text for one in reversed(verdict.findings))


@bad
def test_a_robot_whose_state_is_not_known_has_no_way_out(make, cause):
    """Also while what stopped it counts."""
    supervisor, q = ready(pose=BOUNDARY)
    steps = feed(supervisor, [approach(q, ms, (-6.0, 0.0)) for ms in range(1, 75)])
    stop = next(step.verdict for step in steps if step.verdict is not None and step.verdict.level == Level.STOP)
    assert stop.escape_cause & stop.causes
    assert supervisor.escape.direction
    unknown = newest(feed(supervisor, [make(ms, q) for ms in range(75, 80)]))
    assert unknown.level == Level.UNKNOWN
    assert any(finding.level == Level.STOP for finding in unknown.findings)
    assert (unknown.escape_direction, unknown.escape_cause) == ((), Cause.NONE)


def test_a_stop_is_ended_by_its_number_and_work_goes_on():
    supervisor, q, verdict = stopped()
    answer = supervisor.step(reset(2400, verdict.event))
    assert answer.refusal == ""
    assert (answer.verdict.level <= Level.WARN, answer.verdict.latched) == (True, False)
    assert all(one.level <= Level.WARN for one in expectation(feed(supervisor, resting(2401, 2600, q))))


@pytest.mark.parametrize("offset", [-1, 1, 7])
def test_another_number_ends_nothing(offset):
    supervisor, q, verdict = stopped()
    assert str(verdict.event) in supervisor.step(reset(2400, verdict.event + offset)).refusal
    assert newest(feed(supervisor, resting(2401, 2450, q))).latched


def test_a_robot_that_moves_is_not_reset():
    supervisor, q, verdict = stopped()
    feed(supervisor, [approach(q, ms, (0.5, 0.0), 2400) for ms in range(2400, 2450)])
    assert "standing" in supervisor.step(reset(2450, verdict.event)).refusal


@bad
def test_no_stop_is_reset_while_the_newest_data_is_bad(make, cause):
    supervisor, q, verdict = stopped()
    feed(supervisor, [make(ms, q) for ms in range(2400, 2410)])
    answer = supervisor.step(reset(2410, verdict.event))
    assert "not known" in answer.refusal
    assert newest([answer, *feed(supervisor, resting(2411, 2500, q))]).latched


def test_no_stop_is_reset_in_silence():
    supervisor, _q, verdict = stopped()
    assert "no good sample" in supervisor.step(reset(2451, verdict.event)).refusal
    assert "no good sample" in supervisor_of().step(reset(0, 0)).refusal


def test_no_stop_is_reset_while_its_cause_is_there():
    supervisor, q = ready(pose=BOUNDARY)
    steps = feed(supervisor, [approach(q, ms, (-6.0, 0.0)) for ms in range(1, 85)])
    near = steps[-1].state.joint_position
    steps = feed(supervisor, resting(100, 400, near))
    assert min(steps[-1].state.type1_margin) < 0.15, "the robot is not near: the fixture proves nothing"
    assert "still there" in supervisor.step(reset(400, newest(steps).event)).refusal


def test_a_reset_may_take_more_cuts_than_a_sample():
    """At rest in front of a limit, which 12 cuts do not prove to be far enough, after the encoders had jumped."""
    settings, robot = read_settings("rrr3_base")
    place = (-2.321354212617107, -2.468769582307453, -1.3599758075247117)
    stand = Stand(robot, settings)
    assert stand.stand(place)
    assert not stand.stand(robot.inverse(robot.direct(place, settings.assembly_mode), (1, 1, -1)))
    assert not stand.stand(place), "latched"
    assert stand.reset() == ""
    assert stand._supervisor._predictor._cuts == CUTS_OF_A_SAMPLE, "the next samples may not"
    assert stand.stand(place)


def test_a_refused_reset_confirms_nothing():
    """The branch is lost and the posture bad: the operator may not reset, and his try must not be remembered."""
    supervisor = supervisor_of("irsbot2_beta45")
    geometry = supervisor.robot.mechanism.geometry
    q2 = float(-np.arccos(-geometry.b0 / geometry.l1))
    contact = (-np.pi - q2, q2)
    event = newest(feed(supervisor, resting(0, 60, contact))).event
    beside = (contact[0] + 0.01, contact[1] - 0.01)
    feed(supervisor, resting(60, 160, beside))
    assert supervisor.step(reset(160, event)).refusal
    assert supervisor.step(sample(161, beside)).state.causes & Cause.BRANCH


@pytest.mark.parametrize("event", [0, 1, 2])
def test_a_reset_cannot_be_armed_beforehand(event):
    supervisor, q = ready(pose=BOUNDARY)
    for ms in range(1, 75):
        assert supervisor.step(reset(ms, event)).refusal
        step = supervisor.step(approach(q, ms, (-6.0, 0.0)))
    assert step.state.level == Level.STOP
    assert newest([supervisor.step(tick(100))]).latched


def test_the_seed_pose_of_a_reset_determines_the_assembly_mode():
    supervisor, q, verdict = stopped()
    other = supervisor.robot.direct(q, 1)
    assert "assembly mode" in supervisor.step(reset(2400, verdict.event)._replace(seed_pose=tuple(other))).refusal
    for nonsense in ((nan, nan), (1.0,), (0.0, -0.8, 0.0), (inf, 0.0)):
        assert supervisor.step(reset(2401, verdict.event)._replace(seed_pose=nonsense)).refusal
    for elsewhere in ((300.0, -700.0), (40.0, 3.0)):  # millimetres; another frame
        refusal = supervisor.step(reset(2401, verdict.event)._replace(seed_pose=elsewhere)).refusal
        assert "too far from every pose" in refusal
    assert (
        supervisor.step(reset(2402, verdict.event)._replace(seed_pose=(1.0, -0.6))).refusal == ""
    )  # it is at (1.04, -0.49)


# --- a restart ---------------------------------------------------------------------------------------------------


def test_after_a_restart_nothing_is_known_until_a_reset_and_no_old_number_resets_it():
    supervisor = supervisor_of()
    q = joints_of(supervisor, 0.0, -0.85)
    first = supervisor.step(Restart(*at_ns(-300), 1_700_000_000)).verdict
    assert first is not None
    assert (first.level, first.latched, first.event) == (Level.UNKNOWN, True, 1_700_000_000)
    steps = feed(supervisor, resting(-300, 200, q))
    assert all(one.latched and one.level == Level.UNKNOWN for one in expectation(steps))
    assert newest(steps).causes & Cause.BRANCH
    assert "started again" in newest(steps).text
    assert "is not the stop in force" in supervisor.step(reset(200, 1)).refusal
    assert supervisor.step(reset(200, first.event)).refusal == ""
    assert level_in_force(feed(supervisor, resting(201, 260, q))) == Level.OK


def test_a_restart_is_replayed_from_its_line_of_the_journal():
    event = Restart(1, 2, 3)
    assert read_entry(write_entry(event)) == event
    with pytest.raises(JournalError):
        read_entry('{"kind": "restart", "received_ns": 1, "seen_ns": 2}')
