"""Where the joints may have been while no samples came: drives that brake late, settings that change meanwhile, and
joints that went too far."""

from __future__ import annotations

from typing import NamedTuple

import pytest
from near_type2 import FREE, along, distance_m, out_s, standing, stood_at
from supervised import (
    MS,
    at_ns,
    configure,
    expectation,
    feed,
    joints_of,
    newest,
    ready,
    resting,
    supervisor_of,
    tick,
)

from irsbot_msgs_py.records import Cause, Floats, LateBrakes, Level
from irsbot_supervisor.bag.journal import JournalError, read_entry, write_entry
from irsbot_supervisor.nodes.spoken import Spoken


class Trip(NamedTuple):
    """A motion of rails3 that meets Type 2 and comes back part of the way, from rest to rest."""

    start: Floats  # m
    end: Floats
    met_s: float


def trip(out_m: float, free_s: float) -> Trip:
    """From `out_m` before Type 2 there, at full acceleration up to full speed; stopped hard there, and back at full
    acceleration until the drives brake after `free_s`."""
    settings, near_m = supervisor_of("rails3").settings, distance_m()
    fastest, gain = settings.velocity_limit[0], settings.acceleration_limit[0]
    met_s = out_s(out_m)
    assert met_s < free_s, "the drives cannot get there"
    faster_s = min(free_s - met_s, fastest / gain)
    speed = gain * faster_s
    back_m = 0.5 * speed * faster_s + speed * (free_s - met_s - faster_s)
    back_m += 0.5 * speed**2 / settings.deceleration_limit[0]
    return Trip(along(near_m - out_m), along(near_m - back_m), met_s)


def late(seen_ms: float, brakes_ms: float) -> LateBrakes:
    return LateBrakes(*at_ns(seen_ms), at_ns(brakes_ms)[1])


@pytest.mark.parametrize("told", [False, True], ids=["in time", "late"])
def test_a_supervisor_that_was_silent_itself_counts_the_time_until_its_consumers_braked(told):
    """The last verdict at time 0, the next sample after 200 ms: consumers have braked after 100 ms."""
    robot = trip(0.0375, 0.1 + supervisor_of("rails3").settings.latency_s)
    assert robot.met_s > supervisor_of("rails3").settings.stale_s + 0.01, "too near to tell the difference"
    supervisor = stood_at(robot.start)
    assert supervisor.is_late(at_ns(100)[1])
    steps = feed(supervisor, [late(200, 100)] if told else [tick(50.1)])
    assert newest(steps).causes == Cause.STALE
    steps = feed(supervisor, standing(200, 600, robot.end))
    assert bool(newest(steps).causes & Cause.BRANCH) == newest(steps).latched == told
    assert any(one.level == Level.OK for one in expectation(steps)) != told


def test_only_brakes_that_act_later_than_supposed_are_late():
    supervisor = supervisor_of("rails3")
    assert not supervisor.is_late(at_ns(1000)[1])  # no sample has come
    supervisor = stood_at(FREE)
    assert [supervisor.is_late(at_ns(ms)[1]) for ms in (-100, 0, 50, 60, 60.001, 100)] == [False] * 4 + [True] * 2


def test_late_brakes_count_for_their_silence_alone():
    start = trip(0.0375, 0.105).start
    supervisor = stood_at(start)
    feed(supervisor, [late(1, 100), *standing(2, 400, start)])  # the silence has ended before
    steps = feed(supervisor, standing(600, 900, start))
    assert newest(steps).level == Level.OK


@pytest.mark.parametrize("changes", [[{}], [{"stale_s": 0.01}], [{"stale_s": 0.01}, {"stale_s": 0.012}]])
def test_settings_that_change_during_a_silence_do_not_shorten_it_backwards(changes):
    """The silence is noticed when its limit becomes shorter: until then the drives were free."""
    robot = trip(0.0165, 0.049 + supervisor_of("rails3").settings.latency_s)
    supervisor = stood_at(robot.start)
    steps = feed(supervisor, [tick(ms) for ms in (10, 20, 30, 40)])
    assert newest(steps).level == Level.OK
    steps = feed(supervisor, [configure(49 + k, supervisor, **change) for k, change in enumerate(changes)])
    steps = feed(supervisor, standing(80, 480, robot.end))
    assert newest(steps).causes & Cause.BRANCH
    assert newest(steps).latched


