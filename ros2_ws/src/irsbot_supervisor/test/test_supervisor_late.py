"""Samples that come late: a robot at rest is not stopped for them, one that moves is judged all the same."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from counted import Counted
from supervised import (
    BOUNDARY,
    approach,
    configure,
    feed,
    joints_of,
    level_in_force,
    newest,
    ready,
    resting,
    sample,
    settings_of,
    supervisor_of,
)

from irsbot_msgs_py.records import Cause, Level
from irsbot_supervisor.core.events import Step
from irsbot_supervisor.core.supervisor import Supervisor

# --- samples that come late -------------------------------------------------------------------------------------


def with_pauses(supervisor: Supervisor, make, pause_ms: int = 30, number: int = 3) -> list[Step]:
    """Samples every millisecond, and pauses of the machine, after each of which only the newest sample is judged."""
    times = [ms for k in range(number) for ms in range(k * (20 + pause_ms), k * (20 + pause_ms) + 20)]
    return feed(supervisor, [make(ms) for ms in times])


@pytest.mark.parametrize("z", [-1.05, -1.1, -1.15])
def test_late_samples_do_not_stop_a_robot_at_rest_but_its_state_is_unknown(z):
    """At 400 rad/s2 a joint could get 0.8 rad far in two pauses: too far for these postures."""
    supervisor, q = ready(pose=(0.0, z))
    steps = with_pauses(supervisor, lambda ms: sample(ms, q))
    late = newest(steps)
    assert (late.level, late.latched, late.event) == (Level.UNKNOWN, False, 0)
    assert late.causes & Cause.STALE
    assert "samples come late, by now the next may be judged 36 ms after this one" in late.text  # 31 and 5 for judging
    steps += feed(supervisor, resting(120, 500, q))
    assert level_in_force(steps) <= Level.WARN
    assert not any(step.verdict.latched for step in steps if step.verdict is not None)


def test_a_busy_start_latches_no_stop_of_a_robot_at_rest():
    """Its first samples come as rarely as those of a sender that is too slow, until the interval is known."""
    supervisor = supervisor_of("irsbot2")
    q = joints_of(supervisor, 0.0, -0.85)
    steps = feed(supervisor, [sample(ms, q) for ms in (0, 45, 85, *range(90, 600))])
    assert newest(steps).level == Level.OK
    assert not any(turn.latched for step in steps for turn in step.transitions)


def test_a_sender_that_is_as_slow_as_that_stops_the_robot():
    supervisor, q = ready(pose=(0.0, -1.02))
    slow = newest([supervisor.step(sample(31 * k, q)) for k in range(10)])
    assert (slow.level, slow.latched) == (Level.STOP, True)


def test_the_intervals_of_the_page_about_verdicts_are_those_after_which_a_robot_at_rest_is_stopped():
    page = " ".join((Path(__file__).parents[4] / "docs" / "explanation" / "verdicts.md").read_text().split())
    far, far_ms = re.findall(r"rests at \(0, ([-.0-9]+)\) m is not stopped after two intervals of (\d+) ms", page)[0]
    near, borne_ms, stopped_ms = re.findall(
        r"at \(0, ([-.0-9]+)\) m, it is not stopped after two of (\d+) ms, and it is after two of (\d+) ms", page
    )[0]

    def stands(z: str, interval_ms: str) -> bool:
        supervisor, q = ready(pose=(0.0, float(z)))
        steps = [supervisor.step(sample(k * int(interval_ms), q)) for k in (1, 2, 3)]
        return newest(steps).level <= Level.WARN

    assert stands(far, far_ms)
    assert stands(near, borne_ms)
    assert not stands(near, stopped_ms)


def test_samples_that_jitter_within_a_heartbeat_are_not_late():
    supervisor, q = ready(pose=BOUNDARY)
    times = [ms for ms in range(80) if ms % 20 not in range(1, 7)]
    transitions = [turn for ms in times for turn in supervisor.step(approach(q, ms, (-3.0, 3.0))).transitions]
    assert [turn.level for turn in transitions][-1] == Level.STOP
    assert Level.UNKNOWN not in [turn.level for turn in transitions]


def test_a_robot_that_moves_towards_a_limit_is_stopped_however_late_samples_come():
    supervisor, q = ready(pose=BOUNDARY)
    steps = with_pauses(supervisor, lambda ms: approach(q, ms, (-3.0, 3.0)), number=4)
    seen = [(step.state, newest(steps[: k + 1]).level) for k, step in enumerate(steps)]
    stop = supervisor.settings.type1_stop
    assert all(level >= Level.STOP for state, level in seen if min(state.type1_margin) < stop + 0.05)
    assert min(min(state.type1_margin) for state, _level in seen) < stop, "it never got there: the test proves nothing"
    assert newest(steps).latched


# --- the time of one sample -------------------------------------------------------------------------------------------


def boxes_of_steps(pause_ms: int, **changes: float) -> tuple[int, int]:
    """Most boxes for one sample before a stop is latched and after it: of a robot that comes near a limit slowly and
    fast."""
    before = after = 0
    for rates in ((-0.3, 0.3), (-3.0, 3.0)):
        settings, robot = settings_of("irsbot2", **changes)
        robot.mechanism = counted = Counted(robot.mechanism)
        supervisor = Supervisor(settings, robot)
        q = joints_of(supervisor, *BOUNDARY)
        feed(supervisor, resting(-200, 0, q))
        for ms in [ms for k in range(6) for ms in range(k * (20 + pause_ms), k * (20 + pause_ms) + 20)]:
            view, counted.boxes = supervisor.view, 0
            supervisor.step(approach(q, ms, rates), report=False)
            if view is None or view.judgement.latched:
                after = max(after, counted.boxes)
            else:
                before = max(before, counted.boxes)
    return before, after


@pytest.mark.parametrize("pause_ms", [0, 30])
@pytest.mark.parametrize("cuts", [0, 2])
def test_where_the_time_of_a_box_is_stated_every_sample_keeps_its_time(cuts: int, pause_ms: int) -> None:
    """As much again is needed for the branch of a stopped robot, and less after a pause: for a quick look at what it
    would be without late samples, and for the branch, without a wider box."""
    most = 3 + 2 * cuts
    before, after = boxes_of_steps(pause_ms, bounding_s=1e-6, judging_s=most * 1e-6)
    assert before <= (2 * most - 1 if pause_ms else most)
    assert after <= 2 * most
    assert min(boxes_of_steps(pause_ms)) > 7, "no sample needs more: the run proves nothing"


BOX_S = 2e-4
"""s: stated time of one box, here."""


def boxes_after(supervisor: Supervisor, counted: Counted, pose: tuple[float, ...], **changes: float) -> list[int]:
    """Boxes for each of the samples after a change of settings, of a robot that stood and begins to move."""
    q, found = joints_of(supervisor, *pose), []
    feed(supervisor, resting(-200, 0, q))
    supervisor.step(configure(0.1, supervisor, **changes))
    for ms in range(1, 6):
        counted.boxes = 0
        supervisor.step(approach(q, ms, (-2.0, 2.0)), report=False)
        found.append(counted.boxes)
    return found


@pytest.mark.parametrize(
    ("before", "changes", "most"),
    [
        ({"bounding_s": BOX_S, "judging_s": 3 * BOX_S}, {"judging_s": 27 * BOX_S}, 3),
        ({"bounding_s": BOX_S, "judging_s": 7 * BOX_S}, {"judging_s": 27 * BOX_S}, 7),
        ({}, {"bounding_s": BOX_S, "judging_s": 27 * BOX_S}, 5),
        ({"bounding_s": BOX_S, "judging_s": 27 * BOX_S}, {"bounding_s": 3 * BOX_S, "judging_s": 81 * BOX_S}, 9),
    ],
    ids=["more time", "from two cuts", "time is stated", "boxes take longer"],
)
def test_the_first_sample_after_a_change_has_the_time_that_the_last_box_covers(
    before: dict[str, float], changes: dict[str, float], most: int
) -> None:
    """Samples come every millisecond, so without a stated time a sample has one: that of five boxes."""
    firsts, others = [], []
    for k in range(12):
        settings, robot = settings_of("irsbot2", **before, type1_warn=0.15, type2_warn=0.15)
        robot.mechanism = counted = Counted(robot.mechanism)
        first, *more = boxes_after(Supervisor(settings, robot), counted, (0.6 + 0.04 * k, -0.55), **changes)
        firsts.append(first)
        others += more
    assert 1 < max(firsts) <= most
    assert max(others) > most, "no sample needs more: the run proves nothing"


@pytest.mark.parametrize(("changes", "hurried"), [({"judging_s": 27 * BOX_S}, True), ({"type1_warn": 0.2}, False)])
def test_that_sample_is_judged_alone_in_a_replay_too(changes: dict[str, float], hurried: bool) -> None:
    """Samples are judged as columns while the supervisor is quiet, with all cuts."""
    supervisor, q = ready("irsbot2", bounding_s=BOX_S, judging_s=3 * BOX_S)
    assert supervisor.quiet
    supervisor.step(configure(0.1, supervisor, **changes))
    assert supervisor.quiet is not hurried
    supervisor.step(sample(1, q))
    assert supervisor.quiet
