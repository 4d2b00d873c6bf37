"""Whatever arrives in whatever order: no exception, nothing bad is called good, and equal stories for equal events."""

from __future__ import annotations

from math import inf, isfinite, nan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from supervised import (
    JOINTS,
    MS,
    ROS_NS,
    STEADY_NS,
    configure,
    expectation,
    feed,
    joints_of,
    ready,
    reset,
    sample,
    supervisor_of,
    tick,
)

from irsbot_msgs_py.records import JointSample, Level, Tick
from irsbot_supervisor.core.events import Event
from irsbot_supervisor.core.settings import InvalidSettings
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.core.validation import FARTHEST

AGE_NS, FUTURE_NS = 200 * MS, 20 * MS
"""Shipped limits of a stamp's age."""
Q = joints_of(supervisor_of(), 0.0, -0.85)
weird = st.sampled_from([nan, inf, -inf, 0.0, -0.0, 5e-324, 1e-300, 1e6, 1e6 + 1, 1e16, -1e308, 1e308, 3.14, 180.0])
gaps_ms = st.sampled_from([0.01, 0.2, 1.0, 1.0, 1.0, 1.0, 2.0, 5.0, 12.0, 49.0, 51.0, 300.0])


def motion(ms: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """A robot that swings about a good posture with up to 2 rad/s."""
    phase = ms * 0.02
    return (
        (Q[0] + 0.1 * np.sin(phase).item(), Q[1] + 0.1 * np.cos(phase).item() - 0.1),
        (2.0 * np.cos(phase).item(), -2.0 * np.sin(phase).item()),
    )


@st.composite
def actions(draw: st.DrawFn) -> tuple[str, object]:
    """What happens next, most often a good sample."""
    kind = draw(
        st.sampled_from(
            ["good"] * 12
            + ["value", "rate", "names", "lengths", "age", "zero", "repeat", "overtaken", "jump", "frozen", "silent"]
            + ["no rates", "tick", "tick", "reset", "configure", "nonsense"]
        )
    )
    match kind:
        case "value" | "rate":
            return kind, (draw(st.integers(0, 1)), draw(weird))
        case "names":
            return kind, draw(st.lists(st.sampled_from([*JOINTS, "gripper", ""]), max_size=4))
        case "lengths":
            return kind, tuple(draw(st.integers(0, 4)) for _ in range(3))
        case "age":
            return kind, draw(st.sampled_from([-3e11, -1e4, -21.0, -19.0, 1.0, 30.0, 199.0, 201.0, 1e5, 3e11]))
        case "jump":
            return kind, draw(st.floats(-7.0, 7.0))
        case "reset":
            return kind, (draw(st.integers(-1, 3)), draw(st.sampled_from([(), (0.0, -0.85), (nan, 0.0), (1.0,)])))
        case "configure":
            return kind, draw(
                st.sampled_from(
                    [
                        {"dwell_s": 0.0},
                        {"dwell_s": 0.05},
                        {"stale_s": 0.02},
                        {"stale_s": 0.05},
                        {"type2_warn": 0.9},
                        {"type2_warn": 0.25},
                        {"velocity_limit": [12.0, 12.0]},
                        {"velocity_limit": [1.0, 1.0]},
                        {"reaction_check": "stop"},
                        {"reaction_check": "none"},
                    ]
                )
            )
        case "nonsense":
            return kind, draw(
                st.sampled_from([{"stale_s": nan}, {"type1_warn": 0.01}, {"no": 1}, {"joint_names": JOINTS[::-1]}])
            )
    return kind, None


def event_of(ms: float, action: tuple[str, object], supervisor: Supervisor, before: list[Event]) -> Event:
    kind, what = action
    q, v = motion(ms)
    match kind:
        case "value":
            return sample(ms, [what[1] if k == what[0] else value for k, value in enumerate(q)], v)
        case "rate":
            return sample(ms, q, [what[1] if k == what[0] else value for k, value in enumerate(v)])
        case "names":
            values = [dict(zip(JOINTS, q, strict=True)).get(name, 0.0) for name in what]
            return JointSample(*sample(ms, q)[:3], tuple(what), tuple(values))
        case "lengths":
            return sample(ms, q)._replace(
                **{field: (0.5,) * count for field, count in zip(("position", "velocity", "effort"), what, strict=True)}
            )
        case "age":
            return sample(ms, q, v, age_ms=what)
        case "zero":
            return sample(ms, q, v)._replace(stamp_ns=0)
        case "repeat" | "overtaken":
            stamps = [one.stamp_ns for one in before if isinstance(one, JointSample)]
            stamp_ns = (stamps[-1] if stamps else ROS_NS) - (0 if kind == "repeat" else 3 * MS)
            return sample(ms, q, v)._replace(stamp_ns=stamp_ns)
        case "jump":
            return sample(ms, (q[0] + what, q[1]), v)
        case "frozen":
            return sample(ms, Q, (8.0, -8.0))
        case "no rates":
            return sample(ms, q, ())
        case "tick" | "silent":
            return tick(ms)
        case "reset":
            return reset(ms, what[0])._replace(seed_pose=what[1])
        case "configure" | "nonsense":
            return configure(ms, supervisor, **what)
    return sample(ms, q, v, effort=(1.0, nan) if round(ms) % 7 == 0 else (1.0, 1.0))


def usable(one: JointSample) -> bool:
    """Independent of the intake: exactly what docs/explanation/verdicts.md asks of a sample that is looked at alone."""
    count = len(one.names)
    if not all(one.names.count(joint) == 1 for joint in JOINTS):
        return False
    if len(one.position) != count or len(one.velocity) not in (0, count) or len(one.effort) not in (0, count):
        return False
    q = [one.position[one.names.index(joint)] for joint in JOINTS]
    if not all(isfinite(value) and abs(value) <= FARTHEST for value in q):
        return False
    age = one.received_ns - one.stamp_ns
    return one.stamp_ns > 0 and -FUTURE_NS <= age <= AGE_NS


def check(supervisor: Supervisor, script: list[tuple[float, tuple[str, object]]]) -> list[Event]:
    """Feed a script and hold every answer against what may be known. Returns the events that were taken."""
    events: list[Event] = []
    now_ms, newest_ns, good_seen_ns, sound = 0.0, 0, None, True
    level = Level.UNKNOWN
    for gap, action in script:
        now_ms += gap
        try:
            event = event_of(now_ms, action, supervisor, events)
            step = supervisor.step(event)
        except InvalidSettings:
            assert action[0] == "nonsense"
            continue
        assert action[0] != "nonsense"
        events.append(event)
        if step.verdict is not None:
            level = step.verdict.level
        if isinstance(event, JointSample):
            state = step.state
            straggler = usable(event) and event.stamp_ns <= newest_ns
            if not usable(event):
                sound = False
                assert state.level == Level.UNKNOWN, (action, state)
            elif state.level < Level.UNKNOWN:
                sound, newest_ns, good_seen_ns = True, event.stamp_ns, event.seen_ns
            elif not straggler:
                sound = False
            if state.level <= Level.WARN:
                found = supervisor.robot.evaluate(state.joint_position)
                limits = supervisor.settings
                stops = (limits.type1_stop, limits.type2_stop, limits.constraint_stop)
                assert min(found.type1_margin) >= stops[0]
                assert found.type2_margin >= stops[1]
                assert found.constraint_margin >= stops[2]
                assert found.working_mode == limits.working_mode
                assert all(map(isfinite, (*state.joint_velocity, state.stop_margin, state.type2_margin)))
        stale_ns = round(supervisor.settings.stale_s * 1e9)
        known = sound and good_seen_ns is not None and event.seen_ns - good_seen_ns <= stale_ns
        assert known or level == Level.UNKNOWN, f"{level.name} after {action} at {now_ms} ms"
    return events


@given(script=st.lists(st.tuples(gaps_ms, actions()), max_size=120), dwell_s=st.sampled_from([0.0, 0.01, 0.05]))
@settings(max_examples=60)
def test_nothing_that_arrives_makes_the_supervisor_fail_or_call_bad_data_good(script, dwell_s):
    check(supervisor_of(dwell_s=dwell_s), script)


@pytest.mark.parametrize("dwell_s", [0.0, 0.01, 0.05])
def test_nothing_bad_makes_a_supervisor_that_was_content_call_it_good(dwell_s):
    """The same from a good state, with a plain generator, so that long runs of good samples are frequent."""
    rng = np.random.default_rng(round(1000 * dwell_s))
    kinds = [("value", (0, nan)), ("jump", 0.4), ("zero", None), ("age", 500.0), ("silent", None), ("frozen", None)]
    kinds += [("names", [JOINTS[0]]), ("rate", (1, inf)), ("no rates", None), ("overtaken", None), ("repeat", None)]
    script = [(1.0, ("good", None))] * 100
    for _ in range(60):
        chosen = kinds[rng.integers(len(kinds))]
        script += [(float(rng.choice([0.5, 1.0, 5.0])), chosen)] * int(rng.integers(1, 12))
        script += [(1.0, ("good", None))] * int(rng.integers(0, 120)) + [(1.0, ("tick", None))] * int(rng.integers(3))
    check(supervisor_of(dwell_s=dwell_s), script)


@given(script=st.lists(st.tuples(gaps_ms, actions()), max_size=100))
def test_the_same_events_give_the_same_answers_twice(script):
    first = supervisor_of()
    events = check(first, script)
    again, third = (feed(supervisor_of(), events) for _ in range(2))
    assert repr(again) == repr(third)


@given(
    script=st.lists(st.tuples(gaps_ms, actions()), min_size=1, max_size=80),
    phases=st.lists(st.lists(st.floats(0.001, 0.999), max_size=60), min_size=2, max_size=2),
    dwell_s=st.sampled_from([0.0, 0.01, 0.05, 0.12]),
)
def test_when_the_timer_ticks_does_not_show_in_the_story(script, phases, dwell_s):
    events = [event for event in check(supervisor_of(dwell_s=dwell_s), script) if not isinstance(event, Tick)]
    end_ns = max([event.seen_ns for event in events], default=STEADY_NS)
    expectations = []
    for shares in phases:
        ticks = [tick((end_ns - STEADY_NS) / MS * share) for share in shares]
        mixed = sorted([tick(0), *events, *ticks], key=lambda event: event.seen_ns)
        expectations.append(
            expectation(feed(supervisor_of(dwell_s=dwell_s), [*mixed, tick((end_ns - STEADY_NS) / MS + 1e4)]))
        )
    assert expectations[0] == expectations[1]


@pytest.mark.parametrize("seed", range(3))
def test_a_thousand_messages_of_random_numbers_are_all_unknown_or_right(seed):
    rng = np.random.default_rng(seed)
    supervisor, _q = ready()
    for ms in range(1000):
        exponents = rng.uniform(-320, 308, 6)
        values = (rng.choice([-1.0, 1.0], 6) * 10.0**exponents).tolist()
        step = supervisor.step(sample(ms, values[:2], values[2:4], effort=values[4:]))
        if step.state.level <= Level.WARN:
            assert min(supervisor.robot.evaluate(values[:2]).type1_margin) >= supervisor.settings.type1_stop