def test_a_longer_latency_that_comes_into_force_later_does_not_stretch_the_last_box():
    supervisor = stood_at(FREE)
    feed(supervisor, [configure(1, supervisor, latency_s=0.04)])
    steps = feed(supervisor, standing(41, 441, FREE))
    assert newest(steps).causes & Cause.BRANCH


@pytest.mark.parametrize("silence_ms", [60, 400, 5000])
@pytest.mark.parametrize(("share", "lost"), [(0.95, False), (1.05, True)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_joint_that_is_farther_away_than_it_can_get_until_it_stands_loses_the_branch(silence_ms, share, lost, sign):
    """From rest: a while at the largest acceleration, then at the largest speed, and braked."""
    supervisor, q = ready(velocity_limit=[2.0])
    settings = supervisor.settings
    gain, fastest, brake = settings.acceleration_limit[0], settings.velocity_limit[0], settings.deceleration_limit[0]
    free_s = min(silence_ms / 1e3, settings.stale_s + settings.heartbeat_s) + settings.latency_s
    most = fastest * free_s - 0.5 * fastest**2 / gain + 0.5 * fastest**2 / brake
    there = (q[0], q[1] + sign * share * most)
    if share > 1.0:
        there = (q[0], there[1] + sign * 0.005)  # the speed at rest is known to 1 rad/s
    steps = feed(supervisor, [tick(ms) for ms in range(10, silence_ms, 10)])
    steps = feed(supervisor, resting(silence_ms, silence_ms + 400, there))
    assert bool(newest(steps).causes & Cause.BRANCH) == newest(steps).latched == lost, newest(steps).text
    if lost:
        assert "joint 'joint_2' moved by" in newest(steps).text
    else:
        assert newest(steps).level == Level.OK


def test_far_away_after_a_silence_is_no_branch_where_each_posture_is_good():
    """One joint by 1.84 rad: no singularity lies between, but a braked robot does not get there."""
    supervisor, _q = ready(pose=(0.3, -0.7))
    there = joints_of(supervisor, -0.5, -1.0)
    steps = feed(supervisor, resting(400, 900, there))
    assert newest(steps).causes & Cause.BRANCH
    assert all(one.level != Level.OK for one in expectation(steps))


def test_a_robot_that_a_stop_holds_moves_at_recovery_speed_in_a_silence():
    supervisor, q = ready(pose=(0.2, -0.6))
    steps = feed(supervisor, [configure(0, supervisor, type1_stop=0.7, type1_warn=0.8)])
    steps = feed(supervisor, resting(1, 300, q))
    assert (newest(steps).level, newest(steps).latched) == (Level.STOP, True)
    settings = supervisor.settings
    rate = settings.recovery_share * settings.velocity_limit[0] + settings.standstill_speed
    free_s = settings.stale_s + settings.heartbeat_s + settings.latency_s
    most = rate * free_s + 0.5 * rate**2 / settings.deceleration_limit[0]
    steps = feed(supervisor, resting(700, 900, (q[0], q[1] + 0.98 * most)))
    assert not newest(steps).causes & Cause.BRANCH
    steps = feed(supervisor, resting(1300, 1500, (q[0], q[1] + 2.1 * most)))
    assert newest(steps).causes & Cause.BRANCH


# --- what consumers make of verdicts ----------------------------------------------------------------------------


def test_consumers_brake_when_told_so_or_when_nothing_is_heard():
    spoken = Spoken()
    assert spoken.brakes_ns(5 * MS) == 0  # motion was never allowed
    spoken.note(False, 10 * MS)
    assert spoken.brakes_ns(20 * MS) == 0
    spoken.note(True, 30 * MS)
    assert spoken.brakes_ns(40 * MS) == 40 * MS  # not yet
    assert spoken.brakes_ns(500 * MS) == 130 * MS  # nothing is heard
    spoken.note(False, 90 * MS)
    spoken.note(False, 100 * MS)
    assert spoken.brakes_ns(500 * MS) == 90 * MS  # told so, once
    spoken.note(True, 600 * MS)
    spoken.note(False, 900 * MS)
    assert spoken.brakes_ns(950 * MS) == 700 * MS  # the verdict came too late


def test_the_journal_keeps_late_brakes():
    entry = LateBrakes(1, 2, 3)
    assert read_entry(write_entry(entry)) == entry
    for line in ('{"kind": "late_brakes", "received_ns": 1, "seen_ns": 2}', "[" * 100_000):
        with pytest.raises(JournalError):
            read_entry(line)
